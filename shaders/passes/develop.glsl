// The develop stage: exposure, tone and sRGB encoding of a finished picture. DEVELOP_NEAR: for codes of 8 bits. DEVELOP_ROUND: a fisheye, whose circle ends within
// pixels: they are dark by as much of them as lies outside, and show what lies inside beside them.
#define COLOUR_NEAR DEVELOP_NEAR
#include "shaders/lib/colour.glsl"

uniform sampler2D picture;

#if DEVELOP_ROUND
// Share of a pixel inside the circle.
float develop_inside(float to_middle, float radius)
{
	return clamp(radius - to_middle + 0.5, 0.0, 1.0);
}
#endif

void pass(ivec2 pixel)
{
	vec2 at = vec2(pixel) + 0.5;
#if DEVELOP_ROUND
	float radius = 0.5 * float(textureSize(picture, 0).x);
	vec2 from_middle = at - radius;
	float to_middle = max(length(from_middle), 1e-3);
	// So far in that the pixel found there has its middle inside.
	if (to_middle > radius)
		at -= from_middle * ((to_middle - radius + 0.75) / to_middle);
#endif
	// Sampled, unfiltered: software renderers fetch texels by number at twice the price.
	vec4 texel = textureLod(picture, at / vec2(textureSize(picture, 0)), 0.0);
	vec3 rgb = colour_into_gamut(vec3(texel)) * exp2(develop.y);
	if (develop.z < 0.5)
		rgb = colour_filmic_hue(rgb * COLOUR_FILM_BALANCE);
	rgb = min(rgb, vec3(1.0));
#if DEVELOP_ROUND
	rgb *= develop_inside(to_middle, radius);
#endif
#if DEVELOP_NEAR
	rgb = vec3(colour_srgb_near(rgb.x), colour_srgb_near(rgb.y), colour_srgb_near(rgb.z)) + colour_dither(pixel) / develop.w;
#else
	rgb = vec3(colour_srgb(rgb.x), colour_srgb(rgb.y), colour_srgb(rgb.z));
#endif
	STORE(0, vec4(clamp(rgb, 0.0, 1.0), 1.0));
}
