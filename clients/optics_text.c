#include "clients/optics_text.h"

#include "clients/client.h"
#include "clients/plot.h"

#include <math.h>
#include <string.h>

enum { BANDS = 3, MIDDLE = 1, COLUMNS = 73, ROWS = 21 };

static const json_t *angles_of(const json_t *optics)
{
	return json_object_get(json_object_get(optics, "phase_function"), "angle_deg");
}

static const json_t *values_of(const json_t *optics, size_t band)
{
	return json_array_get(json_object_get(json_object_get(optics, "phase_function"), "value"), band);
}

static double at(const json_t *array, size_t i)
{
	return json_number_value(json_array_get(array, i));
}

bool optics_is_whole(const json_t *optics)
{
	static const char *const names[] = {"wavelength_nm", "extinction_per_m", "asymmetry", "single_scattering_albedo",
					    "forward_peak_fraction"};
	const size_t count = json_array_size(angles_of(optics));
	bool whole = count > 1;
	for (size_t i = 0; i < sizeof names / sizeof *names; i++)
		whole &= json_array_size(json_object_get(optics, names[i])) == BANDS;
	for (size_t band = 0; band < BANDS; band++)
		whole &= json_array_size(values_of(optics, band)) == count;
	return whole;
}

/* P at an angle, linear in its logarithm between those that are told. */
static double phase_at(const json_t *optics, size_t band, double angle_deg)
{
	const json_t *angles = angles_of(optics), *values = values_of(optics, band);
	size_t low = 0, high = json_array_size(angles) - 1;
	while (high - low > 1) {
		const size_t middle = (low + high) / 2;
		if (at(angles, middle) <= angle_deg)
			low = middle;
		else
			high = middle;
	}
	const double share = (angle_deg - at(angles, low)) / (at(angles, high) - at(angles, low));
	return exp((1 - share) * log(at(values, low)) + share * log(at(values, high)));
}

/* The angle between two others at which P has its largest local maximum; 0 when it has none there. */
static double peak_between(const json_t *optics, size_t band, double from_deg, double to_deg)
{
	const json_t *angles = angles_of(optics), *values = values_of(optics, band);
	double best = 0, peak_deg = 0;
	for (size_t i = 1; i + 1 < json_array_size(angles); i++) {
		const double angle_deg = at(angles, i), value = at(values, i);
		if (angle_deg > from_deg && angle_deg < to_deg && value > at(values, i - 1) && value >= at(values, i + 1) && value > best) {
			best = value;
			peak_deg = angle_deg;
		}
	}
	return peak_deg;
}

/* --- the table --------------------------------------------------------------------------------------------------------------------------
 */

static void print_row(FILE *to, const char *name, const double value[static BANDS], const char *format)
{
	fprintf(to, "%-34s", name);
	for (int band = 0; band < BANDS; band++) {
		char text[32];
		snprintf(text, sizeof text, format, value[band]);
		fprintf(to, " %12s", value[band] == 0 && strstr(format, "f") ? "none" : text);
	}
	fputc('\n', to);
}

static void print_property(FILE *to, const json_t *optics, const char *name, const char *title, const char *format)
{
	double value[BANDS];
	for (size_t band = 0; band < BANDS; band++)
		value[band] = at(json_object_get(optics, name), band);
	print_row(to, title, value, format);
}

void optics_print_table(FILE *to, const json_t *optics)
{
	static const double angles_deg[] = {0, 1, 5, 10, 30, 60, 90, 120, 140, 160, 170, 178, 180};
	double value[BANDS];
	print_property(to, optics, "wavelength_nm", "wavelength, nm", "%.0f");
	print_property(to, optics, "extinction_per_m", "extinction, 1/m", "%.5g");
	for (size_t band = 0; band < BANDS; band++)
		value[band] = 1 / at(json_object_get(optics, "extinction_per_m"), band);
	print_row(to, "mean free path, m", value, "%.4g");
	print_property(to, optics, "single_scattering_albedo", "single scattering albedo", "%.7g");
	print_property(to, optics, "asymmetry", "asymmetry", "%.4f");
	print_property(to, optics, "forward_peak_fraction", "share of the forward peak", "%.4f");
	for (size_t band = 0; band < BANDS; band++)
		value[band] = peak_between(optics, band, 125, 165);
	print_row(to, "fogbow, degrees from the sun", value, "%.1f");
	for (size_t band = 0; band < BANDS; band++) {
		const double peak_deg = peak_between(optics, band, 165, 179.9);
		value[band] = peak_deg > 0 ? 180 - peak_deg : 0;
	}
	print_row(to, "glory's ring, radius in degrees", value, "%.2f");
	fputs("\nphase function (isotropic: 1)\n", to);
	for (size_t i = 0; i < sizeof angles_deg / sizeof *angles_deg; i++) {
		char name[32];
		snprintf(name, sizeof name, "%*s%.0f degrees", 2, "", angles_deg[i]);
		for (size_t band = 0; band < BANDS; band++)
			value[band] = phase_at(optics, band, angles_deg[i]);
		print_row(to, name, value, "%.4g");
	}
}

/* --- curves -----------------------------------------------------------------------------------------------------------------------------
 */

void optics_print_curve(FILE *to, const json_t *optics)
{
	char picture[ROWS][COLUMNS + 1];
	double low = INFINITY, high = -INFINITY;
	for (int column = 0; column < COLUMNS; column++) {
		const double value = log10(phase_at(optics, MIDDLE, 180.0 * column / (COLUMNS - 1)));
		low = fmin(low, value);
		high = fmax(high, value);
	}
	low = floor(low);
	high = ceil(high);
	for (int row = 0; row < ROWS; row++) {
		memset(picture[row], ' ', COLUMNS);
		picture[row][COLUMNS] = '\0';
	}
	for (int column = 0; column < COLUMNS; column++) {
		const double value = log10(phase_at(optics, MIDDLE, 180.0 * column / (COLUMNS - 1)));
		picture[ROWS - 1 - (int)((value - low) / (high - low) * (ROWS - 1) + 0.5)][column] = '*';
	}
	fprintf(to, "phase function at %.0f nm over the scattering angle\n", at(json_object_get(optics, "wavelength_nm"), MIDDLE));
	for (int row = 0; row < ROWS; row++) {
		const double power = high - (high - low) * row / (ROWS - 1);
		if (fabs(power - round(power)) < 0.5 * (high - low) / (ROWS - 1))
			fprintf(to, "%8.4g |%s\n", pow(10, round(power)), picture[row]);
		else
			fprintf(to, "%8s |%s\n", "", picture[row]);
	}
	fprintf(to, "%8s +", "");
	for (int column = 0; column < COLUMNS; column++)
		fputc(column % 12 == 0 ? '+' : '-', to);
	fprintf(to, "\n%9s", "");
	for (int column = 0; column < COLUMNS; column += 12)
		fprintf(to, "%-12.0f", 180.0 * column / (COLUMNS - 1));
	fputc('\n', to);
}

int optics_draw(const json_t *optics, const char *path)
{
	static const char *const colours[BANDS] = {PLOT_RED, PLOT_GREEN, PLOT_BLUE};
	const json_t *angles = angles_of(optics);
	struct plot plot;
	if (!plot_begin(&plot, path, 800, 480))
		return CLIENT_UNWRITABLE;
	fputs("set logscale y; set format y '10^{%L}'; set xrange [0:180]; set xtics 30; set xlabel 'scattering angle in degrees'\n"
	      "set ylabel 'phase function (isotropic: 1)'; set key outside top center horizontal\nplot ",
	      plot.to);
	for (size_t band = 0; band < BANDS; band++)
		fprintf(plot.to, "%s'-' with lines lw 1.8 lc rgb '%s' title '%.0f nm'", band ? ", " : "", colours[band],
			at(json_object_get(optics, "wavelength_nm"), band));
	fputc('\n', plot.to);
	for (size_t band = 0; band < BANDS; band++) {
		for (size_t i = 0; i < json_array_size(angles); i++)
			fprintf(plot.to, "%.6g %.6g\n", at(angles, i), at(values_of(optics, band), i));
		fputs("e\n", plot.to);
	}
	return plot_end(&plot);
}
