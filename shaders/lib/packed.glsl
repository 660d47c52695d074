// Periodic pictures of one number packed so that they are cheap to read: a texel of the packed texture holds 2 x 2 neighbours, a level 0 and all smaller
// levels lie in one texture of 3/2 of its width. Software renderers fetch four neighbouring floats at a quarter of what four textures reads of one cost.
// shaders/passes/pack.glsl makes them.
#ifndef SHADERS_LIB_PACKED
#define SHADERS_LIB_PACKED

// Where a level begins, for a picture of `side` texels, a power of two: level 0 on the left, then one above the other on the right.
ivec2 packed_origin(int side, int level)
{
	return level == 0 ? ivec2(0, 0) : ivec2(side, side - 2 * (side >> level));
}

// Level of a texel of the packed texture.
int packed_level(int side, ivec2 texel)
{
	int level = 0;
	for (int rest = side; texel.x >= side && rest > max(side - texel.y - 1, 1); rest >>= 1)
		level++;
	return level;
}

// Texels a side of a level of so whole a number. By its bits, since software renderers shift lane by lane.
float packed_size(int side, float level)
{
	return float(side) * intBitsToFloat((127 - int(level)) << 23);
}

// A texel of the level of that size, at a place (its centre) in tiles from 0 to 1. Sampled without filter: software renderers fetch texels by number at twice the price.
vec4 packed_texel(sampler2D from, vec2 place, int side, float size)
{
	float whole = float(side);
	vec2 origin = size < whole ? vec2(whole, whole - 2.0 * size) : vec2(0.0);
	return textureLod(from, (place * size + origin) * (vec2(2.0 / 3.0, 1.0) / whole), 0.0);
}

// A level that is looked up at many places: x texels a side; y, z where it begins, w 1/side of the whole.
vec4 packed_chosen(int side, float level)
{
	float size = packed_size(side, level);
	float whole = float(side);
	return vec4(size, size < whole ? vec2(whole, whole - 2.0 * size) : vec2(0.0), 1.0 / whole);
}

// Bilinear, of such a level. p: place in its texels.
float packed_linear_of(sampler2D from, vec2 p, vec4 chosen)
{
	vec2 at = p - 0.5;
	vec2 base = floor(at);
	vec2 f = at - base;
	vec2 place = fract((base + 0.5) / chosen.x) * chosen.x + vec2(chosen.y, chosen.z);
	vec4 texel = textureLod(from, place * vec2(2.0 / 3.0, 1.0) * chosen.w, 0.0);
	return mix(mix(texel.x, texel.y, f.x), mix(texel.z, texel.w, f.x), f.y);
}

// The same, of one place. uv: in tiles.
float packed_linear(sampler2D from, vec2 uv, int side, float level)
{
	vec4 chosen = packed_chosen(side, level);
	return packed_linear_of(from, uv * chosen.x, chosen);
}

// Cubic B-spline, of level 0.
float packed_spline(sampler2D from, vec2 uv, int side)
{
	float size = float(side);
	vec2 p = uv * size - 0.5;
	vec2 base = floor(p);
	vec2 f = p - base;
	vec2 f2 = f * f;
	vec2 f3 = f2 * f;
	vec2 w3 = f3 * (1.0 / 6.0);
	vec2 w1 = (2.0 / 3.0) - f2 + 0.5 * f3;
	vec2 w2 = (1.0 / 6.0) + 0.5 * (f + f2 - f3);
	vec2 w0 = 1.0 - w1 - w2 - w3;
	vec2 low = fract((base - 0.5) / size);
	vec2 high = fract((base + 1.5) / size);
	vec4 a = packed_texel(from, low, side, size);
	vec4 b = packed_texel(from, vec2(high.x, low.y), side, size);
	vec4 c = packed_texel(from, vec2(low.x, high.y), side, size);
	vec4 d = packed_texel(from, high, side, size);
	return w0.y * (w0.x * a.x + w1.x * a.y + w2.x * b.x + w3.x * b.y) + w1.y * (w0.x * a.z + w1.x * a.w + w2.x * b.z + w3.x * b.w) +
	       w2.y * (w0.x * c.x + w1.x * c.y + w2.x * d.x + w3.x * d.y) + w3.y * (w0.x * c.z + w1.x * c.w + w2.x * d.z + w3.x * d.w);
}

// Between levels as a footprint of 2^lod texels says, each interpolated by itself.
float packed_linear_between(sampler2D from, vec2 uv, int side, float lod)
{
	float last = log2(float(side));
	float bounded = clamp(lod, 0.0, last);
	float low = floor(bounded);
	return mix(packed_linear(from, uv, side, low), packed_linear(from, uv, side, min(low + 1.0, last)), bounded - low);
}
#endif
