// The thickness as a picture over the tile: evened out, as light that is scattered often sees it; and for views from above as a height field over the flat
// base, met by a ray through a pyramid of maxima (Tevs, Ihrke and Seidel 2008, "Maximum Mipmaps for Fast, Accurate, and Scalable Dynamic Height Field
// Rendering").
#ifndef SHADERS_LIB_HEIGHT
#define SHADERS_LIB_HEIGHT
#include "shaders/lib/sphere.glsl"

#ifndef __cplusplus
uniform sampler2D height_table;
uniform sampler2D height_maximum;
uniform sampler2D smooth_table;
#endif

// Texels a side.
const float HEIGHT_SIZE = 1024.0;
const float HEIGHT_SIZE_SMOOTH = 256.0;
const int HEIGHT_ITERATIONS = 160;

// Height of the top above the base at a place, m, seen at a footprint.
float height_at(vec2 place, float footprint)
{
	float lod = max(0.0, log2(footprint * HEIGHT_SIZE / cloud_layer.z));
	return textureLod(height_table, (place - vec2(cloud_drift.x, cloud_drift.y)) / cloud_layer.z, lod).x;
}

// Thickness evened out over the way that light goes sideways, m.
float height_smooth(vec2 place, float footprint)
{
	float lod = max(0.0, log2(footprint * HEIGHT_SIZE_SMOOTH / cloud_layer.z));
	return textureLod(smooth_table, (place - vec2(cloud_drift.x, cloud_drift.y)) / cloud_layer.z, lod).x;
}

// Distance along the ray to the cloud top, or -1. from..to: where the ray lies between the highest top and the base.
// pixel_angle: angle between pixels, which sets how fine the search becomes.
float height_intersect(vec3 direction, float from, float to, float pixel_angle)
{
	float texel = cloud_layer.z / HEIGHT_SIZE;
	vec2 origin = vec2(camera_position) - vec2(cloud_drift.x, cloud_drift.y);
	vec2 flat_direction = vec2(direction);
	float speed = max(length(flat_direction), 1e-4);
	// A ray that meets the layer at a slant sees a long strip of it in one pixel.
	float spread = pixel_angle * inversesqrt(clamp(-direction.z, 0.02, 1.0));
	// Steps short enough that a steep ray does not pass the layer in one.
	float longest = (to - from) * (1.0 / 24.0);
	float t = from;
	float level = 5.0;
	float previous_gap = 0.0;
	float previous_t = from;
	for (int i = 0; i < HEIGHT_ITERATIONS; i++) {
		if (t >= to) {
			// Out through the top again, or at the base: there the ray came down through cloud if there is any above this point.
			if (sphere_height(camera_position.z, direction.z, to) > cloud_layer.x + 1.0)
				return -1.0;
			float over = textureLod(height_table, (origin + flat_direction * to) / cloud_layer.z, log2(max(spread * to / texel, 1.0))).x;
			return over > 1.0 ? to : -1.0;
		}
		float finest = log2(max(spread * t / texel, 1.0));
		float z = sphere_height(camera_position.z, direction.z, t) - cloud_layer.x;
		vec2 uv = (origin + flat_direction * t) / cloud_layer.z;
		if (level > finest + 0.5) {
			// Is the ray, until it leaves this cell, above all that the cell holds?
			float cell = texel * exp2(level);
			float cells = cloud_layer.z / cell;
			vec2 inside = fract(uv * cells);
			vec2 ahead = mix(inside, 1.0 - inside, step(vec2(0.0), flat_direction));
			vec2 exits = ahead * cell / max(abs(flat_direction), vec2(1e-7));
			float leave = min(min(exits.x, exits.y) + 0.02 * texel / speed, to - t);
			float highest = textureLod(height_maximum, (floor(uv * cells) + 0.5) / cells, level - 1.0).x;
			float z_leave = sphere_height(camera_position.z, direction.z, t + leave) - cloud_layer.x;
			if (min(z, z_leave) > highest) {
				previous_t = t + leave;
				t = previous_t;
				previous_gap = 0.0;
				level = min(level + 1.0, 7.0);
			} else {
				level -= 1.0;
			}
		} else {
			float gap = z - textureLod(height_table, uv, finest).x;
			if (gap <= 0.0) {
				// Between the last point above and this one, by the ratio of the gaps.
				float share = previous_gap > 0.0 ? previous_gap / (previous_gap - gap) : 1.0;
				return mix(previous_t, t, share);
			}
			previous_gap = gap;
			previous_t = t;
			t += min(0.6 * texel * exp2(finest) / speed * (gap > 4.0 * texel ? 2.0 : 1.0), longest);
			// From time to time, try larger cells again.
			if ((i & 3) == 3)
				level = floor(finest) + 2.0;
		}
	}
	// Out of steps, which happens far away and along the tops of a closed deck.
	return t;
}

// Upward normal of the top; differences over what a pixel covers, at least a few mean free paths, since light does not see finer relief.
vec3 height_normal(vec2 place, float footprint)
{
	float e = max(3.5 * cloud_layer.z / HEIGHT_SIZE, footprint);
	float dx = height_at(place + vec2(e, 0.0), e) - height_at(place - vec2(e, 0.0), e);
	float dy = height_at(place + vec2(0.0, e), e) - height_at(place - vec2(0.0, e), e);
	return normalize(vec3(-dx, -dy, 2.0 * e));
}
#endif
