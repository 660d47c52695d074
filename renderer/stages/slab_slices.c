/* Slices of the solved slab: which elevations of the sun a frame needs, and their tables on the GPU. */
#include "renderer/log.h"
#include "renderer/stages/slab_tables.h"

#include <math.h>
#include <stdlib.h>

enum { SLICES_MAX = 8, SLICE_TEXELS = SLAB_SLICE_DEPTH_COUNT * SLAB_SLICE_VIEW_COUNT * SLAB_SLICE_AZIMUTH_COUNT };

/* Radius of the Earth, m, and half-width of the terminator in the cosine, both as in the shaders. */
#define EARTH_RADIUS_M 6371000.0
#define TERMINATOR     0.06

/* Steps of the slices' coordinate that linear interpolation bridges: 3 degrees at the zenith, 2 in the middle, 0.4 at the horizon. */
#define SLICE_STEP 0.04
#define MU_MIN     0.01

/* What the sun lights, and the cosines under which it does. */
struct span {
	bool top, base;
	double first, last; /* coordinates of mu_l */
	int count;
};

/* Cosine under which a side is lit whose normal has cosine mu to the sun: view_lit_cosine in shaders/lib/view.glsl. */
static double lit_cosine(double mu)
{
	const double x = fmax(mu + TERMINATOR, 0);
	return mu > TERMINATOR ? mu : x * x / (4 * TERMINATOR);
}

/* Coordinate of a sun's cosine, dense at zenith and horizon: solved_slice_coordinate in shaders/lib/slab_solved.glsl, and its inverse. */
static double coordinate_of(double mu)
{
	return sqrt(mu) - sqrt(1 - mu);
}

double slab_slices_cosine(double coordinate)
{
	/* mu = sin^2 a with sin a - cos a = coordinate. */
	const double sine = sin(M_PI / 4 + asin(fmin(fmax(coordinate * M_SQRT1_2, -1), 1)));
	return sine * sine;
}

/* Largest angle at the Earth's centre between the camera and a point of the layer that it sees; rounded up, so that a camera that climbs
 * does not change the tables all the time. */
static double reach(const struct scene *scene)
{
	static const double steps[] = {1.5, 3, 6, 12};
	const double top = EARTH_RADIUS_M + scene->clouds.base_m + scene->clouds.thickness_m;
	const double degrees =
		(acos(EARTH_RADIUS_M / (EARTH_RADIUS_M + scene->camera.position_m[2])) + acos(EARTH_RADIUS_M / top)) * 180 / M_PI;
	int i = 0;
	while (i < 3 && steps[i] < degrees)
		i++;
	return steps[i];
}

static struct span span_of(const struct scene *scene)
{
	const double degree = M_PI / 180, e = scene->sun.elevation_deg, r = reach(scene);
	const double low = sin(fmax(e - r, -90) * degree), high = e + r > 90 ? 1 : sin((e + r) * degree);
	struct span span = {.top = high > -TERMINATOR, .base = low < TERMINATOR};
	double smallest = 1, largest = MU_MIN;
	if (span.top) {
		smallest = fmin(smallest, lit_cosine(low));
		largest = fmax(largest, lit_cosine(high));
	}
	if (span.base) {
		smallest = fmin(smallest, lit_cosine(-high));
		largest = fmax(largest, lit_cosine(-low));
	}
	span.first = coordinate_of(fmax(smallest, MU_MIN));
	span.last = fmax(coordinate_of(largest), span.first + 1e-3);
	span.count = (int)fmin(fmax(2, ceil((span.last - span.first) / SLICE_STEP) + 1), SLICES_MAX);
	return span;
}

/* One slice into its planes of the texels. */
static void put_slice(const struct slab_slice *slice, float *texels)
{
	const float *from = &slice->k[0][0][0][0];
	for (int i = 0; i < SLICE_TEXELS; i++, texels += 4, from += BAND_COUNT)
		for (int band = 0; band < BAND_COUNT; band++)
			texels[band] = from[band];
}

static void fill(const struct droplet_tables *tables, const struct span *span, bool from_above, struct slab_slice *slice, float *texels)
{
	double ratio[BAND_COUNT];
	for (int band = 0; band < BAND_COUNT; band++)
		ratio[band] = tables->optics->extinction_per_m[band] / tables->optics->extinction_per_m[1];
	for (int base = 0; base < 2; base++) {
		if (!(base ? span->base : span->top))
			continue;
		const enum slab_side side = (base == 1) == from_above ? SLAB_TRANSMITTED : SLAB_REFLECTED;
		for (int i = 0; i < span->count; i++, texels += (size_t)SLICE_TEXELS * 4) {
			const double at = span->first + (span->last - span->first) * i / (span->count - 1);
			slab_slice_fill(tables->slab, side, slab_slices_cosine(at), ratio, slice);
			put_slice(slice, texels);
		}
	}
}

static void slices_destroy(void *value)
{
	struct texture *texture = value;
	if (texture)
		texture_finish(texture);
	free(texture);
}

static struct texture *slices_create(const struct droplet_tables *tables, const struct span *span, bool from_above)
{
	const int planes = SLAB_SLICE_DEPTH_COUNT * span->count * (span->top + span->base);
	struct texture *texture = calloc(1, sizeof *texture);
	struct slab_slice *slice = malloc(sizeof *slice);
	float *texels = calloc((size_t)planes * SLAB_SLICE_VIEW_COUNT * SLAB_SLICE_AZIMUTH_COUNT, 4 * sizeof *texels);
	bool ok = texture && slice && texels;
	if (ok) {
		fill(tables, span, from_above, slice, texels);
		ok = texture_init_3d(texture, SLAB_SLICE_AZIMUTH_COUNT, SLAB_SLICE_VIEW_COUNT, planes, TEXTURE_RGBA16F, 0);
	}
	if (ok)
		texture_upload(texture, texels);
	free(texels);
	free(slice);
	if (!ok) {
		free(texture);
		texture = NULL;
	}
	return texture;
}

/* Length over which light that is scattered often evens out a thickness that varies (Marshak, Davis, Wiscombe and Cahalan 1998, J. Geophys.
 * Res. 103, 19557): about H for what is transmitted, H/sqrt((1-g) tau) for what is reflected; H: 0.6 of the largest, about the mean. */
static double smoothing_length(const struct scene *scene, const struct optics *optics, bool from_above)
{
	const double thickness = 0.6 * scene->clouds.thickness_m;
	const double depth = (1 - optics->asymmetry[1]) * optics->extinction_per_m[1] * thickness;
	return from_above ? thickness / sqrt(fmax(depth, 1)) : thickness;
}

bool slab_slices_get(struct stage_context *context, const struct scene *scene, const struct droplets *droplets,
		     const struct texture **slices)
{
	const bool from_above = scene->camera.position_m[2] >= scene->clouds.base_m;
	const struct span span = span_of(scene);
	struct scene_block *block = &context->block;
	block->slab_light[0] = span.top;
	block->slab_light[1] = span.base;
	block->slab_light[2] = (float)smoothing_length(scene, droplets->tables->optics, from_above);
	block->slab_light[3] = (float)((1 - droplets->tables->optics->asymmetry[1]) * droplets->tables->optics->extinction_per_m[1]);
	*slices = NULL;
	if (scene->model.shading != SHADING_SOLVED)
		return true;
	block->slab_slice_range[0] = (float)span.first;
	block->slab_slice_range[1] = (float)((span.count - 1) / (span.last - span.first));
	block->slab_slice_range[2] = (float)span.count;
	block->slab_slice_range[3] = (float)(SLAB_SLICE_DEPTH_COUNT * span.count * (span.top + span.base));

	struct cache_key key = cache_key_make("slices");
	droplets_key_add(&key, scene);
	const double inputs[] = {span.top, span.base, span.first, span.last, span.count, from_above};
	for (size_t i = 0; i < sizeof inputs / sizeof *inputs; i++)
		cache_key_add(&key, inputs[i]);
	struct texture *texture = cache_find(context->cache, &key);
	if (!texture) {
		context->reused = false;
		texture = slices_create(droplets->tables, &span, from_above);
		if (!texture || !cache_keep(context->cache, &key, texture, texture_bytes(texture), slices_destroy)) {
			log_error("slab tables: out of memory");
			return false;
		}
	}
	*slices = texture;
	return true;
}
