/* What GLSL has and C++ lacks, so that the files of shaders/lib compile for the processor: vectors by glm, samplers that read copies of
 * textures, and the members of the scene block as globals. Everything lies in namespace glsl; each use of the library includes its
 * files in a namespace of its own inside it, after undefining their guards (glsl_again.h).
 *
 * Arguments that GLSL leaves undefined are asserted against: roots and logarithms of negative numbers, fetches outside a level,
 * coordinates that are not finite.
 */
#ifndef STRATUS_TESTS_GLSL_SHIM_H
#define STRATUS_TESTS_GLSL_SHIM_H

#undef NDEBUG
#include <cassert>
#include <cmath>
#include <cstring>
#include <memory>
#include <vector>

#include <glm/glm.hpp>

#include "renderer/scene_block.h"
#include "tests/unit/glsl_block.h"

#define INOUT(type) type &

namespace glsl
{
using namespace glm;

inline float sqrt(float x)
{
	assert(x >= 0);
	return std::sqrt(x);
}

inline float inversesqrt(float x)
{
	assert(x > 0);
	return 1 / std::sqrt(x);
}

inline float log(float x)
{
	assert(x > 0);
	return std::log(x);
}

inline float log2(float x)
{
	assert(x > 0);
	return std::log2(x);
}

inline float pow(float x, float y)
{
	assert(x > 0 || (x == 0 && y > 0));
	return std::pow(x, y);
}

inline float acos(float x)
{
	assert(x >= -1 && x <= 1);
	return std::acos(x);
}

inline float asin(float x)
{
	assert(x >= -1 && x <= 1);
	return std::asin(x);
}

/* glm has no smoothstep of floats that asserts its edges in order. */
inline float smoothstep(float low, float high, float x)
{
	assert(low < high);
	const float t = glm::clamp((x - low) / (high - low), 0.0f, 1.0f);
	return t * t * (3.0f - 2.0f * t);
}

/* A texture's levels and how it is sampled. */
struct image {
	struct level {
		int width, height;
		std::vector<vec4> texels;
	};
	std::vector<level> levels;
	bool repeat_x = false, repeat_y = false, nearest = false;
};

using sampler2D = std::shared_ptr<const image>;

inline int wrap_texel(int i, int size, bool repeat)
{
	return repeat ? ((i % size) + size) % size : glm::clamp(i, 0, size - 1);
}

inline vec4 sample_level(const image &image, int level, vec2 uv)
{
	const image::level &at = image.levels[(size_t)level];
	const vec2 p = uv * vec2(at.width, at.height) - (image.nearest ? 0.0f : 0.5f);
	const vec2 base = glm::floor(p), f = image.nearest ? vec2(0.0f) : p - base;
	const int x[2] = {wrap_texel((int)base.x, at.width, image.repeat_x), wrap_texel((int)base.x + 1, at.width, image.repeat_x)};
	const int y[2] = {wrap_texel((int)base.y, at.height, image.repeat_y), wrap_texel((int)base.y + 1, at.height, image.repeat_y)};
	vec4 texel[2][2];
	for (int i = 0; i < 2; i++)
		for (int k = 0; k < 2; k++)
			texel[i][k] = at.texels[(size_t)y[i] * (size_t)at.width + (size_t)x[k]];
	return glm::mix(glm::mix(texel[0][0], texel[0][1], f.x), glm::mix(texel[1][0], texel[1][1], f.x), f.y);
}

inline vec4 textureLod(const sampler2D &sampler, vec2 uv, float lod)
{
	assert(sampler && std::isfinite(uv.x) && std::isfinite(uv.y) && std::isfinite(lod));
	const int last = (int)sampler->levels.size() - 1;
	const float bounded = glm::clamp(lod, 0.0f, (float)last);
	if (sampler->nearest)
		return sample_level(*sampler, (int)std::floor(bounded + 0.5f), uv);
	const int level = (int)bounded;
	const vec4 fine = sample_level(*sampler, level, uv);
	return level == last ? fine : glm::mix(fine, sample_level(*sampler, level + 1, uv), bounded - (float)level);
}

inline vec4 texelFetch(const sampler2D &sampler, ivec2 at, int level)
{
	assert(sampler && level >= 0 && (size_t)level < sampler->levels.size());
	const image::level &from = sampler->levels[(size_t)level];
	assert(at.x >= 0 && at.x < from.width && at.y >= 0 && at.y < from.height);
	return from.texels[(size_t)at.y * (size_t)from.width + (size_t)at.x];
}

/* In three dimensions, filtered linearly; each level half as large as the one before it. */
struct volume {
	int width, height, depth;
	std::vector<vec4> texels;
	bool repeat = false;
	std::vector<volume> coarser;
};

using sampler3D = std::shared_ptr<const volume>;

inline vec4 sample_volume(const volume &volume, vec3 at)
{
	const ivec3 size(volume.width, volume.height, volume.depth);
	const vec3 p = at * vec3(size) - 0.5f, base = glm::floor(p), f = p - base;
	vec4 sum(0.0f);
	for (int corner = 0; corner < 8; corner++) {
		const ivec3 offset(corner & 1, corner >> 1 & 1, corner >> 2), texel = ivec3(base) + offset;
		const vec3 weight = glm::mix(1.0f - f, f, vec3(offset));
		const int x = wrap_texel(texel.x, size.x, volume.repeat), y = wrap_texel(texel.y, size.y, volume.repeat),
			  z = wrap_texel(texel.z, size.z, volume.repeat);
		sum += weight.x * weight.y * weight.z *
		       volume.texels[((size_t)z * (size_t)size.y + (size_t)y) * (size_t)size.x + (size_t)x];
	}
	return sum;
}

inline vec4 textureLod(const sampler3D &sampler, vec3 at, float lod)
{
	assert(sampler && std::isfinite(at.x) && std::isfinite(at.y) && std::isfinite(at.z) && std::isfinite(lod));
	const int last = (int)sampler->coarser.size();
	const float bounded = glm::clamp(lod, 0.0f, (float)last);
	const int level = (int)bounded;
	const volume &fine = level ? sampler->coarser[(size_t)level - 1] : *sampler;
	const vec4 found = sample_volume(fine, at);
	return level == last ? found : glm::mix(found, sample_volume(sampler->coarser[(size_t)level], at), bounded - (float)level);
}

/* Samplers of the library. */
static sampler2D field_coarse, field_detail, ground_map, sea_sky, height_table, height_light, height_near_light, height_start, smooth_table;
static sampler2D side_light, thickness_packed;
static sampler2D height_below, shadow_below, shadow_table, received_table;
static sampler2D height_puff_layers, probes, phase_table, event_table, slab_table;
static sampler3D slab_slices, height_puffs;
static sampler2D transmittance_table, sky_total, sky_near, air_to_layer, air_to_end;
static sampler2D ground_received, cloud_received, ground_irradiance, seen_place, seen_light;
static sampler2D path_tops, path_bounds, phase_inverse, forward_chains, sky_at_layer, sky_at_ground;
static sampler2D diffuse_0, diffuse_1, diffuse_2, diffuse_3, diffuse_4, diffuse_5, diffuse_6, diffuse_7;

/* The sun's disc, of the box in the block's member sun_disc_box. */
static std::vector<float> sun_disc_weights;

/* Arguments of the pass, and what it stores. */
static vec4 arguments[4], stored[8];
#define STORE(index, value) stored[index] = (value)

#define GLSL_MEMBER(name) static vec4 name;
GLSL_BLOCK(GLSL_MEMBER)
#undef GLSL_MEMBER

#define GLSL_COUNT(name) +1
/* And an array of them. */
static vec4 sea_waves[SEA_WAVES];

static_assert(sizeof(scene_block) == 16 * (SEA_WAVES GLSL_BLOCK(GLSL_COUNT)), "the scene block has other members than GLSL_BLOCK");
#undef GLSL_COUNT

/* Copies the block to the globals, as an upload of the uniform buffer does. */
inline void set_scene_block(const scene_block &block)
{
#define GLSL_COPY(name) std::memcpy(&name, block.name, sizeof name);
	GLSL_BLOCK(GLSL_COPY)
#undef GLSL_COPY
	std::memcpy(sea_waves, block.sea_waves, sizeof sea_waves);
}
} // namespace glsl

#endif
