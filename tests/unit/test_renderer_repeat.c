/* The tile of the clouds far away: its copies neither repeat in the picture nor move with the camera. */
#include "test_renderer_common.h"

static const double earth = 6371000;

/* Autocorrelation of `count` values at a shift, less what is slower than half the row. */
static double autocorrelation(const double *row, int count, int shift)
{
	double mean = 0, slope = 0, squares = 0, variance = 0, product = 0;
	for (int i = 0; i < count; i++)
		mean += row[i] / count;
	for (int i = 0; i < count; i++) {
		const double x = i - 0.5 * (count - 1);
		slope += x * row[i];
		squares += x * x;
	}
	slope /= squares;
	for (int i = 0; i < count; i++) {
		const double a = row[i] - mean - slope * (i - 0.5 * (count - 1));
		variance += a * a / count;
		if (i + shift < count)
			product += a * (row[i + shift] - mean - slope * (i + shift - 0.5 * (count - 1))) / (count - shift);
	}
	return product / fmax(variance, 1e-30);
}

/* Of a row that shows the layer at a distance along the ground, looking along an axis of the tile: at one tile's length. */
static double repeat_of_row(const struct scene *scene, const struct frame *frame, double distance)
{
	enum { WIDTH = 512 };
	double row[WIDTH], best = -1;
	const double z = scene->camera.position_m[2], base = scene->clouds.base_m + 0.5 * scene->clouds.thickness_m;
	const double x = (earth + base) * sin(distance / earth), y = (earth + base) * cos(distance / earth) - (earth + z);
	const double half = 0.5 * scene->output.height / tan(0.5 * scene->camera.vertical_fov_deg * DEGREE);
	const double below = atan2(y, x) - scene->camera.elevation_deg * DEGREE;
	const int at = (int)floor(0.5 * scene->output.height - half * tan(below));
	const int shift = (int)lround(scene->clouds.tile_m / (hypot(x, y) * cos(below) / half));
	assert_true(at >= 0 && at < scene->output.height && shift < WIDTH - 50);
	for (int i = 0; i < WIDTH; i++)
		row[i] = pixel_of(frame, LAYER_OPTICAL_THICKNESS, i, at)[0];
	for (int i = shift - 2; i <= shift + 2; i++)
		best = fmax(best, autocorrelation(row, WIDTH, i));
	return best;
}

static void rows_far_away_do_not_repeat(void **state)
{
	(void)state;
	enum { ROWS = 40 };
	for (int azimuth = 90; azimuth <= 180; azimuth += 90) {
		struct scene scene = small_scene(512, 256, LAYER(OPTICAL_THICKNESS));
		scene.clouds.seed = 2;
		scene.clouds.base_m = 900;
		scene.clouds.thickness_m = 600;
		scene.camera.position_m[2] = 11000;
		scene.camera.azimuth_deg = azimuth;
		scene.camera.elevation_deg = -14;
		struct frame frame = render(&scene);
		double mean = 0;
		for (int i = 0; i < ROWS; i++)
			mean += repeat_of_row(&scene, &frame, scene.clouds.tile_m * (2 + 0.1 * i)) / ROWS;
		print_message("azimuth %d: autocorrelation at a tile's length %.2f\n", azimuth, mean);
		/* 0.4 to 0.5 of the periodic tile. */
		assert_true(mean < 0.18);
		frame_finish(&frame);
	}
}

/* Direction from a camera to a point of the base over a place, and where the camera shows it. */
static bool project_place(const struct scene *scene, const double place[2], double at[2])
{
	double to[3] = {place[0] - scene->camera.position_m[0], place[1] - scene->camera.position_m[1], 0};
	const double across = hypot(to[0], to[1]), r = earth + scene->clouds.base_m;
	to[2] = sqrt(r * r - across * across) - (earth + scene->camera.position_m[2]);
	const double length = sqrt(dot3(to, to));
	for (int i = 0; i < 3; i++)
		to[i] /= length;
	return project(scene, to, at);
}

/* Optical thicknesses over a square of the base round a place. */
enum { SIDE = 24 };
static void thicknesses(struct scene scene, const double centre[2], double step, double found[SIDE * SIDE])
{
	const double dx = centre[0] - scene.camera.position_m[0], dy = centre[1] - scene.camera.position_m[1];
	scene.camera.azimuth_deg = fmod(atan2(dx, dy) / DEGREE + 360, 360);
	scene.camera.elevation_deg = atan2(scene.clouds.base_m - scene.camera.position_m[2], hypot(dx, dy)) / DEGREE;
	struct frame frame = render(&scene);
	for (int i = 0; i < SIDE * SIDE; i++) {
		const double place[2] = {centre[0] + step * (i % SIDE - 0.5 * SIDE), centre[1] + step * (i / SIDE - 0.5 * SIDE)};
		double at[2];
		assert_true(project_place(&scene, place, at));
		assert_true(at[0] >= 0 && at[1] >= 0 && at[0] < scene.output.width && at[1] < scene.output.height);
		found[i] = pixel_of(&frame, LAYER_OPTICAL_THICKNESS, (int)at[0], (int)at[1])[0];
	}
	frame_finish(&frame);
}

static double correlation(const double *a, const double *b, int count)
{
	double ma = 0, mb = 0, aa = 0, bb = 0, ab = 0;
	for (int i = 0; i < count; i++)
		ma += a[i] / count, mb += b[i] / count;
	for (int i = 0; i < count; i++) {
		aa += (a[i] - ma) * (a[i] - ma);
		bb += (b[i] - mb) * (b[i] - mb);
		ab += (a[i] - ma) * (b[i] - mb);
	}
	return ab / sqrt(fmax(aa * bb, 1e-30));
}

/* Cameras kilometres apart, one of them in another copy of the tile, see the same clouds over the same place far from both; and the one's
 * clouds drift with the wind. As the paper shades it: of plane bases, since from elsewhere one sees other sides of clouds. */
static void clouds_far_away_stay_where_they_are(void **state)
{
	(void)state;
	struct scene scene = small_scene(128, 128, LAYER(OPTICAL_THICKNESS));
	scene.model.shading = SHADING_PAPER;
	scene.clouds.base_m = 5000;
	scene.clouds.tile_m = 3000;
	scene.clouds.wind_mps[0] = 20;
	scene.clouds.wind_mps[1] = 5;
	scene.clouds.time_s = 1000;
	scene.camera.vertical_fov_deg = 14;
	const double centre[2] = {6000, 7500};
	double one[SIDE * SIDE], other[SIDE * SIDE];
	thicknesses(scene, centre, 40, one);
	scene.camera.position_m[0] = -1700;
	scene.camera.position_m[1] = -3900;
	thicknesses(scene, centre, 40, other);
	print_message("from two places: correlation %.3f\n", correlation(one, other, SIDE * SIDE));
	assert_true(correlation(one, other, SIDE * SIDE) > 0.95);
	/* Half a minute is short for clouds that live for minutes: they are where the wind has carried them. */
	scene.clouds.time_s += 30;
	const double later[2] = {centre[0] + 600, centre[1] + 150};
	thicknesses(scene, later, 40, one);
	print_message("30 s later: correlation %.3f\n", correlation(one, other, SIDE * SIDE));
	assert_true(correlation(one, other, SIDE * SIDE) > 0.9);
}

/* Sides too: cameras on one line of sight to a place see the same ones. */
static void sides_far_away_stay_where_they_are(void **state)
{
	(void)state;
	struct scene scene = small_scene(128, 128, LAYER(OPTICAL_THICKNESS));
	scene.clouds.base_m = 5000;
	scene.clouds.tile_m = 3000;
	scene.camera.vertical_fov_deg = 30;
	const double centre[2] = {6000, 7500};
	double one[SIDE * SIDE], other[SIDE * SIDE];
	thicknesses(scene, centre, 40, one);
	for (int i = 0; i < 2; i++)
		scene.camera.position_m[i] += 0.2 * centre[i];
	scene.camera.position_m[2] = 0.2 * scene.clouds.base_m;
	thicknesses(scene, centre, 40, other);
	print_message("on one line of sight: correlation %.3f\n", correlation(one, other, SIDE * SIDE));
	assert_true(correlation(one, other, SIDE * SIDE) > 0.95);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(rows_far_away_do_not_repeat),
		cmocka_unit_test(clouds_far_away_stay_where_they_are),
		cmocka_unit_test(sides_far_away_stay_where_they_are),
	};
	return RUN_WITH_RENDERER(tests);
}
