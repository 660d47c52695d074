/* From radiance in three bands to colour. Any thread. */
#ifndef STRATUS_RENDERER_STAGES_COLOUR_H
#define STRATUS_RENDERER_STAGES_COLOUR_H

/* Solar irradiance outside the atmosphere in the bands (650, 550, 450 nm), W/m2/nm: ASTM extraterrestrial spectrum, means over 10 nm. */
extern const double colour_solar_irradiance[3];

/* Luminance in cd/m2 that linear Rec.709 (1, 1, 1) stands for. */
#define COLOUR_WHITE_LUMINANCE 1000.0

/* CIE 1931 2 degree observer at a wavelength in nm: x, y, z. */
void colour_observer(double nm, double xyz[3]);

/* matrix[channel][band]: linear Rec.709 (D65, colorimetric) of spectral radiance 1 W/m2/nm/sr in one band. What the spectrum does between
 * the bands is the solar spectrum times the parabola through the three ratios to it, integrated with the CIE 1931 observer. */
void colour_band_matrix(double matrix[3][3]);

/* Luminance (cd/m2), or from irradiances illuminance (lux), of three bands. */
double colour_luminance(const double bands[3]);

#endif
