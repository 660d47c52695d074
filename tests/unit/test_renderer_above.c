/* Pictures of the layer from above: no specks, no traces of the blocks of pixels that begin together, in one part or in many. */
#include "tests/unit/test_renderer_common.h"

/* Just above the tops of a thick layer, where rays graze many crests one behind the other. */
static struct scene above_tops(double height, double elevation)
{
	struct scene scene = small_scene(256, 192, LAYER(COLOR));
	scene.clouds.seed = 6;
	scene.clouds.coverage = 0.9;
	scene.clouds.thickness_m = 700;
	scene.camera.position_m[2] = scene.clouds.base_m + scene.clouds.thickness_m + height;
	scene.camera.azimuth_deg = 190;
	scene.camera.elevation_deg = elevation;
	scene.sun.azimuth_deg = 240;
	scene.sun.elevation_deg = 20;
	return scene;
}

/* Pixels darker by `share` than each of their eight neighbours, over all. */
static double dark_specks(const struct frame *frame, double share)
{
	int specks = 0;
	for (int y = 1; y < frame->height - 1; y++)
		for (int x = 1; x < frame->width - 1; x++) {
			double darkest = INFINITY;
			for (int i = 0; i < 9; i++)
				if (i != 4)
					darkest = fmin(darkest, luminance_of(frame, LAYER_COLOR, x + i % 3 - 1, y + i / 3 - 1));
			specks += luminance_of(frame, LAYER_COLOR, x, y) < (1 - share) * darkest;
		}
	return (double)specks / (frame->width * frame->height);
}

/* A pixel on a crest shows crest and what stands behind, not a place in between. */
static void crests_have_no_specks(void **state)
{
	(void)state;
	for (int i = 0; i < 3; i++) {
		static const double heights[] = {20, 100, 900}, bounds[] = {3e-4, 3e-4, 8e-4};
		const struct scene scene = above_tops(heights[i], -9);
		struct frame frame = render(&scene);
		const double specks = dark_specks(&frame, 0.15);
		print_message("%.0f m above the tops: %.3f %% of the pixels are dark specks\n", heights[i], 100 * specks);
		assert_true(specks < bounds[i]);
		frame_finish(&frame);
	}
}

/* Rows and columns where blocks meet differ no more than others do. */
static void blocks_leave_no_traces(void **state)
{
	enum { BLOCK = 8 };
	(void)state;
	const struct scene scene = above_tops(60, -12);
	struct frame frame = render(&scene);
	double sums[2] = {0};
	int counts[2] = {0};
	for (int y = 100; y < frame.height; y++)
		for (int x = 1; x < frame.width; x++) {
			const bool meets = x % BLOCK == 0;
			const double a = luminance_of(&frame, LAYER_COLOR, x - 1, y), b = luminance_of(&frame, LAYER_COLOR, x, y);
			sums[meets] += fmin(fabs(a - b) / (a + b), 0.1);
			counts[meets]++;
		}
	const double inside = sums[0] / counts[0], across = sums[1] / counts[1];
	print_message("neighbours differ by %.4f inside blocks of pixels, by %.4f across their borders\n", inside, across);
	assert_true(across < 1.1 * inside);
	frame_finish(&frame);
}

/* What is seen of the layer is held of so many pixels at a time; a picture of more shows the same as a small one everywhere. */
static void large_pictures_are_made_in_parts(void **state)
{
	enum { WIDTH = 2048, HEIGHT = 2304, LEAST = 64 };
	(void)state;
	struct scene scene = above_tops(900, -55);
	scene.output.width = WIDTH;
	scene.output.height = HEIGHT;
	struct frame whole = render(&scene);
	/* The same field of view at a quarter of the width and height: means of 16 pixels. */
	scene.output.width = WIDTH / 4;
	scene.output.height = HEIGHT / 4;
	struct frame small = render(&scene);
	double worst = 0;
	for (int part = 0; part < HEIGHT / 4 / LEAST; part++) {
		double sums[2] = {0};
		for (int y = part * LEAST; y < (part + 1) * LEAST; y++)
			for (int x = 0; x < WIDTH / 4; x++) {
				sums[0] += luminance_of(&small, LAYER_COLOR, x, y);
				for (int i = 0; i < 16; i++)
					sums[1] += luminance_of(&whole, LAYER_COLOR, 4 * x + i % 4, 4 * y + i / 4) / 16;
			}
		worst = fmax(worst, fabs(sums[1] / sums[0] - 1));
	}
	print_message("rows of a picture in parts and of a small one differ by up to %.2f %%\n", 100 * worst);
	assert_true(worst < 0.02);
	frame_finish(&small);
	frame_finish(&whole);
}

/* At twilight gaps show the dark ground, in air that the layer keeps in the dark. */
static void gaps_are_darker_at_twilight(void **state)
{
	(void)state;
	struct scene scene = above_tops(2000, -6);
	scene.output.layers = LAYER(COLOR) | LAYER(OPTICAL_THICKNESS) | LAYER(DISTANCE);
	scene.clouds.coverage = 0.6;
	scene.clouds.thickness_m = 400;
	scene.camera.position_m[2] = 3000;
	scene.camera.azimuth_deg = scene.sun.azimuth_deg;
	scene.camera.vertical_fov_deg = 12;
	scene.ground.type = GROUND_COUNTRY;
	scene.sun.elevation_deg = -4;
	struct frame frame = render(&scene);
	double sums[2] = {0};
	int counts[2] = {0};
	for (int y = frame.height / 2; y < frame.height; y++)
		for (int x = 0; x < frame.width; x++) {
			const double tau = pixel_of(&frame, LAYER_OPTICAL_THICKNESS, x, y)[0];
			const int gap = tau < 0.05 ? 1 : tau > 3 ? 0 : -1;
			if (gap < 0)
				continue;
			sums[gap] += luminance_of(&frame, LAYER_COLOR, x, y);
			counts[gap]++;
		}
	const double cloud = sums[0] / fmax(counts[0], 1), gap = sums[1] / fmax(counts[1], 1);
	print_message("sun at -4 deg, seen towards it: %d pixels of gaps have %.2f of the luminance of %d of cloud\n", counts[1],
		      gap / cloud, counts[0]);
	assert_true(counts[0] > 200 && counts[1] > 200 && gap < 0.98 * cloud);
	frame_finish(&frame);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(crests_have_no_specks),
		cmocka_unit_test(blocks_leave_no_traces),
		cmocka_unit_test(large_pictures_are_made_in_parts),
		cmocka_unit_test(gaps_are_darker_at_twilight),
	};
	return RUN_WITH_RENDERER(tests);
}
