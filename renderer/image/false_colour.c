#include "renderer/image/false_colour.h"

#include <math.h>

/* Linear between `count` colours that stand at equal distances from 0 to 1. */
static void blend(const float (*colours)[3], int count, float x, unsigned char rgb[3])
{
	const float place = fminf(fmaxf(x, 0), 1) * (float)(count - 1);
	const int i = place < (float)(count - 2) ? (int)place : count - 2;
	const float share = place - (float)i;
	for (int c = 0; c < 3; c++)
		rgb[c] = (unsigned char)lrintf(255 * (colours[i][c] + share * (colours[i + 1][c] - colours[i][c])));
}

void false_colour_magma(float x, unsigned char rgb[3])
{
	/* Every sixteenth of its 256 colours, the last one in place of the 257th. */
	static const float magma[17][3] = {
		{0.001462f, 0.000466f, 0.013866f}, {0.039608f, 0.031090f, 0.133515f}, {0.113094f, 0.065492f, 0.276784f},
		{0.211718f, 0.061992f, 0.418647f}, {0.316654f, 0.071690f, 0.485380f}, {0.414709f, 0.110431f, 0.504662f},
		{0.512831f, 0.148179f, 0.507648f}, {0.613617f, 0.181811f, 0.498536f}, {0.716387f, 0.214982f, 0.475290f},
		{0.816914f, 0.255895f, 0.436461f}, {0.904281f, 0.319610f, 0.388137f}, {0.960949f, 0.418323f, 0.359630f},
		{0.986700f, 0.535582f, 0.382210f}, {0.996096f, 0.653659f, 0.446213f}, {0.996898f, 0.769591f, 0.534892f},
		{0.992440f, 0.884330f, 0.640099f}, {0.987053f, 0.991438f, 0.749504f}};
	blend(magma, 17, x, rgb);
}

void false_colour_diverging(float x, unsigned char rgb[3])
{
	/* Table of the paper's map at nine places, codes over 255. */
	static const float cool_warm[9][3] = {{0.2314f, 0.2980f, 0.7529f}, {0.3843f, 0.5098f, 0.9176f}, {0.5529f, 0.6902f, 0.9961f},
					      {0.7216f, 0.8157f, 0.9765f}, {0.8667f, 0.8667f, 0.8667f}, {0.9608f, 0.7686f, 0.6784f},
					      {0.9569f, 0.6039f, 0.4824f}, {0.8706f, 0.3765f, 0.3020f}, {0.7059f, 0.0157f, 0.1490f}};
	blend(cool_warm, 9, 0.5f + 0.5f * x, rgb);
}
