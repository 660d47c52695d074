// A ray from above through the height field, which is filled with droplets: what it meets of them and where.
//
// Empty space is passed by a pyramid of maxima (Tevs, Ihrke and Seidel 2008, "Maximum Mipmaps for Fast, Accurate, and Scalable Dynamic Height
// Field Rendering"), for all rays of a block of pixels together as far as that goes. Droplets are counted on from there, so that edges are as
// translucent as their chords are short; what is finer than a pixel covers a part of it.
#ifndef SHADERS_LIB_HEIGHT_MARCH
#define SHADERS_LIB_HEIGHT_MARCH
#include "shaders/lib/height_detail.glsl"

const int HEIGHT_ITERATIONS = 128;
// What is left of the light behind is no longer looked at.
const float HEIGHT_OPAQUE = 0.02;
// Pixels a side of the blocks that begin together.
const int HEIGHT_BLOCK = 8;
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

// Distance up to which no ray of a block, `radius` per distance around this one, meets any cloud; the end of the range or beyond where none
// meets one at all.
float height_block_start(vec3 direction, vec2 range, float radius)
{
	float texel = cloud_layer.z / HEIGHT_SIZE;
	vec2 origin = (vec2(camera_position) - vec2(cloud_drift.x, cloud_drift.y)) / cloud_layer.z;
	vec2 rate = vec2(direction) / cloud_layer.z;
	float speed = max(length(vec2(direction)), 1e-3);
	// Rays of the block that point further down reach the layer earlier.
	float t = range.x * max(1.0 - radius / max(-direction.z, radius), 0.0);
	float level = 4.0;
	float puffs = HEIGHT_PUFF_TOP * height_puff_scale(cloud_layer.y);
	for (int i = 0; i < HEIGHT_ITERATIONS; i++) {
		if (t >= range.y)
			break;
		float cell = texel * exp2(level);
		// A value between texels holds for half a cell around: a quarter of it sideways for the block, a quarter ahead and back.
		float hop = 0.5 * cell / speed;
		float around = radius * (t + hop);
		float lowest = min(height_of_ray(direction.z, t), height_of_ray(direction.z, t + hop)) - around;
		bool wide = 0.25 * cell >= around;
		if (wide && lowest > height_tap(origin + rate * (t + 0.5 * hop), level).y + puffs) {
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

// HEIGHT_NEAR: puffs stand on the tops (1), and smaller ones on them (2).
// range: where to look, m. pixel_angle: angle between pixels.
height_path height_march(vec3 direction, vec2 range, float pixel_angle)
{
	float texel = cloud_layer.z / HEIGHT_SIZE;
	vec2 origin = (vec2(camera_position) - vec2(cloud_drift.x, cloud_drift.y)) / cloud_layer.z;
	vec2 rate = vec2(direction) / cloud_layer.z;
	float slowness = 1.0 / max(length(vec2(direction)), 1e-3);
	// A ray that meets the layer at a slant sees a long strip of it in one pixel.
	float spread = pixel_angle * inversesqrt(clamp(-direction.z, 0.02, 1.0));
	// Steps short enough that a steep ray does not pass the layer in one.
	float longest = cloud_layer.y / max(-direction.z, 0.01) * (1.0 / 16.0);
	// Inside, the way between two scatterings needs no more than a few steps.
	float dense = 0.3 / extinction_scaled.y;
	height_path path = height_path_clear();
	float t = range.x;
	float level = 1.0;
	float cell = 2.0 * texel;
	float before = -1.0; // where the last sample was; none
	float gap_before = 0.0;
	bool behind = false;
	// Distances are means over the outermost droplets: further in, a ray through a crest would find the side behind.
	float outer = 1.0;
	vec2 outer_weight = vec2(0.0);
	// A crest hides no more of a pixel than it reaches up into it, however long the way through it is: what is left at least.
	float clear_before = 1.0;
	float highest = 0.0;
	for (int i = 0; i < HEIGHT_ITERATIONS; i++) {
		if (t > range.y || path.clear < HEIGHT_OPAQUE)
			break;
		float width = spread * t; // of what a pixel covers
		float coarse = max(width, texel);
		bool fine = cell <= coarse;
		// A value between texels holds for half a cell around, so it is taken in the middle of the way that it is wanted for.
		float hop = cell * slowness;
		float z = height_of_ray(direction.z, t);
		float z_hop = height_of_ray(direction.z, t + hop);
		vec2 tap = height_tap(origin + rate * (fine ? t : t + 0.5 * hop), fine ? log2(coarse / texel) : level);
#if HEIGHT_NEAR
		float top = tap.y + HEIGHT_PUFF_TOP * height_puff_scale(tap.y);
#else
		float top = tap.y;
#endif
		if (!fine && min(z, z_hop) > top) {
			t += hop;
			level = min(level + 1.0, HEIGHT_LEVEL_MAX);
			cell = min(2.0 * cell, exp2(HEIGHT_LEVEL_MAX) * texel);
			before = -1.0;
			if (path.weight.x > 0.0) {
				outer = behind ? outer : 1.0;
				behind = true;
			}
			clear_before = path.clear;
			highest = 0.0;
		} else if (!fine) {
			level -= 1.0;
			cell *= 0.5;
		} else {
			// Where there is no cloud, what the base's height is off by is none either.
			float gap = z - tap.x + 3.0 * max(1.0 - tap.x, 0.0);
			float finest = coarse;
#if HEIGHT_NEAR
			finest = max(width, 0.25 * texel);
			gap -= height_puff_scale(tap.x) * height_puff((origin + rate * t) * cloud_layer.z, z, finest).x;
#endif
			float stride = gap > 0.0 ? 0.7 * finest + 0.4 * gap : max(0.7 * finest, dense) - 0.8 * gap;
			// Half a pixel above a crest some of it still is in the pixel.
			float soft = pixel_angle * t + 0.2 * (tap.y - tap.x) * clamp(width / texel - 1.0, 0.0, 1.0);
			if (before >= 0.0) {
				float length_m = t - before;
				float inside = height_inside(gap_before, gap, soft);
				if (inside == 0.0) {
					clear_before = path.clear;
					highest = 0.0;
					if (!behind && path.weight.x > 0.02) {
						behind = true;
						outer = 1.0;
					}
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
				path.distance += outermost * inside * middle * to_which;
				outer_weight += outermost * inside * to_which;
				outer -= outermost;
			}
			if (gap > tap.y - tap.x + coarse) {
				// Far above: larger cells again.
				level += 1.0;
				cell *= 2.0;
			}
			before = t;
			gap_before = gap;
			// The last sample is at the end itself.
			t = t < range.y ? min(t + min(stride * slowness, longest), range.y) : range.y + 1.0;
		}
	}
	if (t <= range.y && path.clear > HEIGHT_OPAQUE && height_tap(origin + rate * t, 5.0).x > 1.0) {
		// Out of steps, which happens far away along the tops: where there are any, there is always another cloud.
		vec2 to_which = path.weight.x > 0.02 ? vec2(0.0, 1.0) : vec2(1.0, 0.0);
		path.weight += path.clear * to_which;
		path.distance += 1e-3 * t * to_which;
		outer_weight += 1e-3 * to_which;
		path.clear = 0.0;
	}
	path.distance /= max(outer_weight, vec2(1e-12));
	float kept = max(path.clear - HEIGHT_OPAQUE, 0.0) / (1.0 - HEIGHT_OPAQUE);
	path.weight *= (1.0 - kept) / max(path.weight.x + path.weight.y, 1e-6);
	path.clear = kept;
	return path;
}
#endif
