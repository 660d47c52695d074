#include "renderer/stages/field_noise.h"

#include <math.h>

enum field_noise_pass { PASS_FIRST, PASS_OCTAVE, PASS_LAST, PASS_FIRST_VECTOR, PASS_OCTAVE_VECTOR, PASS_CELLS, PASS_TUFTS };

static const struct pass_desc pass_descs[FIELD_NOISE_PASS_COUNT] = {
	[PASS_FIRST] = {.file = "shaders/passes/field_octave.glsl", .defines = "#define OCTAVE_FIRST 1\n", .outputs = 1},
	[PASS_OCTAVE] = {.file = "shaders/passes/field_octave.glsl", .outputs = 1, .samplers = {"coarser"}},
	[PASS_LAST] = {.file = "shaders/passes/field_octave.glsl",
		       .defines = "#define OCTAVE_LAST 1\n",
		       .outputs = 1,
		       .samplers = {"coarser", "shape"}},
	[PASS_FIRST_VECTOR] = {.file = "shaders/passes/field_octave.glsl",
			       .defines = "#define OCTAVE_FIRST 1\n#define OCTAVE_VECTOR 1\n",
			       .outputs = 1},
	[PASS_OCTAVE_VECTOR] = {.file = "shaders/passes/field_octave.glsl",
				.defines = "#define OCTAVE_VECTOR 1\n",
				.outputs = 1,
				.samplers = {"coarser"}},
	[PASS_CELLS] = {.file = "shaders/passes/field_cells.glsl", .outputs = 1, .samplers = {"slow", "before"}},
	[PASS_TUFTS] = {.file = "shaders/passes/field_tufts.glsl", .outputs = 1, .samplers = {"slow", "before"}},
};

enum { LAYERS_MAX = 4, LATTICE_FIRST = 4, DETAIL_FIRST = 128 };

/* A layer of cells and what it looks like; lengths in m, times in s, weights in densities. */
struct cell_layer {
	double length, life;
	double warp;    /* by which smooth noise moves the cells */
	double where;   /* 0 everywhere, 1 where cells are open, -1 where they are closed */
	double dome;    /* higher in the middle of a cell */
	double lane;    /* lower along the borders between cells */
	double wall;    /* higher there */
	double scatter; /* of the centres, 0..1 */
	/* Tufts in rows across the wind in place of cells, where not 0: their length along the rows over that across them. */
	double stretch;
	double roll;   /* higher along the rows, which here and there join in rolls */
	double spread; /* of the sizes of tufts, squares of lengths */
};

/* The types of cloud. Octaves of turbulence follow k^(-8/3) from `outer` down. */
static const struct cloud_kind {
	struct field_noise_profile profile;
	struct cell_layer layers[LAYERS_MAX]; /* from large to small; a length of 0 ends them */
	double roll_length, roll;             /* of waves in which the cells of the last layer stand; weight */
	double open;                          /* coverage below which half of the cells are open */
	double meso, meso_outer;              /* weight of variation over several km; length above which it is no stronger */
	double outer, turbulence, life;       /* of turbulence: outer length, weight, life at 1 km */
	double fine;                          /* share of it that is left far below 40 m, less than 1 where edges are soft */
	double curl;                          /* by which turbulence moves the cells, m per density */
	double displacement;                  /* of detail, m per density */
	double billow;                        /* height of its lumps on thick layers, m */
} kinds[CLOUD_TYPE_COUNT] = {
	[CLOUD_STRATUS] = {.profile = {3.0, 0.10, 0.4},
			   .layers = {{2600, 4000, 900, 0, 0.25, 0.0, 0, 1.0}},
			   .roll_length = 1700,
			   .roll = 0.06,
			   .open = -1,
			   .meso = 0.28,
			   .meso_outer = 2500,
			   .outer = 2500,
			   .turbulence = 0.32,
			   .life = 1500,
			   .fine = 0.4,
			   .displacement = 60},
	[CLOUD_STRATOCUMULUS] = {.profile = {1.8, 0.08, 0.1},
				 .layers = {{3600, 4000, 1100, 1, 0.0, 0.0, 1.2, 0.9},
					    {1400, 2400, 500, -1, 0.6, 0.5, 0, 0.85},
					    {560, 1100, 280, 0, 0.35, 0.15, 0, 0.9},
					    {190, 700, 0, 0, 0.16, 0.06, 0, 0.95}},
				 .open = 0.38,
				 .meso = 0.2,
				 .meso_outer = 2500,
				 .outer = 1500,
				 .turbulence = 0.27,
				 .life = 1000,
				 .fine = 0.5,
				 .displacement = 60,
				 .billow = 9},
	[CLOUD_ALTOCUMULUS] = {.profile = {1.5, 0.22, 0.03},
			       .layers = {{.length = 160,
					   .life = 800,
					   .stretch = 1.25,
					   .warp = 420,
					   .dome = 1.34,
					   .roll = 0.15,
					   .scatter = 0.55,
					   .spread = 0.35},
					  {.length = 75, .life = 500, .stretch = 1.2, .dome = 0.33, .scatter = 0.9, .spread = 0.3}},
			       .open = -1,
			       .meso = 0.75,
			       .meso_outer = 7000,
			       .outer = 1500,
			       .turbulence = 0.3,
			       .life = 1000,
			       .fine = 1,
			       .curl = 80,
			       .displacement = 60},
	[CLOUD_CIRROCUMULUS] =
		{.profile = {1.6, 0.12, 0.03},
		 .layers = {{.length = 95, .life = 500, .stretch = 1.3, .dome = 0.95, .roll = 0.06, .scatter = 1.0, .spread = 0.5}},
		 .open = -1,
		 .meso = 0.5,
		 .meso_outer = 6000,
		 .outer = 1500,
		 .turbulence = 0.3,
		 .life = 1000,
		 .fine = 1,
		 .curl = 60,
		 .displacement = 110},
};

/* A sum of splines about random values has 0.23 of their variance, and octaves that each have 0.63 of the variance of the one before add
 * up to 2.7 of the first's: this brings the whole sum's variance to 1. */
static const double octave_scale = 1.268;
/* Small eddies turn faster, as their size to the power of 2/3; the slow sums of mesoscale variation live this much longer. */
static const double meso_life = 3;
/* Share of the wind by which each octave of turbulence slides over the one above it. */
static const double octave_shear = 0.012;

struct pyramid {
	const struct field_noise *noise;
	struct stage_context *context;
	const struct scene_clouds *clouds;
	double tile;     /* m */
	uint32_t seed;   /* of the ingredient */
	double life;     /* s, of a length of 1 km */
	double scale;    /* amplitude at `outer` */
	double outer;    /* m */
	double fine;     /* share of the amplitude that is left far below 40 m */
	int first, last; /* points a side of the first and the last octave */
	enum texture_format format;
};

bool field_noise_init(struct field_noise *noise, const struct pass_compiler *compiler)
{
	return stage_create_passes(compiler, pass_descs, noise->passes, FIELD_NOISE_PASS_COUNT);
}

void field_noise_finish(struct field_noise *noise)
{
	stage_destroy_passes(noise->passes, FIELD_NOISE_PASS_COUNT);
}

struct field_noise_profile field_noise_profile_of(enum cloud_type type)
{
	return kinds[type].profile;
}

static double wrap(double x, double period)
{
	return x - period * floor(x / period);
}

/* A whole number below 2^24, which a float holds exactly, with every bit of the seed and of the ingredient's number mixed in. */
static float seed_number(uint32_t seed, uint32_t ingredient)
{
	uint32_t x = seed + 0x9e3779b9u * (ingredient + 1);
	x = (x ^ (x >> 16)) * 0x85ebca6bu;
	x = (x ^ (x >> 13)) * 0xc2b2ae35u;
	return (float)((x ^ (x >> 16)) & 0xffffff);
}

/* 0..1 */
static double seed_share(uint32_t seed, uint32_t ingredient)
{
	return (double)seed_number(seed, ingredient) / (1 << 24);
}

/* How many lives have passed, in two parts. */
static void fill_lives(float lives[2], double time, double life)
{
	lives[0] = (float)floor(time / life);
	lives[1] = (float)(time / life - floor(time / life));
}

/* Amplitude of the octave of a spacing, relative to that of the outer length: none above it. fine: share of it that is left far below 40 m.
 */
static double octave_weight(double spacing, double outer, double fine)
{
	const double x = spacing / 40;
	return spacing > 1.5 * outer ? 0 : octave_scale * cbrt(fmin(1, spacing / outer)) * (fine + (1 - fine) * x * x / (1 + x * x));
}

static double detail_tile(const struct scene_clouds *clouds)
{
	return clouds->tile_m * 64 / clouds->resolution;
}

/* So many tiles of detail, each finer than the one before, that points lie 6 m apart or closer. */
static int detail_count(const struct scene_clouds *clouds)
{
	int count = 1;
	for (double spacing = detail_tile(clouds) / FIELD_DETAIL_SIDE; spacing > 6 && count < 3; spacing /= 8)
		count++;
	return count;
}

/* Of the first tile of detail, in densities. */
static double detail_weight(const struct scene_clouds *clouds)
{
	const struct cloud_kind *kind = &kinds[clouds->type];
	return kind->turbulence * octave_weight(detail_tile(clouds) / DETAIL_FIRST, kind->outer, kind->fine);
}

void field_noise_fill_block(struct scene_block *block, const struct scene_clouds *clouds)
{
	const struct cloud_kind *kind = &kinds[clouds->type];
	const double tile = clouds->tile_m, detail = detail_tile(clouds);
	const double east = clouds->wind_mps[0] * clouds->time_s, north = clouds->wind_mps[1] * clouds->time_s;
	block->cloud_field[0] = (float)kind->profile.skirt;
	block->cloud_field[1] = (float)kind->displacement;
	block->cloud_field[2] = (float)detail_count(clouds);
	block->cloud_field[3] = (float)kind->billow;
	block->cloud_drift[0] = (float)wrap(east, tile);
	block->cloud_drift[1] = (float)wrap(north, tile);
	block->cloud_detail[0] = (float)detail;
	block->cloud_detail[1] = (float)wrap(4 * octave_shear * east, detail);
	block->cloud_detail[2] = (float)wrap(4 * octave_shear * north, detail);
	block->cloud_detail[3] = (float)detail_weight(clouds);
}

/* Weights of the four slow sums: mesoscale variation, openness of the cells, and a smooth warp. */
static void fill_slow(struct pass_run *run, const struct cloud_kind *kind, double coverage, double spacing, bool first)
{
	run->arguments[1][3] = first ? (float)(kind->open < 0 ? 0.5 : (kind->open - coverage) / 0.25 + 0.5) : 0;
	run->arguments[2][0] = (float)(kind->meso * octave_scale * (spacing < 600 ? 0 : cbrt(fmin(1, spacing / kind->meso_outer))));
	run->arguments[2][1] = (float)(0.5 * octave_scale * (spacing < 1200 ? 0 : 1));
	run->arguments[2][2] = run->arguments[2][3] = (float)(octave_scale * pow(fmin(1, spacing / 1250), 1.2));
}

static void fill_octave(struct pass_run *run, const struct pyramid *p, int side)
{
	const double spacing = p->tile / side;
	const uint32_t octave = (uint32_t)lrint(log2(side));
	run->arguments[0][0] = (float)side;
	run->arguments[0][1] = (float)(p->scale * octave_weight(spacing, p->outer, p->fine));
	fill_lives(&run->arguments[0][2], p->clouds->time_s, p->life * pow(spacing / 1000, 2. / 3));
	/* Lattices of different octaves lie askew, and slide. */
	for (int i = 0; i < 2; i++) {
		const double slid = octave_shear * p->clouds->wind_mps[i] * p->clouds->time_s / p->tile;
		run->arguments[1][i] = (float)wrap(slid + seed_share(p->seed, 100 + 2 * octave + (uint32_t)i), 1);
	}
	run->arguments[1][2] = seed_number(p->seed, octave);
	if (p->format == TEXTURE_RGBA32F)
		fill_slow(run, &kinds[p->clouds->type], p->clouds->coverage, spacing, side == p->first);
}

/* All octaves but the last: the sum is the caller's. shape: what the last octave is added to, or NULL. */
static bool pyramid_run(const struct pyramid *p, const struct texture *shape, struct texture *target)
{
	const bool vector = p->format == TEXTURE_RGBA32F;
	struct texture sum = {0}, finer = {0};
	bool ok = true;
	for (int side = p->first; ok && side <= p->last; side *= 2) {
		const bool first = side == p->first, last = side == p->last;
		ok = !stage_is_stopped(p->context) && (last || texture_init(&finer, side, side, p->format, TEXTURE_REPEAT));
		if (!ok)
			break;
		struct pass_run run = {.targets = (struct texture *[]){last ? target : &finer}, .samplers = {&sum, shape}};
		fill_octave(&run, p, side);
		int pass = first ? PASS_FIRST : PASS_OCTAVE;
		if (vector)
			pass = first ? PASS_FIRST_VECTOR : PASS_OCTAVE_VECTOR;
		if (last && shape) {
			pass = PASS_LAST;
			run.arguments[1][3] = (float)shape->width;
			run.arguments[2][0] = (float)(kinds[p->clouds->type].curl / p->tile);
		}
		pass_run(p->noise->passes[pass], &run);
		texture_finish(&sum);
		sum = finer;
		finer = (struct texture){0};
	}
	texture_finish(&sum);
	return ok;
}

/* The smallest power of two that is at least this, from 8 to the resolution. */
static int side_for(double points, int resolution)
{
	int side = 8;
	while (side < points && side < resolution)
		side *= 2;
	return side;
}

static int cells_a_tile(double tile, double length)
{
	return (int)fmax(1, round(tile / length));
}

static void fill_roll(float arguments[4], const struct cloud_kind *kind, const struct scene_clouds *clouds)
{
	if (kind->roll <= 0)
		return;
	const double heading = 2 * M_PI * seed_share(clouds->seed, 60), waves = clouds->tile_m / kind->roll_length;
	const double slid = 0.06 * clouds->time_s / kind->roll_length * hypot(clouds->wind_mps[0], clouds->wind_mps[1]);
	arguments[0] = (float)round(waves * sin(heading));
	arguments[1] = (float)round(waves * cos(heading));
	arguments[2] = (float)kind->roll;
	arguments[3] = (float)wrap(slid, 1);
}

/* The layer of the field or of its detail over a tile in m, weights times `scale`. */
static void fill_cells(struct pass_run *run, const struct scene_clouds *clouds, int i, double tile, double scale)
{
	const struct cell_layer *layer = &kinds[clouds->type].layers[i];
	run->arguments[0][0] = (float)run->targets[0]->width;
	run->arguments[0][1] = (float)cells_a_tile(tile, layer->length);
	run->arguments[0][2] = seed_number(clouds->seed, 40 + (uint32_t)i);
	fill_lives(run->arguments[1], clouds->time_s, layer->life);
	run->arguments[2][0] = (float)(layer->dome * scale);
	run->arguments[2][1] = (float)(layer->lane * scale);
	run->arguments[2][2] = (float)(layer->wall * scale);
	run->arguments[2][3] = (float)layer->scatter;
}

/* Rows of tufts lie across the wind, more or less; in calm air anyhow. Direction from row to row, radians from east to north. */
static double row_heading(const struct scene_clouds *clouds)
{
	const double east = clouds->wind_mps[0], north = clouds->wind_mps[1], share = seed_share(clouds->seed, 60);
	return hypot(east, north) > 0 ? atan2(north, east) + 1.2 * (share - 0.5) : 2 * M_PI * share;
}

/* As noise_lattice_wrap has it: from row to row in its second coordinate. Tiles too small for slanting rows have straight ones. */
static void fill_lattice(float lattice[4], const struct scene_clouds *clouds, const struct cell_layer *layer, double tile)
{
	const double heading = row_heading(clouds), across = tile / layer->length, along = across / layer->stretch;
	lattice[0] = (float)round(along * sin(heading));
	lattice[1] = (float)round(-along * cos(heading));
	lattice[2] = (float)round(across * cos(heading));
	lattice[3] = (float)round(across * sin(heading));
	if (lattice[0] * lattice[3] - lattice[1] * lattice[2] >= 1)
		return;
	lattice[0] = (float)fmax(1, round(along));
	lattice[3] = (float)fmax(1, round(across));
	lattice[1] = lattice[2] = 0;
}

/* Likewise. */
static void fill_tufts(struct pass_run *run, const struct scene_clouds *clouds, int i, double tile, double scale)
{
	const struct cell_layer *layer = &kinds[clouds->type].layers[i];
	fill_lattice(run->arguments[0], clouds, layer, tile);
	run->arguments[1][0] = (float)run->targets[0]->width;
	run->arguments[1][1] = seed_number(clouds->seed, 40 + (uint32_t)i);
	fill_lives(&run->arguments[1][2], clouds->time_s, layer->life);
	run->arguments[2][0] = (float)(layer->dome * scale);
	run->arguments[2][1] = (float)(layer->roll * scale);
	run->arguments[2][2] = (float)layer->scatter;
	run->arguments[2][3] = (float)layer->spread;
}

static void fill_layer(struct pass_run *run, const struct scene_clouds *clouds, int i, double tile, double scale)
{
	(kinds[clouds->type].layers[i].stretch > 0 ? fill_tufts : fill_cells)(run, clouds, i, tile, scale);
}

static enum field_noise_pass layer_pass(const struct scene_clouds *clouds, int i)
{
	return kinds[clouds->type].layers[i].stretch > 0 ? PASS_TUFTS : PASS_CELLS;
}

/* A tuft needs some points across, a cell with its sharp lanes more. */
static bool layer_fits(const struct cell_layer *layer, double spacing)
{
	return layer->length >= (layer->stretch > 0 ? 4 : 6) * spacing;
}

static int layer_count(const struct scene_clouds *clouds)
{
	int count = 0;
	while (count < LAYERS_MAX && kinds[clouds->type].layers[count].length > 0)
		count++;
	return count;
}

/* How many stand in the field itself; where its points are too far apart for the others, those of its detail are not. */
static int coarse_layer_count(const struct scene_clouds *clouds)
{
	int count = layer_count(clouds);
	while (count > 0 && !layer_fits(&kinds[clouds->type].layers[count - 1], clouds->tile_m / clouds->resolution))
		count--;
	return count;
}

/* Cells upon cells, each layer in as many points as its cells, and the rolls in the last one, need. */
static bool shape_run(const struct field_noise *noise, const struct scene_clouds *clouds, const struct texture *slow, struct texture *shape)
{
	const struct cloud_kind *kind = &kinds[clouds->type];
	const int count = coarse_layer_count(clouds);
	for (int i = 0; i < count; i++) {
		const struct cell_layer *layer = &kind->layers[i];
		const double points =
			7 * fmax(clouds->tile_m / layer->length, i == count - 1 && kind->roll > 0 ? clouds->tile_m / kind->roll_length : 0);
		const int side = side_for(points, clouds->resolution);
		struct texture next;
		if (!texture_init(&next, side, side, TEXTURE_R32F, TEXTURE_REPEAT))
			return false;
		struct pass_run run = {.targets = (struct texture *[]){&next}, .samplers = {slow, shape->id ? shape : slow}};
		fill_layer(&run, clouds, i, clouds->tile_m, 1);
		if (layer->stretch > 0) {
			run.arguments[3][0] = (float)(layer->warp / layer->length);
		} else {
			run.arguments[0][3] = (float)shape->width;
			run.arguments[1][2] = (float)(layer->warp * run.arguments[0][1] / clouds->tile_m);
			run.arguments[1][3] = (float)layer->where;
			if (i == count - 1)
				fill_roll(run.arguments[3], kind, clouds);
		}
		pass_run(noise->passes[layer_pass(clouds, i)], &run);
		texture_finish(shape);
		*shape = next;
	}
	return true;
}

static bool coarse_run(const struct field_noise *noise, struct stage_context *context, const struct scene_clouds *clouds,
		       struct texture *coarse)
{
	const struct cloud_kind *kind = &kinds[clouds->type];
	struct pyramid p = {.noise = noise,
			    .context = context,
			    .clouds = clouds,
			    .tile = clouds->tile_m,
			    .seed = clouds->seed ^ 0x5bd1e995u,
			    .life = kind->life * meso_life,
			    .outer = clouds->tile_m,
			    .fine = 1,
			    .first = LATTICE_FIRST,
			    .last = side_for(clouds->tile_m / 320, clouds->resolution),
			    .format = TEXTURE_RGBA32F};
	struct texture slow = {0}, shape = {0};
	bool ok = texture_init(&slow, p.last, p.last, p.format, TEXTURE_REPEAT) && pyramid_run(&p, NULL, &slow) &&
		  shape_run(noise, clouds, &slow, &shape);
	if (ok) {
		p.seed = clouds->seed ^ 0x2545f491u;
		p.life = kind->life;
		p.scale = kind->turbulence;
		p.outer = kind->outer;
		p.fine = kind->fine;
		p.last = clouds->resolution;
		p.format = TEXTURE_R32F;
		ok = pyramid_run(&p, shape.id ? &shape : &slow, coarse);
	}
	texture_finish(&shape);
	texture_finish(&slow);
	return ok;
}

/* Cells too small for the field, upon what the detail has so far. */
static void detail_cells_run(const struct field_noise *noise, const struct scene_clouds *clouds, int i, const struct texture *before,
			     struct texture *target)
{
	const struct cloud_kind *kind = &kinds[clouds->type];
	/* In the tile of detail that resolves them; finer ones repeat them as smaller ones. */
	double tile = detail_tile(clouds), weight = detail_weight(clouds);
	for (int k = detail_count(clouds); k > 1 && !layer_fits(&kind->layers[i], tile / FIELD_DETAIL_SIDE); k--) {
		tile /= 8;
		weight /= 2;
	}
	/* Where several tiles of detail show the same cells, in several sizes, each does so the less. */
	const double share = detail_count(clouds) > 1 ? 0.5 : 1;
	struct pass_run run = {.targets = (struct texture *[]){target}, .samplers = {before, before}};
	fill_layer(&run, clouds, i, tile, share / weight);
	if (kind->layers[i].stretch > 0)
		run.arguments[3][1] = 0.5f; /* rolls as strong as on average: nothing here says where */
	else
		run.arguments[0][3] = FIELD_DETAIL_SIDE;
	pass_run(noise->passes[layer_pass(clouds, i)], &run);
}

static bool detail_run(const struct field_noise *noise, struct stage_context *context, const struct scene_clouds *clouds,
		       struct texture *detail)
{
	const struct cloud_kind *kind = &kinds[clouds->type];
	const double tile = detail_tile(clouds);
	const struct pyramid p = {.noise = noise,
				  .context = context,
				  .clouds = clouds,
				  .tile = tile,
				  .seed = clouds->seed ^ 0x6c078965u,
				  .life = kind->life,
				  .scale = 1 / octave_scale, /* the block has the weight */
				  .outer = tile / DETAIL_FIRST,
				  .fine = 1,
				  .first = DETAIL_FIRST,
				  .last = FIELD_DETAIL_SIDE,
				  .format = TEXTURE_R32F};
	const int count = layer_count(clouds), coarse = coarse_layer_count(clouds);
	struct texture sum[2] = {{0}, {0}};
	bool ok = true;
	for (int i = 0; ok && i < 2 && i < count - coarse; i++)
		ok = texture_init(&sum[i], FIELD_DETAIL_SIDE, FIELD_DETAIL_SIDE, TEXTURE_R32F, TEXTURE_REPEAT);
	ok = ok && pyramid_run(&p, NULL, count > coarse ? &sum[0] : detail);
	for (int i = coarse; ok && i < count; i++)
		detail_cells_run(noise, clouds, i, &sum[(i - coarse) % 2], i == count - 1 ? detail : &sum[(i - coarse + 1) % 2]);
	texture_finish(&sum[1]);
	texture_finish(&sum[0]);
	return ok;
}

bool field_noise_run(const struct field_noise *noise, struct stage_context *context, const struct scene_clouds *clouds,
		     struct texture *coarse, struct texture *detail)
{
	return coarse_run(noise, context, clouds, coarse) && detail_run(noise, context, clouds, detail);
}
