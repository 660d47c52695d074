// The layer seen from below by a mesh: what changes slowly over the picture is computed at the corners of a mesh of cells and interpolated between them by the
// rasteriser, so that a pixel computes its thickness and little else. How light depends on the thickness, in a direction, is a polynomial there, through values out of
// the tables of shaders/lib/view_up.glsl.
#ifndef SHADERS_LIB_VIEW_MESH
#define SHADERS_LIB_VIEW_MESH
#include "shaders/lib/view_up.glsl"

const int MESH_MANY = 11; // coefficients of the orders from the second on and of diffuse light, over the depth unit of the smooth thickness
const int MESH_FIRST = 6; // of the first order, over the depth unit up to where nothing is left of it
const float MESH_FIRST_DEPTH = 6.0;

// At a corner.
struct mesh_corner {
	vec4 many[MESH_MANY];   // radiance per share of the view that lies in droplets, and share of diffuse light seen through the layer, over mesh_thinning
	vec3 first[MESH_FIRST]; // radiance per that share and the attenuation of `along.y`
	vec3 sky;               // radiance behind the layer
	vec3 near;              // radiance added before it
	vec3 reflected;         // radiance of the ground's light, where it is reflected alone
	vec3 ray;               // any length: place is the camera's plus xy / z
	vec2 along;             // 1/m of thickness: extinction along the view, 550 nm; attenuation that light scattered once is measured by
	float first_end;        // depth unit where the polynomial of the first order ends, the inverse
	vec2 filtering;         // octaves (field_octaves) and softness of the field (field_softness)
};

// Nodes of a polynomial in Newton's form, at the extremes of Chebyshev's polynomial over 0..1: both ends are among them.
float mesh_node(int i, int count)
{
	return 0.5 - 0.5 * cos(PI * float(i) / float(count - 1));
}

// Light from below thick layers goes like this: what is left over it is smooth.
float mesh_thinning(float depth_unit)
{
	return 1.0 - depth_unit * depth_unit * (cloud_layer.y / (cloud_layer.y + up_thickness_scale()));
}

// Radiance of the first order of scattering per irradiance of 1.
vec3 mesh_first_of(vec2 half_angle, float thickness, float mu_l, float mu_v)
{
	vec3 tau = vec3(extinction_scaled) * thickness;
	return up_first_at(half_angle, solved_mean_depth(tau.y / mu_l, tau.y / mu_v)) * up_single(tau, mu_l, mu_v, exp(-tau / mu_l), exp(-tau / mu_v));
}

void mesh_fit_many(vec2 unit, vec3 sun, vec3 to_layer, INOUT(mesh_corner) corner)
{
	for (int i = 0; i < MESH_MANY; i++) {
		float depth_unit = mesh_node(i, MESH_MANY);
		vec4 light = up_light_at(unit, depth_unit);
		corner.many[i] = vec4(sun * vec3(light) + to_layer * vec3(sky_irradiance_cloud) * (light.w / PI), light.w) / mesh_thinning(depth_unit);
	}
	for (int k = 1; k < MESH_MANY; k++)
		for (int i = MESH_MANY - 1; i >= k; i--)
			corner.many[i] = (corner.many[i] - corner.many[i - 1]) / (mesh_node(i, MESH_MANY) - mesh_node(i - k, MESH_MANY));
}

void mesh_fit_first(up_ray ray, vec3 direction, vec3 sun, INOUT(mesh_corner) corner)
{
	vec2 half_angle = scattering_half_angle(-vec3(sun_direction), -direction);
	float end = up_depth_unit(MESH_FIRST_DEPTH / corner.along.y);
	corner.first_end = 1.0 / end;
	for (int i = 0; i < MESH_FIRST; i++) {
		float thickness = max(up_depth_thickness(end * mesh_node(i, MESH_FIRST)), 0.02);
		float scale = exp(-corner.along.y * thickness) * (1.0 - exp(-corner.along.x * thickness));
		corner.first[i] = sun * mesh_first_of(half_angle, thickness, ray.mu_l, ray.mu_v) / scale;
	}
	for (int k = 1; k < MESH_FIRST; k++)
		for (int i = MESH_FIRST - 1; i >= k; i--)
			corner.first[i] = (corner.first[i] - corner.first[i - 1]) / (mesh_node(i, MESH_FIRST) - mesh_node(i - k, MESH_FIRST));
}

// direction: of length 1; length_of: of the ray through the corner that changes linearly over the picture. cell: angle between corners, rad.
mesh_corner mesh_corner_of(vec3 direction, float length_of, float cell)
{
	mesh_corner corner;
	vec2 air = sky_table_coordinates(direction);
	vec2 unit = up_unit(air);
	up_ray ray = up_ray_of(direction);
	vec4 sky = textureLod(up_sky, air, 0.0);
	vec4 near = textureLod(up_air, air, 0.0);
	vec4 sun = textureLod(up_sun, air, 0.0);
	vec3 to_layer = vec3(sky.w, near.w, sun.w);
	corner.sky = vec3(sky);
	corner.near = vec3(near);
	// From the ground comes light that is smooth over the distance between corners, but for far ones.
	float across = cell * ray.distance / ray.mu_v * float(textureSize(cloud_received, 0).x) / cloud_layer.z;
	corner.reflected = to_layer * vec3(textureLod(cloud_received, ray.place / cloud_layer.z, max(log2(across), 0.0))) * (1.0 / PI);
	corner.ray = vec3(vec2(direction), 1.0 / ray.distance) * length_of;
	// Light scattered once is attenuated along light or view, whichever is less: a mean without a kink, and not less than half.
	vec2 mu2 = vec2(ray.mu_v, ray.mu_l) * vec2(ray.mu_v, ray.mu_l);
	corner.along = extinction_scaled.y * vec2(1.0 / ray.mu_v, inversesqrt(sqrt(mu2.x * mu2.x + mu2.y * mu2.y)));
	corner.filtering = vec2(field_octaves(ray.footprint), field_softness(field_octaves(ray.footprint)));
	mesh_fit_many(unit, vec3(sun), to_layer, corner);
	mesh_fit_first(ray, direction, vec3(sun), corner);
	return corner;
}

vec4 mesh_many(mesh_corner corner, float depth_unit)
{
	vec4 sum = corner.many[MESH_MANY - 1];
	for (int i = MESH_MANY - 2; i >= 0; i--)
		sum = sum * (depth_unit - mesh_node(i, MESH_MANY)) + corner.many[i];
	return sum * mesh_thinning(depth_unit);
}

vec3 mesh_first(mesh_corner corner, float depth_unit)
{
	float at = min(depth_unit * corner.first_end, 1.0);
	vec3 sum = corner.first[MESH_FIRST - 1];
	for (int i = MESH_FIRST - 2; i >= 0; i--)
		sum = sum * (at - mesh_node(i, MESH_FIRST)) + corner.first[i];
	return sum;
}

// What arrives along a ray, but for the sun's disc. corner: interpolated between the corners.
vec3 mesh_radiance(mesh_corner corner)
{
	vec2 place = vec2(camera_position) + vec2(corner.ray) / corner.ray.z;
	float octaves = corner.filtering.x;
	float thickness = cloud_layer.w < 0.5 ? 0.0 : field_thickness_soft(field_density_at(place, octaves), corner.filtering.y);
	float spread = slab_light.w * thickness;
	float smooth_thickness = mix(thickness, up_smooth_thickness_at(place, octaves + log2(HEIGHT_SIZE_SMOOTH / cloud_threshold.w)), spread / (1.0 + spread));

	// Extinction differs by some percent between the bands.
	float depth = corner.along.x * thickness;
	float seen = exp(-depth);
	vec3 more = depth * (vec3(extinction_scaled) / extinction_scaled.y - 1.0);
	vec3 along_view = seen * (vec3(1.0) - more * (1.0 - 0.5 * more));

	vec4 many = mesh_many(corner, up_depth_unit(smooth_thickness));
	vec3 first = mesh_first(corner, up_depth_unit(thickness));
	return corner.near + corner.sky * along_view + (vec3(1.0) - along_view) * (vec3(many) + corner.reflected * (1.0 - many.w)) +
	       first * ((1.0 - seen) * exp(-corner.along.y * thickness));
}
#endif
