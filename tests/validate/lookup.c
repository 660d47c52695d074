/* The view's look-ups of the solved slab, run on the GPU and read back, against the solver. */
#include "tests/validate/validate.h"

#include "renderer/gl/context.h"
#include "renderer/stages/slab_probe.h"

#include <epoxy/gl.h>

#include <stdlib.h>

enum { PROBES = 2048, RINGS = 64, SPOKES = 16, CONE = RINGS * SPOKES };

static const struct pass_compiler compiler = {.kind = PASS_FRAGMENT};

static struct scene scene_of(struct scene_dsd dsd, bool above, double elevation_deg)
{
	struct scene scene = scene_default();
	scene.dsd = dsd;
	scene.sun.elevation_deg = elevation_deg;
	scene.camera.position_m[2] = above ? 6000 : 2;
	scene.clouds.thickness_m = 2000;
	return scene;
}

static double light_sum(const struct slab_probe_light *light, int band)
{
	return light->first[band] + light->multiple[band];
}

/* One side of a layer: optical thickness 0.01 to 1000, views down to 1 degree above the horizon. */
static void compare_side(struct validation *validation, const struct slab_probe_frame *frame, const struct scene *scene, bool base)
{
	static struct slab_probe probes[PROBES];
	static struct slab_probe_light light[PROBES];
	const struct droplet_tables *tables = frame->droplets->tables;
	const bool above = scene->camera.position_m[2] >= scene->clouds.base_m;
	const enum slab_side side = base == above ? SLAB_TRANSMITTED : SLAB_REFLECTED;
	for (int i = 0; i < PROBES; i++)
		probes[i] = (struct slab_probe){.thickness_m = 0.01 * pow(1e5, random_unit()) / tables->optics->extinction_per_m[1],
						.mu_l = frame->mu_first + (frame->mu_last - frame->mu_first) * random_unit(),
						.mu_v = 0.02 + 0.98 * random_unit(),
						.azimuth = M_PI * random_unit()};
	require(slab_probe_run(&compiler, frame, scene, base, probes, PROBES, light), "the look-up cannot be run");
	for (int i = 0; i < PROBES; i++) {
		const struct slab_probe *probe = &probes[i];
		const int band = i % BAND_COUNT;
		const double cosine = scattering_cosine(side, probe->mu_l, probe->mu_v, probe->azimuth);
		if (cosine > cos(3 * DEGREE) || cosine < cos(175 * DEGREE))
			continue;
		const double tau = tables->optics->extinction_per_m[band] * probe->thickness_m;
		const double wanted =
			slab_radiance(tables->slab, tables->optics, band, side, tau, probe->mu_l, probe->mu_v, probe->azimuth);
		/* What is less than a millionth of the sun's light is nothing. */
		tally_add(&validation->measured.tally[TALLY_LOOKUP], fabs(light_sum(&light[i], band) - wanted) / fmax(wanted, 1e-6),
			  "gamma %.3g, re %.3g um, %s, tau %.3g, sun at %.1f, view at %.1f deg, azimuth %.0f", scene->dsd.gamma,
			  scene->dsd.effective_radius_um, side == SLAB_REFLECTED ? "reflected" : "transmitted", tau,
			  acos(probe->mu_l) / DEGREE, acos(probe->mu_v) / DEGREE, probe->azimuth / DEGREE);
	}
}

static void compare_frame(struct validation *validation, struct stage_context *context, int number)
{
	const bool low = random_unit() < 0.3;
	const struct scene scene = scene_of(droplets_at(number), random_unit() < 0.5, low ? 12 * random_unit() - 3 : 90 * random_unit());
	struct slab_probe_frame frame;
	cache_begin_frame(context->cache);
	require(slab_probe_prepare(context, &scene, &frame), "the look-up's tables cannot be made");
	for (int base = 0; base < 2; base++)
		if (frame.lit[base])
			compare_side(validation, &frame, &scene, base);
	droplets_release(context);
}

/* --- the aureole ----------------------------------------------------------------------------------------------------------------- */

/* The direction of a node: rings about the beam (0 along x), dense in the middle. Returns its share of solid angle. */
static double cone_probe(struct slab_probe *probe, int node)
{
	const double unit = (node / SPOKES + 0.5) / RINGS, angle = 3 * DEGREE * unit * unit, turn = 2 * M_PI * (node % SPOKES) / SPOKES;
	const double mu = probe->mu_l, sine = sqrt(1 - mu * mu);
	const double x = sine * cos(angle) + mu * sin(angle) * cos(turn);
	probe->mu_v = mu * cos(angle) - sine * sin(angle) * cos(turn);
	probe->azimuth = atan2(sin(angle) * sin(turn), x);
	return 2 * M_PI * sin(angle) * 3 * DEGREE * 2 * unit / RINGS / SPOKES;
}

static void compare_cone(struct validation *validation, struct stage_context *context, int number)
{
	static struct slab_probe probes[CONE];
	static struct slab_probe_light light[CONE];
	static double share[CONE];
	const double tau = 0.05 * pow(400, random_unit());
	const struct scene scene = scene_of(droplets_at(number), false, 10 + 80 * random_unit());
	struct slab_probe_frame frame;
	cache_begin_frame(context->cache);
	require(slab_probe_prepare(context, &scene, &frame), "the look-up's tables cannot be made");
	const struct droplet_tables *tables = frame.droplets->tables;
	for (int i = 0; i < CONE; i++) {
		probes[i] = (struct slab_probe){.thickness_m = tau / tables->optics->extinction_per_m[1],
						.mu_l = fmin(sin(scene.sun.elevation_deg * DEGREE), 1)};
		share[i] = cone_probe(&probes[i], i);
	}
	require(slab_probe_run(&compiler, &frame, &scene, false, probes, CONE, light), "the look-up cannot be run");
	for (int band = 0; band < BAND_COUNT; band++) {
		double found = 0, wanted = 0;
		for (int i = 0; i < CONE; i++) {
			found += share[i] * light_sum(&light[i], band);
			wanted += share[i] * slab_radiance(tables->slab, tables->optics, band, SLAB_TRANSMITTED,
							   tables->optics->extinction_per_m[band] * probes[i].thickness_m, probes[i].mu_l,
							   probes[i].mu_v, probes[i].azimuth);
		}
		tally_add(&validation->measured.tally[TALLY_LOOKUP_FORWARD], fabs(found / wanted - 1),
			  "gamma %.3g, re %.3g um, tau %.3g, sun at %.1f deg", scene.dsd.gamma, scene.dsd.effective_radius_um, tau,
			  90 - scene.sun.elevation_deg);
	}
	droplets_release(context);
}

void validate_lookup(struct validation *validation)
{
	struct gl_context *gl = gl_context_create(-1, false);
	require(gl, "no OpenGL context");
	struct stage_context context = {.cache = cache_create(64u << 20)};
	context.droplets = droplet_store_create(&(struct droplet_store_params){.kernel = validation->kernel, .memory_bytes = 1});
	require(context.cache && context.droplets, "out of memory");
	glCreateBuffers(1, &context.block_buffer);
	glNamedBufferStorage(context.block_buffer, sizeof context.block, NULL, GL_DYNAMIC_STORAGE_BIT);
	for (int i = 0, count = effort_count(validation, 60); i < count; i++)
		compare_frame(validation, &context, i);
	for (int i = 0, count = effort_count(validation, 40); i < count; i++)
		compare_cone(validation, &context, i);
	fprintf(validation->page,
		"- Look-ups: random tau 0.01 to 1000, sun and view down to a degree above the horizon, all azimuths, outside 3 degrees of "
		"the "
		"forward and 5 of the\n"
		"  backward direction, run by %s.\n",
		glGetString(GL_RENDERER));
	cache_destroy(context.cache);
	glDeleteBuffers(1, &context.block_buffer);
	gl_context_destroy(gl);
	droplet_store_destroy(context.droplets);
}
