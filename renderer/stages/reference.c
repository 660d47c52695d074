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
	SAMPLES_A_PASS = 32,
	BLOCK_SIDE = 8, /* pixels that run in step with each other lie in such squares, of fragments and of work groups alike */
	CALL_BLOCKS = 4 /* at least, for processors to share */
};

/* Texels of the tops from below, m: as fine as pixels of the zenith are. */
static const double tops_texel_m = 10;
/* A call of OpenGL is to last about so long, ms: one that is to stop waits for its end. */
static const double call_ms = 40;

/* All that one picture needs. Between two calls: what it was made of is the same then, looked up again. */
struct reference_work {
	struct reference_tables tables;
	struct texture fixed[FIXED], slots[GROUPS][GROUP];
	enum layer slot_layer[GROUPS][GROUP];
	int slot_count, group_count;
	struct path_chains *drawn;
	enum view_side side;
	enum view_ground ground;
	double blocks; /* of a call */

	int samples;      /* rounds that are done */
	int view, block;  /* of the round in work: views that are done, blocks of the next one, row by row of them */
	int chains_first; /* the round that chains were drawn for; -1: none */
	double spent_ms;
};

void reference_stage_init(struct reference_stage *stage, const struct pass_compiler *compiler)
{
	*stage = (struct reference_stage){.compiler = *compiler};
}

static void finish_tables(struct reference_tables *tables)
{
	texture_finish(&tables->tops);
	texture_finish(&tables->bounds);
	texture_finish(&tables->inverse);
	texture_finish(&tables->chains);
}

static void drop_last(struct reference_stage *stage)
{
	finish_tables(&stage->tables);
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

void reference_work_destroy(struct reference_work *work)
{
	if (!work)
		return;
	finish_tables(&work->tables);
	for (int i = 0; i < FIXED; i++)
		texture_finish(&work->fixed[i]);
	for (int i = 0; i < GROUPS * GROUP; i++)
		texture_finish(&work->slots[i / GROUP][i % GROUP]);
	free(work->drawn);
	free(work);
}

int reference_work_samples(const struct reference_work *work)
{
	return work->samples;
}

/* --- programs ------------------------------------------------------------------------------------------------------------------- */

static const struct pass *paths_pass(struct reference_stage *stage, const struct reference_work *work, enum projection projection,
				     bool large)
{
	const bool layers = work->slot_count > 0;
	struct pass_compiler compiler = stage->compiler;
	struct pass **pass = &stage->paths[work->side][layers][projection][large][work->ground];
	char defines[200];
	const struct pass_desc desc = {.file = "shaders/passes/reference.glsl",
				       .defines = defines,
				       .outputs = layers ? FIXED + GROUP : FIXED,
				       .samplers = {"transmittance_table", "sky_total", "sky_near", "air_to_layer", "air_to_end",
						    "ground_map", "phase_table", "path_tops", "path_bounds", "phase_inverse",
						    "forward_chains", "sky_at_layer", "sky_at_ground"},
				       .adds = true};
	/* Software shares fragments among processors by squares of 64, work groups one by one. */
	if (compiler.software)
		compiler.kind = PASS_COMPUTE;
	snprintf(defines, sizeof defines,
		 "#define REFERENCE_ABOVE %d\n#define REFERENCE_LAYERS %d\n#define VIEW_PROJECTION %d\n#define VIEW_LARGE_SUN %d\n"
		 "#define VIEW_GROUND %d\n",
		 work->side == VIEW_ABOVE, layers, projection, large, work->ground);
	if (!*pass)
		*pass = pass_create(&compiler, &desc);
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

static bool make_tops(struct reference_stage *stage, const struct scene *scene, const struct view_inputs *view, struct reference_work *work)
{
	const struct field_maps *field = view->field;
	const struct pass *pass = tops_pass(stage, work->side);
	const int side = tops_side(scene, work->side);
	float(*bounds)[BOUNDS_SIDE] = malloc(sizeof(float[BOUNDS_SIDE][BOUNDS_SIDE]));
	float *values = malloc((size_t)side * (size_t)side * sizeof *values);
	const bool ok = pass && bounds && values && texture_init(&work->tables.tops, side, side, TEXTURE_R32F, TEXTURE_REPEAT) &&
			texture_init(&work->tables.bounds, BOUNDS_SIDE, BOUNDS_SIDE, TEXTURE_R32F, TEXTURE_REPEAT | TEXTURE_NEAREST);
	if (ok) {
		const bool above = work->side == VIEW_ABOVE;
		pass_run(pass, &(struct pass_run){.targets = (struct texture *[]){&work->tables.tops},
						  .samplers = {above ? field->height : field->coarse, above ? NULL : field->detail},
						  .arguments = {{(float)side}}});
		stage_read_texture(&work->tables.tops, 0, 1, values);
		find_bounds(values, side, bounds);
		texture_upload(&work->tables.bounds, &bounds[0][0]);
	}
	free(values);
	free(bounds);
	return ok;
}

static bool make_droplets(const struct view_inputs *view, struct reference_work *work)
{
	struct path_inverse *inverse = malloc(sizeof *inverse);
	work->drawn = malloc(sizeof *work->drawn);
	const bool ok = inverse && work->drawn && texture_init(&work->tables.inverse, PATH_INVERSE_COLUMNS, 1, TEXTURE_RGBA32F, 0) &&
			texture_init(&work->tables.chains, PATH_CHAINS_A_ROW * PATH_CHAIN_LENGTH, BAND_COUNT * PATH_CHAIN_ROWS,
				     TEXTURE_RGBA32F, TEXTURE_NEAREST);
	if (ok) {
		path_inverse_fill(inverse, view->droplets->tables);
		texture_upload(&work->tables.inverse, &inverse->unit[0][0]);
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

static bool make_sums(const struct scene *scene, const enum layer *layers, int count, struct reference_work *work)
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
	const struct reference_watch *watch;
};

static bool asks(renderer_cancelled *question, void *context)
{
	return question && question(context);
}

/* The first rounds are short, so that there soon is a picture. */
static int round_samples(int first, int samples)
{
	const int wanted = first < 1 ? 1 : first < 4 ? 3 : first < 16 ? 12 : first < SAMPLES_A_PASS ? 16 : SAMPLES_A_PASS;
	return wanted < samples - first ? wanted : samples - first;
}

static struct pass_run run_of(const struct scene *scene, const struct reference_inputs *inputs, const struct reference_work *work,
			      const struct round *round)
{
	const struct view_inputs *view = inputs->view;
	return (struct pass_run){.samplers = {view->sky->transmittance, view->sky->total, view->sky->near, view->sky->to_layer,
					      view->sky->to_end, view->ground->map, &view->droplets->phase, &work->tables.tops,
					      &work->tables.bounds, &work->tables.inverse, &work->tables.chains, inputs->sky_at_layer,
					      inputs->sky_at_ground},
				 .arguments = {{(float)round->first, (float)round->samples, (float)(scene->model.seed & 0xffff),
						(float)(scene->model.seed >> 16)},
					       {0},
					       {0, (float)scene->model.paths}}};
}

/* A rectangle, of all groups of layers. false when a program does not compile. */
static bool run_rectangle(struct reference_stage *stage, const struct camera_view *view, bool large, struct reference_work *work,
			  struct pass_run *run)
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

enum outcome { OUTCOME_DONE, OUTCOME_PAUSED, OUTCOME_STOPPED, OUTCOME_TIME_OVER, OUTCOME_FAILED };

/* The next blocks of a view: some of a row of blocks, or some whole rows. Returns how many they are. */
static int next_rectangle(const struct camera_view *view, const struct reference_work *work, int width, struct pass_run *run)
{
	const int columns = (width + BLOCK_SIDE - 1) / BLOCK_SIDE, rows = (view->height + BLOCK_SIDE - 1) / BLOCK_SIDE;
	const int column = work->block % columns, row = work->block / columns;
	const int wanted = (int)fmin(fmax(work->blocks, CALL_BLOCKS), columns * rows);
	const bool whole = column == 0 && wanted >= columns;
	const int across = whole ? columns : (int)fmin(wanted, columns - column);
	const int down = whole ? (int)fmin(wanted / columns, rows - row) : 1;
	run->first_column = column * BLOCK_SIDE;
	run->width = (int)fmin(across * BLOCK_SIDE, width - run->first_column);
	run->first_row = view->first_row + row * BLOCK_SIDE;
	run->height = (int)fmin(down * BLOCK_SIDE, view->height - row * BLOCK_SIDE);
	return across * down;
}

/* The blocks of one view, a few at a time, from where an earlier call left off. */
static enum outcome run_view_blocks(struct reference_stage *stage, const struct camera_view *view, int width, bool large,
				    const struct round *round, struct reference_work *work, struct pass_run *run)
{
	const int count = ((width + BLOCK_SIDE - 1) / BLOCK_SIDE) * ((view->height + BLOCK_SIDE - 1) / BLOCK_SIDE);
	while (work->block < count) {
		const double begin = clock_milliseconds();
		if (asks(round->watch->cancelled, round->watch->context))
			return OUTCOME_STOPPED;
		if (round->deadline > 0 && begin > round->deadline && round->first > 0)
			return OUTCOME_TIME_OVER;
		const int blocks = next_rectangle(view, work, width, run);
		if (!run_rectangle(stage, view, large, work, run))
			return OUTCOME_FAILED;
		work->block += blocks;
		/* What a call takes now, the next one will take per sample and block. */
		const double took = clock_milliseconds() - begin;
		work->blocks = blocks * fmin(fmax(call_ms / fmax(took, 0.01), 0.25), 4);
		if (asks(round->watch->paused, round->watch->context))
			return OUTCOME_PAUSED;
	}
	work->block = 0;
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
			      const struct reference_inputs *inputs, const struct round *round, struct reference_work *work)
{
	struct pass_run run = run_of(scene, inputs, work, round);
	enum outcome outcome = OUTCOME_DONE;
	if (work->chains_first != round->first) {
		path_chains_draw(work->drawn, inputs->view->droplets->tables, context->block.sun_direction[3], scene->model.seed,
				 (uint64_t)round->first);
		texture_upload(&work->tables.chains, &work->drawn->chain[0][0][0][0][0]);
		work->chains_first = round->first;
	}
	for (; work->view < camera_view_count(scene); work->view++) {
		const struct camera_view view = camera_view_of(scene, work->view);
		set_view(stage, context, scene, work->view);
		outcome = run_view_blocks(stage, &view, scene->output.width, stage->disc.views[work->view].large, round, work, &run);
		if (outcome != OUTCOME_DONE)
			return outcome;
	}
	work->view = 0;
	work->blocks *= (double)round->samples / fmax(1, round_samples(round->first + round->samples, scene->model.samples));
	return outcome;
}

static enum outcome run_rounds(struct reference_stage *stage, struct stage_context *context, const struct scene *scene,
			       const struct reference_inputs *inputs, const struct reference_watch *watch, struct reference_work *work)
{
	const double begin = clock_milliseconds(), budget = scene->model.time_budget_ms;
	struct round round = {.deadline = budget > 0 ? begin + budget - work->spent_ms : 0, .watch = watch};
	enum outcome outcome = OUTCOME_DONE;
	while (outcome == OUTCOME_DONE && work->samples < scene->model.samples) {
		round.first = work->samples;
		round.samples = round_samples(round.first, scene->model.samples);
		outcome = run_round(stage, context, scene, inputs, &round, work);
		if (outcome == OUTCOME_DONE)
			work->samples += round.samples;
	}
	work->spent_ms += clock_milliseconds() - begin;
	return outcome;
}

/* --- the picture ------------------------------------------------------------------------------------------------------------------ */

static const struct texture *sums_of(const struct reference_work *work, enum layer layer)
{
	for (int i = 0; i < work->slot_count; i++)
		if (work->slot_layer[i / GROUP][i % GROUP] == layer)
			return &work->slots[i / GROUP][i % GROUP];
	return &work->fixed[0];
}

static bool resolve(struct reference_stage *stage, const struct scene *scene, const enum layer *layers, int count,
		    const struct reference_work *work, const struct texture **pictures)
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

static struct reference_work *begin_work(struct reference_stage *stage, const struct scene *scene, const struct reference_inputs *inputs,
					 const enum layer *layers, int count)
{
	struct reference_work *work = calloc(1, sizeof *work);
	if (!work)
		return NULL;
	work->side = scene->camera.position_m[2] < scene->clouds.base_m ? VIEW_BELOW : VIEW_ABOVE;
	work->ground = view_ground_of(scene);
	work->blocks = 1;
	work->chains_first = -1;
	if (make_tops(stage, scene, inputs->view, work) && make_droplets(inputs->view, work) && make_sums(scene, layers, count, work))
		return work;
	reference_work_destroy(work);
	return NULL;
}

bool reference_stage_run(struct reference_stage *stage, struct stage_context *context, const struct scene *scene,
			 const struct reference_inputs *inputs, const enum layer *layers, int count, const struct reference_watch *watch,
			 struct reference_work **work, const struct texture **pictures, struct reference_result *result)
{
	enum outcome outcome = OUTCOME_FAILED;
	*result = (struct reference_result){0};
	context->reused = false;
	drop_last(stage);
	if (!*work)
		*work = begin_work(stage, scene, inputs, layers, count);
	if (*work &&
	    disc_buffer_fill(&stage->disc, &context->block, scene, horizon_sine(scene->camera.position_m[2]), inputs->view->sun_cover))
		outcome = run_rounds(stage, context, scene, inputs, watch, *work);
	if (outcome == OUTCOME_PAUSED)
		return false;
	result->samples = *work ? (*work)->samples : 0;
	result->stopped = outcome == OUTCOME_STOPPED;
	bool ok = outcome == OUTCOME_DONE || outcome == OUTCOME_TIME_OVER ||
		  (outcome == OUTCOME_STOPPED && scene->model.partial && result->samples > 0);
	ok = ok && resolve(stage, scene, layers, count, *work, pictures);
	if (*work) {
		stage->tables = (*work)->tables;
		(*work)->tables = (struct reference_tables){0};
	}
	reference_work_destroy(*work);
	*work = NULL;
	return ok;
}
