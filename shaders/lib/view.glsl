// The picture: what arrives at the camera along a ray, in parts that add up to the whole. W/m2/nm/sr in the three bands.
#ifndef SHADERS_LIB_VIEW
#define SHADERS_LIB_VIEW
#include "shaders/lib/camera.glsl"
#include "shaders/lib/field.glsl"
#include "shaders/lib/ground.glsl"
#include "shaders/lib/height.glsl"
#include "shaders/lib/sky_table.glsl"
#include "shaders/lib/slab.glsl"
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

// The unscattered disc of the sun, limb darkened: 1 - u (1 - cos), u = 0.6 in the visible (Allen 1973), whose mean over the disc is 1 - u/3.
vec3 view_sun_disc(vec3 direction)
{
	float angle = length(direction - vec3(sun_direction));
	float radius = sun_direction.w;
	float pixel = camera_position.w;
	float cover = clamp(0.5 + (radius - angle) / pixel, 0.0, 1.0);
	float rho = min(angle / radius, 1.0);
	float limb = (1.0 - 0.6 * (1.0 - sqrt(1.0 - rho * rho))) / 0.8;
	return vec3(sun_at_camera) * (cover * limb / (PI * radius * radius));
}

// Radiance of the ground under sun, sky and clouds, before the air between.
vec3 view_ground(vec2 place, float footprint, float mu_sun)
{
	vec3 received = vec3(sky_irradiance_ground);
	vec3 direct = sun_irradiance(0.0, mu_sun) * max(mu_sun, 0.0);
#if VIEW_CLOUDS
	{
		received = vec3(textureLod(ground_received, place / cloud_layer.z, 0.0));
		// The beam passed the layer where the parallax says; its shadow is as soft as the sun is wide.
		vec2 through = place + vec2(sun_direction) * cloud_layer.x / max(sun_direction.z, 0.02);
		float penumbra = 2.0 * sun_direction.w * cloud_layer.x;
		direct *= slab_directional_transmittance(field_thickness(through, max(footprint, penumbra)));
	}
#endif
	return ground_reflectance(place, footprint) * (received + direct) / PI;
}

// Light of the sun that the layer sends to the viewer, per irradiance `sun` on a plane normal to the beam.
// through: sun and viewer are on different sides. mu_l: cosine of the sun to the vertical; mu_l_facet, mu_v_facet: cosines to the surface's normal, for the orders 1
// and 2; depth_scale: thickness along that normal over H.
void view_layer_sunlight(vec3 direction, bool through, float thickness, float depth_scale, float mu_l, float mu_l_facet, float mu_v_facet, vec3 sun,
                         INOUT(view_parts) parts)
{
	vec2 angle = scattering_half_angle(-vec3(sun_direction), -direction);
	// A facet turned away from light or view is faded out instead of cut.
	float facing = smoothstep(-0.05, 0.15, mu_l_facet) * smoothstep(-0.05, 0.10, mu_v_facet);
	float m_l = max(mu_l_facet, 0.03);
	float m_v = max(mu_v_facet, 0.03);
	vec3 tau = vec3(extinction_modified) * (thickness * depth_scale);
	vec3 shape = (through ? slab_single_transmitted(tau, m_l, m_v) : facing * slab_single_reflected(tau, m_l, m_v)) * (0.25 / PI);
	vec3 p_f = vec3(1.0) - vec3(extinction_modified) / vec3(extinction);
	vec3 full = phase_full(angle);
	parts.order2 = sun * phase_twice(angle) * shape * slab_double_scale(thickness, through);
	parts.multiple = sun * (mu_l / PI) * slab_multiple(thickness, through);
#if VIEW_ABOVE
	// The forward peak does not turn back.
	parts.order1 = sun * full / (vec3(1.0) - p_f) * shape;
#else
	float depth = through ? extinction.y * thickness * 0.5 * (1.0 / m_l + 1.0 / m_v) : 0.0;
	// One event and no forward ones beside it: order 0 inside the forward peak, order 1 outside.
	vec3 sharp = full * exp(-p_f * depth) / (vec3(1.0) - p_f) * shape;
	bool inside = angle.x < FORWARD_PEAK_SINE;
	parts.order0 = sun * ((inside ? sharp : vec3(0.0)) + forward_peak(angle, depth));
	parts.order1 = sun * ((inside ? vec3(0.0) : sharp) + forward_blur(angle, depth) * shape);
#endif
}

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
// Upwards from below the layer.
view_parts view_from_below(vec3 direction, vec2 air)
{
	view_parts parts = view_nothing();
	float base = cloud_layer.x;
	float t = sphere_distance_up(camera_position.z, direction.z, base);
	vec2 place = vec2(camera_position) + vec2(direction) * t;
	float mu_v = max(sphere_cosine(camera_position.z, direction.z, t, base), 0.01);
	float mu_sun = view_sun_cosine(direction, t, base);
	float footprint = camera_position.w * t * inversesqrt(mu_v);
	float thickness = field_thickness(place, footprint);

	float mu_l = max(abs(mu_sun), 0.03);
	vec3 to_layer = vec3(textureLod(air_to_layer, air, 0.0));
	vec3 sun = vec3(textureLod(air_to_end, air, 0.0)) * float(thickness > 0.01);
	view_layer_sunlight(direction, mu_sun > 0.0, thickness, 1.0, mu_l, mu_l, mu_v, sun, parts);
	parts.transmittance = exp(-vec3(extinction_modified) * (thickness / mu_v));
	float plane = slab_plane_transmittance(thickness, mu_v);
	parts.cloud_sky = to_layer * vec3(sky_irradiance_cloud) / PI * max(vec3(plane) - parts.transmittance, vec3(0.0));
	parts.cloud_ground = to_layer * vec3(textureLod(cloud_received, place / cloud_layer.z, 0.0)) * ((1.0 - plane) / PI);

	vec3 near = vec3(textureLod(sky_near, air, 0.0));
	parts.sun_direct = view_sun_disc(direction) * exp(-vec3(extinction) * (thickness / mu_v));
	parts.sky = max(vec3(textureLod(sky_total, air, 0.0)) - near, vec3(0.0)) * parts.transmittance;
	parts.air = near * vec3(air_below) + (vec3(1.0) - to_layer) * vec3(air_around);
	parts.optical_thickness = extinction.y * thickness;
	parts.distance = thickness > 0.01 ? t : 0.0;
	return parts;
}
#endif

#if VIEW_ABOVE
// Distance to the cloud top along a ray from above, or -1.
float view_cloud_distance(vec3 direction)
{
	float top = cloud_layer.x + cloud_layer.y;
	float from = camera_position.z <= top ? 0.0 : sphere_distance_down(camera_position.z, direction.z, top);
	float to = sphere_distance_down(camera_position.z, direction.z, cloud_layer.x);
	// A ray that only grazes the layer leaves it again as far behind its lowest point as it entered before it.
	if (to < 0.0)
		to = -2.0 * (EARTH_RADIUS + camera_position.z) * direction.z - from;
	return from < 0.0 ? -1.0 : height_intersect(direction, from, to, camera_position.w);
}

// The cloud top met at distance t by a ray from above.
void view_cloud_top(vec3 direction, float t, vec2 air, INOUT(view_parts) parts)
{
	float height = max(sphere_height(camera_position.z, direction.z, t), cloud_layer.x);
	vec2 place = vec2(camera_position) + vec2(direction) * t;
	float footprint = camera_position.w * t;
	float mu_sun = view_sun_cosine(direction, t, height);
	float mu_v = max(-sphere_cosine(camera_position.z, direction.z, t, height), 0.01);
	vec3 normal = height_normal(place, footprint);
	float thickness = field_thickness(place, footprint);
	float mu_l = max(mu_sun, 0.03);
	vec3 to_layer = vec3(textureLod(air_to_layer, air, 0.0));
	vec3 sun = to_layer * sun_irradiance(height, mu_sun) * smoothstep(-0.02, 0.02, mu_sun);
	// The vertical turns with the distance: facets are taken against the local one.
	float mu_l_facet = dot(normal, vec3(sun_direction)) + (mu_sun - sun_direction.z) * normal.z;
	float mu_v_facet = -dot(normal, direction) + (mu_v + direction.z) * normal.z;
	view_layer_sunlight(direction, false, thickness, normal.z, mu_l, mu_l_facet, mu_v_facet, sun, parts);
	parts.transmittance = exp(-vec3(extinction_modified) * (thickness * normal.z / max(mu_v_facet, 0.03)));
	float plane = slab_plane_transmittance(thickness, mu_v);
	parts.cloud_sky = to_layer * vec3(sky_irradiance_cloud) * ((1.0 - plane) / PI);
	parts.cloud_ground = to_layer * vec3(textureLod(cloud_received, place / cloud_layer.z, 0.0)) / PI * max(vec3(plane) - parts.transmittance, vec3(0.0));
	parts.optical_thickness = extinction.y * thickness;
	parts.distance = t;
}
#endif

// What lies below the horizon, seen through the layer as `parts` has it.
void view_add_ground(vec3 direction, vec2 air, INOUT(view_parts) parts)
{
	float t = max(sphere_distance_down(camera_position.z, min(direction.z, sphere_horizon(camera_position.z) - 1e-7), 0.0), 0.0);
	vec2 place = vec2(camera_position) + vec2(direction) * t;
	float mu_v = max(-sphere_cosine(camera_position.z, direction.z, t, 0.0), 0.002);
	float footprint = camera_position.w * t * inversesqrt(mu_v);
	float mu_sun = view_sun_cosine(direction, t, 0.0);
	vec3 to_end = vec3(textureLod(air_to_end, air, 0.0));
	parts.ground = view_ground(place, footprint, mu_sun) * to_end * parts.transmittance;
	vec3 total = vec3(textureLod(sky_total, air, 0.0));
#if VIEW_ABOVE
	vec3 near = vec3(textureLod(sky_near, air, 0.0));
	vec3 below = max(vec3(textureLod(air_to_layer, air, 0.0)) - to_end, vec3(0.0));
	parts.air = near + (max(total - near, vec3(0.0)) * vec3(air_below) + below * vec3(air_around)) * parts.transmittance;
#else
	parts.air = total * vec3(air_below) + (vec3(1.0) - to_end) * vec3(air_around); // 1 and 0 without clouds
#endif
	if (parts.distance == 0.0)
		parts.distance = t;
}

#if !VIEW_CLOUDS || VIEW_ABOVE
// What lies above the horizon where no layer is between, or behind the cloud top that `parts` holds.
void view_add_sky(vec3 direction, vec2 air, INOUT(view_parts) parts)
{
	bool cloud = parts.distance > 0.0;
	vec3 total = vec3(textureLod(sky_total, air, 0.0));
	vec3 near = vec3(textureLod(sky_near, air, 0.0));
	parts.sun_direct = view_sun_disc(direction) * parts.transmittance;
	parts.air = cloud ? near : vec3(0.0);
	parts.sky = cloud ? max(total - near, vec3(0.0)) * parts.transmittance : total;
}
#endif

// The whole picture. Decided when the shader is built, since software renderers execute both sides of every branch:
// VIEW_CLOUDS: there is a layer; VIEW_ABOVE: the camera is above it; VIEW_REGION: rays of this part of the picture end on the ground (1), meet neither ground nor, from above, the layer (2), or do either (0).
view_parts view_ray(vec3 direction)
{
	vec2 air = sky_table_coordinates(direction);
	view_parts parts = view_nothing();
#if VIEW_REGION == 1
	bool to_ground = true;
#elif VIEW_REGION == 2
	bool to_ground = false;
#else
	bool to_ground = direction.z <= sphere_horizon(camera_position.z);
#endif
#if VIEW_ABOVE && VIEW_REGION != 2
	// Rays that end on the ground, or pass between the horizons of layer and ground, meet the layer first.
	float t = view_cloud_distance(direction);
	if (t >= 0.0)
		view_cloud_top(direction, t, air, parts);
#endif
	if (to_ground) {
		view_add_ground(direction, air, parts);
	} else {
#if VIEW_CLOUDS && !VIEW_ABOVE
		parts = view_from_below(direction, air);
#else
		view_add_sky(direction, air, parts);
#endif
	}
	return parts;
}

vec3 view_sum(view_parts p)
{
	return p.sun_direct + p.order0 + p.order1 + p.order2 + p.multiple + p.cloud_sky + p.cloud_ground + p.sky + p.ground + p.air;
}
#endif
