/* What the tests of whole pictures share: one renderer per program, rendering to float layers, and looking values up.
 *
 * Wants build/mie.kernel, or the file that STRATUS_KERNEL names. Programs end with 77 (skipped) where no OpenGL context comes up.
 */
#ifndef STRATUS_TESTS_RENDERER_COMMON_H
#define STRATUS_TESTS_RENDERER_COMMON_H

#include "renderer/log.h"
#include "renderer/optics/kernel.h"
#include "renderer/renderer.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#define DEGREE      (M_PI / 180)
#define LAYER(name) (1u << LAYER_##name)

static struct renderer *renderer;
static struct kernel *kernel;
static struct droplet_store *droplets;

static inline struct renderer *create_renderer(size_t cache_bytes)
{
	const struct renderer_params params = {
		.device_index = -1, .pass_kind = PASS_FRAGMENT, .droplets = droplets, .cache_bytes = cache_bytes};
	return renderer_create(&params);
}

/* Exit status of the program. */
static inline int run_with_renderer(const struct CMUnitTest *tests, size_t count)
{
	const char *path = getenv("STRATUS_KERNEL");
	kernel = kernel_load(path ? path : "build/mie.kernel");
	if (!kernel)
		return 1;
	log_set_level(LOG_ERROR);
	droplets = droplet_store_create(&(struct droplet_store_params){.kernel = kernel});
	renderer = droplets ? create_renderer(0) : NULL;
	const int failed = renderer ? _cmocka_run_group_tests("tests", tests, count, NULL, NULL) : 77;
	renderer_destroy(renderer);
	droplet_store_destroy(droplets);
	kernel_destroy(kernel);
	return failed;
}
#define RUN_WITH_RENDERER(tests) run_with_renderer(tests, sizeof(tests) / sizeof *(tests))

/* The default scene as a small picture of float layers. */
static inline struct scene small_scene(int width, int height, uint32_t layers)
{
	struct scene scene = scene_default();
	scene.output.width = width;
	scene.output.height = height;
	scene.output.format = IMAGE_EXR;
	scene.output.layers = layers;
	return scene;
}

static inline struct frame render(const struct scene *scene)
{
	struct frame frame;
	assert_int_equal(renderer_render(renderer, scene, NULL, NULL, &frame), RENDER_OK);
	return frame;
}

/* Red, green and blue of a pixel of a float layer. */
static inline const float *pixel_of(const struct frame *frame, enum layer layer, int x, int y)
{
	for (int i = 0; i < frame->layer_count; i++)
		if (frame->layer[i] == layer)
			return (const float *)frame->pixels +
			       3 * (((size_t)i * (size_t)frame->height + (size_t)y) * (size_t)frame->width + (size_t)x);
	fail_msg("no layer %s", scene_layer_names[layer]);
	return NULL;
}

static inline double luminance_of(const struct frame *frame, enum layer layer, int x, int y)
{
	const float *rgb = pixel_of(frame, layer, x, y);
	return 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
}

static inline void direction_of(double azimuth_deg, double elevation_deg, double direction[3])
{
	direction[0] = cos(elevation_deg * DEGREE) * sin(azimuth_deg * DEGREE);
	direction[1] = cos(elevation_deg * DEGREE) * cos(azimuth_deg * DEGREE);
	direction[2] = sin(elevation_deg * DEGREE);
}

static inline double dot3(const double a[3], const double b[3])
{
	return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Camera axes from angles alone, written independently of renderer/stages/view.c: the picture's up is the zenith's side, turned
 * anticlockwise by the roll. */
static inline void camera_axes(const struct scene_camera *camera, double forward[3], double right[3], double up[3])
{
	double level_up[3], level_right[3];
	direction_of(camera->azimuth_deg, camera->elevation_deg, forward);
	direction_of(camera->azimuth_deg, camera->elevation_deg + 90, level_up);
	direction_of(camera->azimuth_deg + 90, 0, level_right);
	const double c = cos(camera->roll_deg * DEGREE), s = sin(camera->roll_deg * DEGREE);
	for (int i = 0; i < 3; i++) {
		right[i] = c * level_right[i] + s * level_up[i];
		up[i] = c * level_up[i] - s * level_right[i];
	}
}

/* Where a direction appears, in pixels from the upper left corner (centres at halves). false behind the camera. */
static inline bool project(const struct scene *scene, const double direction[3], double at[2])
{
	double forward[3], right[3], up[3];
	camera_axes(&scene->camera, forward, right, up);
	const double depth = dot3(direction, forward);
	const double half = 0.5 * scene->output.height / tan(0.5 * scene->camera.vertical_fov_deg * DEGREE);
	at[0] = 0.5 * scene->output.width + half * dot3(direction, right) / depth;
	at[1] = 0.5 * scene->output.height - half * dot3(direction, up) / depth;
	return depth > 0;
}

/* Direction seen by the centre of a pixel. */
static inline void ray_of(const struct scene *scene, int x, int y, double direction[3])
{
	double forward[3], right[3], up[3];
	camera_axes(&scene->camera, forward, right, up);
	const double scale = 2 * tan(0.5 * scene->camera.vertical_fov_deg * DEGREE) / scene->output.height;
	const double across = scale * (x + 0.5 - 0.5 * scene->output.width), above = scale * (0.5 * scene->output.height - y - 0.5);
	double length = 0;
	for (int i = 0; i < 3; i++) {
		direction[i] = forward[i] + across * right[i] + above * up[i];
		length += direction[i] * direction[i];
	}
	for (int i = 0; i < 3; i++)
		direction[i] /= sqrt(length);
}

#endif
