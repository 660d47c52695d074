// The picture: what arrives at the camera along a ray, in parts that add up to the whole. W/m2/nm/sr in the three bands.
#ifndef SHADERS_LIB_VIEW
#define SHADERS_LIB_VIEW
#define FIELD_WARPED 1
#include "shaders/lib/camera.glsl"
#include "shaders/lib/field.glsl"
#include "shaders/lib/ground.glsl"
#include "shaders/lib/ground_near.glsl"
#include "shaders/lib/height_sun.glsl"
#if VIEW_CLOUDS && !VIEW_ABOVE
#ifndef SIDE_LOW
#define SIDE_LOW 2
#endif
#include "shaders/lib/side_low.glsl"
#endif
#if VIEW_GROUND == 2
#include "shaders/lib/sea.glsl"
#endif
#include "shaders/lib/sky_table.glsl"
#include "shaders/lib/slab_solved.glsl"
#include "shaders/lib/sun_disc.glsl"
#include "shaders/lib/sunlight.glsl"

#ifndef __cplusplus
uniform sampler2D sky_total;
uniform sampler2D sky_near;
uniform sampler2D air_to_layer;
uniform sampler2D air_to_end;
uniform sampler2D ground_received;
uniform sampler2D cloud_received;
#endif

struct view_parts {
	vec3 sun_direct;
	vec3 order0;
	vec3 order1;
	vec3 order2;
	vec3 multiple;
	vec3 cloud_sky;
	vec3 cloud_ground;
	vec3 sky;
	vec3 ground;
	vec3 air;
	vec3 transmittance;      // of the layer, for diffuse background
	float optical_thickness; // of the layer along the vertical, 550 nm
	float distance;          // m, to cloud or ground; 0 where the ray meets neither
};

// Cosine of the sun's zenith angle at a point along the ray.
float view_sun_cosine(vec3 direction, float t, float height)
{
	vec3 sun = vec3(sun_direction);
	return clamp(((EARTH_RADIUS + camera_position.z) * sun.z + t * dot(direction, sun)) / (EARTH_RADIUS + height), -1.0, 1.0);
}

#if VIEW_CLOUDS
// Thickness H at a place. From above: what the beam passes on its way to that place of the base, with all that stands towards the sun.
float view_thickness(vec2 place, float footprint)
{
#if VIEW_ABOVE
	vec2 uv = field_place(place) / cloud_layer.z;
	return textureLod(height_light, uv, max(0.0, log2(footprint * HEIGHT_SIZE_LIGHT / cloud_layer.z))).z;
#else
	return field_thickness(place, footprint);
#endif
}
#endif

#if VIEW_CLOUDS
// Thickness that a shadow on the ground is of.
float view_shadow_thickness(vec2 place, float footprint)
{
#if VIEW_ABOVE
	return view_thickness(place, footprint);
#else
	return field_thickness_shadow(place, footprint);
#endif
}
#endif

// Light that a place of the ground receives, and its reflectance; each a mean.
struct view_lit {
	vec3 beam;     // normal to it
	vec3 received; // other
	vec3 reflectance;
};

// lit_painted: the place that light comes to, and the one whose paint shows there; footprints: sizes of what light and paint are means over, m.
void view_add_lit(vec4 lit_painted, vec2 footprints, vec3 sun, float share, INOUT(view_lit) lit)
{
	vec3 received = vec3(sky_irradiance_ground);
	vec3 beam = sun;
#if VIEW_CLOUDS
	{
		vec2 place = vec2(lit_painted);
		received = vec3(textureLod(ground_received, place / cloud_layer.z, 0.0));
		// The beam passed the layer where the parallax says; its shadow is as soft as the sun is wide.
		vec2 through = place + vec2(sun_direction) * cloud_layer.x / max(sun_direction.z, 0.02);
		float penumbra = 2.0 * sun_direction.w * cloud_layer.x;
		beam *= slab_directional_transmittance(view_shadow_thickness(through, max(footprints.x, penumbra)));
	}
#endif
	lit.beam += share * beam;
	lit.received += share * received;
#if VIEW_GROUND == 3
	lit.reflectance += share * ground_ice(ground_reflectance_seen(vec2(lit_painted.z, lit_painted.w), footprints.y), footprints.y);
#elif VIEW_GROUND != 2
	lit.reflectance += share * ground_reflectance_seen(vec2(lit_painted.z, lit_painted.w), footprints.y);
#endif
}

// A pixel covers a long strip at a slant, which the means of squares stand for: larger ones than of the strip's area, lest rows at the horizon show single places.
float view_ground_footprint(float across, float mu_v)
{
	return across * pow(mu_v, -0.75);
}

// Land is not flat: under a smaller angle than it undulates by, what is seen is crests from far and near, not one field in front of the next one.
const float VIEW_UNDULATION = 0.02;

// Of light, which comes to so many places that stand for the pixel, and of paint.
vec2 view_ground_footprints(float across, float mu_v, float places)
{
	float footprint = view_ground_footprint(across, mu_v);
	float steepness = VIEW_UNDULATION / mu_v;
	return vec2(footprint * inversesqrt(places), footprint * (1.0 + steepness * steepness));
}

// At the horizon a pixel's strip reaches over kilometres: several places of it, evenly over the picture. A sea mirrors the sun so brightly that edges of shadows show where it is
// still hundreds of metres long.
const int VIEW_STRIP_PLACES = 4;
#if VIEW_GROUND == 2 && VIEW_CLOUDS
const int VIEW_STRIP_PLACES_NEAR = 3;
#else
const int VIEW_STRIP_PLACES_NEAR = 1;
#endif
const float VIEW_STRIP_ROWS = 1.9; // below the horizon; rows from 2 on have a program of their own (renderer/stages/view.c)

// Radiance of the ground under sun, sky and clouds, before the air between. direction: of the middle of what the pixel shows of the ground, which is so high as a difference of
// sines of elevation.
vec3 view_ground(vec3 direction, float high, ground_point point)
{
	vec2 place = vec2(camera_position) + point.offset;
	float mu_sun = point.mu_sun;
	vec3 sun = sun_irradiance(0.0, mu_sun);
	vec2 ragged = vec2(0.0);
#if VIEW_GROUND == 3
	ragged = ground_ragged(point);
#endif
	view_lit lit;
	lit.beam = lit.received = lit.reflectance = vec3(0.0);
	int places = VIEW_STRIP_PLACES_NEAR;
#if VIEW_REGION == 0
	if (direction.z > sphere_horizon(camera_position.z) - VIEW_STRIP_ROWS * camera_position.w)
		places = VIEW_STRIP_PLACES;
#endif
#if VIEW_REGION == 0 || (VIEW_GROUND == 2 && VIEW_CLOUDS)
	for (int i = 0; i < places; i++) {
		float z = direction.z + high * ((float(i) + 0.5) / float(places) - 0.5);
		float t = places > 1 ? max(sphere_distance_down(camera_position.z, z, 0.0), 0.0) : 0.0;
		float mu_v = places > 1 ? max(-sphere_cosine(camera_position.z, z, t, 0.0), 0.002) : point.mu_v;
		vec2 there = places > 1 ? vec2(camera_position) + vec2(direction) * t : place;
		float across = places > 1 ? camera_position.w * t : point.across;
		view_add_lit(vec4(there, there + ragged), view_ground_footprints(across, mu_v, float(places)), sun, 1.0 / float(places), lit);
	}
#else
	view_add_lit(vec4(place, place + ragged), view_ground_footprints(point.across, point.mu_v, 1.0), sun, 1.0, lit);
#endif
#if VIEW_GROUND == 2
	vec2 heading = -point.offset * inversesqrt(max(dot(point.offset, point.offset), 1e-8));
	vec2 flat_sun = vec2(sun_direction.x, sun_direction.y) * inversesqrt(max(1.0 - sun_direction.z * sun_direction.z, 1e-8));
	vec3 to_viewer = vec3(heading * sqrt(1.0 - point.mu_v * point.mu_v), point.mu_v);
	vec3 to_sun = vec3(flat_sun * sqrt(1.0 - mu_sun * mu_sun), mu_sun);
	sea_slopes slopes = sea_slopes_at(point.offset, heading, point.across, point.across / point.mu_v);
	return ground_patch.y * sea_radiance(slopes, to_viewer, to_sun, lit.beam, lit.received);
#else
	vec3 detail = ground_detail(point);
#if VIEW_GROUND == 1
	lit.reflectance = ground_drier(lit.reflectance, detail.z);
#endif
	return lit.reflectance * (lit.received + lit.beam * (max(mu_sun, 0.0) * detail.x)) * (detail.y / PI);
#endif
}

#if VIEW_CLOUDS
// A point of the layer as it is seen.
struct view_point {
	float thickness;        // H, m
	float smooth_thickness; // H evened out over the way that light goes sideways, m
	float mu_v;             // cosine of the view to the local vertical, positive
	float view_index;
	float mu_sun;      // of the sun, negative below the layer's horizon
	float cos_azimuth; // between the headings of light before and after
	vec2 half_angle;   // of scattering
	float way;         // through cloud to the viewer, m
	float mu_l_facet;  // cosines to the surface; those above on a flat base
	float mu_v_facet;
	float lit;         // share of the beam that comes there past other clouds
	float received;    // by light that is scattered often, relative to a flat top
	float sun;         // thickness that the beam meets, m
	float upright;     // share of what is seen from below that stands
};

// cos_view: cosine of the viewing direction to the local vertical, positive upwards.
float view_cos_azimuth(vec3 direction, float cos_view, float mu_sun)
{
	float sines = sqrt(max((1.0 - cos_view * cos_view) * (1.0 - mu_sun * mu_sun), 1e-8));
	return (dot(direction, vec3(sun_direction)) - cos_view * mu_sun) / sines;
}

// Cosine under which a side of the layer is lit. Base and top undulate, so that at the terminator both get some light.
const float VIEW_TERMINATOR = 0.06;

float view_lit_cosine(float mu)
{
	float x = max(mu + VIEW_TERMINATOR, 0.0);
	return mu > VIEW_TERMINATOR ? mu : x * x * (0.25 / VIEW_TERMINATOR);
}

// Orders 0 to 2 of the modified phase function, per irradiance 1: what the paper's model is made of, and how the solved sum is shared out to layers.
struct view_orders {
	vec3 order0;
	vec3 order1;
	vec3 order2;
};

view_orders view_orders_of(view_point p, float m_l, float m_v, float thickness, float facing, bool through)
{
	vec3 tau = vec3(extinction_modified) * thickness;
	vec3 shape = (through ? slab_single_transmitted(tau, m_l, m_v) : facing * slab_single_reflected(tau, m_l, m_v)) * (0.25 / PI);
	vec3 p_f = vec3(1.0) - vec3(extinction_modified) / vec3(extinction);
	vec3 full = phase_full(p.half_angle);
	view_orders orders;
	orders.order2 = phase_twice(p.half_angle) * shape * slab_double_scale(p.thickness, through);
#if VIEW_ABOVE
	// The forward peak does not turn back.
	orders.order0 = vec3(0.0);
	orders.order1 = full / (vec3(1.0) - p_f) * shape;
#else
	float depth = through ? extinction.y * p.thickness * 0.5 * (1.0 / m_l + 1.0 / m_v) : 0.0;
	// One event and no forward ones beside it: order 0 inside the forward peak, order 1 outside.
	vec3 sharp = full * exp(-p_f * depth) / (vec3(1.0) - p_f) * shape;
	bool inside = p.half_angle.x < FORWARD_PEAK_SINE;
	orders.order0 = (inside ? sharp : vec3(0.0)) + forward_peak(p.half_angle, depth);
	orders.order1 = (inside ? vec3(0.0) : sharp) + forward_blur(p.half_angle, depth) * shape;
#endif
	return orders;
}

// Cosine to a facet as single scattering has it, which takes place a free path deep: facets are as large as that, so that light comes through crests, and what both grazes and faces the
// sun is no mirror. flat: to the flat top, for which it stays as it is.
const float VIEW_FACET_SOFT = 0.3;

float view_facet_cosine(float facet, float flat_cosine)
{
	const float soft = VIEW_FACET_SOFT * VIEW_FACET_SOFT;
	return flat_cosine * (facet + sqrt(facet * facet + soft)) / (flat_cosine + sqrt(flat_cosine * flat_cosine + soft));
}

// Light of the sun, of irradiance `sun` normal to its beam, that one lit side of the layer, base or top, sends to the viewer.
void view_layer_side(view_point p, bool base, vec3 sun, INOUT(view_parts) parts)
{
	bool through = base == (VIEW_ABOVE > 0);
	float mu_l = view_lit_cosine(base ? -p.mu_sun : p.mu_sun);
	float m_l = max(mu_l, 0.01);
	float m_v = p.mu_v;
	float thickness = p.thickness;
	float facing = 1.0;
	float received = base ? 1.0 : p.received;
#if VIEW_ABOVE
	if (!through) {
		// A facet turned away from light is faded out instead of cut. One turned away from the view is not seen: what says so is the crest that a pixel is on.
		facing = smoothstep(-0.2, 0.15, p.mu_l_facet) * p.lit;
		m_l = max(view_facet_cosine(p.mu_l_facet, max(mu_l, 0.03)), 0.03);
		m_v = max(view_facet_cosine(p.mu_v_facet, m_v), 0.1);
		thickness = p.way * m_v;
		received = p.received;
	}
#endif
#if !VIEW_ABOVE
	if (through)
		m_l = max(m_l * (thickness + 1e-3) / (p.sun + 1e-3), 1e-4);
#endif
	sun *= mu_l / max(mu_l, 0.01);
#if VIEW_SOLVED
	vec3 first = facing * sun * solved_first(p.half_angle, vec3(extinction_scaled) * thickness, m_l, m_v, through);
	vec3 rest = received * sun * solved_multiple(base ? slab_light.x : 0.0, p.smooth_thickness, vec3(extinction_scaled) * (p.way * p.mu_v),
	                                             max(mu_l, 0.01), p.mu_v, p.view_index, p.cos_azimuth);
#if VIEW_COLOR_ONLY
	parts.order1 += first;
	parts.multiple += rest;
#else
	// The sum is the solver's. In layers the orders 0 to 2 are those of the modified phase function and 3+ is what they leave of the solver's
	// orders; what these four miss or exceed the sum by, a few percent, is shared out.
	view_orders orders = view_orders_of(p, m_l, m_v, thickness, facing, through);
	vec3 many = rest * max(1.0 - sun.y * orders.order2.y / max(rest.y, 1e-20), 0.0);
	vec3 share = (first + rest) / max(sun * (orders.order0 + orders.order1 + orders.order2) + many, vec3(1e-20));
	parts.order0 += sun * orders.order0 * share;
	parts.order1 += sun * orders.order1 * share;
	parts.order2 += sun * orders.order2 * share;
	parts.multiple += many * share;
#endif
#else
	view_orders orders = view_orders_of(p, m_l, m_v, thickness, facing, through);
	parts.order0 += sun * orders.order0;
	parts.order1 += sun * orders.order1;
	parts.order2 += sun * orders.order2;
	// Edges that the view passes on a short way are a part of what the slab would be.
	vec3 seen = min((vec3(1.0) - exp(-vec3(extinction) * p.way)) / (vec3(1.0) - exp(-vec3(extinction) * (p.thickness + 1e-3) / p.mu_v)), vec3(1.0));
	parts.multiple += seen * received * sun * (max(mu_l, 0.01) / PI) * slab_multiple(p.thickness, through);
#endif
}

// All light of the sun from the layer.
void view_layer_sunlight(view_point p, vec3 sun, INOUT(view_parts) parts)
{
	view_layer_side(p, false, sun, parts);
#if VIEW_TWILIGHT
	view_layer_side(p, true, sun, parts);
#endif
}

// Diffuse light of sky and ground by way of the layer, which they reach with irradiances `sky` and `ground`; and how much of what lies behind
// is seen through it.
void view_layer_diffuse(view_point p, vec3 sky, vec3 ground, INOUT(view_parts) parts)
{
	parts.transmittance = exp(-vec3(extinction_scaled) * p.way);
	vec3 met = (vec3(1.0) - parts.transmittance) / PI;
	vec3 share = slab_diffuse_share(p.smooth_thickness, p.view_index);
#if VIEW_ABOVE
	parts.cloud_sky = sky * met * (vec3(1.0) - share);
	parts.cloud_ground = ground * met * share;
#else
	share = mix(share, vec3(0.5), p.upright); // side_low_sky
	parts.cloud_sky = sky * met * share;
	parts.cloud_ground = ground * met * (vec3(1.0) - share);
#endif
	parts.optical_thickness = extinction.y * p.thickness;
}

// inside: thickness where there is cloud in the pixel.
view_point view_point_at(vec3 direction, float thickness, float inside, float smooth_thickness, float cos_view, float mu_sun)
{
	view_point p;
	p.thickness = thickness;
	// The more often light is scattered on its way, the more of it has come from the side.
	float spread = VIEW_SOLVED > 0 ? slab_light.w * inside : 0.0;
	p.smooth_thickness = mix(inside, smooth_thickness, spread / (1.0 + spread));
	p.mu_v = max(abs(cos_view), 0.01);
	p.view_index = slab_view_index(p.mu_v);
	p.mu_sun = mu_sun;
	p.cos_azimuth = view_cos_azimuth(direction, cos_view, mu_sun);
	p.half_angle = scattering_half_angle(-vec3(sun_direction), -direction);
	p.way = thickness / p.mu_v;
	p.mu_l_facet = abs(mu_sun);
	p.mu_v_facet = p.mu_v;
	p.lit = 1.0;
	p.received = 1.0;
	p.sun = thickness;
	p.upright = 0.0;
	return p;
}
#endif

view_parts view_nothing()
{
	view_parts parts;
	parts.sun_direct = vec3(0.0);
	parts.order0 = vec3(0.0);
	parts.order1 = vec3(0.0);
	parts.order2 = vec3(0.0);
	parts.multiple = vec3(0.0);
	parts.cloud_sky = vec3(0.0);
	parts.cloud_ground = vec3(0.0);
	parts.sky = vec3(0.0);
	parts.ground = vec3(0.0);
	parts.air = vec3(0.0);
	parts.transmittance = vec3(1.0);
	parts.optical_thickness = 0.0;
	parts.distance = 0.0;
	return parts;
}

void view_attenuate(vec3 air, INOUT(view_parts) parts)
{
	parts.order0 *= air;
	parts.order1 *= air;
	parts.order2 *= air;
	parts.multiple *= air;
	parts.cloud_sky *= air;
	parts.cloud_ground *= air;
}

#if VIEW_CLOUDS && !VIEW_ABOVE
// Beside the sun the beam comes to the air below the layer past the very clouds that are seen: air before a gap is lit, air before a thick cloud lies in its shadow, not both by the
// mean. What that makes of the share of a clear sky's light that the mean leaves. along: transmittance of the layer along the view; distance: to it. Up to an offset of
// VIEW_BEAM_ASIDE at the layer, a part of the size of clouds, and not over long ways, on which haze mixes the beams.
const float VIEW_BEAM_ASIDE = 400.0; // m
const float VIEW_BEAM_MIXED = 8000.0;

vec3 view_air_beside(vec3 along, vec2 half_angle, float distance)
{
	float aside = half_angle.x * (2.0 / VIEW_BEAM_ASIDE);
	return (along - vec3(air_below)) * (1.0 / (1.0 + distance * distance * (aside * aside + 1.0 / (VIEW_BEAM_MIXED * VIEW_BEAM_MIXED))));
}

#if VIEW_SOLVED
// The layer as a view meets it whose cosine to the vertical is mu_v, in the solved shading. place: where that meets the base; heading: of the view, any length.
side_lit view_side_lit(vec2 place, vec2 heading, float mu_v, float footprint)
{
#if SIDE_LOW != 1
	side_view side = side_view_at(place, heading, max(mu_v, SIDE_LOW_ALL), field_rugged(place));
	float thickness = field_thickness(side.place, footprint);
	side_lit lit = side_lit_at(side, footprint, thickness, thickness);
#endif
#if SIDE_LOW
	side_low low = side_low_at(place, heading, mu_v, footprint);
	// One place stands for both halves of a pixel: detail finer than half way from its square to its strip would come out as dots.
	float detail = sqrt(footprint * camera_strip(footprint, mu_v));
	side_lit low_lit = side_low_lit(low, footprint, field_thickness(low.place, detail));
	// A loop, since software renders what is in a condition whether it holds or not.
	for (float other = step(SIDE_LOW_OTHER, low.other); other > 0.0; other -= 1.0) {
		side_low behind = side_low_other(low);
		low_lit = side_both(low_lit, side_low_lit(behind, footprint, field_thickness(behind.place, detail)), vec2(low.other));
	}
#endif
#if SIDE_LOW == 1
	return low_lit;
#elif SIDE_LOW == 2
	return side_mixed(lit, low_lit, side_low_share(mu_v));
#else
	return lit;
#endif
}
#endif

// Upwards from below the layer.
view_parts view_from_below(vec3 direction, vec2 air, vec3 disc)
{
	view_parts parts = view_nothing();
	float base = cloud_layer.x;
	float t = sphere_distance_up(camera_position.z, direction.z, base);
	vec2 place = vec2(camera_position) + vec2(direction) * t;
	float cos_view = max(sphere_cosine(camera_position.z, direction.z, t, base), 0.01);
	float footprint = camera_footprint(t, cos_view);
	float mu_sun = view_sun_cosine(direction, t, base);
#if VIEW_SOLVED
	side_lit lit = view_side_lit(place, vec2(direction), cos_view, footprint);
	view_point p = view_point_at(direction, lit.thickness, lit.inside, lit.smooth_m, cos_view, mu_sun);
	p.smooth_thickness = lit.smooth_m;
	p.sun = lit.sun;
	p.received = lit.light;
	p.upright = lit.upright;
	float sine = sky_table_sine(sphere_horizon(camera_position.z), side_low_row(sky_table_row(air), lit.upright));
	p.view_index = slab_view_index(sphere_cosine(camera_position.z, sine, sphere_distance_up(camera_position.z, sine, base), base));
#else
	// The paper's model knows a plane base alone.
	vec2 layer = vec2(view_thickness(place, footprint));
#if VIEW_PROJECTION != 1
	// A fisheye's footprint is as long as the strip.
	if (cos_view < FIELD_ALONG_COSINE && cloud_layer.w > 0.5)
		layer = field_thickness_along(place, vec2(direction), footprint, cos_view, extinction_scaled.y);
#endif
	view_point p = view_point_at(direction, layer.x, layer.y, layer.y, cos_view, mu_sun);
#endif

	vec3 to_layer = vec3(textureLod(air_to_layer, air, 0.0));
	view_layer_sunlight(p, vec3(textureLod(air_to_end, air, 0.0)) * float(p.thickness > 0.01), parts);
	view_layer_diffuse(p, to_layer * vec3(sky_irradiance_cloud), to_layer * vec3(textureLod(cloud_received, place / cloud_layer.z, 0.0)), parts);

	vec3 near = vec3(textureLod(sky_near, air, 0.0));
	parts.sun_direct = disc;
#if VIEW_LARGE_SUN
	parts.sun_direct *= exp(-vec3(extinction) * (p.thickness / p.mu_v));
#endif
	parts.sky = max(vec3(textureLod(sky_total, air, 0.0)) - near, vec3(0.0)) * parts.transmittance;
	parts.air = near * (vec3(air_below) + view_air_beside(parts.transmittance, p.half_angle, t)) + (vec3(1.0) - to_layer) * vec3(air_around);
	parts.distance = p.thickness > 0.01 ? t : 0.0;
	return parts;
}
#endif

#if VIEW_ABOVE
// Light of the sky on a place of the top, relative to that on a flat one: what stands out of its surroundings sees more of it than what lies in between, and of a low
// sun's sky the bright side is seen by the slopes that face it. Both vary about 1: what one place gets less, its neighbours get more.
float view_sky_received(float standing_out, vec2 slope)
{
	float low = 1.0 - smoothstep(-0.05, 0.25, sun_direction.z);
	float open = clamp(1.0 + 0.5 * standing_out, 0.55, 1.35);
	return open * clamp(1.0 - 0.35 * low * dot(slope, height_sun_heading()), 0.6, 1.6);
}

// The cloud that a ray from above meets, as shaders/passes/height_view.glsl has it for the pixel.
void view_cloud_top(vec3 direction, vec4 place, vec4 light, vec2 air, INOUT(view_parts) parts)
{
	float t = place.x;
	float height = max(sphere_height(camera_position.z, direction.z, t), cloud_layer.x);
	float mu_sun = view_sun_cosine(direction, t, height);
	float cos_view = min(sphere_cosine(camera_position.z, direction.z, t, height), -0.01);
	view_point p = view_point_at(direction, place.z, place.z, place.w, cos_view, mu_sun);
	vec3 normal = normalize(vec3(-light.x, -light.y, 1.0));
	p.way = place.y;
	// The vertical turns with the distance: facets are taken against the local one.
	p.mu_l_facet = dot(normal, vec3(sun_direction)) + (mu_sun - sun_direction.z) * normal.z;
	p.mu_v_facet = -dot(normal, direction) + (p.mu_v + direction.z) * normal.z;
	p.lit = light.z;
	p.received = light.w;
	vec3 to_layer = vec3(textureLod(air_to_layer, air, 0.0));
	vec2 below = vec2(camera_position) + vec2(direction) * t;
	view_layer_sunlight(p, to_layer * sun_irradiance(height, mu_sun), parts);
	float sky_received = view_sky_received((place.z - place.w) / max(place.w, 0.25 * cloud_layer.y), vec2(light));
	view_layer_diffuse(p, to_layer * vec3(sky_irradiance_cloud) * sky_received, to_layer * vec3(textureLod(cloud_received, below / cloud_layer.z, 0.0)), parts);
	parts.distance = t;
}
#endif

// What lies below the horizon, seen through the layer as `parts` has it. high: of the pixel's part there, as for view_ground.
void view_add_ground(vec3 direction, float high, vec2 air, INOUT(view_parts) parts)
{
	float t = max(sphere_distance_down(camera_position.z, min(direction.z, sphere_horizon(camera_position.z) - 1e-7), 0.0), 0.0);
	ground_point point;
	point.offset = vec2(direction) * t;
	point.across = camera_position.w * t;
	point.mu_v = max(-sphere_cosine(camera_position.z, direction.z, t, 0.0), 0.002);
	point.mu_sun = view_sun_cosine(direction, t, 0.0);
	vec3 to_end = vec3(textureLod(air_to_end, air, 0.0));
	if (parts.transmittance.y > 1e-5)
		parts.ground = view_ground(direction, high, point) * to_end * parts.transmittance;
	vec3 total = vec3(textureLod(sky_total, air, 0.0));
#if VIEW_ABOVE
	vec3 near = vec3(textureLod(sky_near, air, 0.0));
	vec3 below = max(vec3(textureLod(air_to_layer, air, 0.0)) - to_end, vec3(0.0));
	// What lights the air at twilight comes from along the horizon: on its slant way it meets the layer several times over.
	float slant = 1.0 - smoothstep(-0.03, 0.06, sun_direction.z);
	vec3 share = vec3(air_below) * mix(vec3(1.0), vec3(air_below) * vec3(air_below), slant);
	parts.air = near + (max(total - near, vec3(0.0)) * share + below * vec3(air_around)) * parts.transmittance;
#else
	parts.air = total * vec3(air_below) + (vec3(1.0) - to_end) * vec3(air_around); // 1 and 0 without clouds
#endif
	if (parts.distance == 0.0)
		parts.distance = t;
}

#if !VIEW_CLOUDS || VIEW_ABOVE
// What lies above the horizon where no layer is between, or behind the cloud top that `parts` holds.
void view_add_sky(vec3 disc, vec2 air, INOUT(view_parts) parts)
{
	bool cloud = parts.distance > 0.0;
	vec3 total = vec3(textureLod(sky_total, air, 0.0));
	vec3 near = vec3(textureLod(sky_near, air, 0.0));
	parts.sun_direct = disc * parts.transmittance;
	parts.air = cloud ? near : vec3(0.0);
	parts.sky = cloud ? max(total - near, vec3(0.0)) * parts.transmittance : total;
}
#endif

#if VIEW_REGION == 0
// Of a pixel that sees the ground, `b`, by this share and otherwise `a`. A small disc was spread over pixels above the horizon already.
view_parts view_mixed(view_parts a, view_parts b, float share)
{
#if VIEW_LARGE_SUN
	a.sun_direct *= 1.0 - share;
#endif
	a.order0 = mix(a.order0, b.order0, share);
	a.order1 = mix(a.order1, b.order1, share);
	a.order2 = mix(a.order2, b.order2, share);
	a.multiple = mix(a.multiple, b.multiple, share);
	a.cloud_sky = mix(a.cloud_sky, b.cloud_sky, share);
	a.cloud_ground = mix(a.cloud_ground, b.cloud_ground, share);
	a.sky = mix(a.sky, b.sky, share);
	a.ground = mix(a.ground, b.ground, share);
	a.air = mix(a.air, b.air, share);
	a.transmittance = mix(a.transmittance, b.transmittance, share);
	a.optical_thickness = mix(a.optical_thickness, b.optical_thickness, share);
	a.distance = share > 0.5 ? b.distance : a.distance;
	return a;
}
#endif

// The whole picture. Decided when the shader is built, since software renderers execute both sides of every branch:
// VIEW_CLOUDS: there is a layer; VIEW_ABOVE: the camera is above it; VIEW_SOLVED: shading; VIEW_TWILIGHT: the sun lights the base somewhere; VIEW_COLOR_ONLY: parts are not asked for; VIEW_REGION: rays of this part of the picture end on the ground (1), meet neither ground nor, from above, the layer (2), or do either (0).
// disc: radiance of the sun's disc in the pixel (shaders/lib/sun_disc.glsl).
// place, light: what a ray from above sees of the layer, as shaders/passes/height_view.glsl stores it; place.x = 0: nothing.
#if VIEW_ABOVE
view_parts view_ray_seen(vec3 direction, vec3 disc, vec4 place, vec4 light)
#else
view_parts view_ray(vec3 direction, vec3 disc)
#endif
{
	view_parts parts = view_nothing();
#if VIEW_REGION == 0
	// A pixel that the horizon crosses shows both, each by the middle of its part.
	float horizon = sphere_horizon(camera_position.z);
	float share = clamp(0.5 + (horizon - direction.z) / camera_position.w, 0.0, 1.0);
#if VIEW_PROJECTION == 1
	share = step(0.5, share); // it ends at its rim
#endif
	float high = camera_position.w * share;
	vec3 down = vec3(direction.x, direction.y, min(direction.z - 0.5 * (camera_position.w - high), horizon - 1e-7));
	vec3 up = vec3(direction.x, direction.y, max(direction.z + 0.5 * high, horizon + 1e-7));
	view_parts above = view_nothing();
#if VIEW_ABOVE
	if (place.x > 0.0) {
		view_cloud_top(direction, place, light, sky_table_coordinates(direction), parts);
		above = parts;
	}
#endif
	view_add_ground(down, high, sky_table_coordinates(down), parts);
#if VIEW_CLOUDS && !VIEW_ABOVE
	above = view_from_below(up, sky_table_coordinates(up), disc);
#else
	view_add_sky(disc, sky_table_coordinates(up), above);
#endif
	return view_mixed(above, parts, share);
#else
	vec2 air = sky_table_coordinates(direction);
#if VIEW_ABOVE && VIEW_REGION == 1
	// Rays that end on the ground meet the layer first.
	if (place.x > 0.0)
		view_cloud_top(direction, place, light, air, parts);
#endif
#if VIEW_REGION == 1
	view_add_ground(direction, camera_position.w, air, parts);
#elif VIEW_CLOUDS && !VIEW_ABOVE
	parts = view_from_below(direction, air, disc);
#else
	view_add_sky(disc, air, parts);
#endif
	return parts;
#endif
}

#if VIEW_ABOVE
// Of a ray that does not meet the layer.
view_parts view_ray(vec3 direction, vec3 disc)
{
	return view_ray_seen(direction, disc, vec4(0.0), vec4(0.0));
}
#endif

vec3 view_sum(view_parts p)
{
	return p.sun_direct + p.order0 + p.order1 + p.order2 + p.multiple + p.cloud_sky + p.cloud_ground + p.sky + p.ground + p.air;
}
#endif
