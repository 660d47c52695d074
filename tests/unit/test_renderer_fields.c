/* Fields of cloud by their statistics, measured in views from straight below: spectrum, thickness, cover, and no seam where tiles meet.
 *
 * Views of the slab meet the sides of clouds, which differ from one place of the camera to the next; what says something about the field
 * alone is seen as the paper shades it, which knows a plane base. */
#include "tests/unit/test_renderer_common.h"

#include <complex.h>

/* Extinction of the default droplets at 550 nm, 1/m (Mie theory, gamma 2, effective radius 7 um, 300 per cm3). */
static const double extinction = 0.0368;

static struct scene looking_up(enum cloud_type type, double coverage, uint32_t seed)
{
	static const double thickness[] = {
		[CLOUD_STRATUS] = 300, [CLOUD_STRATOCUMULUS] = 400, [CLOUD_ALTOCUMULUS] = 100, [CLOUD_CIRROCUMULUS] = 50};
	struct scene scene = small_scene(16, 16, LAYER(OPTICAL_THICKNESS));
	scene.clouds.type = type;
	scene.clouds.seed = seed;
	scene.clouds.coverage = coverage;
	scene.clouds.thickness_m = thickness[type];
	scene.camera.position_m[2] = 1;
	scene.camera.elevation_deg = 90;
	scene.radiosity.enabled = false;
	return scene;
}

/* Optical thickness over the whole tile out of places x places pictures side by side, each seen from under its middle. Rows go south,
 * columns west. */
static float *map_of(struct scene scene, int places, int side)
{
	const int size = places * side;
	float *map = malloc((size_t)size * (size_t)size * sizeof *map);
	assert_non_null(map);
	const double width = scene.clouds.tile_m / places;
	/* From so far below that all rays go up steeply. */
	scene.clouds.base_m = fmin(12000, fmax(1000, width));
	scene.camera.vertical_fov_deg = 2 * atan(0.5 * width / (scene.clouds.base_m - scene.camera.position_m[2])) / DEGREE;
	scene.output.width = scene.output.height = side;
	for (int place = 0; place < places * places; place++) {
		const int column = place % places, row = place / places;
		scene.camera.position_m[0] = -(column + 0.5) * width;
		scene.camera.position_m[1] = -(row + 0.5) * width;
		struct frame frame = render(&scene);
		for (int i = 0; i < side * side; i++)
			map[(row * side + i / side) * size + column * side + i % side] =
				pixel_of(&frame, LAYER_OPTICAL_THICKNESS, i % side, i / side)[0];
		frame_finish(&frame);
	}
	return map;
}

/* --- spectrum ---------------------------------------------------------------------------------------------------------------------- */

/* In place, by halves; count a power of two, stride in elements. */
static void transform(double complex *values, double complex *scratch, int count, int stride)
{
	if (count == 1)
		return;
	for (int i = 0; i < count; i++)
		scratch[i] = values[i * stride];
	for (int i = 0; i < count / 2; i++) {
		values[i * stride] = scratch[2 * i];
		values[(i + count / 2) * stride] = scratch[2 * i + 1];
	}
	transform(values, scratch, count / 2, stride);
	transform(values + count / 2 * stride, scratch, count / 2, stride);
	for (int i = 0; i < count / 2; i++) {
		const double complex even = values[i * stride];
		const double complex odd = values[(i + count / 2) * stride] * cexp(-2 * M_PI * I * i / count);
		values[i * stride] = even + odd;
		values[(i + count / 2) * stride] = even - odd;
	}
}

/* Exponent of the power spectrum in the plane, radially averaged, from 5 km to 200 m: least squares over bands of a third of an octave. */
static double spectral_slope(const float *map, int size, double tile)
{
	double complex *plane = malloc((size_t)size * (size_t)size * sizeof *plane), *scratch = malloc((size_t)size * sizeof *scratch);
	assert_true(plane && scratch);
	for (int i = 0; i < size * size; i++)
		plane[i] = map[i];
	for (int i = 0; i < size; i++)
		transform(plane + (size_t)i * (size_t)size, scratch, size, 1);
	for (int i = 0; i < size; i++)
		transform(plane + i, scratch, size, size);
	enum { BANDS = 14 };
	double power[BANDS] = {0}, wave_number[BANDS] = {0}, count[BANDS] = {0};
	for (int y = 0; y < size; y++)
		for (int x = 0; x < size; x++) {
			const double k = hypot(x < size / 2 ? x : x - size, y < size / 2 ? y : y - size) / tile;
			const int band = k > 0 ? (int)floor(3 * log2(k * 5000)) : -1;
			if (band < 0 || band >= BANDS || k > 1 / 200.)
				continue;
			power[band] += creal(plane[y * size + x] * conj(plane[y * size + x]));
			wave_number[band] += k;
			count[band]++;
		}
	double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
	for (int i = 0; i < BANDS; i++)
		if (count[i] > 0) {
			const double x = log(wave_number[i] / count[i]), y = log(power[i] / count[i]);
			n++, sx += x, sy += y, sxx += x * x, sxy += x * y;
		}
	free(scratch);
	free(plane);
	return (n * sxy - sx * sy) / (n * sxx - sx * sx);
}

/* Altocumulus and cirrocumulus from a half of the sky on: less of it is single tufts, whose own size then is what the spectrum shows. */
static void spectrum_is_that_of_cloud(void **state)
{
	(void)state;
	for (int type = CLOUD_STRATUS; type <= CLOUD_CIRROCUMULUS; type++) {
		double sum = 0;
		for (int i = 0; i < 4; i++) {
			const struct scene scene = looking_up((enum cloud_type)type, 0.5 + 0.1 * i, 1 + (uint32_t)i);
			float *map = map_of(scene, 4, 128);
			const double slope = spectral_slope(map, 512, scene.clouds.tile_m);
			print_message("%s, coverage %.1f: k^%.2f\n", scene_cloud_type_names[type], scene.clouds.coverage, slope);
			assert_float_equal(slope, -8. / 3, 0.4);
			sum += slope / 4;
			free(map);
		}
		print_message("%s: k^%.2f on average\n", scene_cloud_type_names[type], sum);
	}
}

/* --- thickness and seams ------------------------------------------------------------------------------------------------------------ */

static double largest_share(const struct scene *scene)
{
	enum { SIZE = 640 };
	float *map = map_of(*scene, 4, SIZE / 4), largest = 0;
	for (int k = 0; k < SIZE * SIZE; k++)
		largest = fmaxf(largest, map[k]);
	free(map);
	return largest / extinction / scene->clouds.thickness_m;
}

/* Of the field, and of what slanted rays meet of it. */
static void thickness_is_the_maximum(void **state)
{
	(void)state;
	for (int type = CLOUD_STRATUS; type <= CLOUD_CIRROCUMULUS; type++)
		for (int i = 0; i < 3; i++) {
			const double coverages[] = {0.1, 0.6, 1};
			struct scene scene = looking_up((enum cloud_type)type, coverages[i], 5);
			const double met = largest_share(&scene);
			scene.model.shading = SHADING_PAPER;
			const double share = largest_share(&scene);
			print_message("%s, coverage %.1f: largest H %.3f of thickness_m, with sides %.3f\n", scene_cloud_type_names[type],
				      coverages[i], share, met);
			assert_true(share > 0.94 && share < 1.005);
			assert_true(met > 0.94 && met < 1.005);
		}
}

/* Neighbours differ as much across the edge of the tile as inside. One picture, beside the tile's corner, so that rays on both sides of
 * the edge are slanted alike. */
static double seam_of(struct scene scene)
{
	enum { SIZE = 512, EDGE = SIZE / 4 };
	scene.clouds.base_m = scene.clouds.tile_m;
	scene.camera.vertical_fov_deg = 2 * atan(0.5 * scene.clouds.tile_m / (scene.clouds.base_m - scene.camera.position_m[2])) / DEGREE;
	scene.camera.position_m[0] = scene.camera.position_m[1] = -0.25 * scene.clouds.tile_m;
	scene.output.width = scene.output.height = SIZE;
	struct frame frame = render(&scene);
	double inside = 0, across = 0;
	for (int y = 0; y < SIZE; y++)
		for (int x = 8; x < SIZE; x += 8) {
			const double here = pixel_of(&frame, LAYER_OPTICAL_THICKNESS, x, y)[0];
			const double there = pixel_of(&frame, LAYER_OPTICAL_THICKNESS, y, x)[0];
			const double differ = fabs(here - (double)pixel_of(&frame, LAYER_OPTICAL_THICKNESS, x - 1, y)[0]) +
					      fabs(there - (double)pixel_of(&frame, LAYER_OPTICAL_THICKNESS, y, x - 1)[0]);
			*(x == EDGE ? &across : &inside) += differ;
		}
	frame_finish(&frame);
	return across / (inside / (SIZE / 8 - 2));
}

static void tiles_meet_without_a_seam(void **state)
{
	(void)state;
	for (int type = CLOUD_STRATUS; type <= CLOUD_CIRROCUMULUS; type++)
		for (int sides = 0; sides < 2; sides++) {
			struct scene scene = looking_up((enum cloud_type)type, 0.8, 9);
			scene.clouds.time_s = 7.7e6; /* in which the wind carries tiles onto each other */
			scene.clouds.tile_m = 5000;
			scene.model.shading = sides ? SHADING_SOLVED : SHADING_PAPER;
			const double ratio = seam_of(scene);
			print_message("%s, %s: neighbours differ %.2f times as much across the tile's edge\n", scene_cloud_type_names[type],
				      sides ? "sides" : "field", ratio);
			assert_true(ratio > 0.6 && ratio < 1.6);
		}
}

/* --- cover -------------------------------------------------------------------------------------------------------------------------- */

/* Tiles and resolutions; so many pictures and pixels a side that a pixel is smaller than what makes up the cover. */
static const struct {
	double tile, time;
	int resolution, places, side;
} grids[] = {{20000, 0, 512, 4, 128}, {20000, 9.9e6, 64, 4, 128}, {2000, 1234, 64, 1, 256},
	     {5000, 50, 512, 1, 256}, {20000, 0, 2048, 4, 128},   {60000, 7e5, 1024, 8, 128}};

static void cover_is_what_was_asked_for(void **state)
{
	(void)state;
	static const double coverages[] = {0.05, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95};
	double worst = 0;
	int number = 0;
	for (int type = CLOUD_STRATUS; type <= CLOUD_CIRROCUMULUS; type++)
		for (size_t grid = 0; grid < sizeof grids / sizeof *grids; grid++)
			for (int i = (int)grid % 3; i < 7; i += 3) {
				struct scene scene = looking_up((enum cloud_type)type, coverages[i], 100 + (uint32_t)number++);
				scene.clouds.tile_m = grids[grid].tile;
				scene.clouds.time_s = grids[grid].time;
				scene.clouds.resolution = grids[grid].resolution;
				const int pixels = grids[grid].places * grids[grid].places * grids[grid].side * grids[grid].side;
				float *map = map_of(scene, grids[grid].places, grids[grid].side);
				int covered = 0;
				for (int k = 0; k < pixels; k++)
					covered += map[k] > 0.1f;
				free(map);
				const double share = (double)covered / pixels;
				worst = fmax(worst, fabs(share - coverages[i]));
				if (fabs(share - coverages[i]) > 0.03)
					fail_msg("%s, tile %.0f m, resolution %d, coverage %.2f: %.3f", scene_cloud_type_names[type],
						 grids[grid].tile, grids[grid].resolution, coverages[i], share);
			}
	print_message("%d skies: cover within %.3f of the request\n", number, worst);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(spectrum_is_that_of_cloud),
		cmocka_unit_test(thickness_is_the_maximum),
		cmocka_unit_test(tiles_meet_without_a_seam),
		cmocka_unit_test(cover_is_what_was_asked_for),
	};
	return RUN_WITH_RENDERER(tests);
}
