// What each pixel sees of the height field, which lies below the camera. 0: x mean distance, m; y way through cloud, m; z thickness there, m; w the thickness
// evened out. arguments[0].z: row of the picture that is the first here. 1: x, y slopes to the east and to the north; z share of the beam that comes there; w what often scattered light has received.
#define FIELD_WARPED 1
#include "shaders/lib/camera.glsl"
#include "shaders/lib/height_march.glsl"
#include "shaders/lib/height_sun.glsl"
#include "shaders/lib/optics.glsl"

#ifndef __cplusplus
uniform sampler2D height_start;
uniform sampler2D height_near_light;
#endif

// Height over which shadows end, a metre of what a pixel covers.
const float HEIGHT_SHADOW_SOFT = 0.3;

// Least cosine of the view to what is seen; as shaders/lib/view.glsl bounds it.
const float HEIGHT_GRAZING = 0.1;

// Slope of what is seen. What is turned away from the view is not: on a crest, that is the part which is turned just so far that the ray grazes it. Without this, single
// pixels there would show the light of hidden flanks, and towards a low sun, of facets that are visible and lit at once, which hardly any can be.
vec2 height_slope_seen(vec2 slope, vec3 direction, float t)
{
	vec3 normal = normalize(vec3(-slope, 1.0));
	// Against the vertical there, which turns with the distance.
	vec3 view = normalize(vec3(-vec2(direction), max(-direction.z - t / EARTH_RADIUS, 0.0)));
	float mu_v = dot(normal, view);
	vec3 along = (normal - mu_v * view) * inversesqrt(max(1.0 - mu_v * mu_v, 1e-6));
	vec3 seen = along * sqrt(1.0 - HEIGHT_GRAZING * HEIGHT_GRAZING) + HEIGHT_GRAZING * view;
	return mu_v < HEIGHT_GRAZING ? -vec2(seen) / max(seen.z, 0.1) : slope;
}

// Share of the light from the second order on that was scattered a few times only and comes out near where it went in. The second order of a thick layer is P_2 / (4 (mu_l + mu_v)) times
// the flux over pi, which all orders together are about once; from views towards a low sun, where that is much, the third and fourth are added to it, elsewhere none is told apart.
float height_few(vec3 direction)
{
	float mu = max(sun_direction.z, 0.05) + max(-direction.z, 0.05);
	float twice = 0.25 / mu * phase_twice(scattering_half_angle(-vec3(sun_direction), -direction)).y;
	return twice * twice / (1.0 + twice * twice);
}

struct height_surface {
	vec4 place; // as stored in 0, distance first
	vec4 light; // as stored in 1
};

height_surface height_surface_at(vec3 direction, float t, float few)
{
	vec2 place = vec2(camera_position) + vec2(direction) * t;
	// What a pixel covers is longer than wide, which the means of squares stand for.
	float footprint = camera_position.w * t * inversesqrt(clamp(-direction.z, 0.04, 1.0));
	float height = height_at(place, footprint);
	float shadow_edge = HEIGHT_SHADOW_SOFT * footprint;
	vec2 drifting = field_place(place);
	vec2 uv = drifting / cloud_layer.z;
	float lod = max(log2(footprint * HEIGHT_SIZE_LIGHT / cloud_layer.z), 0.0);
	vec4 light = textureLod(height_light, uv, lod);
	vec2 slope = vec2(light);
	float received = mix(light.w, textureLod(height_near_light, uv, lod).x, few);
#if HEIGHT_NEAR
	float scale = height_puff_scale(height);
	vec4 puff = height_puff(drifting, height_of_ray(direction.z, t), max(footprint, HEIGHT_PUFF_FINEST));
	// The surface bulges on flanks, too.
	slope = (slope + scale * vec2(puff.y, puff.z)) / max(1.0 - scale * puff.w, 0.4);
	height += scale * puff.x;
	// Of the light that is scattered often, creases get less.
	received *= 1.0 + 0.3 * puff.x * scale / (scale + 30.0);
#endif
	slope = height_slope_seen(slope, direction, t);
	// Slopes get it as they face the sun.
	float facing = 1.0 - 0.06 * dot(slope - vec2(light), height_sun_heading()) / max(height_sun_rise(), 0.3);
	received *= clamp(facing, 0.6, 1.5);
	height_surface at;
	at.place = vec4(t, 0.0, height, height_smooth(place, footprint));
	at.light = vec4(slope, height_sunlit(height, light.z, shadow_edge), received);
	return at;
}

void pass(ivec2 pixel)
{
	vec3 direction = camera_ray(vec2(pixel) + vec2(0.5, arguments[0].z + 0.5));
	vec2 range = height_range(direction);
	height_path path = height_path_clear();
	range.x = max(range.x, texelFetch(height_start, pixel / HEIGHT_BLOCK, 0).x);
	if (range.y > range.x)
		path = height_march(direction, range, camera_position.w);
	float weight = path.weight.x + path.weight.y;
	if (weight <= 0.0) {
		STORE(0, vec4(0.0));
		STORE(1, vec4(0.0, 0.0, 1.0, 1.0));
		return;
	}
	bool both = path.weight.y > HEIGHT_HARDLY;
	float few = height_few(direction);
	height_surface surface = height_surface_at(direction, path.distance.x, few);
	if (both) {
		height_surface second = height_surface_at(direction, path.distance.y, few);
		surface.place = mix(surface.place, second.place, path.weight.y / weight);
		surface.light = mix(surface.light, second.light, path.weight.y / weight);
	}
	surface.place.y = -log(max(path.clear, 1e-6)) / extinction_scaled.y;
	STORE(0, surface.place);
	STORE(1, surface.light);
}
