// Tops made as round as they are thick (opening by a paraboloid): everywhere the lowest place under a paraboloid that hangs over it, and then the highest that
// paraboloids set upon those reach. Spikes are cut down to what is wide enough, what lies between tops stays. arguments[0].x: points a side; .y: by how much the
// paraboloid falls within a texel, m; .z: 1 for lowest, -1 for highest places; .w: level of the heights to start from.
#include "shaders/lib/scene_block.glsl"

uniform sampler2D heights;

const int REACH = 2;

void pass(ivec2 pixel)
{
	float side = arguments[0].x;
	float sign_of = arguments[0].z;
	float found = 1e9;
	for (int y = -REACH; y <= REACH; y++)
		for (int x = -REACH; x <= REACH; x++) {
			vec2 at = (vec2(pixel) + vec2(float(x), float(y)) + 0.5) / side;
			float height = textureLod(heights, at, arguments[0].w).x;
			found = min(found, sign_of * height + arguments[0].y * float(x * x + y * y));
		}
	STORE(0, vec4(sign_of * found, 0.0, 0.0, 1.0));
}
