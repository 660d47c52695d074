/* Panoramas as measurements: the cosine integral of a picture of the whole sky is the global illuminance that its header says, whatever the
 * projection and however few its pixels. */
#include "tests/unit/test_renderer_common.h"

#include "renderer/camera.h"

enum { SIZE_COUNT = 5 };
static const int sizes[SIZE_COUNT] = {64, 96, 128, 512, 2048};

/* Horizontal illuminance by a layer. */
static double lux_of(const struct scene *scene, const struct frame *frame, enum layer layer)
{
	double lux = 0;
	for (int i = 0; i < camera_view_count(scene); i++) {
		const struct camera_view view = camera_view_of(scene, i);
		for (int row = view.first_row; row < view.first_row + view.height; row++)
			for (int column = 0; column < view.width; column++) {
				double direction[3];
				if (camera_direction(&view, (double[]){column + 0.5, row + 0.5}, direction))
					lux += 1000 * luminance_of(frame, layer, column, row) * fmax(0, direction[2]) *
					       camera_pixel_solid_angle(&view, column, row);
			}
	}
	return lux;
}

/* A whole sky of so many pixels round the horizon, or across. */
static struct scene panorama(enum projection projection, int size, uint32_t layers)
{
	struct scene scene = small_scene(size, size, layers);
	scene.camera.projection = projection;
	if (projection == PROJECTION_EQUIRECTANGULAR)
		scene.output.height = size / 2;
	if (projection == PROJECTION_CUBEMAP) {
		scene.camera.face = FACE_ALL;
		scene.output.width = size / 4;
		scene.output.height = 6 * (size / 4);
	}
	return scene;
}

/* What the picture shows too much, relative to its header. */
static double excess_of(const struct scene *scene)
{
	struct frame frame = render(scene);
	const double lux = lux_of(scene, &frame, LAYER_COLOR), said = frame.global_illuminance_lux;
	frame_finish(&frame);
	return lux / said - 1;
}

static const enum projection projections[] = {PROJECTION_EQUIRECTANGULAR, PROJECTION_FISHEYE, PROJECTION_CUBEMAP};

static void skies_add_up_in_every_size(void **state)
{
	(void)state;
	static const double elevations[] = {60, 20, 3, -3}, covers[] = {0, 0.5, 1};
	for (int p = 0; p < 3; p++)
		for (int sky = 0; sky < 12; sky++) {
			print_message("%-15s cover %.1f, sun at %2.0f:", scene_projection_names[projections[p]], covers[sky / 4],
				      elevations[sky % 4]);
			/* The largest once a projection: what is wrong with small pictures is found with them. */
			for (int i = 0; i < (sky == 5 ? SIZE_COUNT : SIZE_COUNT - 1); i++) {
				struct scene scene = panorama(projections[p], sizes[i], LAYER(COLOR));
				scene.sun.elevation_deg = elevations[sky % 4];
				scene.clouds.coverage = covers[sky / 4];
				if (sky < 4)
					scene.clouds.type = CLOUD_NONE;
				const double excess = excess_of(&scene);
				print_message("  %d %+.2f %%", sizes[i], 100 * excess);
				assert_float_equal(excess, 0, 0.01);
			}
			print_message("\n");
		}
}

/* The finest clouds, and what has the steepest edges. */
static void clouds_of_all_types_add_up(void **state)
{
	(void)state;
	static const struct {
		enum cloud_type type;
		double base_m, thickness_m, coverage, elevation_deg;
	} skies[] = {{CLOUD_STRATUS, 500, 300, 0.65, 13},      {CLOUD_STRATOCUMULUS, 1000, 500, 0.33, 12},
		     {CLOUD_ALTOCUMULUS, 4000, 200, 0.56, 18}, {CLOUD_CIRROCUMULUS, 8000, 200, 0.94, 32},
		     {CLOUD_CIRROCUMULUS, 8000, 200, 0.8, 13}, {CLOUD_ALTOCUMULUS, 4000, 200, 0.5, -4}};
	for (size_t i = 0; i < sizeof skies / sizeof *skies; i++)
		for (int p = 0; p < 3; p++) {
			print_message("%-14s %-15s", scene_cloud_type_names[skies[i].type], scene_projection_names[projections[p]]);
			for (int size = 64; size <= 1024; size *= 4) {
				struct scene scene = panorama(projections[p], size, LAYER(COLOR));
				scene.clouds.type = skies[i].type;
				scene.clouds.base_m = skies[i].base_m;
				scene.clouds.thickness_m = skies[i].thickness_m;
				scene.clouds.coverage = skies[i].coverage;
				scene.clouds.seed = (uint32_t)i;
				scene.sun.elevation_deg = skies[i].elevation_deg;
				const double excess = excess_of(&scene);
				print_message("  %d %+.2f %%", size, 100 * excess);
				assert_float_equal(excess, 0, 0.01);
			}
			print_message("\n");
		}
}

/* Of pixels that several rays make: the layers add up, the disc is all there, and distances are of what is met. */
static void layers_of_coarse_pixels_add_up(void **state)
{
	(void)state;
	struct scene scene = panorama(PROJECTION_EQUIRECTANGULAR, 96,
				      LAYER(COLOR) | LAYER(SUN_DIRECT) | LAYER(ORDER0) | LAYER(ORDER1) | LAYER(ORDER2) | LAYER(MULTIPLE) |
					      LAYER(CLOUD_SKY) | LAYER(CLOUD_GROUND) | LAYER(SKY) | LAYER(GROUND) | LAYER(AIR) |
					      LAYER(DISTANCE) | LAYER(TRANSMITTANCE));
	scene.clouds.coverage = 0.4;
	struct frame frame = render(&scene);
	assert_true(frame.direct_illuminance_lux > 0);
	assert_float_equal(lux_of(&scene, &frame, LAYER_SUN_DIRECT) / frame.direct_illuminance_lux, 1, 0.01);
	double sum = 0;
	for (int layer = LAYER_SUN_DIRECT; layer <= LAYER_AIR; layer++)
		sum += lux_of(&scene, &frame, (enum layer)layer);
	assert_float_equal(sum / lux_of(&scene, &frame, LAYER_COLOR), 1, 1e-4);
	for (int y = 0; y < scene.output.height / 2 - 1; y++)
		for (int x = 0; x < scene.output.width; x++) {
			const double distance = (double)*pixel_of(&frame, LAYER_DISTANCE, x, y);
			assert_true(distance == 0 || distance > 0.99 * (scene.clouds.base_m - scene.camera.position_m[2]));
		}
	frame_finish(&frame);
	scene.model.paths &= ~1u; /* without the sun's disc */
	frame = render(&scene);
	assert_true(lux_of(&scene, &frame, LAYER_SUN_DIRECT) == 0);
	frame_finish(&frame);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(skies_add_up_in_every_size),
		cmocka_unit_test(clouds_of_all_types_add_up),
		cmocka_unit_test(layers_of_coarse_pixels_add_up),
	};
	return RUN_WITH_RENDERER(tests);
}
