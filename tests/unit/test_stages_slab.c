/* The view's look-ups of the solved slab, run on the GPU, against the solver on the processor. Wants build/mie.kernel, or the file that
 * STRATUS_KERNEL names; skipped where no OpenGL context comes up. */
#include "renderer/gl/context.h"
#include "renderer/log.h"
#include "renderer/optics/kernel.h"
#include "renderer/stages/slab_probe.h"

#include <epoxy/gl.h>

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#define DEGREE (M_PI / 180)

enum { PROBES = 2048 };

static struct stage_context context;
static const struct pass_compiler compiler = {.kind = PASS_FRAGMENT};

/* 0..1, the same in every run. */
static double random_unit(void)
{
	static uint64_t state = 11;
	state = state * 6364136223846793005ULL + 1442695040888963407ULL;
	return (double)(state >> 11) * 0x1p-53;
}

struct errors {
	double square, worst;
	int count;
};

static void errors_add(struct errors *errors, double value, double wanted, double scale)
{
	const double error = fabs(value - wanted) / scale;
	assert_true(isfinite(value) && value >= 0);
	errors->square += error * error;
	errors->worst = fmax(errors->worst, error);
	errors->count++;
}

static void errors_check(const char *what, const struct errors *errors, double rms, double worst)
{
	const double found = sqrt(errors->square / errors->count);
	print_message("%s: rms %.3f %%, worst %.2f %% of %d\n", what, 100 * found, 100 * errors->worst, errors->count);
	assert_true(errors->count > 0 && found <= rms && errors->worst <= worst);
}

static double scattering_angle(const struct slab_probe *probe, enum slab_side side)
{
	const double along = side == SLAB_TRANSMITTED ? probe->mu_l * probe->mu_v : -probe->mu_l * probe->mu_v;
	const double sines = sqrt((1 - probe->mu_l * probe->mu_l) * (1 - probe->mu_v * probe->mu_v));
	return acos(fmin(fmax(along + sines * cos(probe->azimuth), -1), 1));
}

static struct scene random_scene(void)
{
	struct scene scene = scene_default();
	do {
		scene.dsd.gamma = 1 + 19 * random_unit();
		scene.dsd.effective_radius_um = pow(30, random_unit());
		scene.dsd.n0_per_cm3 = pow(5000, random_unit());
	} while (scene_dsd_liquid_water(&scene.dsd) > 5);
	scene.sun.elevation_deg = random_unit() < 0.3 ? 12 * random_unit() - 3 : 90 * random_unit();
	scene.camera.position_m[2] = random_unit() < 0.5 ? 2 : 6000;
	scene.clouds.thickness_m = 2000;
	return scene;
}

static struct slab_probe random_probe(const struct slab_probe_frame *frame)
{
	const double tau = 0.01 * pow(1e5, random_unit()); /* 0.01 .. 1000 */
	return (struct slab_probe){.thickness_m = tau / frame->droplets->tables->optics->extinction_per_m[1],
				   .mu_l = frame->mu_first + (frame->mu_last - frame->mu_first) * random_unit(),
				   .mu_v = 0.03 + 0.97 * random_unit(),
				   .azimuth = M_PI * random_unit()};
}

/* One side of a frame against the solver. */
static void compare(const struct slab_probe_frame *frame, const struct scene *scene, bool base, struct errors *all, struct errors *peaks)
{
	static struct slab_probe probes[PROBES];
	static struct slab_probe_light light[PROBES];
	const struct droplet_tables *tables = frame->droplets->tables;
	const bool from_above = scene->camera.position_m[2] >= scene->clouds.base_m;
	const enum slab_side side = base == from_above ? SLAB_TRANSMITTED : SLAB_REFLECTED;
	for (int i = 0; i < PROBES; i++)
		probes[i] = random_probe(frame);
	assert_true(slab_probe_run(&compiler, frame, scene, base, probes, PROBES, light));
	for (int i = 0; i < PROBES; i++) {
		const int band = i % BAND_COUNT;
		const double tau = tables->optics->extinction_per_m[band] * probes[i].thickness_m;
		const double wanted =
			slab_radiance(tables->slab, tables->optics, band, side, tau, probes[i].mu_l, probes[i].mu_v, probes[i].azimuth);
		const double angle = scattering_angle(&probes[i], side);
		const bool peak = angle < 3 * DEGREE || angle > 175 * DEGREE;
		/* What is less than a millionth of the sun's light is nothing. */
		errors_add(peak ? peaks : all, light[i].first[band] + light[i].multiple[band], wanted, fmax(wanted, 1e-6));
	}
}

static void look_ups_follow_the_solver(void **state)
{
	(void)state;
	struct errors all = {0}, peaks = {0};
	const char *count = getenv("STRATUS_SLAB_SCENES");
	for (int i = 0, scenes = count ? atoi(count) : 24; i < scenes; i++) {
		const struct scene scene = random_scene();
		struct slab_probe_frame frame;
		cache_begin_frame(context.cache);
		assert_true(slab_probe_prepare(&context, &scene, &frame));
		for (int base = 0; base < 2; base++)
			if (frame.lit[base])
				compare(&frame, &scene, base, &all, &peaks);
	}
	errors_check("outside the peaks", &all, 0.01, 0.04);
	errors_check("within them", &peaks, 0.03, 0.15);
}

/* Light within 3 degrees of the forward direction, by rings round the sun. */
static double forward_flux(const struct slab_probe_light *light, int rings, int spokes, int band)
{
	double sum = 0;
	for (int ring = 0; ring < rings; ring++)
		for (int spoke = 0; spoke < spokes; spoke++) {
			const double unit = (ring + 0.5) / rings, angle = 3 * DEGREE * unit * unit;
			const double area = 2 * M_PI * sin(angle) * 3 * DEGREE * 2 * unit / rings / spokes;
			sum += area * (light[ring * spokes + spoke].first[band] + light[ring * spokes + spoke].multiple[band]);
		}
	return sum;
}

static void aureole_has_its_flux(void **state)
{
	(void)state;
	enum { RINGS = 64, SPOKES = 16 };
	static struct slab_probe probes[RINGS * SPOKES];
	static struct slab_probe_light light[RINGS * SPOKES], exact[RINGS * SPOKES];
	static const double depths[] = {0.1, 0.5, 2, 5, 12};
	double worst = 0;
	for (int i = 0; i < 20; i++) {
		struct scene scene = random_scene();
		struct slab_probe_frame frame;
		scene.sun.elevation_deg = 15 + 65 * random_unit();
		scene.camera.position_m[2] = 2;
		cache_begin_frame(context.cache);
		assert_true(slab_probe_prepare(&context, &scene, &frame));
		const struct droplet_tables *tables = frame.droplets->tables;
		const double mu_l = sin(scene.sun.elevation_deg * DEGREE), sine = sqrt(1 - mu_l * mu_l), tau = depths[i % 5];
		for (int k = 0; k < RINGS * SPOKES; k++) {
			const double unit = (k / SPOKES + 0.5) / RINGS, angle = 3 * DEGREE * unit * unit,
				     turn = 2 * M_PI * (k % SPOKES) / SPOKES;
			/* The direction at `angle` from the beam (0 along x), turned round it. */
			const double x = sine * cos(angle) + mu_l * sin(angle) * cos(turn),
				     z = mu_l * cos(angle) - sine * sin(angle) * cos(turn);
			probes[k] = (struct slab_probe){.thickness_m = tau / tables->optics->extinction_per_m[1],
							.mu_l = mu_l,
							.mu_v = z,
							.azimuth = atan2(sin(angle) * sin(turn), x)};
			for (int band = 0; band < BAND_COUNT; band++)
				exact[k].first[band] = slab_radiance(tables->slab, tables->optics, band, SLAB_TRANSMITTED,
								     tables->optics->extinction_per_m[band] * probes[k].thickness_m, mu_l,
								     z, probes[k].azimuth);
		}
		assert_true(slab_probe_run(&compiler, &frame, &scene, false, probes, RINGS * SPOKES, light));
		for (int band = 0; band < BAND_COUNT; band++) {
			const double found = forward_flux(light, RINGS, SPOKES, band), wanted = forward_flux(exact, RINGS, SPOKES, band);
			worst = fmax(worst, fabs(found / wanted - 1));
		}
	}
	print_message("flux within 3 degrees of the sun: off by at most %.2f %%\n", 100 * worst);
	assert_true(worst < 0.02);
}

/* At the horizon and beyond the last depth everything stays finite and not negative. */
static void horizon_is_finite(void **state)
{
	(void)state;
	static const double cosines[] = {0, 1e-6, 1e-3, 0.01, 1};
	static const double depths[] = {0, 1e-6, 1e-2, 551, 2e4};
	struct slab_probe probes[25];
	struct slab_probe_light light[25];
	for (double elevation = -18; elevation <= 90; elevation += 12) {
		struct scene scene = scene_default();
		struct slab_probe_frame frame;
		scene.sun.elevation_deg = elevation;
		cache_begin_frame(context.cache);
		assert_true(slab_probe_prepare(&context, &scene, &frame));
		for (int i = 0; i < 25; i++)
			probes[i] = (struct slab_probe){.thickness_m = depths[i / 5] / 0.037,
							.mu_l = i % 2 ? frame.mu_first : frame.mu_last,
							.mu_v = fmax(cosines[i % 5], 0.01),
							.azimuth = i};
		for (int base = 0; base < 2; base++) {
			if (!frame.lit[base])
				continue;
			assert_true(slab_probe_run(&compiler, &frame, &scene, base, probes, 25, light));
			for (int i = 0; i < 25; i++)
				for (int band = 0; band < BAND_COUNT; band++) {
					assert_true(isfinite(light[i].first[band]) && light[i].first[band] >= 0);
					assert_true(isfinite(light[i].multiple[band]) && light[i].multiple[band] >= 0);
				}
		}
	}
}

int main(void)
{
	const char *path = getenv("STRATUS_KERNEL");
	struct kernel *kernel = kernel_load(path ? path : "build/mie.kernel");
	if (!kernel)
		return 1;
	log_set_level(LOG_ERROR);
	struct gl_context *gl = gl_context_create(-1, false);
	if (!gl)
		return 77;
	context.droplets = droplet_store_create(&(struct droplet_store_params){.kernel = kernel, .memory_bytes = 1});
	if (!context.droplets)
		return 1;
	context.cache = cache_create(64u << 20);
	glCreateBuffers(1, &context.block_buffer);
	glNamedBufferStorage(context.block_buffer, sizeof context.block, NULL, GL_DYNAMIC_STORAGE_BIT);
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(look_ups_follow_the_solver),
		cmocka_unit_test(aureole_has_its_flux),
		cmocka_unit_test(horizon_is_finite),
	};
	const int failed = cmocka_run_group_tests(tests, NULL, NULL);
	droplets_release(&context);
	cache_destroy(context.cache);
	glDeleteBuffers(1, &context.block_buffer);
	gl_context_destroy(gl);
	droplet_store_destroy(context.droplets);
	kernel_destroy(kernel);
	return failed;
}
