#include "renderer/stages/height_puffs.h"

#include <math.h>
#include <stdlib.h>

/* Texels, as in shaders/lib/height_detail.glsl. */
enum { SIDE = 128, DEPTH = 30, LAYERS = 3 };
/* Of the other picture: rows of a group of planes, the first and the last of which lie beyond the edges; and groups. */
enum { GROUP_PLANES = 3, GROUP_ROWS = SIDE + 2, GROUPS = DEPTH / GROUP_PLANES };

/* Cells of each layer across the volume and down. No one's number is a multiple of another's, so that their lattices never lie alike. */
static const int periods[LAYERS][2] = {{10, 3}, {21, 5}, {43, 11}};

/* Amplitude goes as size to a power. Outlines of clouds have the dimension 4/3 (Lovejoy 1982, Science 216, 185), which a surface has whose
 * height varies over distance to the power of 2/3; tops, which are seen down to less than a mean free path, are smoother there. */
static const double roughness = 0.8;
/* A cell's top falls off so with the square of the distance to its middle, in cells. */
static const double fall = 1.5;

/* Steepest rise that is stored, full ranges a texel. As in shaders/lib/height_detail.glsl. */
static const float steepest = 0.25f;

/* Size of the largest puffs and how far all of them together bulge from crease to top, m; speed at which they well up, m/s; most that they
 * bulge, over the thickness: on a thin even sheet nothing stirs. */
static const struct {
	double length, height, speed, share;
} kinds[CLOUD_TYPE_COUNT] = {
	[CLOUD_STRATUS] = {110, 8, 0.2, 0.015},
	[CLOUD_STRATOCUMULUS] = {100, 75, 0.7, 0.4},
	[CLOUD_ALTOCUMULUS] = {60, 30, 0.4, 0.4},
	[CLOUD_CIRROCUMULUS] = {40, 16, 0.3, 0.4},
};

/* Tile for which the lengths are; on larger ones puffs begin at what the height field's larger texels leave out. */
static const double usual_tile = 20000;
/* Thicker ones tower higher, with larger puffs. */
static const double usual_thickness = 700;

static double share_of(uint32_t x)
{
	x = (x ^ (x >> 16)) * 0x7feb352du;
	x = (x ^ (x >> 15)) * 0x846ca68bu;
	return (double)((x ^ (x >> 16)) >> 8) / (1 << 24);
}

int height_puffs_field_side(const struct scene_clouds *clouds)
{
	return clouds->tile_m > 2 * usual_tile ? 2048 : 1024;
}

/* By how much the largest puffs are larger than usual. */
static double enlargement(const struct scene_clouds *clouds)
{
	return fmax(1, fmax(clouds->tile_m / usual_tile * 1024 / height_puffs_field_side(clouds), clouds->thickness_m / usual_thickness));
}

int height_puffs_octaves(const struct scene_clouds *clouds)
{
	/* Nothing is added to what a map says. */
	return clouds->map.map ? 0 : enlargement(clouds) > 4 ? 2 : 1;
}

void height_puffs_fill_block(struct scene_block *block, const struct scene_clouds *clouds)
{
	const int octaves = height_puffs_octaves(clouds);
	const double larger = enlargement(clouds), length = kinds[clouds->type].length * larger * periods[0][0];
	/* As many times as fit: the volume repeats with the tile of the field. */
	const double tile = length > 0 ? clouds->tile_m / fmax(1, round(clouds->tile_m / length)) : 1, depth = tile * DEPTH / SIDE;
	/* On larger ones smaller ones stand. */
	const double bulge = kinds[clouds->type].height * pow(larger, roughness);
	const double share = octaves > 1 ? 1.5 * kinds[clouds->type].share : kinds[clouds->type].share;
	const double height = octaves > 0 ? fmin(bulge, share * clouds->thickness_m) : 0;
	const double risen = kinds[clouds->type].speed * clouds->time_s / depth;
	block->cloud_puffs[0] = (float)height;
	block->cloud_puffs[1] = (float)tile;
	block->cloud_puffs[2] = (float)height_puffs_field_side(clouds);
	block->cloud_puffs[3] = 0;
	block->cloud_puffs_drift[0] = (float)share_of(3 * clouds->seed);
	block->cloud_puffs_drift[1] = (float)share_of(3 * clouds->seed + 1);
	block->cloud_puffs_drift[2] = (float)(share_of(3 * clouds->seed + 2) - (risen - floor(risen)));
	block->cloud_puffs_drift[3] = 0;
}

/* Squared distances, in cells, to the nearest middle of a cell, at most 1. */
static void measure_cells(int across, int down, uint32_t seed, float *distances)
{
	const int periods_of[3] = {across, across, down}, sizes[3] = {SIDE, SIDE, DEPTH};
	for (int i = 0; i < SIDE * SIDE * DEPTH; i++)
		distances[i] = 1;
	for (int cell = 0; cell < across * across * down; cell++) {
		const int place[3] = {cell % across, cell / across % across, cell / across / across};
		double middle[3];
		int first[3], last[3];
		for (int k = 0; k < 3; k++) {
			middle[k] = place[k] + 0.5 + 0.9 * (share_of(seed + 3 * (uint32_t)cell + (uint32_t)k) - 0.5);
			first[k] = (int)ceil((middle[k] - 1) * sizes[k] / periods_of[k] - 0.5);
			last[k] = (int)floor((middle[k] + 1) * sizes[k] / periods_of[k] - 0.5);
		}
		for (int z = first[2]; z <= last[2]; z++)
			for (int y = first[1]; y <= last[1]; y++) {
				float *row = distances + ((z + DEPTH) % DEPTH * SIDE + (y + SIDE) % SIDE) * SIDE;
				const double dz = (z + 0.5) * down / DEPTH - middle[2], dy = (y + 0.5) * across / SIDE - middle[1];
				for (int x = first[0]; x <= last[0]; x++) {
					const double dx = (x + 0.5) * across / SIDE - middle[0];
					float *to = row + (x + SIDE) % SIDE;
					*to = fminf(*to, (float)(dx * dx + dy * dy + dz * dz));
				}
			}
	}
}

/* Adds up the layers; the mean becomes 0 and the full range about 1. */
static void sum_cells(float *sum, float *distances)
{
	enum { COUNT = SIDE * SIDE * DEPTH };
	double range = 0, mean = 0;
	for (int layer = 0; layer < LAYERS; layer++) {
		const double weight = pow((double)periods[0][0] / periods[layer][0], roughness);
		measure_cells(periods[layer][0], periods[layer][1], 0x51ed27u * (uint32_t)(layer + 1), distances);
		for (int i = 0; i < COUNT; i++)
			sum[i] += (float)(weight * fmax(1 - fall * (double)distances[i], -0.5));
		range += weight;
	}
	for (int i = 0; i < COUNT; i++)
		mean += (double)sum[i] / COUNT;
	for (int i = 0; i < COUNT; i++)
		sum[i] = (float)(((double)sum[i] - mean) / range);
}

static float rise(const float *sum, int ahead, int back)
{
	return fminf(fmaxf(0.5f + 0.5f * (0.5f / steepest) * (sum[ahead] - sum[back]), 0), 1);
}

/* How far it bulges, and how that rises along the three axes, as 0..1. */
static void fill_texels(const float *sum, float *texels)
{
	for (int z = 0; z < DEPTH; z++)
		for (int y = 0; y < SIDE; y++)
			for (int x = 0; x < SIDE; x++) {
				const int plane = SIDE * SIDE, row = z * plane + y * SIDE, column = z * plane + x, at = row + x;
				float *texel = texels + 4 * (size_t)at;
				texel[0] = fminf(fmaxf(0.5f + 0.5f * sum[at], 0), 1);
				texel[1] = rise(sum, row + (x + 1) % SIDE, row + (x + SIDE - 1) % SIDE);
				texel[2] = rise(sum, column + (y + 1) % SIDE * SIDE, column + (y + SIDE - 1) % SIDE * SIDE);
				texel[3] =
					rise(sum, (z + 1) % DEPTH * plane + y * SIDE + x, (z + DEPTH - 1) % DEPTH * plane + y * SIDE + x);
			}
}

/* A group's texels hold its planes and the first one of the next group. */
static void fill_groups(const float *sum, float *texels)
{
	for (int row = 0; row < GROUPS * GROUP_ROWS; row++)
		for (int x = 0; x < SIDE; x++)
			for (int i = 0; i <= GROUP_PLANES; i++) {
				const int z = (row / GROUP_ROWS * GROUP_PLANES + i) % DEPTH, y = (row % GROUP_ROWS + SIDE - 1) % SIDE;
				texels[4 * (row * SIDE + x) + i] = fminf(fmaxf(0.5f + 0.5f * sum[(z * SIDE + y) * SIDE + x], 0), 1);
			}
}

static bool compute(struct height_puffs *puffs)
{
	const size_t count = (size_t)SIDE * SIDE * DEPTH;
	float *sum = calloc(count, sizeof *sum), *distances = calloc(count, sizeof *distances), *texels = calloc(count, 4 * sizeof *texels);
	const bool ok = sum && distances && texels &&
			texture_init_3d(&puffs->volume, SIDE, SIDE, DEPTH, TEXTURE_RGBA8, TEXTURE_REPEAT | TEXTURE_MIPMAPS) &&
			texture_init(&puffs->layers, SIDE, GROUPS * GROUP_ROWS, TEXTURE_RGBA8, TEXTURE_REPEAT_X);
	if (ok) {
		sum_cells(sum, distances);
		fill_texels(sum, texels);
		texture_upload(&puffs->volume, texels);
		texture_build_mipmaps(&puffs->volume);
		fill_groups(sum, texels);
		texture_upload(&puffs->layers, texels);
	}
	free(texels);
	free(distances);
	free(sum);
	return ok;
}

static void puffs_destroy(void *value)
{
	struct height_puffs *puffs = value;
	if (!puffs)
		return;
	texture_finish(&puffs->layers);
	texture_finish(&puffs->volume);
	free(puffs);
}

const struct height_puffs *height_puffs_get(struct stage_context *context)
{
	const struct cache_key key = cache_key_make("height puffs");
	struct height_puffs *puffs = cache_find(context->cache, &key);
	if (puffs)
		return puffs;
	context->reused = false;
	puffs = calloc(1, sizeof *puffs);
	if (!puffs || !compute(puffs)) {
		puffs_destroy(puffs);
		return NULL;
	}
	const size_t bytes = texture_bytes(&puffs->volume) + texture_bytes(&puffs->layers);
	return cache_keep(context->cache, &key, puffs, bytes, puffs_destroy) ? puffs : NULL;
}
