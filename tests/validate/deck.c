#include "tests/validate/deck.h"

#include "renderer/camera.h"
#include "renderer/embed.h"
#include "renderer/gl/context.h"
#include "renderer/optics/quadrature.h"
#include "renderer/stages/colour.h"
#include "renderer/stages/view.h"

#include <epoxy/gl.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { PICTURE_SIDE = 16, LAYERS = 9, VIEW_NODES = 12, AZIMUTHS = 12, FACE_SIDE = 48, FACES = 5 };

#define DEGREE (M_PI / 180)

const double deck_views[2] = {0, 30};

/* Above the mean top and the puffs on it, and above what grows. */
static const double deck_clearance_m = 25;

/* All that the layer sends to the camera but for what is seen through it; then what is. */
static const enum layer layers[LAYERS] = {LAYER_ORDER0,       LAYER_ORDER1, LAYER_ORDER2, LAYER_MULTIPLE, LAYER_CLOUD_SKY,
					  LAYER_CLOUD_GROUND, LAYER_GROUND, LAYER_AIR,    LAYER_SKY};
enum { OWN_LAYERS = 6, GROUND_LAYER = 6, AIR_LAYER = 7 };

struct deck {
	struct gl_context *gl;
	char folder[64]; /* of shaders, while there are any */
	struct droplet_store *droplets;
	struct stage_context context;
	struct ground_stage ground;
	struct sky_stage sky;
	struct field_stage field;
	struct radiosity_stage radiosity;
	struct view_stage view;
	struct optics *optics;
	struct slab_solution *slab;
};

/* What the stages make of a scene. */
struct made {
	const struct droplets *droplets;
	const struct texture *slab_rows, *slab_slices;
	struct ground_maps ground;
	struct sky_tables sky;
	struct field_maps field;
	struct radiosity_light light;
};

/* --- shaders --------------------------------------------------------------------------------------------------------------------- */

/* What is put behind a text, the beginning of a function or of the file, in decks of kinds up to the last. */
static const struct {
	enum deck_kind last;
	const char *file, *head, *text;
} replacements[] = {
	{DECK_PUFFED, "shaders/lib/field.glsl", "float field_thickness_of(float density, float footprint)\n{\n",
	 "\tif (cloud_layer.y > 0.0)\n\t\treturn cloud_layer.y;\n"},
	{DECK_UNIFORM, "shaders/passes/height_view.glsl", "", "#undef HEIGHT_NEAR\n#define HEIGHT_NEAR 0\n"},
	{DECK_PUFFED, "shaders/lib/ground_paint.glsl", "vec3 ground_sea_ice(vec2 p, float tile)\n{\n",
	 "\tif (tile > 0.0)\n\t\treturn p.x < 0.5 ? ALBEDO_SNOW : ALBEDO_WATER;\n"},
};

static bool write_shader(const struct deck *deck, enum deck_kind kind, const struct embedded_file *file)
{
	char path[512];
	snprintf(path, sizeof path, "%s/%s", deck->folder, strchr(file->name, '/') + 1);
	FILE *out = fopen(path, "w");
	if (!out)
		return false;
	size_t done = 0;
	bool ok = true;
	for (size_t i = 0; i < sizeof replacements / sizeof *replacements; i++) {
		if (kind > replacements[i].last || strcmp(file->name, replacements[i].file) != 0)
			continue;
		const char *at = strstr(file->data, replacements[i].head);
		if (!at) {
			fprintf(stderr, "%s has no longer %s", file->name, replacements[i].head);
			ok = false;
			break;
		}
		done = (size_t)(at - file->data) + strlen(replacements[i].head);
		fwrite(file->data, 1, done, out);
		fputs(replacements[i].text, out);
	}
	fwrite(file->data + done, 1, file->size - done, out);
	return fclose(out) == 0 && ok;
}

static bool write_shaders(struct deck *deck, enum deck_kind kind)
{
	static const char *const folders[] = {"lib", "passes"};
	char path[512];
	strcpy(deck->folder, "/tmp/stratus-deck-XXXXXX");
	bool ok = mkdtemp(deck->folder);
	for (int i = 0; ok && i < 2; i++) {
		snprintf(path, sizeof path, "%s/%s", deck->folder, folders[i]);
		ok = mkdir(path, 0700) == 0;
	}
	for (const struct embedded_file *file = shader_files; ok && file->name; file++)
		ok = write_shader(deck, kind, file);
	return ok;
}

static void remove_shaders(struct deck *deck)
{
	static const char *const folders[] = {"lib", "passes", ""};
	char path[512];
	if (!deck->folder[0])
		return;
	for (const struct embedded_file *file = shader_files; file->name; file++) {
		snprintf(path, sizeof path, "%s/%s", deck->folder, strchr(file->name, '/') + 1);
		unlink(path);
	}
	for (int i = 0; i < 3; i++) {
		snprintf(path, sizeof path, "%s/%s", deck->folder, folders[i]);
		rmdir(path);
	}
}

/* --- life ------------------------------------------------------------------------------------------------------------------------ */

static bool stages_init(struct deck *deck, enum deck_kind kind)
{
	const struct pass_compiler compiler = {.kind = PASS_FRAGMENT, .shader_dir = kind == DECK_AS_IT_IS ? NULL : deck->folder};
	ground_stage_init(&deck->ground, &compiler);
	return (kind == DECK_AS_IT_IS || write_shaders(deck, kind)) && sky_stage_init(&deck->sky, &compiler) &&
	       field_stage_init(&deck->field, &compiler) && radiosity_stage_init(&deck->radiosity, &compiler) &&
	       view_stage_init(&deck->view, &compiler);
}

struct deck *deck_create(const struct kernel *kernel, enum deck_kind kind)
{
	const struct scene_dsd dsd = scene_default().dsd;
	struct deck *deck = calloc(1, sizeof *deck);
	if (!deck)
		return NULL;
	deck->gl = gl_context_create(-1, false);
	deck->droplets = deck->gl ? droplet_store_create(&(struct droplet_store_params){.kernel = kernel}) : NULL;
	deck->context.droplets = deck->droplets;
	deck->context.cache = cache_create(64u << 20);
	deck->optics = optics_create(kernel, &dsd, OPTICS_MIE);
	deck->slab = deck->optics ? slab_solve(deck->optics, 2) : NULL;
	if (!deck->droplets || !deck->context.cache || !deck->slab || !stages_init(deck, kind)) {
		deck_destroy(deck);
		return NULL;
	}
	glCreateBuffers(1, &deck->context.block_buffer);
	glNamedBufferStorage(deck->context.block_buffer, sizeof deck->context.block, NULL, GL_DYNAMIC_STORAGE_BIT);
	return deck;
}

void deck_destroy(struct deck *deck)
{
	if (!deck)
		return;
	if (deck->gl) {
		view_stage_finish(&deck->view);
		radiosity_stage_finish(&deck->radiosity);
		field_stage_finish(&deck->field);
		sky_stage_finish(&deck->sky);
		ground_stage_finish(&deck->ground);
		cache_destroy(deck->context.cache);
		if (deck->context.block_buffer)
			glDeleteBuffers(1, &deck->context.block_buffer);
		gl_context_destroy(deck->gl);
	}
	droplet_store_destroy(deck->droplets);
	slab_destroy(deck->slab);
	optics_destroy(deck->optics);
	remove_shaders(deck);
	free(deck);
}

/* --- pictures -------------------------------------------------------------------------------------------------------------------- */

struct scene deck_scene(const struct deck *deck, double tau, double sun_zenith_deg, double albedo)
{
	struct scene scene = scene_default();
	scene.sun.elevation_deg = 90 - sun_zenith_deg;
	scene.clouds.type = CLOUD_STRATUS;
	scene.clouds.coverage = 1;
	scene.clouds.base_m = 100;
	scene.clouds.thickness_m = tau / deck->optics->extinction_per_m[1];
	scene.clouds.resolution = 64;
	scene.ground.type = GROUND_LAMBERT;
	for (int band = 0; band < BAND_COUNT; band++)
		scene.ground.albedo[band] = albedo;
	scene.atmosphere = (struct scene_atmosphere){0, 0};
	scene.output.width = scene.output.height = PICTURE_SIDE;
	scene.output.format = IMAGE_EXR;
	scene.output.layers = 0;
	for (int i = 0; i < LAYERS; i++)
		scene.output.layers |= 1u << layers[i];
	scene.camera.vertical_fov_deg = 0.5;
	return scene;
}

/* The stages before the view, as renderer.c runs them. */
static bool make(struct deck *deck, const struct scene *scene, struct made *made)
{
	struct stage_context *context = &deck->context;
	double albedo[BAND_COUNT];
	cache_begin_frame(context->cache);
	memset(&context->block, 0, sizeof context->block);
	view_fill_block(&context->block, scene);
	context->block.cloud_layer[0] = (float)scene->clouds.base_m;
	context->block.cloud_layer[1] = (float)scene->clouds.thickness_m;
	context->block.cloud_layer[3] = 1;
	made->droplets = droplets_get(context, scene);
	made->slab_rows = made->droplets ? slab_rows_get(context, scene, made->droplets) : NULL;
	if (!made->slab_rows || !slab_slices_get(context, scene, made->droplets, &made->slab_slices) ||
	    !ground_stage_run(&deck->ground, context, scene, &made->ground))
		return false;
	/* What the air above gets back: ground and deck together. */
	for (int band = 0; band < BAND_COUNT; band++) {
		const double r = slab_spherical_albedo(deck->slab, band, scene->clouds.thickness_m * deck->optics->extinction_per_m[band]),
			     ground = made->ground.mean[band];
		albedo[band] = r + (1 - r) * (1 - r) * ground / (1 - r * ground);
	}
	return sky_stage_run(&deck->sky, context, scene, albedo, &made->sky) &&
	       field_stage_run(&deck->field, context, scene, field_uses(scene), &made->field) &&
	       radiosity_stage_run(&deck->radiosity, context, scene, &made->ground, &made->sky, &made->field, made->slab_rows,
				   &made->light);
}

/* Radiances in the bands out of colour: Cramer's rule. */
static double determinant(const double m[3][3])
{
	return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
	       m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
}

static void bands_of(const double rgb[3], double bands[BAND_COUNT])
{
	double matrix[3][3];
	colour_band_matrix(matrix);
	for (int band = 0; band < BAND_COUNT; band++) {
		double replaced[3][3];
		memcpy(replaced, matrix, sizeof replaced);
		for (int i = 0; i < 3; i++)
			replaced[i][band] = rgb[i];
		bands[band] = determinant(replaced) / determinant(matrix);
	}
}

static void mean_bands(const struct texture *picture, double bands[BAND_COUNT])
{
	static float texels[PICTURE_SIDE * PICTURE_SIDE][4];
	double rgb[3] = {0};
	stage_read_texture(picture, 0, 4, &texels[0][0]);
	for (int i = 0; i < PICTURE_SIDE * PICTURE_SIDE; i++)
		for (int channel = 0; channel < 3; channel++)
			rgb[channel] += (double)texels[i][channel] / (PICTURE_SIDE * PICTURE_SIDE);
	bands_of(rgb, bands);
}

static struct view_inputs inputs_of(const struct made *made)
{
	return (struct view_inputs){.ground = &made->ground,
				    .droplets = made->droplets,
				    .slab_rows = made->slab_rows,
				    .slab_slices = made->slab_slices,
				    .sky = &made->sky,
				    .field = &made->field,
				    .light = &made->light};
}

/* A picture's mean radiances by layer. */
static bool look(struct deck *deck, struct scene scene, double height, double azimuth, double elevation, struct made *made,
		 double bands[LAYERS][BAND_COUNT])
{
	const struct texture *pictures[LAYERS];
	scene.camera.position_m[2] = height;
	scene.camera.azimuth_deg = fmod(azimuth + 720, 360);
	scene.camera.elevation_deg = elevation;
	bool ok = make(deck, &scene, made);
	const struct view_inputs inputs = inputs_of(made);
	if (ok) {
		stage_upload_block(&deck->context);
		ok = view_stage_run(&deck->view, &deck->context, &scene, &inputs, layers, LAYERS, NULL, NULL, pictures);
	}
	for (int i = 0; ok && i < LAYERS; i++)
		mean_bands(pictures[i], bands[i]);
	droplets_release(&deck->context);
	return ok;
}

bool deck_measure(struct deck *deck, const struct scene *scene, struct deck_light *light)
{
	double seen[LAYERS][BAND_COUNT];
	struct made made;
	*light = (struct deck_light){0};
	for (int view = 0; view < 2; view++) {
		if (!look(deck, *scene, scene->clouds.base_m - 1, scene->sun.azimuth_deg + 180, 90 - deck_views[view], &made, seen))
			return false;
		for (int i = 0; i < OWN_LAYERS * BAND_COUNT; i++)
			light->base[view][i % BAND_COUNT] += seen[i / BAND_COUNT][i % BAND_COUNT];
	}
	if (!look(deck, *scene, 1, 0, -90, &made, seen))
		return false;
	const double mu = fmax(0, sin(scene->sun.elevation_deg * DEGREE));
	for (int band = 0; band < BAND_COUNT; band++) {
		light->beam[band] = made.sky.sun_cloud[band] * mu;
		light->sky[band] = made.sky.diffuse_cloud[band];
		light->ground[band] = seen[GROUND_LAYER][band] * M_PI / scene->ground.albedo[band];
	}
	return true;
}

bool deck_measure_leaving(struct deck *deck, const struct scene *scene, double leaving[BAND_COUNT])
{
	double node[VIEW_NODES], weight[VIEW_NODES], seen[LAYERS][BAND_COUNT];
	struct made made;
	quadrature_gauss(VIEW_NODES, node, weight);
	memset(leaving, 0, BAND_COUNT * sizeof *leaving);
	for (int i = 0; i < VIEW_NODES; i++)
		for (int k = 0; k < AZIMUTHS; k++) {
			/* One side of the sun's vertical plane: the other is its mirror image. */
			const double azimuth = scene->sun.azimuth_deg + 180 * (k + 0.5) / AZIMUTHS;
			if (!look(deck, *scene, scene->clouds.base_m + scene->clouds.thickness_m + 1, azimuth, -asin(node[i]) / DEGREE,
				  &made, seen))
				return false;
			for (int layer = 0; layer <= AIR_LAYER; layer++)
				for (int band = 0; band < BAND_COUNT; band++)
					leaving[band] += 2 * M_PI / AZIMUTHS * weight[i] * node[i] * seen[layer][band];
		}
	return true;
}

/* Adds to the irradiance of a horizontal plane from below, in colour, what a picture shows. */
static void add_flux(const struct scene *scene, const struct texture *picture, double rgb[3])
{
	static float texels[FACE_SIDE * FACE_SIDE][4];
	const struct camera_view view = camera_view_of(scene, 0);
	stage_read_texture(picture, 0, 4, &texels[0][0]);
	for (int i = 0; i < FACE_SIDE * FACE_SIDE; i++) {
		const int column = i % FACE_SIDE, row = i / FACE_SIDE;
		double direction[3];
		camera_direction(&view, (double[]){column + 0.5, row + 0.5}, direction);
		const double weight = fmax(0, -direction[2]) * camera_pixel_solid_angle(&view, column, row);
		for (int channel = 0; channel < 3; channel++)
			rgb[channel] += weight * (double)texels[i][channel];
	}
}

/* One side of a cube round the camera: down, and to the four sides. */
static bool look_at_face(struct deck *deck, struct scene scene, int face, enum layer layer, double rgb[3])
{
	const struct texture *picture;
	struct made made;
	scene.camera.elevation_deg = face == 0 ? -90 : 0;
	scene.camera.azimuth_deg = 90 * (face % 4);
	scene.camera.vertical_fov_deg = 90;
	bool ok = make(deck, &scene, &made);
	if (ok) {
		const struct view_inputs inputs = inputs_of(&made);
		stage_upload_block(&deck->context);
		ok = view_stage_run(&deck->view, &deck->context, &scene, &inputs, &layer, 1, NULL, NULL, &picture);
	}
	if (ok)
		add_flux(&scene, picture, rgb);
	droplets_release(&deck->context);
	return ok;
}

/* What comes up at a height, in one layer, as the mean over so many places. */
static bool look_down_around(struct deck *deck, const struct scene *scene, double height, enum layer layer, int places,
			     double flux[BAND_COUNT])
{
	struct scene there = *scene;
	double rgb[3] = {0};
	there.camera.position_m[2] = height;
	there.output.width = there.output.height = FACE_SIDE;
	for (int i = 0; i < places; i++) {
		/* Places that keep apart: multiples of the golden section and of the root of 2. */
		there.camera.position_m[0] = scene->clouds.tile_m * fmod(0.6180340 * i, 1);
		there.camera.position_m[1] = scene->clouds.tile_m * fmod(0.4142136 * i, 1);
		for (int face = 0; face < FACES; face++)
			if (!look_at_face(deck, there, face, layer, rgb))
				return false;
	}
	bands_of(rgb, flux);
	for (int band = 0; band < BAND_COUNT; band++)
		flux[band] /= places;
	return true;
}

bool deck_measure_leaving_around(struct deck *deck, const struct scene *scene, int places, double leaving[BAND_COUNT])
{
	const double height = scene->clouds.base_m + scene->clouds.thickness_m + deck_clearance_m;
	return look_down_around(deck, scene, height, LAYER_COLOR, places, leaving);
}

bool deck_measure_ground(struct deck *deck, const struct scene *scene, int places, double leaving[BAND_COUNT])
{
	return look_down_around(deck, scene, 0.9 * scene->clouds.base_m, LAYER_GROUND, places, leaving);
}

bool deck_measure_luminance(struct deck *deck, const struct scene *scene, const double position_m[3], double azimuth_deg,
			    double elevation_deg, double *luminance)
{
	double seen[LAYERS][BAND_COUNT], sum[BAND_COUNT] = {0};
	struct made made;
	struct scene there = *scene;
	memcpy(there.camera.position_m, position_m, sizeof there.camera.position_m);
	if (!look(deck, there, position_m[2], azimuth_deg, elevation_deg, &made, seen))
		return false;
	for (int layer = 0; layer < LAYERS; layer++)
		for (int band = 0; band < BAND_COUNT; band++)
			sum[band] += seen[layer][band];
	*luminance = colour_luminance(sum);
	return true;
}

bool deck_radiosity(struct deck *deck, const struct scene *scene, struct deck_radiosity *radiosity)
{
	struct made made;
	const bool ok = make(deck, scene, &made);
	droplets_release(&deck->context);
	if (!ok)
		return false;
	radiosity->passes = made.light.passes;
	memcpy(radiosity->residual, made.light.residuals, sizeof radiosity->residual);
	for (int band = 0; band < BAND_COUNT; band++) {
		radiosity->ground_diffuse[band] = made.light.ground_diffuse[band];
		radiosity->ground_direct[band] = made.light.ground_direct[band];
		radiosity->ground_albedo[band] = made.ground.mean[band];
		radiosity->sky_ground[band] = made.sky.diffuse_ground[band];
		radiosity->sun_ground[band] = made.sky.sun_ground[band] * fmax(0, sin(scene->sun.elevation_deg * DEGREE));
	}
	return true;
}

/* --- what it should be ----------------------------------------------------------------------------------------------------------- */

void deck_expect(const struct deck *deck, const struct scene *scene, const struct deck_light *measured, struct deck_light *expected)
{
	const double mu_l = sin(scene->sun.elevation_deg * DEGREE);
	*expected = *measured;
	for (int band = 0; band < BAND_COUNT; band++) {
		const double tau = scene->clouds.thickness_m * deck->optics->extinction_per_m[band], albedo = scene->ground.albedo[band];
		const double back = slab_spherical_albedo(deck->slab, band, tau);
		const double first =
			slab_flux_at(deck->slab, band, tau, mu_l).transmitted * measured->beam[band] + (1 - back) * measured->sky[band];
		expected->ground[band] = first / (1 - albedo * back);
		for (int view = 0; view < 2; view++) {
			const double mu_v = cos(deck_views[view] * DEGREE);
			const struct slab_flux flux = slab_flux_at(deck->slab, band, tau, mu_v);
			/* What delta-M counts as unscattered is seen through the layer, not sent by it. */
			const double through = exp(-tau * (1 - deck->slab->band[band].truncated) / mu_v);
			expected->base[view][band] =
				measured->beam[band] / mu_l *
					slab_radiance(deck->slab, deck->optics, band, SLAB_TRANSMITTED, tau, mu_l, mu_v, M_PI) +
				measured->sky[band] / M_PI * (flux.transmitted - through) +
				albedo * expected->ground[band] / M_PI * flux.reflected;
		}
	}
}
