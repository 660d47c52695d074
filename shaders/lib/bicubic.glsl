// Cubic B-spline interpolation of a texture out of four bilinear samples (Sigg and Hadwiger, GPU Gems 2, chapter 20).
#ifndef SHADERS_LIB_BICUBIC
#define SHADERS_LIB_BICUBIC

// Where to sample and how to mix: texture(near.x, near.y) and its three neighbours towards `far`; share is the weight of near in either direction.
struct bicubic_samples {
	vec2 near;
	vec2 far;
	vec2 share;
};

// uv: place in textures; size: texels a side of the level that is read.
bicubic_samples bicubic_at(vec2 uv, float size)
{
	vec2 p = uv * size - 0.5;
	vec2 base = floor(p);
	vec2 f = p - base;
	vec2 f2 = f * f;
	vec2 f3 = f2 * f;
	vec2 w0 = (1.0 - 3.0 * f + 3.0 * f2 - f3) * (1.0 / 6.0);
	vec2 w1 = (4.0 - 6.0 * f2 + 3.0 * f3) * (1.0 / 6.0);
	vec2 w3 = f3 * (1.0 / 6.0);
	bicubic_samples s;
	s.share = w0 + w1;
	s.near = (base + w1 / s.share - 0.5) / size;
	s.far = (base + 1.5 + w3 / (1.0 - s.share)) / size;
	return s;
}

// Level 0 of a texture of `size` texels a side.
vec4 bicubic_sample(sampler2D source, vec2 uv, float size)
{
	bicubic_samples s = bicubic_at(uv, size);
	vec4 a = mix(textureLod(source, vec2(s.far.x, s.near.y), 0.0), textureLod(source, s.near, 0.0), s.share.x);
	vec4 b = mix(textureLod(source, s.far, 0.0), textureLod(source, vec2(s.near.x, s.far.y), 0.0), s.share.x);
	return mix(b, a, s.share.y);
}
#endif
