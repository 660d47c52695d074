// A layer of the reference model out of the sums over its samples, the number of which lies beside the color's. arguments[0].x: the layer (enum layer).
#include "shaders/lib/colour.glsl"

uniform sampler2D sums;
uniform sampler2D chances;
uniform sampler2D squares;
uniform sampler2D colors;

void pass(ivec2 pixel)
{
	int layer = int(arguments[0].x);
	float count = max(texelFetch(colors, pixel, 0).w, 1.0);
	vec4 sum = texelFetch(sums, pixel, 0);
	vec3 mean = vec3(sum) / count;
	vec3 value = colour_of_bands(mean);
	if (layer == 0) {
		value = mean;
	} else if (layer == 14) {
		// Of the mean, from the scatter of the samples; one alone says nothing, so it is taken for as wrong as it may be.
		mean = vec3(texelFetch(chances, pixel, 0)) / count;
		vec3 variance = max(vec3(texelFetch(squares, pixel, 0)) / count - mean * mean, vec3(0.0));
		value = count > 1.5 ? sqrt(variance / (count - 1.0)) : abs(mean);
	} else if (layer == 11 || layer == 12) {
		value = mean;
	} else if (layer == 13) {
		value = vec3(sum.x / max(sum.y, 1.0)); // of those samples that met anything
	}
	STORE(0, vec4(value, 1.0));
}
