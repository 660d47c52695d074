/* Tables of the paper's parameters: appendix B, and what lies between rows. */
#include "renderer/optics/paper_fit.h"

#include "renderer/optics/quadrature.h"

#include <math.h>
#include <pthread.h>

enum { COLUMN_COUNT = 5, INCIDENCE_COUNT = 16 };

struct paper_fit_table paper_fit_table_published(void)
{
	return (struct paper_fit_table){.extinction_per_m = 0.0388,
					.extinction_modified_per_m = 0.0236,
					.zenith_deg = {0, 10, 20, 30, 40, 50, 60, 70, 80, 90},
					.row = {{0.9961, 1.1796, 0.0138, 0.0265, 0.8389, 0.0547},
						{0.9961, 1.1293, 0.0154, 0.0262, 0.8412, 0.0547},
						{0.9961, 1.1382, 0.0131, 0.0272, 0.8334, 0.0552},
						{0.9961, 1.0953, 0.0049, 0.0294, 0.8208, 0.0564},
						{0.9961, 0.9808, 0.0012, 0.0326, 0.8010, 0.0603},
						{0.9961, 0.9077, 0.0047, 0.0379, 0.7774, 0.0705},
						{0.9961, 0.7987, 0.0207, 0.0471, 0.7506, 0.0984},
						{0.9961, 0.6629, 0.0133, 0.0616, 0.7165, 0.1700},
						{0.9961, 0.5043, 0.0280, 0.0700, 0.7149, 0.3554},
						{0.9961, 0.3021, 0.0783, 0.0700, 0.1000, 0.9500}}};
}

/* b, log c, log kappa_c, t, r. */
static void row_columns(const struct paper_fit_table *table, int row, double column[COLUMN_COUNT])
{
	const struct paper_fit *fit = &table->row[row];
	column[0] = fit->b;
	column[1] = log(fit->c);
	column[2] = log(fit->kappa_c);
	column[3] = fit->t;
	column[4] = fit->r;
}

/* Of a monotone cubic at a row, from the slopes of the chords on both sides: 0 at an extremum, else their harmonic mean (F. N. Fritsch and
 * J. Butland 1984, SIAM J. Sci. Stat. Comput. 5, 300). */
static double slope_between(double left, double right)
{
	return left * right > 0 ? 2 * left * right / (left + right) : 0;
}

/* value: at four rows, of which the middle ones enclose the place t, 0..1; step: the distances between them. At the ends of the table,
 * where a step is 0, the cubic goes on along its chord. */
static double cubic_between(const double value[4], const double step[3], double t)
{
	double rise = value[2] - value[1], chord = rise / step[1];
	double low = step[0] > 0 ? slope_between((value[1] - value[0]) / step[0], chord) : chord;
	double high = step[2] > 0 ? slope_between(chord, (value[3] - value[2]) / step[2]) : chord;
	double bend = (1 - t) * (low * step[1] - rise) + t * (rise - high * step[1]);
	return value[1] + t * rise + t * (1 - t) * bend;
}

struct paper_fit paper_fit_table_at(const struct paper_fit_table *table, double zenith_rad)
{
	const double *place = table->zenith_deg;
	const double zenith = fmin(fmax(zenith_rad * 180 / M_PI, place[0]), place[PAPER_FIT_ROWS - 1]);
	int row = 0;
	while (row < PAPER_FIT_ROWS - 2 && zenith >= place[row + 1])
		row++;

	double column[4][COLUMN_COUNT], step[3], between[COLUMN_COUNT];
	int neighbour[4] = {row > 0 ? row - 1 : row, row, row + 1, row + 2 < PAPER_FIT_ROWS ? row + 2 : row + 1};
	for (int i = 0; i < 4; i++)
		row_columns(table, neighbour[i], column[i]);
	for (int i = 0; i < 3; i++)
		step[i] = place[neighbour[i + 1]] - place[neighbour[i]];
	for (int i = 0; i < COLUMN_COUNT; i++) {
		const double value[4] = {column[0][i], column[1][i], column[2][i], column[3][i]};
		between[i] = cubic_between(value, step, (zenith - place[row]) / step[1]);
	}
	return (struct paper_fit){
		table->row[row].beta, between[0], exp(between[1]), exp(between[2]), between[3], between[4],
	};
}

/* Incidences and weights of a Gauss-Legendre quadrature in mu, for the flux of diffuse light. */
static double incidence_zenith[INCIDENCE_COUNT], incidence_weight[INCIDENCE_COUNT];
static pthread_once_t incidence_once = PTHREAD_ONCE_INIT;

static void fill_incidences(void)
{
	double mu[INCIDENCE_COUNT], weight[INCIDENCE_COUNT];
	quadrature_gauss(INCIDENCE_COUNT, mu, weight);
	for (int i = 0; i < INCIDENCE_COUNT; i++) {
		incidence_zenith[i] = acos(mu[i]);
		incidence_weight[i] = 2 * mu[i] * weight[i];
	}
}

double paper_fit_table_spherical(const struct paper_fit_table *table, double thickness_m)
{
	pthread_once(&incidence_once, fill_incidences);
	double sum = 0;
	for (int i = 0; i < INCIDENCE_COUNT; i++) {
		const struct paper_fit fit = paper_fit_table_at(table, incidence_zenith[i]);
		sum += incidence_weight[i] * paper_transmittance(&fit, thickness_m);
	}
	return sum;
}
