// A layer of convective cells, on top of the layers before. Mesoscale variation, openness and warp come from four slow sums of noise.
// arguments[0]: points a side; cells a side; seed; side of the layers before, 0 when there are none.
// [1]: lives so far: whole, fraction; warp in cells; where the layer is: 0 everywhere, 1 where cells are open, -1 where they are closed.
// [2]: weights of dome, lane and wall; scatter of the centres. [3]: wave of rolls: turns a tile east and north; weight; phase in turns.
#include "shaders/lib/bicubic.glsl"
#include "shaders/lib/noise.glsl"

uniform sampler2D slow;
uniform sampler2D before;

void pass(ivec2 pixel)
{
	vec2 uv = (vec2(pixel) + 0.5) / arguments[0].x;
	vec4 field = bicubic_sample(slow, uv, float(textureSize(slow, 0).x));
	float open = clamp(field.y, 0.0, 1.0);
	float value = field.x;
	if (arguments[0].w > 0.0)
		value = bicubic_sample(before, uv, arguments[0].w).x;

	int period = int(arguments[0].y);
	vec2 place = uv * arguments[0].y + arguments[1].z * vec2(field.z, field.w);
	vec2 centres = noise_centres(place, period, uint(arguments[0].z), arguments[1].x, arguments[1].y, arguments[2].w);
	// Half the difference of squared distances is about the distance to the border between two cells.
	float border = 0.5 * (centres.y - centres.x);
	float dome = max(1.0 - centres.x * 1.5, -0.5);
	float lane = 1.0 - exp(-border * border * 30.0);
	float wall = exp(-border * border * 40.0);
	float cells = arguments[2].x * dome + arguments[2].y * lane + arguments[2].z * wall;
	float gate = arguments[1].w;
	value += cells * (gate == 0.0 ? 1.0 : gate > 0.0 ? open : 1.0 - open);

	float turns = dot(vec2(arguments[3]), uv) + arguments[3].w + 0.45 * field.z;
	value += arguments[3].z * cos(2.0 * PI * turns);
	STORE(0, vec4(value, 0.0, 0.0, 1.0));
}
