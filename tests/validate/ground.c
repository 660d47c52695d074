/* Light between ground and clouds: its form factors, whole pictures of a uniform deck, and how the exchange converges. */
#include "tests/validate/deck.h"
#include "tests/validate/squares.h"
#include "tests/validate/validate.h"

#include <jansson.h>

/* --- form factors ---------------------------------------------------------------------------------------------------------------- */

static void compare_squares(struct validation *validation)
{
	static const double tiles_m[] = {2000, 6000, 20000, 63000, 200000}, bases_m[] = {100, 350, 1200, 4000, 12000};
	static const double halves[] = {0.5, 1, 2, 4, 8, 16};
	double largest = 0;
	for (int i = 0; i < 25; i++)
		for (int k = 0; k < 6; k++) {
			double texel;
			const double tile = tiles_m[i / 5], base = bases_m[i % 5], error = square_error(tile, base, halves[k], &texel);
			require(error >= 0, "out of memory");
			if (texel <= 1 / 3.0)
				tally_add(&validation->measured.tally[TALLY_SQUARES], error, "tile %.0f m, base %.0f m, a = %g h", tile,
					  base, halves[k]);
			else
				largest = fmax(largest, error);
		}
	fprintf(validation->page,
		"- Squares: half-widths of h/2 to 16 h, seen in front of centre, edge and corner and outside, tiles of 2 to 200 km, bases "
		"at "
		"100 to 12000 m,\n"
		"  where the planes' texels are a third of h or finer: tiles up to 85 times the base's height. Beyond, squares of whole "
		"texels are exact in\n"
		"  front of texels' centres, and linear in between, here by up to %.0f %% off.\n",
		100 * largest);
}

/* --- pictures -------------------------------------------------------------------------------------------------------------------- */

static void compare_deck(struct validation *validation, struct deck *deck)
{
	struct tally *tally = validation->measured.tally;
	for (int i = 0, count = effort_count(validation, 80); i < count; i++) {
		const double tau = pow(50, random_unit()), zenith = 75 * random_unit(), albedo = 0.02 + 0.98 * random_unit();
		const struct scene scene = deck_scene(deck, tau, zenith, albedo);
		struct deck_light found, wanted;
		require(deck_measure(deck, &scene, &found), "the deck cannot be rendered");
		deck_expect(deck, &scene, &found, &wanted);
		for (int band = 0; band < BAND_COUNT; band++) {
			tally_add(&tally[TALLY_DECK_GROUND], fabs(found.ground[band] / wanted.ground[band] - 1),
				  "tau %.3g, sun at %.0f deg, albedo %.2f", tau, zenith, albedo);
			for (int view = 0; view < 2; view++)
				if (zenith + deck_views[view] > 10)
					tally_add(&tally[TALLY_DECK_BASE], fabs(found.base[view][band] / wanted.base[view][band] - 1),
						  "tau %.3g, sun at %.0f deg, albedo %.2f, view at %.0f deg", tau, zenith, albedo,
						  deck_views[view]);
		}
	}
}

static double element(const json_t *row, size_t i)
{
	const json_t *value = json_array_get(row, i);
	require(json_is_number(value), "ground.json: an element is missing");
	return json_number_value(value);
}

/* The rows are for sunlight alone: the sky's part of what was measured is taken off as the solver has it. */
static void compare_row(struct validation *validation, struct deck *deck, const json_t *flux, const json_t *radiance)
{
	struct tally *tally = &validation->measured.tally[TALLY_DECK_REFERENCE];
	const double tau = element(flux, 0), zenith = element(flux, 1), albedo = element(flux, 2);
	const struct scene scene = deck_scene(deck, tau, zenith, albedo);
	struct deck_light found, with_sky, sun, alone;
	require(deck_measure(deck, &scene, &found), "the deck cannot be rendered");
	deck_expect(deck, &scene, &found, &with_sky);
	sun = found;
	sun.sky[1] = 0;
	deck_expect(deck, &scene, &sun, &alone);
	const double beam = found.beam[1], normal = beam / cos(zenith * DEGREE);
	if (albedo > 0) /* else nothing is seen of it */
		tally_add(tally, fabs((found.ground[1] - with_sky.ground[1] + alone.ground[1]) / beam / element(flux, 4) - 1),
			  "ground, tau %g, sun at %g deg, albedo %.2f", tau, zenith, albedo);
	for (size_t view = 0; view < 2; view++)
		tally_add(tally,
			  fabs((found.base[view][1] - with_sky.base[view][1] + alone.base[view][1]) / normal / element(radiance, 3 + view) -
			       1),
			  "base, tau %g, sun at %g deg, albedo %.2f", tau, zenith, albedo);
}

static void compare_reference(struct validation *validation, struct deck *deck)
{
	json_t *ground = json_load_file("tests/data/ground.json", JSON_REJECT_DUPLICATES, NULL);
	const json_t *rows = json_object_get(ground, "rows");
	const json_t *radiances = json_object_get(json_object_get(ground, "base_radiance_seen_from_below"), "rows");
	require(json_array_size(rows) > 0 && json_array_size(rows) == json_array_size(radiances), "tests/data/ground.json cannot be read");
	for (size_t i = 0; i < json_array_size(rows); i++)
		compare_row(validation, deck, json_array_get(rows, i), json_array_get(radiances, i));
	json_decref(ground);
}

static void compare_balance(struct validation *validation, struct deck *deck)
{
	for (int i = 0, count = effort_count(validation, 6); i < count; i++) {
		const double tau = 5 * pow(8, random_unit()), zenith = 70 * random_unit(), albedo = 0.02 + 0.98 * random_unit();
		const struct scene scene = deck_scene(deck, tau, zenith, albedo);
		struct deck_light light;
		double leaving[BAND_COUNT];
		require(deck_measure(deck, &scene, &light) && deck_measure_leaving(deck, &scene, leaving), "the deck cannot be rendered");
		for (int band = 0; band < BAND_COUNT; band++)
			tally_add(&validation->measured.tally[TALLY_DECK_BALANCE],
				  fabs((leaving[band] + (1 - albedo) * light.ground[band]) / (light.beam[band] + light.sky[band]) - 1),
				  "tau %.3g, sun at %.0f deg, albedo %.2f", tau, zenith, albedo);
	}
}

void validate_ground(struct validation *validation)
{
	struct deck *deck = deck_create(validation->kernel, true);
	require(deck, "no deck");
	compare_squares(validation);
	compare_deck(validation, deck);
	compare_reference(validation, deck);
	compare_balance(validation, deck);
	deck_destroy(deck);
	fprintf(validation->page,
		"- Decks: pictures of a uniform layer, base at 100 m, without aerosol and ozone, tau 1 to 50, sun 0 to 75 degrees from the "
		"vertical,\n"
		"  albedo 0.02 to 1, all bands. The ground is seen from 1 m above it, the base from 1 m below it, straight up and at 30 "
		"degrees.\n"
		"- Balance: sunlight and skylight on the top of such decks against what leaves it, integrated over pictures from 1 m above "
		"it, and what the\n"
		"  ground takes. Not in it: the air between base and ground. It takes from the beam and adds to the sky's light in the "
		"amount that a clear\n"
		"  sky has, through the gaps between clouds; the light that ground and base exchange passes it unchanged.\n");
}

/* --- water sky ------------------------------------------------------------------------------------------------------------------- */

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
	static const double taus[] = {10, 20, 40}, bases[] = {400, 1000};
	struct deck *deck = deck_create(validation->kernel, true);
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
			if (elevations[k] == 30)
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
		"Res. 107). There rocks and bays lie between snow and ocean; here fresh snow ends at the water.\n");
	deck_destroy(deck);
}

/* --- the figure of the passes ------------------------------------------------------------------------------------------------------ */

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
	struct deck *deck = deck_create(validation->kernel, false);
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
