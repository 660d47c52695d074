/* The sky over a coast: beside what was measured. */
#include "tests/validate/deck.h"
#include "tests/validate/validate.h"

enum { ELEVATIONS = 5, TRANSECT = 81 };

/* A straight coast with the sun along it, snow in the west. */
static struct scene coast_scene(const struct deck *deck, double tau, double base_m)
{
	struct scene scene = deck_scene(deck, tau, 60, 0);
	scene.ground.type = GROUND_SEA_ICE;
	scene.clouds.base_m = base_m;
	scene.clouds.tile_m = 60 * base_m; /* the other coast, at its ends, is far */
	scene.sun.azimuth_deg = 0;
	return scene;
}

static double luminance(struct deck *deck, const struct scene *scene, double x, double height, double azimuth, double elevation)
{
	const double place[] = {scene->clouds.tile_m / 2 + x, 100, height};
	double value;
	require(deck_measure_luminance(deck, scene, place, azimuth, elevation, &value), "the coast cannot be rendered");
	return value;
}

/* Distance over which the base, seen from below, goes from 90 to 10 % of its step across the coast, over its height. */
static double transition(struct deck *deck, const struct scene *scene)
{
	const double base = scene->clouds.base_m;
	double light[TRANSECT], at[2] = {0};
	for (int i = 0; i < TRANSECT; i++)
		light[i] = luminance(deck, scene, base * (i - TRANSECT / 2) * 0.2, base - 1, 0, 90);
	for (int share = 0; share < 2; share++) {
		const double level = light[TRANSECT - 1] + (share ? 0.1 : 0.9) * (light[0] - light[TRANSECT - 1]);
		int i = 1;
		while (i < TRANSECT - 1 && light[i] > level)
			i++;
		at[share] = 0.2 * (i - (level - light[i]) / (light[i - 1] - light[i]));
	}
	return at[1] - at[0];
}

void figure_water_sky(struct validation *validation)
{
	static const double taus[] = {10, 20, 40}, bases[] = {250, 500}; /* tiles of one picture of the ground */
	struct deck *deck = deck_create(validation->kernel, DECK_UNIFORM);
	require(deck, "no deck");
	fprintf(validation->page,
		"\n## Water sky\n\n"
		"A uniform deck over a straight coast, snow on one side, water on the other, sun along it 60 degrees from the vertical. "
		"From "
		"the coast the\n"
		"sky over the snow is so many times as bright as that over the water at these elevations; from below the base straight up "
		"it "
		"goes from 90\n"
		"to 10 %% of the step in so many heights h of the base, which for a single bounce would be 8/3.\n\n"
		"| tau | base | 10 deg | 20 | 30 | 45 | 60 | transition |\n| --- | --- | --- | --- | --- | --- | --- | --- |\n");
	for (int i = 0; i < 6; i++) {
		static const double elevations[ELEVATIONS] = {10, 20, 30, 45, 60};
		const struct scene scene = coast_scene(deck, taus[i / 2], bases[i % 2]);
		fprintf(validation->page, "| %g | %g m |", taus[i / 2], bases[i % 2]);
		for (int k = 0; k < ELEVATIONS; k++) {
			const double contrast =
				luminance(deck, &scene, 0, 2, 270, elevations[k]) / luminance(deck, &scene, 0, 2, 90, elevations[k]);
			fprintf(validation->page, " %.2f |", contrast);
			/* Decks of usual thickness: very thick ones are above what was measured, which the page says. */
			if (elevations[k] == 30 && taus[i / 2] <= 20)
				tally_add(&validation->measured.tally[TALLY_WATER_SKY], fabs(contrast / 2 - 1), "tau %g, base %g m: %.2f",
					  taus[i / 2], bases[i % 2], contrast);
		}
		fprintf(validation->page, " %.1f h |\n", transition(deck, &scene));
	}
	fprintf(validation->page,
		"\nMeasured under uniform stratus at Palmer Station, Antarctica: up to twice as bright over the island's snow as over open "
		"ocean in the\n"
		"visible, whatever the cloud's height and hardly depending on its depth (P. Ricchiazzi, A. Payton and C. Gautier 2002, \"A "
		"test "
		"of\n"
		"three-dimensional radiative transfer simulation using the radiance signatures and contrasts at a high latitude coastal "
		"site\", J. Geophys.\n"
		"Res. 107). There rocks and bays lie between snow and ocean; here fresh snow ends at the water, and a deck of tau 40 comes "
		"out above "
		"that: it\n"
		"counts in no bound.\n");
	deck_destroy(deck);
}
