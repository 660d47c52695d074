/* The clear sky of Hosek and Wilkie, An Analytic Model for Full Spectral Sky-Dome Radiance, SIGGRAPH 2012, eq. 8: luminance by the
 * coefficients in tests/data/hosek.json. */
#ifndef STRATUS_TESTS_VALIDATE_HOSEK_H
#define STRATUS_TESTS_VALIDATE_HOSEK_H

enum hosek_release { HOSEK_1_4A, HOSEK_1_1, HOSEK_RELEASES }; /* two fits by the authors to the same simulated skies */

/* By ground albedo (0, 1), turbidity (2, 3) and control point over the sun's elevation. */
struct hosek {
	double radiance[2][2][6];
	double distribution[HOSEK_RELEASES][2][2][6][9];
};

/* Ends the program where the file lacks anything. */
struct hosek hosek_read(const char *path);

/* Air and sun. turbidity 2..3, albedo 0..1, the sun's zenith angle 0..pi/2. */
struct hosek_sky {
	enum hosek_release release;
	double turbidity, albedo, sun_zenith;
};

/* cd/m2 at a zenith angle 0..pi/2 and an angle from the sun 0..pi. */
double hosek_luminance(const struct hosek *hosek, const struct hosek_sky *sky, double view_zenith, double angle);

/* What the luminance by the two releases differs by at most, as a ratio less 1, at the turbidities and albedos of the data set: the sun at
 * zenith angles of 20 to 80 degrees, views to 75. A number copied wrong shows here. */
double hosek_release_difference(const struct hosek *hosek);

#endif
