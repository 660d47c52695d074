// The picture: what arrives at the camera along a ray, in parts that add up to the whole. W/m2/nm/sr in the three bands.
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

// What the sky stage knows of a direction.
struct view_air {
	vec3 total;   // light of the air to the end of the ray
	vec3 near;    // the part before the layer
	vec3 to_layer;
	vec3 to_end;
};

view_air view_air_along(vec3 direction)
{
	vec2 at = sky_table_coordinates(direction);
	view_air air;
	air.total = vec3(textureLod(sky_total, at, 0.0));
	air.near = vec3(textureLod(sky_near, at, 0.0));
	air.to_layer = vec3(textureLod(air_to_layer, at, 0.0));
	air.to_end = vec3(textureLod(air_to_end, at, 0.0));
	return air;
}

// Cosine of the sun's zenith angle at a point along the ray.
float view_sun_cosine(vec3 direction, float t, float height)
{
	vec3 sun = vec3(sun_direction);
	return clamp(((EARTH_RADIUS + camera_position.z) * sun.z + t * dot(direction, sun)) / (EARTH_RADIUS + height), -1.0, 1.0);
}

// The unscattered disc of the sun, limb darkened: 1 - u (1 - cos), u = 0.6 in the visible (Allen 1973), whose mean over the disc is 1 - u/3.
vec3 view_sun_disc(float angle)
{
	float radius = sun_direction.w;
	float pixel = camera_position.w;
	float cover = clamp(0.5 + (radius - angle) / pixel, 0.0, 1.0);
	if (cover <= 0.0)
		return vec3(0.0);
	float rho = min(angle / radius, 1.0);
	float limb = (1.0 - 0.6 * (1.0 - sqrt(1.0 - rho * rho))) / 0.8;
	return cover * limb * sun_irradiance(camera_position.z, sun_direction.z) / (PI * radius * radius);
}

// Radiance of the ground under sun, sky and clouds, before the air between.
vec3 view_ground(vec2 place, float footprint, float mu_sun)
{
	vec3 received = vec3(sky_irradiance_ground);
	vec3 direct = sun_irradiance(0.0, mu_sun) * max(mu_sun, 0.0);
	if (cloud_layer.w > 0.5) {
		received = vec3(textureLod(ground_received, place / cloud_layer.z, 0.0));
		// The beam passed the layer where the parallax says; its shadow is as soft as the sun is wide.
		vec2 through = place + vec2(sun_direction) * cloud_layer.x / max(sun_direction.z, 0.02);
		float penumbra = 2.0 * sun_direction.w * cloud_layer.x;
		direct *= slab_directional_transmittance(field_thickness(through, max(footprint, penumbra)));
	}
	return ground_reflectance(place, footprint) * (received + direct) / PI;
}

// The layer seen from below, the sun above it: a flat base.
void view_layer_transmitted(vec3 direction, float thickness, float mu_l, float mu_v, vec3 sun, INOUT(view_parts) parts)
{
	float angle = scattering_angle(-vec3(sun_direction), -direction);
	vec3 tau = vec3(extinction_modified) * thickness;
	float depth = extinction.y * thickness * 0.5 * (1.0 / mu_l + 1.0 / mu_v);
	float p_f = extinction_modified.w;
	vec3 shape = slab_single_transmitted(tau, mu_l, mu_v) / (4.0 * PI);
	// One event and no forward ones beside it: order 0 inside the forward peak, order 1 outside.
	vec3 sharp = phase_full(angle) / (1.0 - p_f) * exp(-p_f * depth) * shape;
	bool inside = angle < FORWARD_PEAK_ANGLE;
	parts.order0 = sun * ((inside ? sharp : vec3(0.0)) + forward_peak(angle, depth));
	parts.order1 = sun * ((inside ? vec3(0.0) : sharp) + forward_blur(angle, depth) * shape);
	parts.order2 = sun * phase_twice(angle) * shape * slab_double_transmitted_scale(thickness);
	parts.multiple = sun * mu_l / PI * slab_multiple_transmitted(thickness);
}

// The side that the sun shines on. normal cosines for orders 1 and 2, the vertical for the rest.
void view_layer_reflected(vec3 direction, float thickness, float normal_z, float mu_l, float mu_l_facet, float mu_v_facet, vec3 sun, INOUT(view_parts) parts)
{
	float angle = scattering_angle(-vec3(sun_direction), -direction);
	// A facet turned away from light or view is faded out instead of cut.
	float facing = smoothstep(-0.05, 0.15, mu_l_facet) * smoothstep(-0.05, 0.10, mu_v_facet);
	float m_l = max(mu_l_facet, 0.03);
	float m_v = max(mu_v_facet, 0.03);
	vec3 shape = facing * slab_single_reflected(vec3(extinction_modified) * thickness * normal_z, m_l, m_v) / (4.0 * PI);
	parts.order0 = vec3(0.0);
	parts.order1 = sun * phase_full(max(angle, FORWARD_PEAK_ANGLE)) / (1.0 - extinction_modified.w) * shape;
	parts.order2 = sun * phase_twice(angle) * shape * slab_double_reflected_scale(thickness);
	parts.multiple = sun * mu_l / PI * slab_multiple_reflected(thickness);
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

// Upwards from below the layer.
view_parts view_from_below(vec3 direction, view_air air)
{
	view_parts parts = view_nothing();
	float base = cloud_layer.x;
	float t = sphere_distance_up(camera_position.z, direction.z, base);
	vec2 place = vec2(camera_position) + vec2(direction) * t;
	float mu_v = max(sphere_cosine(camera_position.z, direction.z, t, base), 0.01);
	float mu_sun = view_sun_cosine(direction, t, base);
	float footprint = camera_position.w * t * inversesqrt(mu_v);
	float thickness = field_thickness(place, footprint);

	float mu_l = max(abs(mu_sun), 0.02);
	vec3 sun = sun_irradiance(base + (mu_sun > 0.0 ? cloud_layer.y : 0.0), mu_sun);
	if (thickness > 0.01) {
		if (mu_sun > 0.0)
			view_layer_transmitted(direction, thickness, mu_l, mu_v, sun, parts);
		else
			view_layer_reflected(direction, thickness, 1.0, mu_l, mu_l, mu_v, sun, parts);
	}
	parts.transmittance = exp(-vec3(extinction_modified) * thickness / mu_v);
	float plane = slab_plane_transmittance(thickness, mu_v);
	parts.cloud_sky = vec3(sky_irradiance_cloud) / PI * max(vec3(plane) - parts.transmittance, vec3(0.0));
	parts.cloud_ground = vec3(textureLod(cloud_received, place / cloud_layer.z, 0.0)) / PI * (1.0 - plane);
	view_attenuate(air.to_layer, parts);

	float sun_angle = scattering_angle(vec3(sun_direction), direction);
	parts.sun_direct = view_sun_disc(sun_angle) * exp(-vec3(extinction) * thickness / mu_v);
	parts.sky = max(air.total - air.near, vec3(0.0)) * parts.transmittance;
	parts.air = air.near * vec3(air_below);
	parts.optical_thickness = extinction.y * thickness;
	parts.distance = thickness > 0.01 ? t : 0.0;
	return parts;
}

// The cloud top met at distance t by a ray from above.
void view_cloud_top(vec3 direction, float t, view_air air, INOUT(view_parts) parts)
{
	float height = max(sphere_height(camera_position.z, direction.z, t), cloud_layer.x);
	vec2 place = vec2(camera_position) + vec2(direction) * t;
	float footprint = camera_position.w * t;
	float mu_sun = view_sun_cosine(direction, t, height);
	float mu_v = max(-sphere_cosine(camera_position.z, direction.z, t, height), 0.01);
	vec3 normal = height_normal(place, footprint);
	float thickness = field_thickness(place, footprint);
	float mu_l = max(mu_sun, 0.02);
	vec3 sun = sun_irradiance(height, mu_sun) * smoothstep(-0.02, 0.02, mu_sun);
	// The vertical turns with the distance: facets are taken against the local one.
	float mu_l_facet = dot(normal, vec3(sun_direction)) + (mu_sun - sun_direction.z) * normal.z;
	float mu_v_facet = -dot(normal, direction) + (mu_v + direction.z) * normal.z;
	view_layer_reflected(direction, thickness, normal.z, mu_l, mu_l_facet, mu_v_facet, sun, parts);
	parts.transmittance = exp(-vec3(extinction_modified) * thickness * normal.z / max(mu_v_facet, 0.03));
	float plane = slab_plane_transmittance(thickness, mu_v);
	parts.cloud_sky = vec3(sky_irradiance_cloud) / PI * (1.0 - plane);
	parts.cloud_ground = vec3(textureLod(cloud_received, place / cloud_layer.z, 0.0)) / PI * max(vec3(plane) - parts.transmittance, vec3(0.0));
	view_attenuate(air.to_layer, parts);
	parts.optical_thickness = extinction.y * thickness;
	parts.distance = t;
}

void view_add_ground(vec3 direction, view_air air, bool below_layer, INOUT(view_parts) parts)
{
	float t = max(sphere_distance_down(camera_position.z, min(direction.z, sphere_horizon(camera_position.z) - 1e-7), 0.0), 0.0);
	vec2 place = vec2(camera_position) + vec2(direction) * t;
	float mu_v = max(-sphere_cosine(camera_position.z, direction.z, t, 0.0), 0.002);
	float footprint = camera_position.w * t * inversesqrt(mu_v);
	float mu_sun = view_sun_cosine(direction, t, 0.0);
	parts.ground = view_ground(place, footprint, mu_sun) * air.to_end * parts.transmittance;
	if (cloud_layer.w < 0.5)
		parts.air = air.total;
	else if (below_layer)
		parts.air = air.total * vec3(air_below);
	else
		parts.air = air.near + max(air.total - air.near, vec3(0.0)) * vec3(air_below) * parts.transmittance;
	if (parts.distance == 0.0)
		parts.distance = t;
}

view_parts view_ray(vec3 direction)
{
	view_air air = view_air_along(direction);
	bool to_ground = asin(clamp(direction.z, -1.0, 1.0)) <= sky_table_horizon();
	bool clouds = cloud_layer.w > 0.5;
	bool below_layer = camera_position.z < cloud_layer.x;
	if (clouds && below_layer && !to_ground)
		return view_from_below(direction, air);

	view_parts parts = view_nothing();
	if (clouds && !below_layer) {
		float top = cloud_layer.x + cloud_layer.y;
		float from = camera_position.z <= top ? 0.0 : sphere_distance_down(camera_position.z, direction.z, top);
		float to = sphere_distance_down(camera_position.z, direction.z, cloud_layer.x);
		if (from >= 0.0) {
			// A ray that only grazes the layer leaves it again as far behind its lowest point as it entered before it.
			if (to < 0.0)
				to = -2.0 * (EARTH_RADIUS + camera_position.z) * direction.z - from;
			float t = height_intersect(direction, from, to, camera_position.w);
			if (t >= 0.0)
				view_cloud_top(direction, t, air, parts);
		}
	}
	if (to_ground) {
		view_add_ground(direction, air, below_layer, parts);
	} else {
		parts.sun_direct = view_sun_disc(scattering_angle(vec3(sun_direction), direction)) * parts.transmittance;
		if (parts.distance > 0.0)
			parts.air = air.near;
		parts.sky = parts.distance > 0.0 ? max(air.total - air.near, vec3(0.0)) * parts.transmittance : air.total;
	}
	return parts;
}

vec3 view_sum(view_parts p)
{
	return p.sun_direct + p.order0 + p.order1 + p.order2 + p.multiple + p.cloud_sky + p.cloud_ground + p.sky + p.ground + p.air;
}
