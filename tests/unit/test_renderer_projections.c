/* Whole pictures in every projection: where the sun stands, how much light it sends, what neighbours across seams show, and integrals over
 * the sky. The projections are written down here once more, from their definitions. */
#include "tests/unit/test_renderer_common.h"

/* Direction seen by the centre of a pixel and the solid angle that users take for it: the stretch at the centre times the pixel's area.
 * false beyond the fisheye's circle. */
static bool panorama_ray(const struct scene *scene, int column, int row, double direction[3], double *solid_angle)
{
	const int width = scene->output.width, height = scene->output.height;
	if (scene->camera.projection == PROJECTION_EQUIRECTANGULAR) {
		const double step = M_PI / height, elevation = 0.5 * M_PI - (row + 0.5) * step;
		direction_of((column + 0.5) * 360 / width, elevation / DEGREE, direction);
		*solid_angle = step * step * cos(elevation);
		return true;
	}
	if (scene->camera.projection == PROJECTION_FISHEYE) {
		const double x = column + 0.5 - 0.5 * width, y = row + 0.5 - 0.5 * height, step = M_PI / width;
		const double zenith = step * hypot(x, y);
		direction_of(atan2(-x, -y) / DEGREE, 90 - zenith / DEGREE, direction);
		*solid_angle = step * step * (zenith > 0 ? sin(zenith) / zenith : 1);
		return zenith <= 0.5 * M_PI;
	}
	/* East, up, south of each point of the faces at distance 1; a and b run right and down from the middle. */
	const double a = 2 * (column + 0.5) / width - 1, b = 2 * (row % width + 0.5) / width - 1;
	const double faces[6][3] = {{1, -b, a}, {-1, -b, -a}, {a, 1, -b}, {a, -1, b}, {-a, -b, 1}, {a, -b, -1}};
	const double *file = faces[scene->camera.face == FACE_ALL ? (unsigned)(row / width) : scene->camera.face];
	const double square = 1 + a * a + b * b;
	direction[0] = file[0] / sqrt(square);
	direction[1] = -file[2] / sqrt(square);
	direction[2] = file[1] / sqrt(square);
	*solid_angle = 4.0 / width / width / (square * sqrt(square));
	return true;
}

static struct scene panorama(enum projection projection, int width, uint32_t layers)
{
	struct scene scene = small_scene(width, width, layers);
	scene.camera.projection = projection;
	if (projection == PROJECTION_EQUIRECTANGULAR)
		scene.output.height = width / 2;
	if (projection == PROJECTION_CUBEMAP)
		scene.output.height = 6 * width;
	return scene;
}

static struct scene clear_panorama(enum projection projection, int width, double azimuth, double elevation, uint32_t layers)
{
	struct scene scene = panorama(projection, width, layers);
	scene.clouds.type = CLOUD_NONE;
	scene.sun.azimuth_deg = azimuth;
	scene.sun.elevation_deg = elevation;
	return scene;
}

/* Luminance over solid angle, weighted by the cosine to the vertical when asked, of what lies above the horizon; in lux. */
static double integral_of(const struct scene *scene, const struct frame *frame, enum layer layer, bool cosine)
{
	double sum = 0, direction[3], solid_angle;
	for (int y = 0; y < frame->height; y++)
		for (int x = 0; x < frame->width; x++)
			if (panorama_ray(scene, x, y, direction, &solid_angle) && (!cosine || direction[2] > 0))
				sum += 1000 * luminance_of(frame, layer, x, y) * solid_angle * (cosine ? direction[2] : 1);
	return sum;
}

/* --- the sun ------------------------------------------------------------------------------------------------------------------------ */

static const double suns[][2] = {{0, 30}, {45, 35.2644}, {90, 45}, {123, 12}, {200, 3}, {270, 60}, {359.9, 1}, {140, 89.8}, {225, 20}};
enum { SUNS = sizeof suns / sizeof *suns };

static void sun_stands_on_its_pixel(void **state)
{
	(void)state;
	for (int projection = PROJECTION_FISHEYE; projection < PROJECTION_COUNT; projection++)
		for (int i = 0; i < SUNS; i++) {
			const struct scene scene =
				clear_panorama(projection, 128, suns[i][0], suns[i][1], LAYER(SUN_DIRECT) | LAYER(COLOR));
			struct frame frame = render(&scene);
			double sun[3], sum[3] = {0}, brightest = 0, at[3] = {0}, solid_angle, ray[3], light = 0;
			direction_of(suns[i][0], suns[i][1], sun);
			for (int y = 0; y < frame.height; y++)
				for (int x = 0; x < frame.width; x++) {
					if (!panorama_ray(&scene, x, y, ray, &solid_angle))
						continue;
					const double direct = luminance_of(&frame, LAYER_SUN_DIRECT, x, y) * solid_angle;
					light += direct;
					for (int k = 0; k < 3; k++)
						sum[k] += direct * ray[k];
					if (luminance_of(&frame, LAYER_COLOR, x, y) > brightest) {
						brightest = luminance_of(&frame, LAYER_COLOR, x, y);
						memcpy(at, ray, sizeof at);
					}
				}
			/* Half a pixel of the coarsest, in both directions. */
			const double pixel = (projection == PROJECTION_CUBEMAP   ? 2.0
					      : projection == PROJECTION_FISHEYE ? M_PI
										 : 2 * M_PI) /
					     128;
			double off = 0, far = 0;
			for (int k = 0; k < 3; k++) {
				off += pow(sum[k] / light - sun[k], 2);
				far += pow(at[k] - sun[k], 2);
			}
			assert_true(light > 0);
			if (!(sqrt(off) < 0.71 * pixel && sqrt(far) < 0.71 * pixel + 0.005))
				fail_msg("%s, sun at %g, %g: light is %.2f, the brightest pixel %.2f pixels away",
					 scene_projection_names[projection], suns[i][0], suns[i][1], sqrt(off) / pixel, sqrt(far) / pixel);
			frame_finish(&frame);
		}
}

static void sun_sends_the_whole_beam(void **state)
{
	(void)state;
	static const int widths[PROJECTION_COUNT][3] = {
		[PROJECTION_FISHEYE] = {16, 50, 256}, [PROJECTION_EQUIRECTANGULAR] = {32, 70, 512}, [PROJECTION_CUBEMAP] = {16, 37, 128}};
	for (int projection = PROJECTION_FISHEYE; projection < PROJECTION_COUNT; projection++) {
		double worst = 0;
		for (int i = 0; i < SUNS * 3; i++) {
			const int width = widths[projection][i / SUNS];
			const double azimuth = suns[i % SUNS][0], elevation = suns[i % SUNS][1];
			const struct scene scene = clear_panorama(projection, width, azimuth, elevation, LAYER(SUN_DIRECT));
			struct frame frame = render(&scene);
			const double beam = frame.direct_illuminance_lux / sin(elevation * DEGREE);
			const double ratio = integral_of(&scene, &frame, LAYER_SUN_DIRECT, false) / beam;
			worst = fmax(worst, fabs(ratio - 1));
			if (!(fabs(ratio - 1) < 0.01))
				fail_msg("%s, %d wide, sun at %g, %g: %.4f of the beam", scene_projection_names[projection], width, azimuth,
					 elevation, ratio);
			frame_finish(&frame);
		}
		print_message("%s: the disc holds the beam within %.3f %%\n", scene_projection_names[projection], 100 * worst);
	}
}

/* Perspectives from where the disc is a small part of a pixel to where it fills the picture's height, and far off the middle of a wide one,
 * where pixels are long. */
static void sun_sends_the_whole_beam_through_lenses(void **state)
{
	(void)state;
	static const struct {
		double fov, off;
		int size;
	} cases[] = {{150, 0, 16},  {150, 60, 64}, {60, 20, 48}, {12, 3, 200},    {2, 0, 64},
		     {2, 0.4, 200}, {1, 0, 400},   {4, 1, 600},  {150, 72, 1500}, {5, 1, 300}};
	for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
		const int size = cases[i].size;
		struct scene scene = small_scene(size, size, LAYER(SUN_DIRECT));
		scene.clouds.type = CLOUD_NONE;
		scene.sun.elevation_deg = 15;
		scene.camera.elevation_deg = 15 + cases[i].off;
		scene.camera.vertical_fov_deg = cases[i].fov;
		scene.camera.roll_deg = 30;
		struct frame frame = render(&scene);
		const double step = 2 * tan(0.5 * cases[i].fov * DEGREE) / size;
		double lux = 0;
		for (int y = 0; y < size; y++)
			for (int x = 0; x < size; x++) {
				const double u = step * (x + 0.5 - size / 2.0), v = step * (y + 0.5 - size / 2.0);
				/* Of coarse pixels the whole, from corner to corner. */
				const double u2[2] = {u - 0.5 * step, u + 0.5 * step}, v2[2] = {v - 0.5 * step, v + 0.5 * step};
				double omega = 0;
				for (int k = 0; k < 4; k++) {
					const double a = u2[k & 1], b = v2[k >> 1];
					omega += (k == 0 || k == 3 ? 1 : -1) * atan(a * b / sqrt(1 + a * a + b * b));
				}
				lux += 1000 * luminance_of(&frame, LAYER_SUN_DIRECT, x, y) * omega;
			}
		const double ratio = lux / (frame.direct_illuminance_lux / sin(15 * DEGREE));
		print_message("field of view %g, %d pixels, sun %g deg off the middle: %.4f of the beam\n", cases[i].fov, size,
			      cases[i].off, ratio);
		assert_float_equal(ratio, 1, 0.01);
		frame_finish(&frame);
	}
}

/* --- seams -------------------------------------------------------------------------------------------------------------------------- */

/* How much neighbours differ, relatively, so that the few pixels around the sun do not outweigh the rest. */
struct steps {
	double across, inside;
	int count;
};

static double step_of(double a, double b)
{
	return fabs(a - b) / fmax(fabs(a) + fabs(b), 1e-12);
}

static void add_step(struct steps *steps, double inner_a, double a, double b, double inner_b)
{
	steps->across += step_of(a, b);
	steps->inside += 0.5 * (step_of(a, inner_a) + step_of(b, inner_b));
	steps->count++;
}

static void assert_no_seam(const struct steps *steps, const char *what)
{
	print_message("%s: steps of %.4f across, %.4f beside, over %d pairs\n", what, steps->across / steps->count,
		      steps->inside / steps->count, steps->count);
	assert_true(steps->across <= 1.4 * steps->inside + 1e-4 * steps->count);
}

/* Pixel of a stacked cubemap that sees a direction. */
static void cube_pixel(int size, const double direction[3], int *column, int *row)
{
	const double file[3] = {direction[0], direction[2], -direction[1]};
	int axis = 0;
	for (int i = 1; i < 3; i++)
		axis = fabs(file[i]) > fabs(file[axis]) ? i : axis;
	const int face = 2 * axis + (file[axis] < 0);
	const double depth = fabs(file[axis]), sign = file[axis] < 0 ? -1 : 1;
	const double x = file[0] / depth, y = file[1] / depth, z = file[2] / depth;
	const double a = axis == 0 ? sign * z : axis == 1 ? x : -sign * x, b = axis == 1 ? -sign * z : -y;
	*column = (int)fmin(fmax(0.5 * (1 + a) * size, 0), size - 1);
	*row = face * size + (int)fmin(fmax(0.5 * (1 + b) * size, 0), size - 1);
}

/* Each border pixel of a face beside the one that lies beyond the edge, on another face. */
static void faces_meet(const struct scene *scene, const char *what)
{
	struct frame frame = render(scene);
	const int size = scene->output.width;
	struct steps steps = {0};
	for (int i = 0; i < 6 * 4 * size; i++) {
		const int face = i / (4 * size), edge = i / size % 4, along = i % size;
		const int columns[4] = {0, size - 1, along, along}, rows[4] = {along, along, 0, size - 1};
		const int column = columns[edge], row = face * size + rows[edge];
		const int inner_column = column + (edge == 0) - (edge == 1), inner_row = row + (edge == 2) - (edge == 3);
		/* The neighbour's direction is as far beyond the edge as this pixel's is before it. */
		double here[3], inner[3], beyond[3], further[3], solid_angle;
		panorama_ray(scene, column, row, here, &solid_angle);
		panorama_ray(scene, inner_column, inner_row, inner, &solid_angle);
		for (int k = 0; k < 3; k++) {
			beyond[k] = here[k] + (here[k] - inner[k]);
			further[k] = here[k] + 2 * (here[k] - inner[k]);
		}
		int x, y, x2, y2;
		cube_pixel(size, beyond, &x, &y);
		cube_pixel(size, further, &x2, &y2);
		assert_int_not_equal(y / size, face);
		const double light[4] = {luminance_of(&frame, LAYER_COLOR, inner_column, inner_row),
					 luminance_of(&frame, LAYER_COLOR, column, row), luminance_of(&frame, LAYER_COLOR, x, y),
					 luminance_of(&frame, LAYER_COLOR, x2, y2)};
		add_step(&steps, light[0], light[1], light[2], light[3]);
	}
	assert_no_seam(&steps, what);
	frame_finish(&frame);
}

static void faces_meet_at_their_edges(void **state)
{
	(void)state;
	struct scene scene = clear_panorama(PROJECTION_CUBEMAP, 64, 140, 35, LAYER(COLOR));
	faces_meet(&scene, "cubemap, clear");
	scene = panorama(PROJECTION_CUBEMAP, 128, LAYER(COLOR));
	faces_meet(&scene, "cubemap, clouds");
	scene.sun.elevation_deg = 4;
	faces_meet(&scene, "cubemap, clouds and a low sun");
	scene.camera.position_m[2] = 4000;
	scene.sun.elevation_deg = 25;
	faces_meet(&scene, "cubemap, above clouds");
}

static void faces_are_those_of_the_whole(void **state)
{
	(void)state;
	enum { SIZE = 48 };
	const uint32_t layers = LAYER(COLOR) | LAYER(SUN_DIRECT) | LAYER(AIR);
	struct scene scene = panorama(PROJECTION_CUBEMAP, SIZE, layers);
	struct frame whole = render(&scene);
	scene.output.height = SIZE;
	for (int face = 0; face < FACE_ALL; face++) {
		scene.camera.face = (enum cube_face)face;
		struct frame alone = render(&scene);
		assert_true(alone.exposure_ev == whole.exposure_ev);
		for (int layer = 0; layer < LAYER_COUNT; layer++)
			if (layers & 1u << layer)
				assert_memory_equal(pixel_of(&alone, layer, 0, 0), pixel_of(&whole, layer, 0, face * SIZE),
						    SIZE * SIZE * 3 * sizeof(float));
		frame_finish(&alone);
	}
	frame_finish(&whole);
}

static void equirectangular_wraps(void **state)
{
	(void)state;
	for (int i = 0; i < 4; i++) {
		struct scene scene = panorama(PROJECTION_EQUIRECTANGULAR, 512, LAYER(COLOR) | LAYER(SUN_DIRECT));
		struct steps steps = {0};
		scene.sun.azimuth_deg = i & 1 ? 15 : 140;
		scene.sun.elevation_deg = i & 1 ? 9 : 40;
		scene.camera.position_m[2] = i & 2 ? 3500 : 2;
		struct frame frame = render(&scene);
		const int last = frame.width - 1;
		for (int y = 0; y < frame.height; y++) {
			const int columns[4] = {last - 1, last, 0, 1};
			double light[4];
			/* Not the disc itself, whose pixels differ a thousandfold. */
			for (int k = 0; k < 4; k++)
				light[k] = luminance_of(&frame, LAYER_COLOR, columns[k], y) -
					   luminance_of(&frame, LAYER_SUN_DIRECT, columns[k], y);
			add_step(&steps, light[0], light[1], light[2], light[3]);
		}
		assert_no_seam(&steps, "equirectangular wrap");
		frame_finish(&frame);
	}
}

/* The same directions through different projections: panoramas beside the perspective that looks there. */
static void projections_show_the_same(void **state)
{
	(void)state;
	struct scene wide = panorama(PROJECTION_EQUIRECTANGULAR, 1024, LAYER(SKY) | LAYER(OPTICAL_THICKNESS));
	struct scene round = panorama(PROJECTION_FISHEYE, 512, LAYER(SKY) | LAYER(OPTICAL_THICKNESS));
	wide.clouds.type = round.clouds.type = CLOUD_NONE;
	struct frame across = render(&wide), fisheye = render(&round);
	for (int i = 0; i < 2000; i++) {
		const int x = i * 7919 % 512, y = i * 104729 % 512;
		double ray[3], solid_angle;
		if (!panorama_ray(&round, x, y, ray, &solid_angle) || ray[2] < 0.1 || ray[2] > 0.99)
			continue;
		const double azimuth = atan2(ray[0], ray[1]) / (2 * M_PI);
		const int column = (int)(1024 * (azimuth < 0 ? azimuth + 1 : azimuth)), row = (int)(512 * (0.5 - asin(ray[2]) / M_PI));
		const double a = luminance_of(&fisheye, LAYER_SKY, x, y), b = luminance_of(&across, LAYER_SKY, column, row);
		if (fabs(a / b - 1) > 0.06)
			fail_msg("towards %g, %g, %g: fisheye %g, equirectangular %g", ray[0], ray[1], ray[2], a, b);
	}
	frame_finish(&fisheye);
	frame_finish(&across);
}

static void fisheye_is_black_outside(void **state)
{
	(void)state;
	struct scene scene = panorama(PROJECTION_FISHEYE, 65, (1u << LAYER_COUNT) - 1);
	scene.sun.azimuth_deg = 90;
	struct frame frame = render(&scene);
	double east = 0, west = 0, ray[3], solid_angle;
	for (int layer = 0; layer < LAYER_COUNT; layer++)
		for (int y = 0; y < 65; y++)
			for (int x = 0; x < 65; x++) {
				const float *rgb = pixel_of(&frame, (enum layer)layer, x, y);
				if (panorama_ray(&scene, x, y, ray, &solid_angle))
					continue;
				assert_true(rgb[0] == 0 && rgb[1] == 0 && rgb[2] == 0);
			}
	for (int y = 0; y < 65; y++)
		for (int x = 0; x < 32; x++) {
			east += luminance_of(&frame, LAYER_COLOR, x, y);
			west += luminance_of(&frame, LAYER_COLOR, 64 - x, y);
		}
	assert_true(east > 1.3 * west);
	frame_finish(&frame);
}

/* Share of a pixel inside the circle, by a grid of points. */
static double share_inside(int side, int column, int row)
{
	enum { STEPS = 16 };
	int inside = 0;
	for (int i = 0; i < STEPS * STEPS; i++)
		inside += hypot(column + (i % STEPS + 0.5) / STEPS - 0.5 * side, row + (i / STEPS + 0.5) / STEPS - 0.5 * side) < 0.5 * side;
	return (double)inside / (STEPS * STEPS);
}

/* Linear light of a pixel of a PNG. */
static double light_of_codes(const struct frame *frame, int column, int row)
{
	const unsigned char *rgb = (const unsigned char *)frame->pixels + 3 * ((size_t)row * (size_t)frame->width + (size_t)column);
	const double x = rgb[1] / 255.0;
	return x <= 0.04045 ? x / 12.92 : pow((x + 0.055) / 1.055, 2.4);
}

/* Developed pictures end with the circle, not with the last pixel whose middle it holds: no stairs. */
static void fisheye_ends_softly(void **state)
{
	(void)state;
	enum { SIDE = 200 };
	struct scene scene = panorama(PROJECTION_FISHEYE, SIDE, LAYER(COLOR));
	scene.clouds.type = CLOUD_STRATUS;
	scene.clouds.coverage = 1;
	scene.output.format = IMAGE_PNG;
	scene.output.bits = 8;
	struct frame frame = render(&scene);
	double worst = 0;
	for (int row = 0; row < SIDE; row++)
		for (int column = 0; column < SIDE; column++) {
			const double x = column + 0.5 - 0.5 * SIDE, y = row + 0.5 - 0.5 * SIDE, from_middle = hypot(x, y);
			const double inwards = 1 - 3 / from_middle, share = share_inside(SIDE, column, row);
			if (fabs(from_middle - 0.5 * SIDE) > 2)
				continue;
			const double beside = light_of_codes(&frame, (int)(0.5 * SIDE + inwards * x), (int)(0.5 * SIDE + inwards * y));
			worst = fmax(worst, fabs(light_of_codes(&frame, column, row) / beside - share));
		}
	frame_finish(&frame);
	print_message("light at the rim over that beside it is the share inside within %.3f\n", worst);
	assert_true(worst < 0.15);
}

/* --- integrals ---------------------------------------------------------------------------------------------------------------------- */

/* A horizontal plane under a clear sky: the panorama's cosine integral beside the figures of the frame, which the sky stage integrated by
 * rays of its own. */
static void panorama_holds_the_illuminance(void **state)
{
	(void)state;
	for (double elevation = 4; elevation < 90; elevation += 17) {
		const struct scene scene = clear_panorama(PROJECTION_EQUIRECTANGULAR, 512, 77, elevation, LAYER(COLOR) | LAYER(SUN_DIRECT));
		struct frame frame = render(&scene);
		const double direct = integral_of(&scene, &frame, LAYER_SUN_DIRECT, true);
		const double global = integral_of(&scene, &frame, LAYER_COLOR, true);
		print_message("sun at %g deg: direct %.4f, diffuse %.4f, global %.4f of the figures\n", elevation,
			      direct / frame.direct_illuminance_lux, (global - direct) / frame.diffuse_illuminance_lux,
			      global / frame.global_illuminance_lux);
		assert_float_equal(direct / frame.direct_illuminance_lux, 1, 0.01);
		assert_float_equal(global / frame.global_illuminance_lux, 1, 0.01);
		frame_finish(&frame);
	}
}

/* With clouds: three ways of cutting the sky into pixels. */
static void panoramas_agree_about_the_light(void **state)
{
	(void)state;
	static const int widths[PROJECTION_COUNT] = {0, 512, 1024, 256};
	double lux[PROJECTION_COUNT], exposure[PROJECTION_COUNT];
	for (int projection = PROJECTION_FISHEYE; projection < PROJECTION_COUNT; projection++) {
		struct scene scene = panorama(projection, widths[projection], LAYER(COLOR) | LAYER(SUN_DIRECT));
		struct frame frame = render(&scene);
		/* The thin clouds before the disc differ from pixel to pixel: diffuse light alone. */
		lux[projection] = integral_of(&scene, &frame, LAYER_COLOR, true) - integral_of(&scene, &frame, LAYER_SUN_DIRECT, true);
		exposure[projection] = frame.exposure_ev;
		print_message("%s: %.0f lux of diffuse light, %.4f of the figure\n", scene_projection_names[projection], lux[projection],
			      lux[projection] / frame.diffuse_illuminance_lux);
		frame_finish(&frame);
	}
	for (int projection = PROJECTION_EQUIRECTANGULAR; projection < PROJECTION_COUNT; projection++) {
		assert_float_equal(lux[projection] / lux[PROJECTION_FISHEYE], 1, 0.01);
		assert_true(exposure[projection] == exposure[PROJECTION_FISHEYE]);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(sun_stands_on_its_pixel),
		cmocka_unit_test(sun_sends_the_whole_beam),
		cmocka_unit_test(sun_sends_the_whole_beam_through_lenses),
		cmocka_unit_test(faces_meet_at_their_edges),
		cmocka_unit_test(faces_are_those_of_the_whole),
		cmocka_unit_test(equirectangular_wraps),
		cmocka_unit_test(projections_show_the_same),
		cmocka_unit_test(fisheye_is_black_outside),
		cmocka_unit_test(fisheye_ends_softly),
		cmocka_unit_test(panorama_holds_the_illuminance),
		cmocka_unit_test(panoramas_agree_about_the_light),
	};
	return RUN_WITH_RENDERER(tests);
}
