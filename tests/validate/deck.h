/* A uniform deck over Lambertian ground or over a coast, in whole pictures: what the ground receives, what the base sends down and the top
 * up, and what the solved slab with a reflecting ground says of it.
 *
 * The renderer's own stages and shaders run, but for two functions. The one that says how thick the layer is is replaced by the layer's
 * greatest thickness everywhere; the one that paints sea ice by a straight coast along the tile's middle: snow in the west, water in the
 * east. And the tops have no puffs. Makes an OpenGL context of its own, which is current until another deck is made or this one destroyed:
 * one deck at a time.
 */
#ifndef STRATUS_TESTS_VALIDATE_DECK_H
#define STRATUS_TESTS_VALIDATE_DECK_H

#include "renderer/optics/kernel.h"
#include "renderer/optics/optics.h"
#include "renderer/renderer.h"

#include <stdbool.h>

struct deck;

enum deck_kind {
	DECK_UNIFORM,
	DECK_PUFFED,  /* with the puffs */
	DECK_AS_IT_IS /* with the shaders as they are */
};

/* NULL when OpenGL or its compiler says no. */
struct deck *deck_create(const struct kernel *kernel, enum deck_kind kind);
void deck_destroy(struct deck *deck);

/* Per band, W/m2/nm(/sr). */
struct deck_light {
	double beam[BAND_COUNT], sky[BAND_COUNT]; /* what falls on the top of the layer, horizontal */
	double ground[BAND_COUNT];                /* received by the ground, out of its picture from 1 m above it; NAN when it is black */
	double base[2][BAND_COUNT];               /* radiance of the base at deck_views, from 1 m below it */
};

/* Zenith angles that the base is seen at, in degrees; away from the sun. */
extern const double deck_views[2];

/* The scene with its deck: stratus, overcast, base at 100 m, optical thickness tau at 550 nm, no aerosol, no ozone. */
struct scene deck_scene(const struct deck *deck, double tau, double sun_zenith_deg, double albedo);

/* Of a picture. false when it cannot be rendered. */
bool deck_measure(struct deck *deck, const struct scene *scene, struct deck_light *light);

/* By adding-doubling and, for the ground, the closed form of a Lambertian reflector: from the beam and sky that were measured. */
void deck_expect(const struct deck *deck, const struct scene *scene, const struct deck_light *measured, struct deck_light *expected);

/* The flux that leaves the top, integrated over pictures from 1 m above it. Of a uniform deck, which is the same everywhere. */
bool deck_measure_leaving(struct deck *deck, const struct scene *scene, double leaving[BAND_COUNT]);

/* The same of any deck, as the mean of whole spheres seen from so many places just above the top, air between included. */
bool deck_measure_leaving_around(struct deck *deck, const struct scene *scene, int places, double leaving[BAND_COUNT]);

/* The flux that leaves the ground, likewise, from a little above it. */
bool deck_measure_ground(struct deck *deck, const struct scene *scene, int places, double leaving[BAND_COUNT]);

/* Luminance that the layer sends to a camera at (east, north, height), air between included, cd/m2. */
bool deck_measure_luminance(struct deck *deck, const struct scene *scene, const double position_m[3], double azimuth_deg,
			    double elevation_deg, double *luminance);

/* What the radiosity stage has for a scene, whatever its clouds and ground. */
struct deck_radiosity {
	double ground_diffuse[BAND_COUNT], ground_direct[BAND_COUNT];
	double ground_albedo[BAND_COUNT];                      /* its mean over the tile */
	double sky_ground[BAND_COUNT], sun_ground[BAND_COUNT]; /* of a clear sky, horizontal */
	int passes;
	double residual[RADIOSITY_PASSES_LISTED];
};
bool deck_radiosity(struct deck *deck, const struct scene *scene, struct deck_radiosity *radiosity);

#endif
