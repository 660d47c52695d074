#include "renderer/stages/colour.h"

#include <math.h>

const double colour_solar_irradiance[3] = {1.5821, 1.8682, 1.9899};

/* Solar irradiance outside the atmosphere every 10 nm from 380 to 780 nm, W/m2/nm: the ASTM E-490 spectrum smoothed to 10 nm. */
enum { SPECTRUM_FIRST_NM = 380, SPECTRUM_STEP_NM = 10, SPECTRUM_COUNT = 41 };
static const double solar_spectrum[SPECTRUM_COUNT] = {
	1.12, 1.10, 1.54, 1.71, 1.74, 1.60, 1.82, 1.99, 2.04, 2.04, 2.05, 1.96, 1.93, 1.91, 1.83, 1.91, 1.88, 1.87, 1.83, 1.83, 1.84,
	1.78, 1.76, 1.72, 1.68, 1.65, 1.62, 1.58, 1.55, 1.53, 1.50, 1.46, 1.42, 1.40, 1.36, 1.34, 1.30, 1.27, 1.25, 1.22, 1.20,
};

static double lobe(double nm, double centre, double below, double above)
{
	const double t = (nm - centre) * (nm < centre ? below : above);
	return exp(-0.5 * t * t);
}

/* Multi-lobe fit of Wyman, Sloan, Shirley 2013 ("Simple Analytic Approximations to the CIE XYZ Color Matching
 * Functions", JCGT 2(2), table 1), within 1 % of the tables. */
void colour_observer(double nm, double xyz[3])
{
	xyz[0] =
		1.056 * lobe(nm, 599.8, 0.0264, 0.0323) + 0.362 * lobe(nm, 442.0, 0.0624, 0.0374) - 0.065 * lobe(nm, 501.1, 0.0490, 0.0382);
	xyz[1] = 0.821 * lobe(nm, 568.8, 0.0213, 0.0247) + 0.286 * lobe(nm, 530.9, 0.0613, 0.0322);
	xyz[2] = 1.217 * lobe(nm, 437.0, 0.0845, 0.0278) + 0.681 * lobe(nm, 459.0, 0.0385, 0.0725);
}

/* XYZ of unit radiance in each band, in cd/m2 (Y). */
static void band_xyz(double xyz[3][3])
{
	for (int c = 0; c < 3; c++)
		for (int b = 0; b < 3; b++)
			xyz[c][b] = 0;
	for (int i = 0; i < SPECTRUM_COUNT; i++) {
		const double nm = SPECTRUM_FIRST_NM + SPECTRUM_STEP_NM * i;
		/* Parabola through the bands at x = 0 (450), 1 (550), 2 (650). */
		const double x = (nm - 450) / 100;
		const double weight[3] = {x * (x - 1) / 2, x * (2 - x), (x - 1) * (x - 2) / 2};
		double cmf[3];
		colour_observer(nm, cmf);
		for (int c = 0; c < 3; c++)
			for (int b = 0; b < 3; b++)
				xyz[c][b] += 683.0 * cmf[c] * SPECTRUM_STEP_NM * solar_spectrum[i] * weight[b] / colour_solar_irradiance[b];
	}
}

void colour_band_matrix(double matrix[3][3])
{
	static const double rec709[3][3] = {
		{3.2404542, -1.5371385, -0.4985314}, {-0.9692660, 1.8760108, 0.0415560}, {0.0556434, -0.2040259, 1.0572252}};
	double xyz[3][3];
	band_xyz(xyz);
	for (int c = 0; c < 3; c++)
		for (int b = 0; b < 3; b++)
			matrix[c][b] =
				(rec709[c][0] * xyz[0][b] + rec709[c][1] * xyz[1][b] + rec709[c][2] * xyz[2][b]) / COLOUR_WHITE_LUMINANCE;
}

double colour_luminance(const double bands[3])
{
	double xyz[3][3];
	band_xyz(xyz);
	return fmax(0.0, xyz[1][0] * bands[0] + xyz[1][1] * bands[1] + xyz[1][2] * bands[2]);
}
