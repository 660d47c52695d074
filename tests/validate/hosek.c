/* The sky of Hosek and Wilkie 2012. */
#include "tests/validate/hosek.h"

#include "tests/validate/validate.h"

#include <jansson.h>

/* All numbers below a node, in order. Returns where the next would go. */
static double *read_numbers(const json_t *node, double *to, const double *end)
{
	size_t i;
	json_t *element;
	if (json_is_number(node)) {
		require(to < end, "hosek.json: too many numbers");
		*to = json_number_value(node);
		return to + 1;
	}
	require(json_is_array(node), "hosek.json: no array");
	json_array_foreach(node, i, element) to = read_numbers(element, to, end);
	return to;
}

static void read_all(const json_t *node, double *to, size_t count)
{
	require(read_numbers(node, to, to + count) == to + count, "hosek.json: numbers are missing");
}

struct hosek hosek_read(const char *path)
{
	static const char *const names[HOSEK_RELEASES] = {"release_1_4a", "release_1_1"};
	struct hosek hosek;
	json_t *file = json_load_file(path, JSON_REJECT_DUPLICATES, NULL);
	require(file, "hosek.json cannot be read");
	read_all(json_object_get(file, "radiance"), &hosek.radiance[0][0][0], sizeof hosek.radiance / sizeof(double));
	for (int i = 0; i < HOSEK_RELEASES; i++)
		read_all(json_object_get(json_object_get(file, "distribution"), names[i]), &hosek.distribution[i][0][0][0][0],
			 sizeof hosek.distribution[i] / sizeof(double));
	json_decref(file);
	return hosek;
}

/* Bernstein polynomials of the fifth degree over the cube root of the sun's elevation. */
static void control_weights(double sun_zenith, double weight[6])
{
	static const double choose[6] = {1, 5, 10, 10, 5, 1};
	const double x = cbrt(1 - sun_zenith / (M_PI / 2));
	for (int i = 0; i < 6; i++)
		weight[i] = choose[i] * pow(x, i) * pow(1 - x, 5 - i);
}

/* Coefficients A to I and the mean radiance, linear in albedo and turbidity. */
static double coefficients_of(const struct hosek *hosek, const struct hosek_sky *sky, double c[9])
{
	const double albedo[2] = {1 - sky->albedo, sky->albedo}, turbidity[2] = {3 - sky->turbidity, sky->turbidity - 2};
	double control[6], radiance = 0;
	control_weights(sky->sun_zenith, control);
	for (int k = 0; k < 9; k++)
		c[k] = 0;
	for (int a = 0; a < 2; a++)
		for (int t = 0; t < 2; t++)
			for (int i = 0; i < 6; i++) {
				const double weight = albedo[a] * turbidity[t] * control[i];
				radiance += weight * hosek->radiance[a][t][i];
				for (int k = 0; k < 9; k++)
					c[k] += weight * hosek->distribution[sky->release][a][t][i][k];
			}
	return radiance;
}

/* In the order of the data set: the aureole's factor is c[6], that of the root c[7], the aureole's anisotropy c[8]. */
double hosek_luminance(const struct hosek *hosek, const struct hosek_sky *sky, double view_zenith, double angle)
{
	double c[9];
	const double radiance = coefficients_of(hosek, sky, c);
	const double mu = cos(view_zenith), square = cos(angle) * cos(angle);
	const double aureole = (1 + square) / pow(1 + c[8] * c[8] - 2 * c[8] * cos(angle), 1.5);
	const double gradation = 1 + c[0] * exp(c[1] / (mu + 0.01));
	return 683 * radiance * gradation * (c[2] + c[3] * exp(c[4] * angle) + c[5] * square + c[6] * aureole + c[7] * sqrt(mu));
}

static double difference_of(const struct hosek *hosek, const struct hosek_sky *sky)
{
	struct hosek_sky other = *sky;
	double worst = 0;
	other.release = HOSEK_1_1;
	for (int view = 0; view <= 75; view += 15)
		for (int azimuth = 0; azimuth <= 180; azimuth += 45) {
			const double z = view * DEGREE, sun = sky->sun_zenith;
			const double cosine = cos(sun) * cos(z) + sin(sun) * sin(z) * cos(azimuth * DEGREE),
				     angle = acos(fmin(1, fmax(-1, cosine)));
			const double ratio = hosek_luminance(hosek, &other, z, angle) / hosek_luminance(hosek, sky, z, angle);
			worst = fmax(worst, fabs(ratio - 1));
		}
	return worst;
}

double hosek_release_difference(const struct hosek *hosek)
{
	double worst = 0;
	for (int albedo = 0; albedo <= 1; albedo++)
		for (int turbidity = 2; turbidity <= 3; turbidity++)
			for (int zenith = 20; zenith <= 80; zenith += 15) {
				const struct hosek_sky sky = {HOSEK_1_4A, turbidity, albedo, zenith * DEGREE};
				worst = fmax(worst, difference_of(hosek, &sky));
			}
	return worst;
}
