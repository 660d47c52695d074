/* How the exchange of light between ground and clouds converges. */
#include "tests/validate/deck.h"
#include "tests/validate/validate.h"

enum { CURVES = 5, SHOWN = 8 };

static const char *const curve_names[CURVES] = {"the default scene", "water sky", "radiosity over snow", "snow, a thick deck",
						"albedo 1, that deck"};

static struct scene curve_scene(int curve)
{
	struct scene scene = scene_default();
	scene.radiosity.tolerance = 1e-6;
	if (curve == 0)
		return scene;
	scene.sun.elevation_deg = 20;
	scene.clouds.base_m = curve == 1 ? 250 : 800;
	scene.clouds.type = curve == 2 ? CLOUD_STRATOCUMULUS : CLOUD_STRATUS;
	scene.clouds.coverage = curve == 2 ? 0.85 : 1;
	scene.clouds.thickness_m = curve == 1 ? 900 : curve == 2 ? 400 : 2000;
	scene.ground.type = curve == 1 ? GROUND_SEA_ICE : curve < 4 ? GROUND_SNOW : GROUND_LAMBERT;
	for (int band = 0; band < BAND_COUNT; band++)
		scene.ground.albedo[band] = 1;
	return scene;
}

static void print_curve(FILE *page, const char *name, const struct deck_radiosity *light)
{
	int enough = 0;
	while (light->residual[enough] > 1e-3)
		enough++;
	fprintf(page, "| %s |", name);
	for (int pass = 0; pass < SHOWN; pass++)
		if (light->residual[pass] > 0)
			fprintf(page, pass == enough ? " **%.1e** |" : " %.1e |", light->residual[pass]);
		else
			fprintf(page, " |");
	fprintf(page, "\n");
}

void figure_passes(struct validation *validation)
{
	struct deck *deck = deck_create(validation->kernel, DECK_AS_IT_IS);
	struct deck_radiosity light[CURVES];
	require(deck, "no OpenGL context");
	fprintf(validation->page,
		"\n## Passes of the exchange between ground and clouds\n\n"
		"![Residual after each pass](passes.svg)\n\n"
		"Light still on its way from base to ground after each pass, root mean square over the tile, over the "
		"mean of all that the ground\n"
		"receives, in the worst band. Bold: where the default tolerance of 1e-3 stops. A pass is one bounce up and "
		"one down; by conjugate\n"
		"gradients each takes off a factor of 3 to 100, where the plain series leaves the product of both "
		"albedos, 0.7 to 0.8 over snow.\n\n"
		"| scene | 1 |");
	for (int pass = 1; pass < SHOWN; pass++)
		fprintf(validation->page, " %d |", pass + 1);
	fprintf(validation->page, "\n| --- |");
	for (int pass = 0; pass < SHOWN; pass++)
		fprintf(validation->page, " --- |");
	fprintf(validation->page, "\n");
	for (int curve = 0; curve < CURVES; curve++) {
		const struct scene scene = curve_scene(curve);
		require(deck_radiosity(deck, &scene, &light[curve]), "a scene cannot be prepared");
		print_curve(validation->page, curve_names[curve], &light[curve]);
	}
	FILE *file = figure_file(validation, "passes");
	for (int curve = 0; curve < CURVES; curve++) {
		fprintf(file, "\"%s\"\n", curve_names[curve]);
		for (int pass = 0; pass < SHOWN && light[curve].residual[pass] > 0; pass++)
			fprintf(file, "%d\t%g\n", pass + 1, light[curve].residual[pass]);
		fprintf(file, "\n\n");
	}
	fclose(file);
	deck_destroy(deck);
}
