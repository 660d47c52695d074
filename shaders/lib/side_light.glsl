// The sides of clouds: how the sun lights columns of a layer that are not all as thick, and what a slanted view from below meets of it.
//
// A slab knows no sides. Here the beam comes to a place along its own slant path through what stands around (tilted independent columns: Varnai and Davies 1999, J. Atmos. Sci. 56,
// 4206), flux passes that as it does a layer (Eddington's approximation, delta-scaled by similarity: Meador and Weaver 1980, J. Atmos. Sci. 37, 630), and light that is scattered often is
// evened out sideways (nonlocal independent pixels: Marshak, Davis, Wiscombe and Cahalan 1998, J. Geophys. Res. 103, 19557).
#ifndef SHADERS_LIB_SIDE_LIGHT
#define SHADERS_LIB_SIDE_LIGHT
#include "shaders/lib/field_warp.glsl"
#include "shaders/lib/height_sun.glsl"
#include "shaders/lib/packed.glsl"

#ifndef __cplusplus
uniform sampler2D side_light;
uniform sampler2D thickness_packed;
#endif

// Texels a side of the table: those of the thickness.
const float SIDE_SIZE = HEIGHT_SIZE_SMOOTH;
// Heights at which a slanted view looks for cloud, of that of the layer; in between tops are straight.
const int SIDE_SLICES = 4;
const vec4 SIDE_HEIGHTS = vec4(0.0, 0.12, 0.34, 0.72);
// Octaves by which texels of the tops are smaller than the way through the layer, at the upper slices: about half of what lies between two of them. Larger texels lose the tops.
const float SIDE_SHARP = 2.5;
// Where there is no cloud the top is as far below the base, m.
const float SIDE_NONE = 60.0;
// Of several places that are seen at once, deviation of their heights above which detail of none is told, m.
const float SIDE_CLEAR = 40.0;
// Droplets at the rim of a cloud are fewer than inside, as air that is mixed in dries them: over a way of this share of the layer's thickness.
const float SIDE_RIM = 0.15;
// What is left of the light behind counts so much as something at the base.
const float SIDE_BESIDE = 0.2;
// Within so much of the surface at both ends a slice counts as little filled, m.
const float SIDE_ALONG = 12.0;
// Sides are met elsewhere by what field_rugged says at two thirds of the height of the layer, in proportion above and below.
const float SIDE_RUGGED = 1.5;
// Detail is of the thickness, which hardly varies in the middle of a cloud; on its sides, which are the field's edges elsewhere, it is so much more.
const float SIDE_ROUGHER = 2.5;
// Views along the layer see it as under this slope, m a metre of height; slices would stand beside each other.
const float SIDE_SLOPE_MAX = 4.0;

// Share of the sun's flux that a layer lets through to its base, h m thick at the mean.
float side_transmitted(float h)
{
	float mu = max(sun_direction.z, HEIGHT_SUN_LOWEST);
	float tau = slab_light.w * h;
	return (2.0 / 3.0 + mu + (2.0 / 3.0 - mu) * exp(-tau / mu)) / (4.0 / 3.0 + tau);
}

// Light that is scattered often at a place with `up` m of cloud towards the sun and `down` m behind, both as thickness along the vertical: at the shaded end what comes through, at the
// lit one what is sent back, in between linear, as light diffuses.
float side_source(float up, float down)
{
	float h = up + down;
	float through = side_transmitted(h);
	return mix(through, 1.0 - through, down / max(h, 1.0));
}

// Cloud between two heights where its top is at `top`, m.
float side_filled(float top, float from, float to)
{
	return clamp(top - from, 0.0, to - from);
}

// What a view from below meets, but for detail.
struct side_view {
	float thickness; // m along the vertical that hide as much
	float above;     // m of it that are met above what is thin at the base
	vec2 place;      // m, where what is seen begins: a place of the base, or the foot of one of a side
	float entry;     // m, its height over the base
	float clear;     // 1 where that is the same for all that is seen, down to 0
};

// place: where the view meets the base, m; heading: of the view, any length; mu_v: its cosine to the vertical; rugged: by how much sides are met elsewhere, m (field_rugged).
side_view side_view_at(vec2 place, vec2 heading, float mu_v, vec2 rugged)
{
	vec2 ahead = heading * (min(sqrt(max(1.0 - mu_v * mu_v, 0.0)) / mu_v, SIDE_SLOPE_MAX) * inversesqrt(max(dot(heading, heading), 1e-12)));
	vec2 uv = field_place(place) / cloud_layer.z;
	vec2 stride = ahead * (cloud_layer.y / cloud_layer.z);
	vec4 tops;
	tops[0] = packed_linear(thickness_packed, uv, int(SIDE_SIZE), 0.0);
	// What lies between slices of a slanted view is not looked at; it would leave hooks and bars.
	float level = log2(max(length(stride) * SIDE_SIZE, 1e-3)) - SIDE_SHARP;
	// Elsewhere at each height, and the more so the higher: no flank is a plane that a view may lie in. Straight up none is seen. Shifted by as much at all heights, flanks that lean out
	// over the base would show sides that light paths do not find: clouds 5 to 10 % too bright.
	vec2 shift = rugged * (SIDE_RUGGED * min(length(ahead), 1.0) / cloud_layer.z);
	for (int i = 1; i < SIDE_SLICES; i++) {
		tops[i] = packed_linear_between(thickness_packed, uv + (stride + shift) * SIDE_HEIGHTS[i], int(SIDE_SIZE), level - (i == 1 ? 1.0 : 0.0));
		shift = vec2(-shift.y, shift.x);
	}
	vec4 bottoms = cloud_layer.y * SIDE_HEIGHTS;
	vec4 ends = vec4(bottoms.y, bottoms.z, bottoms.w, cloud_layer.y);
	// How far inside the view is where a slice begins and ends; a top of 0 is none.
	vec4 from = tops - bottoms;
	float none = max(1.0 - 0.1 * tops.x, 0.0);
	from.x -= SIDE_NONE * none;
	vec4 to = vec4(from.y, from.z, from.w, tops.w - ends.w);
	// Along a flank both are next to nothing: of that no edge is made. In an even layer they are as far apart as the slice is high; that stays as it is.
	vec4 both = abs(from) + abs(to);
	vec4 little = max(vec4(1.0) - both / (min(ends - bottoms, vec4(4.0 * SIDE_ALONG)) + 1e-3), vec4(0.0));
	vec4 filled = (ends - bottoms) * (max(from, vec4(0.0)) + max(to, vec4(0.0))) / (both + SIDE_ALONG * little * little + 1e-3);
	vec4 begins = ends - mix(filled, ends - bottoms, step(vec4(0.0), from));
	// Of what is thin at the base both are seen, that and the side behind it.
	float above = filled.y + filled.z + filled.w;
	float rim = min((filled.x + above) / (SIDE_RIM * cloud_layer.y + 1e-3), 1.0);
	rim *= 2.0 - rim;
	float side = filled.x * rim;
	filled.x = max(side, min(tops.x, ends.x));
	begins.x *= none * side / (filled.x + 1e-3);
	vec4 before = vec4(0.0, filled.x, filled.x + filled.y, filled.x + filled.y + filled.z);
	// What a slice lets through: exp(-depth) but for its tail, since weights alone are wanted.
	vec4 depth = filled * (extinction_scaled.y / mu_v);
	vec4 passed = vec4(1.0) / (vec4(1.0) + depth * (vec4(1.0) + 0.5 * depth));
	float left = passed.x * passed.y;
	vec4 seen = (vec4(1.0) - passed) * vec4(1.0, passed.x, left, left * passed.z);
	side_view view;
	view.above = above * rim;
	view.thickness = filled.x + view.above;
	// A rim through which the base shows, thin as that may be, is not all there is.
	float sum = seen.x + seen.y + seen.z + seen.w;
	seen /= (sum + SIDE_BESIDE * (1.0 - sum));
	vec4 entries = max(begins - before, vec4(0.0));
	view.entry = dot(seen, entries);
	view.clear = 1.0 / (1.0 + (dot(seen, entries * entries) - view.entry * view.entry) * (1.0 / (SIDE_CLEAR * SIDE_CLEAR)));
	view.place = place + ahead * view.entry;
	return view;
}

// A place of the layer as it is seen from below and lit.
struct side_lit {
	float thickness; // m along the vertical that hide as much as the view meets
	float inside;    // the same where there is cloud in the pixel
	float sun;       // m along the vertical that hide as much as the beam meets
	float smooth_m;  // thickness evened out, m
	float light;     // light that is scattered often over that of a layer so thick
	float upright;   // share of what is seen that shaders/lib/side_low.glsl found to stand
};

// What a beam that meets `whole` passes with detail that makes h out of `base`, m. Where a beam meets less than stands there, detail counts in proportion: added, it would leave holes.
const float SIDE_LITTLE = 2.0; // m

float side_beam(float h, float base, float whole)
{
	return whole > base ? h + (whole - base) : h * ((whole + SIDE_LITTLE) / (base + SIDE_LITTLE));
}

// thickness, inside: at view.place, with all detail, m.
side_lit side_lit_at(side_view view, float footprint, float thickness, float inside)
{
	vec2 uv = field_place(view.place) / cloud_layer.z;
#ifdef FIELD_NEAR
	float lod = 0.0;
#else
	float lod = max(log2(footprint * SIDE_SIZE / cloud_layer.z), 0.0);
#endif
	vec4 light = textureLod(side_light, uv, lod);
	side_lit lit;
	lit.upright = 0.0;
	float base = packed_linear(thickness_packed, uv, int(SIDE_SIZE), 0.0);
	thickness = mix(base, thickness, view.clear);
	inside = mix(base, inside, view.clear);
	// On sides detail is more or less of what is met there: added, it would end rims with an edge. A slanted way through the layer is all cloud at most.
	float side = clamp(view.entry / (SIDE_HEIGHTS.y * max(cloud_layer.y, 1e-3)), 0.0, 1.0);
	float whole = view.thickness;
	float sided = min(side * 2.0, 1.0);
	vec2 detail = (vec2(thickness, inside) - base) * (1.0 + SIDE_ROUGHER * sided);
	vec2 part = vec2(whole) / (vec2(whole + 1e-3) + abs(detail));
	vec2 met = vec2(whole) + detail * mix(vec2(1.0), part, sided);
	met = min(max(met, vec2(0.4 * view.above)), vec2(cloud_layer.y));
	lit.thickness = met.x;
	lit.inside = met.y;
	lit.sun = side_beam(thickness, base, light.w);
	float spread = slab_light.w * lit.inside;
	lit.smooth_m = mix(lit.inside, light.x, spread / (1.0 + spread));
	lit.light = mix(light.y, light.z, side) / side_transmitted(lit.smooth_m);
	return lit;
}
#endif
