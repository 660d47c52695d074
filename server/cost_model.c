#include "server/cost_model.h"

#include "renderer/log.h"
#include "server/clock.h"
#include "server/line_fit.h"

#include <assert.h>
#include <math.h>
#include <pthread.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <xxhash.h>

/* What views cost alike. */
enum sight { SIGHT_CLEAR, SIGHT_BELOW, SIGHT_ABOVE, SIGHT_COUNT };
enum form { FORM_PNG, FORM_COLOR, FORM_LAYERS, FORM_COUNT };

/* What frames share. */
enum part { PART_OPTICS, PART_SKY, PART_FIELD, PART_RADIOSITY, PART_COUNT };
static_assert((int)PART_COUNT == (int)COST_PARTS, "jobs have a place for each part");

/* So many different ones of each part are remembered, and so many at first taken to be in the renderer's memory. */
enum { KNOWN_COUNT = 32, REACH_START = 4 };

/* Before anything is measured, in ms for each megapixel; rather too little than too much, so that a start refuses nobody: Mesa's llvmpipe
 * on two processors, and a small GPU. Parts and droplets likewise, in ms. */
#define START_SOFTWARE_MS 300.0
#define START_GPU_MS      5.0
#define START_ENCODE_MS   20.0
#define START_PREPARE_MS  1000.0

/* Share of each render in the pace, and its bounds. */
#define PACE_GAIN 0.25
#define PACE_MOST 4.0

/* Millions: of pixels, of light paths. */
#define MEGA 1e-6

/* What was asked for of late, the last first, and how far back the renderer's memory seems to reach. */
struct memory {
	uint64_t key[KNOWN_COUNT];
	int reach;
};

struct cost_model {
	pthread_mutex_t mutex;
	double start_ms; /* for each megapixel */
	double log_pace;
	struct line_fit views[MODEL_COUNT][SIGHT_COUNT][FORM_COUNT], models[MODEL_COUNT];
	struct line_fit light, prepare, parts[PART_COUNT][SIGHT_COUNT], fields[CLOUD_TYPE_COUNT][SIGHT_COUNT];
	struct line_fit png[PNG_COMPRESSION_COUNT], exr[EXR_COMPRESSION_COUNT];
	struct memory known[PART_COUNT];
};

struct cost_model *cost_model_create(void)
{
	struct cost_model *model = calloc(1, sizeof *model);
	if (!model) {
		log_error("cost_model_create: out of memory");
		return NULL;
	}
	pthread_mutex_init(&model->mutex, NULL);
	model->start_ms = START_GPU_MS;
	for (enum part part = 0; part < PART_COUNT; part++)
		model->known[part].reach = REACH_START;
	return model;
}

void cost_model_destroy(struct cost_model *model)
{
	if (!model)
		return;
	pthread_mutex_destroy(&model->mutex);
	free(model);
}

void cost_model_start(struct cost_model *model, bool software)
{
	pthread_mutex_lock(&model->mutex);
	model->start_ms = software ? START_SOFTWARE_MS : START_GPU_MS;
	pthread_mutex_unlock(&model->mutex);
}

/* --- kinds ------------------------------------------------------------------------------------------------------------------------ */

static enum sight sight_of(const struct scene *scene)
{
	if (!scene_has_clouds(scene))
		return SIGHT_CLEAR;
	return scene->camera.position_m[2] < scene->clouds.base_m ? SIGHT_BELOW : SIGHT_ABOVE;
}

static enum form form_of(const struct scene *scene)
{
	if (scene->output.format == IMAGE_PNG)
		return FORM_PNG;
	return scene->output.layers == 1u << LAYER_COLOR ? FORM_COLOR : FORM_LAYERS;
}

static double megapixels_of(const struct scene *scene)
{
	return MEGA * scene->output.width * scene->output.height;
}

static int layers_of(const struct scene *scene)
{
	return scene->output.format == IMAGE_PNG ? 1 : __builtin_popcount(scene->output.layers);
}

/* What the view's cost grows with. */
static double view_size(const struct scene *scene)
{
	const double paths = scene->model.name == MODEL_REFERENCE ? scene->model.samples : 1;
	return megapixels_of(scene) * paths;
}

static double part_size(const struct scene *scene, enum part part)
{
	return part == PART_SKY || part == PART_OPTICS ? 1 : MEGA * scene->clouds.resolution * scene->clouds.resolution;
}

static double light_size(const struct sky_directions *directions)
{
	return MEGA * directions->view_count * directions->azimuth_count;
}

static struct line_fit *encoding_of(struct cost_model *model, const struct scene *scene)
{
	const struct scene_output *output = &scene->output;
	return output->format == IMAGE_PNG ? &model->png[output->png_compression] : &model->exr[output->exr_compression];
}

/* --- what frames share ------------------------------------------------------------------------------------------------------------ */

static uint64_t mix(uint64_t key, const void *data, size_t size)
{
	return XXH3_64bits_withSeed(data, size, key);
}

static uint64_t mix_choice(uint64_t key, const struct scene_map_choice *choice)
{
	return mix(key, choice->hash, strlen(choice->hash));
}

static uint64_t sky_key(const struct scene *scene)
{
	const struct scene_ground *ground = &scene->ground;
	uint64_t key = mix(1, &scene->sun.elevation_deg, sizeof(double));
	key = mix(key, &scene->sun.azimuth_deg, sizeof(double));
	key = mix(key, &scene->atmosphere, sizeof scene->atmosphere);
	key = mix(key, &ground->type, sizeof ground->type);
	key = mix(key, ground->albedo, sizeof ground->albedo);
	key = mix(key, &ground->albedo_scale, sizeof(double));
	return mix_choice(key, &ground->map);
}

static uint64_t field_key(const struct scene *scene)
{
	const struct scene_clouds *clouds = &scene->clouds;
	const double numbers[] = {(double)clouds->type, clouds->seed,   clouds->time_s,      clouds->coverage,    clouds->base_m,
				  clouds->thickness_m,  clouds->tile_m, clouds->wind_mps[0], clouds->wind_mps[1], clouds->resolution};
	return mix_choice(mix(2, numbers, sizeof numbers), &clouds->map);
}

static uint64_t radiosity_key(const struct scene *scene)
{
	const struct scene_radiosity *radiosity = &scene->radiosity;
	const double numbers[] = {radiosity->enabled, radiosity->tolerance, radiosity->max_passes, scene->model.shading,
				  scene->model.optics};
	const uint64_t key = mix(sky_key(scene) ^ field_key(scene), &scene->dsd, sizeof scene->dsd);
	return mix(key, numbers, sizeof numbers);
}

static uint64_t optics_key(const struct scene *scene)
{
	const double numbers[] = {scene->sun.elevation_deg, scene->model.shading, scene->model.optics};
	return mix(mix(3, &scene->dsd, sizeof scene->dsd), numbers, sizeof numbers);
}

/* Seen from above the field needs something of its own, and so does the sky where there are no clouds. */
static enum sight part_sight(const struct scene *scene, enum part part)
{
	const enum sight sight = sight_of(scene);
	return part == PART_FIELD || (part == PART_SKY && sight == SIGHT_CLEAR) ? sight : SIGHT_BELOW;
}

/* That of the part alone; fields of some types have more layers of cells than others. */
static struct line_fit *part_fit(struct cost_model *model, const struct scene *scene, enum part part)
{
	const enum sight sight = part_sight(scene, part);
	return part == PART_FIELD ? &model->fields[scene->clouds.type][sight] : &model->parts[part][sight];
}

static uint64_t part_key(const struct scene *scene, enum part part)
{
	static uint64_t (*const keys[PART_COUNT])(const struct scene *) = {
		[PART_OPTICS] = optics_key, [PART_SKY] = sky_key, [PART_FIELD] = field_key, [PART_RADIOSITY] = radiosity_key};
	const enum sight sight = part_sight(scene, part);
	return mix(keys[part](scene), &sight, sizeof sight);
}

static bool has_part(const struct scene *scene, enum part part)
{
	return part == PART_SKY || (scene_has_clouds(scene) && (part != PART_RADIOSITY || scene->radiosity.enabled));
}

/* How many others were asked for since; KNOWN_COUNT: too many. */
static int rank_of(const struct memory *memory, uint64_t key)
{
	int rank = 0;
	while (rank < KNOWN_COUNT && memory->key[rank] != key)
		rank++;
	return rank;
}

static bool is_known(const struct memory *memory, uint64_t key)
{
	return rank_of(memory, key) < memory->reach;
}

void cost_model_expect(struct cost_model *model, const struct scene *scene, int ranks[static COST_PARTS])
{
	pthread_mutex_lock(&model->mutex);
	for (enum part part = 0; part < PART_COUNT; part++) {
		struct memory *memory = &model->known[part];
		const uint64_t key = part_key(scene, part);
		const int rank = rank_of(memory, key), last = rank < KNOWN_COUNT ? rank : KNOWN_COUNT - 1;
		ranks[part] = rank + 1;
		if (!has_part(scene, part))
			continue;
		memmove(memory->key + 1, memory->key, (size_t)last * sizeof *memory->key);
		memory->key[0] = key;
	}
	pthread_mutex_unlock(&model->mutex);
}

/* What was there shows how far it reaches; what was not, that it reaches less far, by how much depends on sizes. */
static void learn_reach(struct memory *memory, int rank, bool reused)
{
	if (reused && rank < KNOWN_COUNT && rank >= memory->reach)
		memory->reach = rank + 1;
	else if (!reused && rank < memory->reach)
		memory->reach = memory->reach > 1 ? memory->reach - 1 : 1;
}

/* --- predicting ------------------------------------------------------------------------------------------------------------------- */

/* Adds what a fit says, and whether it is fit to refuse by. */
static double use(const struct line_fit *fit, double x, double start_ms, bool *fresh)
{
	*fresh &= fit->count > 0 && clock_now_ms() - fit->last_ms < COST_FRESH_MS;
	return fit->count ? line_fit_at(fit, x) : start_ms * x;
}

/* Kinds that were never seen go by others of their model, which is no reason to refuse them. */
static double predict_view(struct cost_model *model, const struct scene *scene, bool *fresh)
{
	const struct line_fit *own = &model->views[scene->model.name][sight_of(scene)][form_of(scene)];
	const struct line_fit *others = &model->models[scene->model.name];
	*fresh &= own->count > 0;
	return use(own->count ? own : others, view_size(scene), model->start_ms, fresh);
}

/* Of what a megapixel takes, before anything is measured. */
static const double start_shares[PART_COUNT] = {[PART_OPTICS] = 0.15, [PART_SKY] = 0.2, [PART_FIELD] = 2, [PART_RADIOSITY] = 0.1};

/* Likewise: types that were never seen go by others. */
static double predict_part(struct cost_model *model, const struct scene *scene, enum part part, bool *fresh)
{
	const struct line_fit *own = part_fit(model, scene, part), *others = &model->parts[part][part_sight(scene, part)];
	*fresh &= own->count > 0;
	return use(own->count ? own : others, part_size(scene, part), start_shares[part] * model->start_ms, fresh);
}

static void predict_picture(struct cost_model *model, const struct scene *scene, struct cost *cost)
{
	for (enum part part = 0; part < PART_COUNT; part++)
		if (has_part(scene, part) && !is_known(&model->known[part], part_key(scene, part)))
			cost->render_ms += predict_part(model, scene, part, &cost->fresh);
	double view_ms = predict_view(model, scene, &cost->fresh);
	if (scene->model.name == MODEL_REFERENCE && scene->model.time_budget_ms > 0)
		view_ms = fmin(view_ms, scene->model.time_budget_ms);
	cost->render_ms += view_ms;
	bool encoding_fresh = true; /* it is a small part, and is behind the renderer */
	cost->encode_ms = use(encoding_of(model, scene), megapixels_of(scene) * layers_of(scene), START_ENCODE_MS, &encoding_fresh);
}

struct cost cost_model_predict(struct cost_model *model, const struct scene *scene, const struct sky_directions *directions,
			       bool needs_droplets)
{
	struct cost cost = {.fresh = true};
	pthread_mutex_lock(&model->mutex);
	if (needs_droplets)
		cost.prepare_ms = use(&model->prepare, 1, START_PREPARE_MS, &cost.fresh);
	if (directions)
		cost.render_ms = use(&model->light, light_size(directions), model->start_ms, &cost.fresh);
	else
		predict_picture(model, scene, &cost);
	pthread_mutex_unlock(&model->mutex);
	return cost;
}

/* --- learning --------------------------------------------------------------------------------------------------------------------- */

static const enum stage part_stages[PART_COUNT] = {
	[PART_OPTICS] = STAGE_OPTICS, [PART_SKY] = STAGE_SKY, [PART_FIELD] = STAGE_FIELD, [PART_RADIOSITY] = STAGE_RADIOSITY};

/* The view takes what the parts leave of the whole: so that what no stage accounts for is part of the prediction too. */
static void learn_picture(struct cost_model *model, const struct render_job *job, double now_ms)
{
	const struct scene *scene = job->scene;
	double view_ms = job->spent_ms;
	for (enum part part = 0; part < PART_COUNT; part++) {
		const struct stage_timing *timing = &job->frame.timing[part_stages[part]];
		if (!has_part(scene, part))
			continue;
		if (job->cost_ranks[part] > 0)
			learn_reach(&model->known[part], job->cost_ranks[part] - 1, timing->reused);
		if (timing->reused || timing->milliseconds <= 0)
			continue;
		struct line_fit *own = part_fit(model, scene, part), *all = &model->parts[part][part_sight(scene, part)];
		line_fit_add(own, part_size(scene, part), timing->milliseconds, now_ms);
		if (all != own)
			line_fit_add(all, part_size(scene, part), timing->milliseconds, now_ms);
		view_ms -= timing->milliseconds;
	}
	/* What was cut short says nothing of the whole. */
	const double done = scene->model.name == MODEL_REFERENCE ? (double)job->frame.samples / scene->model.samples : 1;
	if (view_ms <= 0 || done <= 0)
		return;
	const double size = view_size(scene) * done;
	line_fit_add(&model->views[scene->model.name][sight_of(scene)][form_of(scene)], size, view_ms, now_ms);
	line_fit_add(&model->models[scene->model.name], size, view_ms, now_ms);
}

double cost_model_pace(struct cost_model *model)
{
	pthread_mutex_lock(&model->mutex);
	const double pace = exp(model->log_pace);
	pthread_mutex_unlock(&model->mutex);
	return pace;
}

static void learn_pace(struct cost_model *model, const struct render_job *job)
{
	if (job->predicted_ms <= 0 || job->spent_ms <= 0)
		return;
	const double ratio = fmin(fmax(job->spent_ms / job->predicted_ms, 1 / PACE_MOST), PACE_MOST);
	model->log_pace += PACE_GAIN * (log(ratio) - model->log_pace);
}

void cost_model_learn(struct cost_model *model, const struct render_job *job)
{
	pthread_mutex_lock(&model->mutex);
	learn_pace(model, job);
	const double now_ms = clock_now_ms();
	if (job->prepared && job->prepared_ms > 0)
		line_fit_add(&model->prepare, 1, job->prepared_ms, now_ms);
	if (job->directions)
		line_fit_add(&model->light, light_size(job->directions), job->spent_ms, now_ms);
	else
		learn_picture(model, job, now_ms);
	pthread_mutex_unlock(&model->mutex);
}

void cost_model_learn_encoding(struct cost_model *model, const struct scene *scene, double milliseconds)
{
	pthread_mutex_lock(&model->mutex);
	if (milliseconds > 0)
		line_fit_add(encoding_of(model, scene), megapixels_of(scene) * layers_of(scene), milliseconds, clock_now_ms());
	pthread_mutex_unlock(&model->mutex);
}
