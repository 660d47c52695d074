// The develop stage: exposure, tone and sRGB encoding of a finished picture. DEVELOP_NEAR: for codes of 8 bits.
#include "shaders/lib/colour.glsl"

uniform sampler2D picture;

void pass(ivec2 pixel)
{
	// Sampled, unfiltered: software renderers fetch texels by number at twice the price.
	vec4 texel = textureLod(picture, (vec2(pixel) + 0.5) / vec2(textureSize(picture, 0)), 0.0);
	vec3 rgb = colour_into_gamut(vec3(texel)) * exp2(develop.y);
	if (develop.z < 0.5)
		rgb = colour_filmic_hue(rgb * COLOUR_FILM_BALANCE);
	rgb = min(rgb, vec3(1.0));
#if DEVELOP_NEAR
	rgb = vec3(colour_srgb_near(rgb.x), colour_srgb_near(rgb.y), colour_srgb_near(rgb.z)) + colour_dither(pixel) / develop.w;
#else
	rgb = vec3(colour_srgb(rgb.x), colour_srgb(rgb.y), colour_srgb(rgb.z));
#endif
	STORE(0, vec4(clamp(rgb, 0.0, 1.0), 1.0));
}
