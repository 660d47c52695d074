#include "renderer/stages/reference.h"

#include "renderer/gl/timer.h"
#include "renderer/log.h"

#include <epoxy/gl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
	BOUNDS_SIDE = 64,   /* as PATH_BOUNDS_SIZE in shaders/lib/light_path.glsl */
	HEIGHT_SIDE = 1024, /* of the field's height, as in shaders/lib/height.glsl */
	TOPS_SIDE_MIN = 1024,
	TOPS_SIDE_MAX = 4096,
	FIXED = 3,                        /* sums that every picture has: color, its part left to chance, and the square of that */
	GROUP = PASS_OUTPUTS_MAX - FIXED, /* layers that one run adds to beside them */
	GROUPS = (LAYER_COUNT + GROUP - 1) / GROUP,
	SAMPLES_A_PASS = 16
};

/* Texels of the tops from below, m: as fine as pixels of the zenith are. */
static const double tops_texel_m = 10;
/* A call of OpenGL is to last about so long, ms: one that is to stop waits for its end. */
static const double call_ms = 40;

/* All that one picture needs; finished with it. */
struct work {
	struct texture fixed[FIXED], slots[GROUPS][GROUP];
	enum layer slot_layer[GROUPS][GROUP];
	int slot_count, group_count;
	struct path_chains *drawn;
	enum view_side side;
	enum view_ground ground;
	double rows; /* of a call */
};

void reference_stage_init(struct reference_stage *stage, const struct pass_compiler *compiler)
{
	*stage = (struct reference_stage){.compiler = *compiler};
}

static void drop_last(struct reference_stage *stage)
{
	texture_finish(&stage->tables.tops);
	texture_finish(&stage->tables.bounds);
	texture_finish(&stage->tables.inverse);
	texture_finish(&stage->tables.chains);
	for (int i = 0; i < LAYER_COUNT; i++)
		texture_finish(&stage->layers[i]);
}

void reference_stage_finish(struct reference_stage *stage)
{
	struct pass **paths = &stage->paths[0][0][0][0][0];
	for (size_t i = 0; i < sizeof stage->paths / sizeof *paths; i++)
		pass_destroy(paths[i]);
	stage_destroy_passes(stage->tops, VIEW_SIDES);
	pass_destroy(stage->resolve);
	disc_buffer_finish(&stage->disc);
	drop_last(stage);
	*stage = (struct reference_stage){0};
}

static void work_finish(struct work *work)
{
	for (int i = 0; i < FIXED; i++)
		texture_finish(&work->fixed[i]);
	for (int i = 0; i < GROUPS * GROUP; i++)
		texture_finish(&work->slots[i / GROUP][i % GROUP]);
	free(work->drawn);
}

/* --- programs ------------------------------------------------------------------------------------------------------------------- */

static const struct pass *paths_pass(struct reference_stage *stage, const struct work *work, enum projection projection, bool large)
{
	const bool layers = work->slot_count > 0;
	struct pass **pass = &stage->paths[work->side][layers][projection][large][work->ground];
	char defines[200];
	const struct pass_desc desc = {.file = "shaders/passes/reference.glsl",
				       .defines = defines,
				       .outputs = layers ? FIXED + GROUP : FIXED,
				       .samplers = {"transmittance_table", "sky_total", "sky_near", "air_to_layer", "air_to_end",
						    "ground_map", "phase_table", "path_tops", "path_bounds", "phase_inverse",
						    "forward_chains", "sky_at_layer", "sky_at_ground"},
				       .adds = true};
	snprintf(defines, sizeof defines,
		 "#define REFERENCE_ABOVE %d\n#define REFERENCE_LAYERS %d\n#define VIEW_PROJECTION %d\n#define VIEW_LARGE_SUN %d\n"
		 "#define VIEW_GROUND %d\n",
		 work->side == VIEW_ABOVE, layers, projection, large, work->ground);
	if (!*pass)
		*pass = pass_create(&stage->compiler, &desc);
	return *pass;
}

static const struct pass *tops_pass(struct reference_stage *stage, enum view_side side)
{
	const bool above = side == VIEW_ABOVE;
	const struct pass_desc desc = {.file = "shaders/passes/reference_tops.glsl",
				       .defines = above ? "#define REFERENCE_ABOVE 1\n" : "#define REFERENCE_ABOVE 0\n",
				       .outputs = 1,
				       .samplers = {above ? "height_table" : "field_coarse", above ? NULL : "field_detail"}};
	if (!stage->tops[side])
		stage->tops[side] = pass_create(&stage->compiler, &desc);
	return stage->tops[side];
}

static const struct pass *resolve_pass(struct reference_stage *stage)
{
	const struct pass_desc desc = {
		.file = "shaders/passes/reference_resolve.glsl", .outputs = 1, .samplers = {"sums", "chances", "squares", "colors"}};
	if (!stage->resolve)
		stage->resolve = pass_create(&stage->compiler, &desc);
	return stage->resolve;
}

/* --- tables --------------------------------------------------------------------------------------------------------------------- */

static int tops_side(const struct scene *scene, enum view_side side)
{
	int texels = TOPS_SIDE_MIN;
	if (side == VIEW_ABOVE)
		return HEIGHT_SIDE;
	while (texels < TOPS_SIDE_MAX && scene->clouds.tile_m / texels > tops_texel_m)
		texels *= 2;
	return texels;
}

/* The largest height in squares of the tile, and then in those and their eight neighbours, so that it holds for as far as a square reaches.
 */
static void find_bounds(const float *tops, int side, float bounds[BOUNDS_SIDE][BOUNDS_SIDE])
{
	static _Thread_local float own[BOUNDS_SIDE][BOUNDS_SIDE];
	const int cell = side / BOUNDS_SIDE;
	memset(own, 0, sizeof own);
	for (int y = 0; y < side; y++)
		for (int x = 0; x < side; x++)
			own[y / cell][x / cell] = fmaxf(own[y / cell][x / cell], tops[(size_t)y * (size_t)side + (size_t)x]);
	for (int y = 0; y < BOUNDS_SIDE; y++)
		for (int x = 0; x < BOUNDS_SIDE; x++) {
			bounds[y][x] = 0;
			for (int k = 0; k < 9; k++)
				bounds[y][x] = fmaxf(
					bounds[y][x],
					own[(y + k / 3 + BOUNDS_SIDE - 1) % BOUNDS_SIDE][(x + k % 3 + BOUNDS_SIDE - 1) % BOUNDS_SIDE]);
		}
}

static bool make_tops(struct reference_stage *stage, const struct scene *scene, const struct view_inputs *view, const struct work *work)
{
	struct reference_tables *tables = &stage->tables;
	const struct field_maps *field = view->field;
	const struct pass *pass = tops_pass(stage, work->side);
	const int side = tops_side(scene, work->side);
	float(*bounds)[BOUNDS_SIDE] = malloc(sizeof(float[BOUNDS_SIDE][BOUNDS_SIDE]));
	float *values = malloc((size_t)side * (size_t)side * sizeof *values);
	const bool ok = pass && bounds && values && texture_init(&tables->tops, side, side, TEXTURE_R32F, TEXTURE_REPEAT) &&
			texture_init(&tables->bounds, BOUNDS_SIDE, BOUNDS_SIDE, TEXTURE_R32F, TEXTURE_REPEAT | TEXTURE_NEAREST);
	if (ok) {
		const bool above = work->side == VIEW_ABOVE;
		pass_run(pass, &(struct pass_run){.targets = (struct texture *[]){&tables->tops},
						  .samplers = {above ? field->height : field->coarse, above ? NULL : field->detail},
						  .arguments = {{(float)side}}});
		stage_read_texture(&tables->tops, 0, 1, values);
		find_bounds(values, side, bounds);
		texture_upload(&tables->bounds, &bounds[0][0]);
	}
	free(values);
	free(bounds);
	return ok;
}

static bool make_droplets(struct reference_stage *stage, const struct view_inputs *view, struct work *work)
{
	struct reference_tables *tables = &stage->tables;
	struct path_inverse *inverse = malloc(sizeof *inverse);
	work->drawn = malloc(sizeof *work->drawn);
	const bool ok = inverse && work->drawn && texture_init(&tables->inverse, PATH_INVERSE_COLUMNS, 1, TEXTURE_RGBA32F, 0) &&
			texture_init(&tables->chains, PATH_CHAINS_A_ROW * PATH_CHAIN_LENGTH, BAND_COUNT * PATH_CHAIN_ROWS, TEXTURE_RGBA32F,
				     TEXTURE_NEAREST);
	if (ok) {
		path_inverse_fill(inverse, view->droplets->tables);
		texture_upload(&tables->inverse, &inverse->unit[0][0]);
	}
	free(inverse);
	return ok;
}

static bool sums_init(struct texture *sums, const struct scene *scene)
{
	static const float zero[4];
	if (!texture_init(sums, scene->output.width, scene->output.height, TEXTURE_RGBA32F, TEXTURE_NEAREST))
		return false;
	glClearTexImage(sums->id, 0, GL_RGBA, GL_FLOAT, zero);
	return true;
}

static bool make_sums(const struct scene *scene, const enum layer *layers, int count, struct work *work)
{
	bool ok = true;
	for (int i = 0; ok && i < FIXED; i++)
		ok = sums_init(&work->fixed[i], scene);
	for (int i = 0; ok && i < count; i++) {
		if (layers[i] == LAYER_COLOR || layers[i] == LAYER_STANDARD_ERROR)
			continue;
		const int group = work->slot_count / GROUP, slot = work->slot_count++ % GROUP;
		work->slot_layer[group][slot] = layers[i];
		ok = sums_init(&work->slots[group][slot], scene);
	}
	work->group_count = work->slot_count > 0 ? (work->slot_count + GROUP - 1) / GROUP : 1;
	return ok;
}

/* --- paths ---------------------------------------------------------------------------------------------------------------------- */

/* A round: some samples of every pixel. */
struct round {
	int first, samples;
	double deadline; /* ms of clock_milliseconds; 0: none */
	renderer_cancelled *cancelled;
	void *cancel_context;
};

/* The first rounds are short, so that there soon is a picture. */
static int round_samples(int first, int samples)
{
	const int wanted = first < 1 ? 1 : first < 4 ? 3 : first < SAMPLES_A_PASS ? SAMPLES_A_PASS - 4 : SAMPLES_A_PASS;
	return wanted < samples - first ? wanted : samples - first;
}

static struct pass_run run_of(const struct reference_tables *tables, const struct scene *scene, const struct reference_inputs *inputs,
			      const struct round *round)
{
	const struct view_inputs *view = inputs->view;
	return (struct pass_run){.width = scene->output.width,
				 .samplers = {view->sky->transmittance, view->sky->total, view->sky->near, view->sky->to_layer,
					      view->sky->to_end, view->ground->map, &view->droplets->phase, &tables->tops, &tables->bounds,
					      &tables->inverse, &tables->chains, inputs->sky_at_layer, inputs->sky_at_ground},
				 .arguments = {{(float)round->first, (float)round->samples, (float)(scene->model.seed & 0xffff),
						(float)(scene->model.seed >> 16)},
					       {0},
					       {0, (float)scene->model.paths}}};
}

/* Some rows, of all groups. false when a program does not compile. */
static bool run_rows(struct reference_stage *stage, const struct camera_view *view, bool large, struct work *work, struct pass_run *run)
{
	for (int group = 0; group < work->group_count; group++) {
		const struct pass *pass = paths_pass(stage, work, view->projection, large);
		struct texture *targets[FIXED + GROUP] = {NULL};
		for (int i = 0; i < FIXED; i++)
			targets[i] = group == 0 ? &work->fixed[i] : NULL;
		for (int i = 0; i < GROUP; i++) {
			const bool used = group * GROUP + i < work->slot_count;
			targets[FIXED + i] = used ? &work->slots[group][i] : NULL;
			run->arguments[1 + i / 4][i % 4] = used ? (float)work->slot_layer[group][i] : -1.0f;
		}
		if (!pass)
			return false;
		run->targets = targets;
		pass_run(pass, run);
	}
	glFinish();
	return true;
}

enum outcome { OUTCOME_DONE, OUTCOME_STOPPED, OUTCOME_TIME_OVER, OUTCOME_FAILED };

/* The rows of one view, a few at a time. */
static enum outcome run_view_rows(struct reference_stage *stage, const struct camera_view *view, bool large, const struct round *round,
				  struct work *work, struct pass_run *run)
{
	const int end = view->first_row + view->height;
	for (int row = view->first_row; row < end;) {
		const double begin = clock_milliseconds();
		if (round->cancelled && round->cancelled(round->cancel_context))
			return OUTCOME_STOPPED;
		if (round->deadline > 0 && begin > round->deadline && round->first > 0)
			return OUTCOME_TIME_OVER;
		run->first_row = row;
		run->height = (int)fmin(fmax(work->rows, 1), end - row);
		if (!run_rows(stage, view, large, work, run))
			return OUTCOME_FAILED;
		row += run->height;
		/* What a call takes now, the next one will take per sample and row. */
		const double took = clock_milliseconds() - begin;
		work->rows = run->height * fmin(fmax(call_ms / fmax(took, 0.01), 0.25), 4);
	}
	return OUTCOME_DONE;
}

/* Fills in the view's camera and disc. */
static void set_view(struct reference_stage *stage, struct stage_context *context, const struct scene *scene, int index)
{
	const struct camera_view view = camera_view_of(scene, index);
	view_fill_camera(&context->block, scene, &view);
	disc_buffer_bind(&stage->disc, index, &context->block);
	stage_upload_block(context);
}

static enum outcome run_round(struct reference_stage *stage, struct stage_context *context, const struct scene *scene,
			      const struct reference_inputs *inputs, const struct round *round, struct work *work)
{
	struct pass_run run = run_of(&stage->tables, scene, inputs, round);
	enum outcome outcome = OUTCOME_DONE;
	path_chains_draw(work->drawn, inputs->view->droplets->tables, context->block.sun_direction[3], scene->model.seed,
			 (uint64_t)round->first);
	texture_upload(&stage->tables.chains, &work->drawn->chain[0][0][0][0][0]);
	for (int i = 0; outcome == OUTCOME_DONE && i < camera_view_count(scene); i++) {
		const struct camera_view view = camera_view_of(scene, i);
		set_view(stage, context, scene, i);
		outcome = run_view_rows(stage, &view, stage->disc.views[i].large, round, work, &run);
	}
	work->rows *= (double)round->samples / fmax(1, round_samples(round->first + round->samples, scene->model.samples));
	return outcome;
}

static enum outcome run_rounds(struct reference_stage *stage, struct stage_context *context, const struct scene *scene,
			       const struct reference_inputs *inputs, renderer_cancelled *cancelled, void *cancel_context,
			       struct work *work, int *samples)
{
	const double begin = clock_milliseconds(), budget = scene->model.time_budget_ms;
	struct round round = {.deadline = budget > 0 ? begin + budget : 0, .cancelled = cancelled, .cancel_context = cancel_context};
	enum outcome outcome = OUTCOME_DONE;
	work->rows = 1;
	for (*samples = 0; outcome == OUTCOME_DONE && *samples < scene->model.samples;) {
		round.first = *samples;
		round.samples = round_samples(round.first, scene->model.samples);
		outcome = run_round(stage, context, scene, inputs, &round, work);
		if (outcome == OUTCOME_DONE)
			*samples += round.samples;
	}
	return outcome;
}

/* --- the picture ------------------------------------------------------------------------------------------------------------------ */

static const struct texture *sums_of(const struct work *work, enum layer layer)
{
	for (int i = 0; i < work->slot_count; i++)
		if (work->slot_layer[i / GROUP][i % GROUP] == layer)
			return &work->slots[i / GROUP][i % GROUP];
	return &work->fixed[0];
}

static bool resolve(struct reference_stage *stage, const struct scene *scene, const enum layer *layers, int count, const struct work *work,
		    const struct texture **pictures)
{
	const struct pass *pass = resolve_pass(stage);
	for (int i = 0; pass && i < count; i++) {
		struct texture *target = &stage->layers[layers[i]];
		if (!texture_init(target, scene->output.width, scene->output.height, TEXTURE_RGBA32F, TEXTURE_NEAREST))
			return false;
		pass_run(pass, &(struct pass_run){.targets = &target,
						  .samplers = {sums_of(work, layers[i]), &work->fixed[1], &work->fixed[2], &work->fixed[0]},
						  .arguments = {{(float)layers[i]}}});
		pictures[i] = target;
	}
	return pass;
}

static double horizon_sine(double height)
{
	const double radius = 6371000.0;
	return -sqrt(height * (2 * radius + height)) / (radius + height);
}

bool reference_stage_run(struct reference_stage *stage, struct stage_context *context, const struct scene *scene,
			 const struct reference_inputs *inputs, const enum layer *layers, int count, renderer_cancelled *cancelled,
			 void *cancel_context, const struct texture **pictures, struct reference_result *result)
{
	struct work work = {.side = scene->camera.position_m[2] < scene->clouds.base_m ? VIEW_BELOW : VIEW_ABOVE,
			    .ground = view_ground_of(scene)};
	enum outcome outcome = OUTCOME_FAILED;
	*result = (struct reference_result){0};
	context->reused = false;
	drop_last(stage);
	if (disc_buffer_fill(&stage->disc, &context->block, scene, horizon_sine(scene->camera.position_m[2]), inputs->view->sun_cover) &&
	    make_tops(stage, scene, inputs->view, &work) && make_droplets(stage, inputs->view, &work) &&
	    make_sums(scene, layers, count, &work))
		outcome = run_rounds(stage, context, scene, inputs, cancelled, cancel_context, &work, &result->samples);
	result->stopped = outcome == OUTCOME_STOPPED;
	bool ok = outcome == OUTCOME_DONE || outcome == OUTCOME_TIME_OVER ||
		  (outcome == OUTCOME_STOPPED && scene->model.partial && result->samples > 0);
	ok = ok && resolve(stage, scene, layers, count, &work, pictures);
	work_finish(&work);
	return ok;
}
