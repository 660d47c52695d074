extern "C" {
#include "tests/twin/twin.h"
}
#include "tests/unit/glsl_block.h"

#include <atomic>
#include <cmath>
#include <cstring>
#include <thread>
#include <vector>

#include <glm/glm.hpp>

#define INOUT(type) type &

namespace glsl
{
using namespace glm;

using sampler2D = const twin_texture *;

static inline int texel_of(int i, int size, bool repeat)
{
	/* Sizes of what repeats are powers of two. */
	return repeat ? i & (size - 1) : i < 0 ? 0 : i >= size ? size - 1 : i;
}

static inline vec4 texel_at(const float *level, int at)
{
	vec4 texel;
	std::memcpy(&texel, level + 4 * (std::size_t)at, sizeof texel);
	return texel;
}

static inline vec4 level_at(sampler2D from, int level, vec2 uv)
{
	const int width = std::max(from->width >> level, 1), height = std::max(from->height >> level, 1);
	const float *texels = from->level[level];
	const float px = uv.x * (float)width - (from->nearest ? 0.0f : 0.5f), py = uv.y * (float)height - (from->nearest ? 0.0f : 0.5f);
	const float bx = std::floor(px), by = std::floor(py), fx = px - bx, fy = py - by;
	const int x0 = texel_of((int)bx, width, from->repeat), y0 = width * texel_of((int)by, height, from->repeat);
	if (from->nearest)
		return texel_at(texels, y0 + x0);
	const int x1 = texel_of((int)bx + 1, width, from->repeat), y1 = width * texel_of((int)by + 1, height, from->repeat);
	return (1 - fy) * ((1 - fx) * texel_at(texels, y0 + x0) + fx * texel_at(texels, y0 + x1)) +
	       fy * ((1 - fx) * texel_at(texels, y1 + x0) + fx * texel_at(texels, y1 + x1));
}

static inline vec4 textureLod(sampler2D from, vec2 uv, float lod)
{
	const float bounded = glm::clamp(lod, 0.0f, (float)(from->levels - 1));
	const int level = (int)bounded;
	const vec4 fine = level_at(from, level, uv);
	return bounded == (float)level ? fine : glm::mix(fine, level_at(from, level + 1, uv), bounded - (float)level);
}

static inline vec4 texelFetch(sampler2D from, ivec2 at, int)
{
	return texel_at(from->level[0], at.y * from->width + at.x);
}

/* One run at a time sets these. */
static sampler2D transmittance_table, sky_total, sky_near, air_to_layer, air_to_end, ground_map, phase_table, path_tops, path_bounds,
	phase_inverse, forward_chains, sky_at_layer, sky_at_ground, event_table;
static vec4 arguments[4];
static thread_local vec4 stored[TWIN_OUTPUTS];
static const float *sun_disc_weights;
#define STORE(index, value) stored[index] = (value)

#define TWIN_MEMBER(name) [[maybe_unused]] static vec4 name;
GLSL_BLOCK(TWIN_MEMBER)
#undef TWIN_MEMBER
#define TWIN_COPY(name) std::memcpy(&name, block.name, sizeof name);
static void set_block(const scene_block &block)
{
	GLSL_BLOCK(TWIN_COPY)
}
#undef TWIN_COPY

#define REFERENCE_LAYERS 1
#define REFERENCE_ABOVE  0
namespace below
{
#include "shaders/passes/reference.glsl"
} // namespace below
#include "tests/unit/glsl_again.h"
#undef REFERENCE_ABOVE
#define REFERENCE_ABOVE 1
namespace above
{
#include "shaders/passes/reference.glsl"
} // namespace above
} // namespace glsl

static void bind(const twin &twin)
{
	using namespace glsl;
	sampler2D *const samplers[TWIN_SAMPLER_COUNT] = {&transmittance_table, &sky_total,    &sky_near,     &air_to_layer, &air_to_end,
							 &ground_map,          &phase_table,  &path_tops,    &path_bounds,  &phase_inverse,
							 &forward_chains,      &sky_at_layer, &sky_at_ground};
	for (int i = 0; i < TWIN_SAMPLER_COUNT; i++)
		*samplers[i] = &twin.texture[i];
	set_block(twin.block);
	sun_disc_weights = twin.disc_weights;
	if (!twin.disc_weights)
		sun_disc_box = vec4(0.0f);
}

extern "C" void twin_run(const struct twin *twin, int width, int height, int first, int count, int threads, float *outputs[TWIN_OUTPUTS])
{
	bind(*twin);
	const int *layer = twin->layer;
	glsl::arguments[0] = glsl::vec4(first, count, twin->seed & 0xffffu, twin->seed >> 16);
	glsl::arguments[1] = glsl::vec4(layer[0], layer[1], layer[2], layer[3]);
	glsl::arguments[2] = glsl::vec4(layer[4], twin->paths, 0, 0);
	std::atomic<int> next{0};
	const auto work = [&] {
		for (int row; (row = next++) < height;)
			for (int column = 0; column < width; column++) {
				const glsl::ivec2 pixel(column, row);
				twin->above ? glsl::above::pass(pixel) : glsl::below::pass(pixel);
				for (int i = 0; i < TWIN_OUTPUTS; i++)
					for (int k = 0; outputs[i] && k < 4; k++)
						outputs[i][4 * ((std::size_t)row * (std::size_t)width + (std::size_t)column) +
							   (std::size_t)k] += glsl::stored[i][k];
			}
	};
	std::vector<std::thread> others;
	for (int i = 1; i < threads; i++)
		others.emplace_back(work);
	work();
	for (std::thread &other : others)
		other.join();
}
