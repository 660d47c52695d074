#include "server/reference_limits.h"

#include <math.h>

void reference_limits_check(const struct config *config, const struct scene *scene, struct problem *problem)
{
	const double paths = (double)scene->output.width * scene->output.height * scene->model.samples;
	if (scene->model.name != MODEL_REFERENCE || paths <= 1e6 * config->reference_mpaths)
		return;
	const double most = floor(1e6 * config->reference_mpaths / ((double)scene->output.width * scene->output.height));
	problem_add(problem, "/model/samples",
		    "times width x height is %.0f million light paths: at most %d (--reference-mpaths), so %.0f samples here",
		    ceil(paths * 1e-6), config->reference_mpaths, most);
}

bool reference_is_timed(const struct scene *scene)
{
	return scene->model.name == MODEL_REFERENCE && (scene->model.time_budget_ms > 0 || scene->model.partial);
}

/* Milliseconds to stop, read back and encode, as a slow and busy processor takes: these, a share of the time there is, and so much for each
 * value of a pixel. */
#define RESERVE_MS       200.0
#define RESERVE_SHARE    0.03
#define RESERVE_PIXEL_MS 2e-4

double reference_stop_ms(const struct scene *scene, double now_ms, double deadline_ms, double after_ms)
{
	if (scene->model.name != MODEL_REFERENCE || !scene->model.partial)
		return deadline_ms;
	const double values = (double)scene->output.width * scene->output.height * __builtin_popcount(scene->output.layers);
	const double reserve = RESERVE_MS + RESERVE_SHARE * (deadline_ms - now_ms) + RESERVE_PIXEL_MS * values + after_ms;
	return fmax(deadline_ms - reserve, now_ms + 0.5 * (deadline_ms - now_ms));
}
