/* Light between ground and clouds: its form factors, and whole pictures of a uniform deck. */
#include "renderer/stages/exchange.h"
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
			if (texel <= 1 / EXCHANGE_TEXELS)
				tally_add(&validation->measured.tally[TALLY_SQUARES], error, "tile %.0f m, base %.0f m, a = %g h", tile,
					  base, halves[k]);
			else
				largest = fmax(largest, error);
		}
	fprintf(validation->page,
		"- Squares: half-widths of h/2 to 16 h, seen in front of centre, edge and corner and outside, tiles of 2 to 200 km, bases "
		"at "
		"100 to 12000 m,\n"
		"  where the planes have 3.2 texels to h or more: tiles up to 160 times the base's height. Beyond, squares of whole "
		"texels are exact in\n"
		"  front of texels' centres, and linear in between, here by up to %.0f %% off.\n",
		100 * largest);
}

/* Places enough that puffs do not count singly. */
enum { PUFFED_PLACES = 32 };

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

static void compare_balance(struct validation *validation, struct deck *deck, bool puffed)
{
	struct tally *tally = &validation->measured.tally[puffed ? TALLY_PUFFED_BALANCE : TALLY_DECK_BALANCE];
	for (int i = 0, count = effort_count(validation, 6); i < count; i++) {
		const double tau = 5 * pow(8, random_unit()), zenith = 70 * random_unit(), albedo = 0.02 + 0.98 * random_unit();
		const struct scene scene = deck_scene(deck, tau, zenith, albedo);
		struct deck_light light;
		double leaving[BAND_COUNT];
		require(deck_measure(deck, &scene, &light), "the deck cannot be rendered");
		require(puffed ? deck_measure_leaving_around(deck, &scene, PUFFED_PLACES, leaving)
			       : deck_measure_leaving(deck, &scene, leaving),
			"the deck cannot be rendered");
		for (int band = 0; band < BAND_COUNT; band++)
			tally_add(tally,
				  fabs((leaving[band] + (1 - albedo) * light.ground[band]) / (light.beam[band] + light.sky[band]) - 1),
				  "tau %.3g, sun at %.0f deg, albedo %.2f", tau, zenith, albedo);
	}
}

void validate_ground(struct validation *validation)
{
	struct deck *deck = deck_create(validation->kernel, DECK_UNIFORM);
	require(deck, "no deck");
	compare_squares(validation);
	compare_deck(validation, deck);
	compare_reference(validation, deck);
	compare_balance(validation, deck, false);
	deck_destroy(deck);
	deck = deck_create(validation->kernel, DECK_PUFFED);
	require(deck, "no deck");
	compare_balance(validation, deck, true);
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
		"  sky has, through the gaps between clouds; the light that ground and base exchange passes it unchanged.\n"
		"- Puffs, which tops near the camera have, are not in these uniform decks; with them the same is the mean of "
		"whole "
		"spheres from %d\n"
		"  places 25 m above the tops.\n",
		PUFFED_PLACES);
}
