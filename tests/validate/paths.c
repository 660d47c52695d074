/* The reference model: its light paths in layers whose light is known, and how long they take. */
#include "renderer/gl/timer.h"
#include "renderer/renderer.h"
#include "tests/twin/layer.h"
#include "tests/validate/validate.h"

#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { THREADS = 2, DIRECTIONS = 20, FLUX_REPLICATES = 128, FLUX_SAMPLES = 4800000, ROUND = 1 << 17, ROUNDS_MAX = 24 };

/* Of every value that is compared. */
static const double error_wanted = 0.009;
static const double sun_zenith_deg = 55;

struct check {
	struct validation *validation;
	struct droplet_tables *tables;
};

/* More samples until the error is as small as wanted, or `most` times as many have been drawn. */
static struct layer_seen see_well(struct uniform_layer *layer, bool above, double mu_v, double azimuth, int most)
{
	struct layer_seen all = {{0}, {0}};
	for (int n = 0; n < most; n++) {
		const struct layer_seen seen = layer_see(layer, above, mu_v, azimuth, ROUND, THREADS);
		bool enough = true;
		for (int band = 0; band < BAND_COUNT; band++) {
			all.mean[band] += (seen.mean[band] - all.mean[band]) / (n + 1);
			all.error[band] = hypot(all.error[band] * n, seen.error[band]) / (n + 1);
			enough = enough && all.error[band] < error_wanted * all.mean[band];
		}
		if (enough)
			break;
	}
	return all;
}

/* Adds to the tallies, and to the page's table. */
static void judge(const struct check *check, enum tally_id id, const char *what, int band, double value, double error, double expected)
{
	struct tally *tally = check->validation->measured.tally;
	const double nm = band_wavelength_nm[band];
	tally_add(&tally[id], fabs(value - expected) / (3 * error), "%s, %.0f nm: %.4g +- %.2g for %.4g", what, nm, value, error, expected);
	tally_add(&tally[TALLY_PATHS_ERROR], error / value, "%s, %.0f nm", what, nm);
	fprintf(check->validation->page, "| %s | %.0f | %.4g | %.4g | %.2f | %+.1f |\n", what, nm, value, expected, 100 * error / value,
		(value - expected) / error);
}

/* --- layers ------------------------------------------------------------------------------------------------------------------------ */

static void compare_radiances(const struct check *check, struct uniform_layer *layer, struct layer_case is, int directions)
{
	const double mu_l = cos(is.sun_zenith_deg * DEGREE);
	for (int i = 0; i < effort_count(check->validation, directions); i++) {
		/* Even over both hemispheres, but not within 10 degrees of the horizon. */
		const bool above = i % 2;
		const double mu_v = 0.17 + 0.83 * (i + 0.5) / directions, turns = i * 0.61803398875,
			     azimuth = M_PI * (turns - floor(turns));
		const enum slab_side side = above ? SLAB_REFLECTED : SLAB_TRANSMITTED;
		if (scattering_cosine(side, mu_l, mu_v, azimuth) > cos(5 * DEGREE))
			continue;
		const struct layer_seen seen = see_well(layer, above, mu_v, azimuth, ROUNDS_MAX);
		char what[128];
		snprintf(what, sizeof what, "%g m, sun at %g deg, %s, view at %.0f deg, azimuth %.0f", is.thickness_m, is.sun_zenith_deg,
			 above ? "reflected" : "transmitted", acos(mu_v) / DEGREE, azimuth / DEGREE);
		for (int band = 0; band < BAND_COUNT; band++) {
			const double tau = is.thickness_m * check->tables->optics->extinction_per_m[band];
			judge(check, TALLY_PATHS_LAYER, what, band, seen.mean[band], seen.error[band],
			      slab_radiance(check->tables->slab, check->tables->optics, band, side, tau, mu_l, mu_v, azimuth));
		}
	}
}

/* Less the beam that nothing scattered, which no path holds. */
static void compare_fluxes(const struct check *check, struct uniform_layer *layer, struct layer_case is)
{
	const double mu_l = cos(is.sun_zenith_deg * DEGREE);
	for (int above = 0; above < 2; above++) {
		const struct layer_seen seen =
			layer_irradiance(layer, above, FLUX_REPLICATES, effort_count(check->validation, FLUX_SAMPLES), THREADS);
		for (int band = 0; band < BAND_COUNT; band++) {
			const double tau = is.thickness_m * check->tables->optics->extinction_per_m[band];
			const struct slab_flux flux = slab_flux_at(check->tables->slab, band, tau, mu_l);
			const double expected = above ? flux.reflected : flux.transmitted - flux.direct;
			char what[64];
			snprintf(what, sizeof what, "%g m, sun at %g deg, %s", is.thickness_m, is.sun_zenith_deg, above ? "R" : "T");
			judge(check, TALLY_PATHS_FLUX, what, band, seen.mean[band] / mu_l, seen.error[band] / mu_l, expected);
		}
	}
}

static void compare_layers(const struct check *check)
{
	/* Ways to a low sun bend most, over what is left of its height. */
	const struct {
		double thickness_m, sun_zenith_deg;
		int directions;
	} layers[] = {{80, sun_zenith_deg, DIRECTIONS}, {300, sun_zenith_deg, DIRECTIONS}, {80, 86, DIRECTIONS / 2}};
	fprintf(check->validation->page, "\n## Light paths in uniform layers\n\nRadiance (of a beam of irradiance 1), R and T without the "
					 "beam, against the solver.\n\n"
					 "| where | nm | light paths | solver | standard error %% | off, in standard errors |\n| --- | --- "
					 "| --- | --- | --- | --- |\n");
	for (int i = 0; i < 3; i++) {
		const struct layer_case is = {.tables = check->tables,
					      .thickness_m = layers[i].thickness_m,
					      .sun_zenith_deg = layers[i].sun_zenith_deg,
					      .sun = true};
		struct uniform_layer layer;
		layer_init(&layer, &is);
		compare_radiances(check, &layer, is, layers[i].directions);
		/* Under the low one single samples weigh so much that a minute knows R and T to no better than 4 %. */
		if (layers[i].directions == DIRECTIONS)
			compare_fluxes(check, &layer, is);
		layer_finish(&layer);
	}
}

/* So thin that what is scattered twice is under 0.2 %, where once is not too little: about 90 degrees, where a droplet scatters least, it
 * is 1.5 %. */
static void compare_thin(const struct check *check)
{
	const double mu_l = cos(sun_zenith_deg * DEGREE), mu_v = 0.6;
	const struct layer_case is = {.tables = check->tables, .thickness_m = 0.05, .sun_zenith_deg = sun_zenith_deg, .sun = true};
	struct uniform_layer layer;
	layer_init(&layer, &is);
	static const double azimuth_of[] = {1, 2.5, 0.5, 3};
	for (int i = 0; i < 4; i++) {
		const bool above = i % 2;
		const double azimuth = azimuth_of[i];
		const struct layer_seen seen = layer_see(&layer, above, mu_v, azimuth, effort_count(check->validation, 24000000), THREADS);
		const double angle = acos(scattering_cosine(above ? SLAB_REFLECTED : SLAB_TRANSMITTED, mu_l, mu_v, azimuth));
		for (int band = 0; band < BAND_COUNT; band++) {
			const double tau = is.thickness_m * check->tables->optics->extinction_per_m[band];
			const double expected = optics_phase(check->tables->optics, band, angle) / (4 * M_PI) * tau / mu_v;
			tally_add(&check->validation->measured.tally[TALLY_PATHS_THIN], fabs(seen.mean[band] / expected - 1),
				  "scattered by %.0f deg, %.0f nm, standard error %.2f %%", angle / DEGREE, band_wavelength_nm[band],
				  100 * seen.error[band] / expected);
		}
	}
	layer_finish(&layer);
}

static void compare_furnace(const struct check *check)
{
	static const double thickness_m[] = {5, 50, 200, 400};
	for (int i = 0; i < 4; i++) {
		const struct layer_case is = {.tables = check->tables, .thickness_m = thickness_m[i], .sky = 1, .ground_albedo = 1};
		struct uniform_layer layer;
		layer_init(&layer, &is);
		for (int above = 0; above < 2; above++) {
			const struct layer_seen seen = see_well(&layer, above, 0.55, 1, 4);
			for (int band = 0; band < BAND_COUNT; band++)
				tally_add(&check->validation->measured.tally[TALLY_PATHS_FURNACE], fabs(seen.mean[band] - 1),
					  "%g m, %s, %.0f nm", is.thickness_m, above ? "above" : "below", band_wavelength_nm[band]);
		}
		layer_finish(&layer);
	}
}

/* --- time -------------------------------------------------------------------------------------------------------------------------- */

static double processor_s(void)
{
	struct timespec now;
	clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
	return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static int compare_numbers(const void *a, const void *b)
{
	const double x = *(const double *)a, y = *(const double *)b;
	return (x > y) - (x < y);
}

static double luminance(const float *rgb)
{
	return 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
}

/* Median over the pixels, or those that show cloud, of the standard error of the green channel, which stands for the luminance, over the
 * luminance. */
static double median_error(const struct frame *frame, bool cloud)
{
	const size_t count = (size_t)frame->width * (size_t)frame->height, plane = 3 * count;
	const float *color = frame->pixels, *passed = color + plane, *error = color + 2 * plane;
	double *values = malloc(count * sizeof *values);
	size_t n = 0;
	require(values, "out of memory");
	for (size_t i = 0; i < count; i++)
		if (!cloud || passed[3 * i + 1] < 0.5)
			values[n++] = luminance(error + 3 * i) / fmax(luminance(color + 3 * i), 1e-9);
	qsort(values, n, sizeof *values, compare_numbers);
	const double median = n ? values[n / 2] : 0;
	free(values);
	return median;
}

static void measure_time(const struct check *check)
{
	struct droplet_store *droplets = droplet_store_create(&(struct droplet_store_params){.kernel = check->validation->kernel});
	require(droplets, "no droplets");
	struct renderer *renderer =
		renderer_create(&(struct renderer_params){.device_index = -1, .pass_kind = PASS_FRAGMENT, .droplets = droplets});
	require(renderer, "no renderer");
	struct scene scene = scene_default();
	struct frame frame;
	scene.model.name = MODEL_REFERENCE;
	scene.output.width = 320;
	scene.output.height = 240;
	scene.output.format = IMAGE_EXR;
	scene.output.layers = 1u << LAYER_COLOR | 1u << LAYER_TRANSMITTANCE | 1u << LAYER_STANDARD_ERROR;
	scene.camera.elevation_deg = 35;
	/* Once for the programs. */
	scene.model.samples = 1;
	require(renderer_render(renderer, &scene, NULL, NULL, &frame) == RENDER_OK, "no picture");
	frame_finish(&frame);
	scene.model.samples = effort_count(check->validation, 32);
	const double begin = processor_s();
	require(renderer_render(renderer, &scene, NULL, NULL, &frame) == RENDER_OK, "no picture");
	const double took = processor_s() - begin, all = median_error(&frame, false), cloud = median_error(&frame, true);
	/* Errors fall with the root of the samples. */
	const double worse = fmax(all, cloud), needed_ms = 1e3 * took * pow(worse / 0.05, 2);
	tally_add(&check->validation->measured.tally[TALLY_PATHS_TIME], needed_ms / 2,
		  "%d samples in %.1f s of a processor; median error %.1f %% of all, %.1f %% of cloud", frame.samples, took, 100 * all,
		  100 * cloud);
	frame_finish(&frame);
	renderer_destroy(renderer);
	droplet_store_destroy(droplets);
}

void validate_paths(struct validation *validation)
{
	struct check check = {.validation = validation};
	check.tables = droplet_tables_create(validation->kernel, &PAPER_DROPLETS, OPTICS_MIE, THREADS);
	require(check.tables, "no droplets");
	compare_thin(&check);
	compare_furnace(&check);
	compare_layers(&check);
	measure_time(&check);
	droplet_tables_destroy(check.tables);
}
