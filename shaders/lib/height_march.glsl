// A ray from above through the height field, which is filled with droplets: what it meets of them and where.
//
// Empty space is passed by a pyramid of maxima (Tevs, Ihrke and Seidel 2008, "Maximum Mipmaps for Fast, Accurate, and Scalable Dynamic Height
// Field Rendering"), for all rays of a block of pixels together as far as that goes. Droplets are counted on from there, so that edges are as
// translucent as their chords are short; what is finer than a pixel covers a part of it.
#ifndef SHADERS_LIB_HEIGHT_MARCH
#define SHADERS_LIB_HEIGHT_MARCH
#include "shaders/lib/height_detail.glsl"

// At most: hops through empty space up to a cloud, steps through that, and clouds one behind the other.
const int HEIGHT_HOPS = 64;
const int HEIGHT_STEPS = 48;
const int HEIGHT_APPROACHES = 12;
// What is left of the light behind is no longer looked at.
const float HEIGHT_OPAQUE = 0.04;
// Share of a pixel that is not worth a place of its own.
const float HEIGHT_HARDLY = 0.02;
// Pixels a side of the blocks that begin together at last.
const int HEIGHT_BLOCK = 2;
// Over longer hops than half of such a cell the Earth's curve would count.
const float HEIGHT_LEVEL_MAX = 8.0;

// Where a ray from the camera lies between the highest top and the base, m; x > y where it does not.
vec2 height_range(vec3 direction)
{
	float top = cloud_layer.x + cloud_layer.y;
	float from = camera_position.z <= top ? 0.0 : sphere_distance_down(camera_position.z, direction.z, top);
	float to = sphere_distance_down(camera_position.z, direction.z, cloud_layer.x);
	// A ray that only grazes the layer leaves it again as far behind its lowest point as it entered before it.
	if (to < 0.0)
		to = -2.0 * (EARTH_RADIUS + camera_position.z) * direction.z - from;
	return from < 0.0 ? vec2(1.0, 0.0) : vec2(from, to);
}

// Height above the base after a distance: sphere_height by its series, the third term of which is centimetres at 400 km.
float height_of_ray(float down, float t)
{
	const float INVERSE = 1.0 / EARTH_RADIUS;
	float rise = t * (2.0 * (1.0 + camera_position.z * INVERSE) * down + t * INVERSE);
	return camera_position.z - cloud_layer.x + 0.5 * rise * (1.0 - 0.25 * INVERSE * rise) * (1.0 - camera_position.z * INVERSE);
}

// Mean and maximum of the tops at a place and level.
vec2 height_tap(vec2 uv, float level)
{
	return vec2(textureLod(height_table, uv, level)) * cloud_layer.y;
}

// Where in the tile an offset from the camera is, all in tiles.
vec2 height_warped(vec2 offset)
{
	return offset + field_warp(offset);
}

// Distance up to which no ray of a block, `radius` per distance around this one, meets any cloud; the end of the range or beyond where none
// meets one at all. begun: what is known to be empty.
float height_block_start(vec3 direction, vec2 range, float radius, float begun)
{
	float texel = cloud_layer.z / cloud_puffs.z;
	vec2 origin = (vec2(camera_position) - vec2(cloud_drift.x, cloud_drift.y)) / cloud_layer.z;
	vec2 rate = vec2(direction) / cloud_layer.z; // of the offset from the camera
	float speed = max(length(vec2(direction)), 1e-3);
	// Rays of the block that point further down reach the layer earlier.
	float t = max(range.x * max(1.0 - radius / max(-direction.z, radius), 0.0), begun);
	float level = begun > 0.0 ? 2.0 : 4.0;
	float puffs = HEIGHT_PUFF_TOP * height_puff_scale(cloud_layer.y);
	for (int i = 0; i < HEIGHT_HOPS; i++) {
		if (t >= range.y)
			break;
		float cell = texel * exp2(level);
		// A value between texels holds for half a cell around: a quarter of it sideways for the block, a quarter ahead and back.
		float hop = 0.5 * cell / speed * field_warp_reach(rate * t);
		float around = radius * (t + hop);
		float lowest = min(height_of_ray(direction.z, t), height_of_ray(direction.z, t + hop)) - around;
		bool wide = 0.25 * cell >= around;
		if (wide && lowest > height_tap(origin + height_warped(rate * (t + 0.5 * hop)), level).y + puffs) {
			t += hop;
			level = min(level + 1.0, HEIGHT_LEVEL_MAX);
		} else {
			level += wide ? -1.0 : 1.0;
			if (level < 0.0 || level > HEIGHT_LEVEL_MAX || (wide && 0.125 * cell < around))
				break;
		}
	}
	return t;
}

// What a ray meets: a first cloud and all that stands behind it.
struct height_path {
	float clear;   // share of the light from behind that comes through, 0..1
	vec2 distance; // of either, m, a fraction of a mean free path inside its surface
	vec2 weight;   // how much is seen of either; sum: 1 - clear
};

height_path height_path_clear()
{
	height_path path;
	path.clear = 1.0;
	path.distance = vec2(0.0);
	path.weight = vec2(0.0);
	return path;
}

// Share of a step that lies in cloud, from the gaps between ray and top at its ends. `soft`: height over which rays of the pixel differ, and the top in what
// the field does not resolve.
float height_inside(float gap_before, float gap, float soft)
{
	return clamp(0.5 - 0.5 * (gap_before + gap) / max(abs(gap - gap_before) + soft, 1e-3), 0.0, 1.0);
}

// Share of light that a step of some optical thickness scatters: 1 - exp(-depth), within a percent.
float height_scattered(float depth)
{
	return 1.0 - 1.0 / (1.0 + depth * (1.0 + depth * (0.5 + depth * (1.0 / 6.0))));
}

// A ray as it looks for the height field.
struct height_ray {
	vec2 origin; // of the ray, and its heading, in tiles
	vec2 rate;
	float down;     // the ray's vertical part
	float slowness; // over its horizontal one
	float spread;   // what a pixel covers per distance
};

height_ray height_ray_of(vec3 direction, float pixel_angle)
{
	height_ray ray;
	ray.origin = (vec2(camera_position) - vec2(cloud_drift.x, cloud_drift.y)) / cloud_layer.z;
	ray.rate = vec2(direction) / cloud_layer.z;
	ray.down = direction.z;
	ray.slowness = 1.0 / max(length(vec2(direction)), 1e-3);
	// A ray that meets the layer at a slant sees a long strip of it in one pixel.
	ray.spread = pixel_angle * inversesqrt(clamp(-direction.z, 0.02, 1.0));
	return ray;
}

vec2 height_uv(height_ray ray, float t)
{
	return ray.origin + height_warped(ray.rate * t);
}

// Distance from t on, or from end on, at which the surface may be within a texel or a pixel.
float height_approach(height_ray ray, float t, float end)
{
	float texel = cloud_layer.z / cloud_puffs.z;
	float level = 2.0;
	for (int i = 0; i < HEIGHT_HOPS; i++) {
		float cell = texel * exp2(level);
		// A value between texels holds for half a cell around, so it is taken in the middle of the way that it is wanted for.
		float hop = cell * ray.slowness * field_warp_reach(ray.rate * t);
		float lowest = min(height_of_ray(ray.down, t), height_of_ray(ray.down, t + hop));
		float top = height_tap(height_uv(ray, t + 0.5 * hop), level).y;
#if HEIGHT_NEAR
		top += HEIGHT_PUFF_TOP * height_puff_scale(top);
#endif
		bool empty = lowest > top;
		if (t > end || (!empty && cell <= 2.0 * max(ray.spread * t, texel)))
			break;
		t += empty ? hop : 0.0;
		// Larger cells where there is room for them.
		level = clamp(level + (empty ? step(0.3 * cell, lowest - top) : -1.0 - step(cell, top - lowest)), 1.0, HEIGHT_LEVEL_MAX);
	}
	return t;
}

// HEIGHT_NEAR: puffs stand on the tops (1), and smaller ones on them (2).
// range: where to look, m. pixel_angle: angle between pixels.
height_path height_march(vec3 direction, vec2 range, float pixel_angle)
{
	float texel = cloud_layer.z / cloud_puffs.z;
	height_ray ray = height_ray_of(direction, pixel_angle);
	// Steps short enough that a steep ray does not pass the layer in one.
	float longest = cloud_layer.y / max(-direction.z, 0.01) * (1.0 / 16.0);
	// Deep inside, the way between two scatterings needs no more than a few steps.
	float dense = 0.8 / extinction_scaled.y;
	height_path path = height_path_clear();
	float t = range.x;
	bool behind = false;
	// Distances are means over the outermost droplets: further in, a ray through a crest would find the side behind.
	float outer = 1.0;
	vec2 outer_weight = vec2(0.0);
	// Of several crests behind the first the one that is seen most has the distance: a strip of a flank that is hidden but for it shall not stand for all.
	vec2 most = vec2(0.0);
	vec3 crest = vec3(0.0); // of this one: sums for the mean distance, how much is seen
	for (int approach = 0; approach < HEIGHT_APPROACHES; approach++) {
		if (path.clear < HEIGHT_OPAQUE)
			break;
		t = height_approach(ray, t, range.y);
		if (t > range.y)
			break;
		float before = -1.0; // where the last sample was; none
		float gap_before = 0.0;
		// A crest hides no more of a pixel than it reaches up into it, however long the way through it is: what is left at least.
		float clear_before = path.clear;
		float highest = 0.0;
		float passed = 1.0; // 1 where a crest lies behind the ray
		for (int i = 0; i < HEIGHT_STEPS; i++) {
			float width = ray.spread * t; // of what a pixel covers
			float finest = max(width, texel);
			float z = height_of_ray(direction.z, t);
			vec2 uv = height_uv(ray, t);
			vec2 tap = height_tap(uv, log2(finest / texel));
			float soft = pixel_angle * t + 0.2 * (tap.y - tap.x) * clamp(width / texel - 1.0, 0.0, 1.0);
			// Where there is no cloud, what the base's height is off by is none either.
			float gap = z - tap.x + (3.0 + soft) * max(1.0 - tap.x, 0.0);
			float room = gap - (tap.y - tap.x) - 8.0 * finest;
#if HEIGHT_NEAR
			finest = max(width, 0.25 * texel);
			float scale = height_puff_scale(tap.x);
			room -= HEIGHT_PUFF_TOP * scale;
			gap -= scale * height_bulge(uv * cloud_layer.z, z, width);
#endif
			float stride = gap > 0.0 ? 0.7 * finest + 0.55 * gap : max(0.7 * finest, dense * min(-0.05 * gap, 1.0)) - 0.8 * gap;
			if (before >= 0.0) {
				float length_m = t - before;
				float inside = height_inside(gap_before, gap, soft);
				if (inside == 0.0) {
					clear_before = path.clear;
					highest = 0.0;
					passed = 1.0;
				} else if (passed > 0.0) {
					passed = 0.0;
					behind = path.weight.x > HEIGHT_HARDLY;
					outer = 1.0;
					crest = vec3(0.0);
				}
				highest = max(highest, inside);
				float seen = min(path.clear * inside * height_scattered(extinction_scaled.y * length_m),
				                 max(path.clear - clear_before * (1.0 - highest), 0.0));
				// However little of the pixel is in the crest, it is seen where it is met.
				float outermost = inside > 0.0 ? outer * height_scattered(4.0 * extinction_scaled.y * length_m) : 0.0;
				// Where in the step: at its end on the way in.
				float middle = gap < gap_before ? t - 0.75 * inside * length_m : before + 0.25 * inside * length_m;
				vec2 to_which = behind ? vec2(0.0, 1.0) : vec2(1.0, 0.0);
				path.weight += seen * to_which;
				path.clear -= seen;
				crest += vec3(outermost * inside * middle, outermost * inside, seen);
				vec2 which = crest.z > dot(most, to_which) ? to_which : vec2(0.0);
				path.distance = mix(path.distance, vec2(crest.x), which);
				outer_weight = mix(outer_weight, vec2(crest.y), which);
				most = mix(most, vec2(crest.z), which);
				outer -= outermost;
			}
			before = t;
			gap_before = gap;
			// Out of steps: on from here, lest a surface that the next one would meet is passed.
			if (i == HEIGHT_STEPS - 1 && room <= 0.0)
				break;
			// High above: back to hops, from no farther than is known to be empty.
			stride = room > 0.0 ? min(stride, finest) : stride;
			// The last sample is at the end itself.
			t = t < range.y ? min(t + min(stride * ray.slowness, longest), range.y) : range.y + 1.0;
			if (t > range.y || path.clear < HEIGHT_OPAQUE || room > 0.0)
				break;
		}
	}
	if (t <= range.y && path.clear > HEIGHT_OPAQUE && height_tap(height_uv(ray, t), 5.0).x > 1.0) {
		// Out of steps, which happens far away along the tops: where there are any, there is always another cloud.
		vec2 to_which = path.weight.x > HEIGHT_HARDLY ? vec2(0.0, 1.0) : vec2(1.0, 0.0);
		path.weight += path.clear * to_which;
		vec2 which = dot(most, to_which) <= HEIGHT_HARDLY ? to_which : vec2(0.0);
		path.distance = mix(path.distance, vec2(t), which);
		outer_weight = mix(outer_weight, vec2(1.0), which);
		path.clear = 0.0;
	}
	path.distance /= max(outer_weight, vec2(1e-12));
	float kept = max(path.clear - HEIGHT_OPAQUE, 0.0) / (1.0 - HEIGHT_OPAQUE);
	path.weight *= (1.0 - kept) / max(path.weight.x + path.weight.y, 1e-6);
	path.clear = kept;
	return path;
}
#endif
