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

// Bilinear, of one level. uv: place in tiles.
float packed_linear(sampler2D from, vec2 uv, int side, int level)
{
	int size = side >> level;
	vec2 p = uv * float(size) - 0.5;
	vec2 base = floor(p);
	vec2 f = p - base;
	vec4 texel = texelFetch(from, (ivec2(base) & (size - 1)) + packed_origin(side, level), 0);
	return mix(mix(texel.x, texel.y, f.x), mix(texel.z, texel.w, f.x), f.y);
}

// Cubic B-spline, of one level.
float packed_spline(sampler2D from, vec2 uv, int side, int level)
{
	int size = side >> level;
	vec2 p = uv * float(size) - 0.5;
	vec2 base = floor(p);
	vec2 f = p - base;
	vec2 f2 = f * f;
	vec2 f3 = f2 * f;
	vec2 w3 = f3 * (1.0 / 6.0);
	vec2 w1 = (2.0 / 3.0) - f2 + 0.5 * f3;
	vec2 w2 = (1.0 / 6.0) + 0.5 * (f + f2 - f3);
	vec2 w0 = 1.0 - w1 - w2 - w3;
	ivec2 origin = packed_origin(side, level);
	ivec2 low = ((ivec2(base) - 1) & (size - 1)) + origin;
	ivec2 high = ((ivec2(base) + 1) & (size - 1)) + origin;
	vec4 a = texelFetch(from, low, 0);
	vec4 b = texelFetch(from, ivec2(high.x, low.y), 0);
	vec4 c = texelFetch(from, ivec2(low.x, high.y), 0);
	vec4 d = texelFetch(from, high, 0);
	return w0.y * (w0.x * a.x + w1.x * a.y + w2.x * b.x + w3.x * b.y) + w1.y * (w0.x * a.z + w1.x * a.w + w2.x * b.z + w3.x * b.w) +
	       w2.y * (w0.x * c.x + w1.x * c.y + w2.x * d.x + w3.x * d.y) + w3.y * (w0.x * c.z + w1.x * c.w + w2.x * d.z + w3.x * d.w);
}

// Levels of a footprint of 2^lod texels, and the share of the second.
vec3 packed_levels(int side, float lod)
{
	float last = log2(float(side));
	float bounded = clamp(lod, 0.0, last);
	float low = floor(bounded);
	return vec3(low, min(low + 1.0, last), bounded - low);
}

// Between levels as the footprint says, each interpolated by itself.
float packed_linear_between(sampler2D from, vec2 uv, int side, float lod)
{
	vec3 levels = packed_levels(side, lod);
	return mix(packed_linear(from, uv, side, int(levels.x)), packed_linear(from, uv, side, int(levels.y)), levels.z);
}

float packed_spline_between(sampler2D from, vec2 uv, int side, float lod)
{
	vec3 levels = packed_levels(side, lod);
	return mix(packed_spline(from, uv, side, int(levels.x)), packed_spline(from, uv, side, int(levels.y)), levels.z);
}
#endif
