// The layer seen from below, fast: shaders/lib/view.glsl with all that is smooth over the sky out of tables, so that a pixel computes little more than
// its thickness. Orders from the second on, diffuse light and what the air adds are tabulated over the sky's directions (shaders/lib/sky_table.glsl), the
// first order over angle and depth. Not for twilight, when the sun lights the base too.
#ifndef SHADERS_LIB_VIEW_UP
#define SHADERS_LIB_VIEW_UP
#include "shaders/lib/packed.glsl"
#include "shaders/lib/view.glsl"

#ifndef __cplusplus
uniform sampler2D up_sky;
uniform sampler2D up_air;
uniform sampler2D up_sun;
uniform sampler2D up_first;
uniform sampler2D up_light;
#endif

// Columns over the azimuth from the sun and rows over the elevation, as those of the sky's table above the horizon; the light's table holds one such
// picture for each depth, on each other.
const vec2 UP_LIGHT_SIZE = vec2(64.0, 64.0);
const float UP_LIGHT_DEPTHS = 24.0;
// The first order: columns over the angle as in the residual tables, rows over the depth s as s/(s + 4).
const vec2 UP_FIRST_SIZE = vec2(1024.0, 64.0);
const float UP_FIRST_DEPTH = 4.0;

// Thickness over which the light changes: where transmittance, which goes like 1/(tau + q), has fallen to half.
float up_thickness_scale()
{
	return extinction_scaled.w / extinction.y;
}

// Depths are even in this, 0 at none and 1 at the layer's full thickness: fine where thin layers change fast, and linear in the transmittance of thick ones.
float up_depth_unit(float thickness)
{
	float h = up_thickness_scale();
	float most = cloud_layer.y / (cloud_layer.y + h);
	return sqrt(clamp(thickness / ((thickness + h) * most), 0.0, 1.0));
}

// The inverse.
float up_depth_thickness(float unit)
{
	float h = up_thickness_scale();
	float share = unit * unit * cloud_layer.y / (cloud_layer.y + h);
	return h * share / (1.0 - share);
}

// How a direction of the sky meets the layer's base.
struct up_ray {
	float distance;  // m
	float mu_v;      // cosine of the view to the local vertical
	float mu_l;      // of the sun
	vec2 place;      // m
	float footprint; // m
};

up_ray up_ray_of(vec3 direction)
{
	up_ray ray;
	float base = cloud_layer.x;
	ray.distance = sphere_distance_up(camera_position.z, direction.z, base);
	ray.mu_v = max(sphere_cosine(camera_position.z, direction.z, ray.distance, base), 0.01);
	ray.mu_l = max(view_lit_cosine(view_sun_cosine(direction, ray.distance, base)), 0.01);
	ray.place = vec2(camera_position) + vec2(direction) * ray.distance;
	ray.footprint = camera_footprint(ray.distance, ray.mu_v);
	return ray;
}

// --- tables ---

// Direction of a place in a table of the sky, both coordinates from 0 to 1.
vec3 up_direction(vec2 unit)
{
	float mu = sky_table_sine(sphere_horizon(camera_position.z), unit.y);
	float half_sine = unit.x * unit.x;
	float cosine = 1.0 - 2.0 * half_sine * half_sine;
	float sine = sqrt(max(1.0 - cosine * cosine, 0.0));
	vec2 flat_sun = length(vec2(sun_direction)) > 1e-9 ? normalize(vec2(sun_direction)) : vec2(1.0, 0.0);
	return vec3((flat_sun * cosine + vec2(-flat_sun.y, flat_sun.x) * sine) * sqrt(max(1.0 - mu * mu, 0.0)), mu);
}

// Radiance of the orders from the second on, for light and view of length 1 through what lies along the view (the factor 1 - exp(-tau/mu_v) is left to
// the pixel), and an irradiance of 1.
vec3 up_light_of(vec2 unit, float thickness)
{
	vec3 direction = up_direction(unit);
	up_ray ray = up_ray_of(direction);
	float cos_azimuth = view_cos_azimuth(direction, ray.mu_v, view_sun_cosine(direction, ray.distance, cloud_layer.x));
	return solved_multiple(0.0, thickness, vec3(1e4), ray.mu_l, ray.mu_v, slab_view_index(ray.mu_v), cos_azimuth);
}

// Of uniform diffuse light that meets droplets, the share seen through the layer, in the middle band: the others' are within a percent of it.
float up_share_of(vec2 unit, float thickness)
{
	return slab_diffuse_share(thickness, slab_view_index(up_ray_of(up_direction(unit)).mu_v)).y;
}

// Phase function of the first order, over 4 pi, at a place in its table.
vec3 up_first_of(vec2 unit)
{
	float x = 1.0 - abs(1.0 - 2.0 * unit.x);
	float near = x * x * 0.70710678;
	float far = sqrt(1.0 - near * near);
	vec2 half_angle = unit.x < 0.5 ? vec2(near, far) : vec2(far, near);
	// The last row stands for all depths beyond, where nothing of the first order is left.
	float depth = min(unit.y, 0.999);
	return solved_first_phase(half_angle, UP_FIRST_DEPTH * depth / (1.0 - depth), true) * (0.25 / PI);
}

// --- a pixel ---

// A direction of the same azimuth in that row.
vec3 up_raised(vec3 direction, float row)
{
	float sine = sky_table_sine(sphere_horizon(camera_position.z), row);
	vec2 heading = vec2(direction);
	return vec3(heading * sqrt((1.0 - sine * sine) / max(dot(heading, heading), 1e-12)), sine);
}

// Coordinates of a direction in tables of the sky above the horizon, 0 to 1.
vec2 up_unit(vec2 air)
{
	return vec2((air.x * SKY_TABLE_SIZE.x - 0.5) / (SKY_TABLE_SIZE.x - 1.0), sky_table_row(air));
}

// Light as of up_light_of, and the share as of up_share_of.
vec4 up_light_at(vec2 unit, float depth_unit)
{
	float depth = depth_unit * (UP_LIGHT_DEPTHS - 1.0);
	float low = min(floor(depth), UP_LIGHT_DEPTHS - 2.0);
	vec2 at = unit * (UP_LIGHT_SIZE - 1.0) + vec2(0.5, 0.5 + low * UP_LIGHT_SIZE.y);
	vec2 scale = 1.0 / (UP_LIGHT_SIZE * vec2(1.0, UP_LIGHT_DEPTHS));
	return mix(textureLod(up_light, at * scale, 0.0), textureLod(up_light, (at + vec2(0.0, UP_LIGHT_SIZE.y)) * scale, 0.0), depth - low);
}

vec3 up_first_at(vec2 half_angle, float s)
{
	float x = 0.5 * sqrt(min(half_angle.x, half_angle.y) * 1.41421356);
	vec2 unit = vec2(half_angle.x < half_angle.y ? x : 1.0 - x, s / (s + UP_FIRST_DEPTH));
	return vec3(textureLod(up_first, (unit * (UP_FIRST_SIZE - 1.0) + 0.5) / UP_FIRST_SIZE, 0.0));
}

// slab_single_transmitted out of the optical thicknesses along view and light and what they let through.
vec3 up_single(vec3 view, vec3 light, vec3 along_light, vec3 along_view)
{
	vec3 x = abs(view - light);
	vec3 larger = max(along_light, along_view);
	vec3 series = larger * (vec3(1.0) - x * (0.5 - x * (1.0 / 6.0)));
	vec3 exact = (larger - min(along_light, along_view)) / max(x, vec3(1e-6));
	return view * mix(exact, series, lessThan(x, vec3(0.01)));
}

// What arrives along a ray that meets the layer from below, W/m2/nm/sr. disc: radiance of the sun's disc in the pixel (shaders/lib/sun_disc.glsl).
vec3 up_radiance(vec3 direction, vec3 disc)
{
	vec2 air = sky_table_coordinates(direction);
	vec2 unit = up_unit(air);
	up_ray ray = up_ray_of(direction);
	side_lit lit = view_side_lit(ray.place, vec2(direction), ray.mu_v, ray.footprint);
	float thickness = lit.thickness;
	float depth_unit = up_depth_unit(lit.smooth_m);

	vec4 sky = textureLod(up_sky, air, 0.0);
	vec4 near = textureLod(up_air, air, 0.0);
	vec4 sun = textureLod(up_sun, air, 0.0);
	vec3 to_layer = vec3(sky.w, near.w, sun.w);

	vec3 tau = vec3(extinction_scaled) * thickness;
	vec3 along_view = exp(-tau / ray.mu_v);
	float along_sun = (lit.sun + 1e-3) / ray.mu_l;
	vec3 along_light = exp(-vec3(extinction_scaled) * along_sun);
	vec2 half_angle = scattering_half_angle(-vec3(sun_direction), -direction);
	vec3 first = up_first_at(half_angle, solved_mean_depth(extinction_scaled.y * along_sun, tau.y / ray.mu_v)) *
	             up_single(tau / ray.mu_v, vec3(extinction_scaled) * along_sun, along_light, along_view);
#if SIDE_LOW
	// The table has the light of the place that is seen in the row, not of the one farther away.
	unit.y = side_low_row(unit.y, lit.upright);
	vec4 light = up_light_at(unit, depth_unit);
	light = vec4(vec3(light) * (ray.mu_l / up_ray_of(up_raised(direction, unit.y)).mu_l), side_low_sky(light.w, lit.upright));
#else
	vec4 light = up_light_at(unit, depth_unit);
#endif
	vec3 received = vec3(textureLod(cloud_received, ray.place / cloud_layer.z, 0.0));
	vec3 diffuse = to_layer * (vec3(sky_irradiance_cloud) * light.w + received * (1.0 - light.w)) * (1.0 / PI);
	vec3 met = vec3(1.0) - along_view;
	vec3 clear = (vec3(near) - (vec3(1.0) - to_layer) * vec3(air_around)) / max(vec3(air_below), vec3(1e-4)); // what was tabled, without clouds
	vec3 beside = clear * view_air_beside(along_view, half_angle, ray.distance);
	vec3 radiance = vec3(near) + beside + vec3(sky) * along_view + met * diffuse +
	                vec3(sun) * (thickness > 0.01 ? 1.0 : 0.0) * (first + met * lit.light * vec3(light));
#if VIEW_LARGE_SUN
	disc *= exp(-vec3(extinction) * (thickness / ray.mu_v));
#endif
	return radiance + disc;
}
#endif
