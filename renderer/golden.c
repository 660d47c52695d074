#include "renderer/golden.h"

#include "renderer/log.h"

#include <math.h>

const struct golden_picture golden_expected = {{
#include "renderer/golden_values.inc"
}};

/* Of full scale. Pixels of one picture differ by about 0.2 % between devices; a block of a cloud that another seed would make by 10 %. */
static const double tolerance = 0.02;

/* A picture of less contrast than this, of full scale between its darkest and brightest block, shows nothing. */
static const double contrast_min = 0.05;

/* The scene of the renderer's own warm-up, so that it shares what that left. Each time the camera turns by a millionth of a degree, and
 * the sun goes up by one with a new sky, which no pixel shows: else the view would be remembered, and say nothing of the device. */
static struct scene golden_scene(bool with_sky)
{
	static _Atomic unsigned turns;
	const double moved_deg = 1e-6 * (1 + turns++ % 4096);
	struct scene scene = scene_default();
	scene.camera.azimuth_deg += moved_deg;
	if (with_sky)
		scene.sun.elevation_deg += moved_deg;
	scene.output.width = GOLDEN_COLUMNS * GOLDEN_BLOCK;
	scene.output.height = GOLDEN_ROWS * GOLDEN_BLOCK;
	return scene;
}

static void average(const struct frame *frame, struct golden_picture *picture)
{
	const unsigned char *pixels = frame->pixels;
	*picture = (struct golden_picture){0};
	for (int y = 0; y < frame->height; y++)
		for (int x = 0; x < frame->width; x++, pixels += 3)
			for (int c = 0; c < 3; c++)
				picture->mean[y / GOLDEN_BLOCK][x / GOLDEN_BLOCK][c] += (float)pixels[c] / (GOLDEN_BLOCK * GOLDEN_BLOCK);
}

static bool shows_something(const struct golden_picture *picture)
{
	const float *mean = &picture->mean[0][0][0];
	float low = mean[0], high = mean[0];
	for (int i = 0; i < GOLDEN_ROWS * GOLDEN_COLUMNS * 3; i++) {
		low = fminf(low, mean[i]);
		high = fmaxf(high, mean[i]);
	}
	return high - low >= contrast_min * 255;
}

enum golden_result golden_render(struct renderer *renderer, bool with_sky, renderer_cancelled *cancelled, void *context,
				 struct golden_picture *picture)
{
	const struct scene scene = golden_scene(with_sky);
	struct frame frame;
	const enum render_result result = renderer_render(renderer, &scene, cancelled, context, &frame);
	if (result == RENDER_CANCELLED)
		return GOLDEN_CANCELLED;
	if (result != RENDER_OK) {
		log_error("golden render: it did not come out");
		return GOLDEN_FAILED;
	}
	average(&frame, picture);
	frame_finish(&frame);
	if (shows_something(picture))
		return GOLDEN_PASSED;
	log_error("golden render: it is one colour");
	return GOLDEN_FAILED;
}

bool golden_compare(const struct golden_picture *picture, const struct golden_picture *expected)
{
	const float *is = &picture->mean[0][0][0], *should = &expected->mean[0][0][0];
	const int count = GOLDEN_ROWS * GOLDEN_COLUMNS * 3;
	int wrong = 0, worst = 0;
	double most = 0;
	for (int i = 0; i < count; i++) {
		const double off = fabs((double)is[i] - (double)should[i]);
		wrong += !(off <= tolerance * 255); /* what is no number is wrong */
		if (off <= most || isnan(most))
			continue;
		most = off;
		worst = i;
	}
	if (wrong > 0)
		log_error("golden render: %d of %d means are off, one is %.1f and should be %.1f", wrong, count, (double)is[worst],
			  (double)should[worst]);
	return wrong == 0;
}

void golden_print(const struct golden_picture *picture, FILE *file)
{
	for (int y = 0; y < GOLDEN_ROWS; y++) {
		fprintf(file, "{\n");
		for (int x = 0; x < GOLDEN_COLUMNS; x++)
			fprintf(file, "\t{%.1ff, %.1ff, %.1ff},\n", (double)picture->mean[y][x][0], (double)picture->mean[y][x][1],
				(double)picture->mean[y][x][2]);
		fprintf(file, "},\n");
	}
}
