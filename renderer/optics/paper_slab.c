#include "renderer/optics/paper_slab.h"

#include "renderer/optics/quadrature.h"

#include <math.h>
#include <pthread.h>

/* T_ms of one metre, for all incidences (appendix B). */
static const double beta = 0.9961;

enum { ROW_COUNT = 10, COLUMN_COUNT = 5, INCIDENCE_COUNT = 24 };

/* Appendix B: b, c, kappa_c, t, r for an incidence of 0, 10 .. 90 degrees. */
static const double rows[ROW_COUNT][COLUMN_COUNT] = {
	{1.1796, 0.0138, 0.0265, 0.8389, 0.0547}, {1.1293, 0.0154, 0.0262, 0.8412, 0.0547}, {1.1382, 0.0131, 0.0272, 0.8334, 0.0552},
	{1.0953, 0.0049, 0.0294, 0.8208, 0.0564}, {0.9808, 0.0012, 0.0326, 0.8010, 0.0603}, {0.9077, 0.0047, 0.0379, 0.7774, 0.0705},
	{0.7987, 0.0207, 0.0471, 0.7506, 0.0984}, {0.6629, 0.0133, 0.0616, 0.7165, 0.1700}, {0.5043, 0.0280, 0.0700, 0.7149, 0.3554},
	{0.3021, 0.0783, 0.0700, 0.1000, 0.9500},
};

/* Thicker is as good as infinite, and its square does not overflow. */
#define THICKNESS_MAX 1e9

/* Slope at a row, per row: 0 at an extremum, else the harmonic mean of both sides, so that the cubic never overshoots. */
static double row_slope(int row, int column)
{
	if (row == 0 || row == ROW_COUNT - 1) {
		int low = row == 0 ? 0 : ROW_COUNT - 2;
		return rows[low + 1][column] - rows[low][column];
	}
	double left = rows[row][column] - rows[row - 1][column], right = rows[row + 1][column] - rows[row][column];
	return left * right > 0 ? 2 * left * right / (left + right) : 0;
}

static double column_at(int column, int row, double t)
{
	double low = rows[row][column], rise = rows[row + 1][column] - low;
	double bend = (1 - t) * (row_slope(row, column) - rise) + t * (rise - row_slope(row + 1, column));
	return low + t * rise + t * (1 - t) * bend;
}

struct paper_fit paper_fit_at(double zenith_rad)
{
	double position = fmin(fmax(zenith_rad * 18 / M_PI, 0), ROW_COUNT - 1);
	int row = position < ROW_COUNT - 2 ? (int)position : ROW_COUNT - 2;
	double t = position - row;
	return (struct paper_fit){
		beta, column_at(0, row, t), column_at(1, row, t), column_at(2, row, t), column_at(3, row, t), column_at(4, row, t)};
}

double paper_transmittance(const struct paper_fit *fit, double thickness_m)
{
	double h = fmin(fmax(thickness_m, 0), THICKNESS_MAX);
	double correction = fit->b + (1 - fit->b) * exp(-fit->c * h);
	double transmittance = correction * fit->beta / (h - (h - 1) * fit->beta);
	return fmin(fmax(transmittance, 0), 1);
}

/* 1 - (1 + z) exp(-z), the chance of two events or more, without cancellation for small z: sum (-1)^n z^n (n-1)/n!, n >= 2. */
static double two_or_more(double z)
{
	if (z > 0.2)
		return 1 - (1 + z) * exp(-z);
	double term = z * z / 2, sum = 0;
	for (int n = 2; n < 12; n++) {
		sum += (n - 1) * term;
		term *= -z / (n + 1);
	}
	return sum;
}

/* z - 1 + exp(-z), likewise: sum (-1)^n z^n / n!, n >= 2. */
static double exponential_rest(double z)
{
	if (z > 0.2)
		return z - 1 + exp(-z);
	double term = z * z / 2, sum = 0;
	for (int n = 2; n < 12; n++) {
		sum += term;
		term *= -z / (n + 1);
	}
	return sum;
}

/* Shares out `total` to orders 1, 2 and 3+ (order[1..3]). Where the fits of the first two claim more than there is, which happens in thin
 * layers between rows of the table and for other distributions, they are scaled down: no light is made. */
static void share_out(double order[4], double total)
{
	double both = order[1] + order[2];
	if (both > total) {
		order[1] *= total / both;
		order[2] *= total / both;
	}
	order[3] = fmax(total - order[1] - order[2], 0);
}

struct paper_orders paper_orders_at(const struct paper_fit *fit, double thickness_m, double slant_depth_modified)
{
	double h = fmin(fmax(thickness_m, 0), THICKNESS_MAX), depth = fit->kappa_c * h;
	struct paper_orders orders = {.t = {exp(-fmax(slant_depth_modified, 0))}};
	orders.t_total = fmax(paper_transmittance(fit, h), orders.t[0]);
	orders.r_total = 1 - orders.t_total;

	double once = fit->t * depth, column = exp(-depth);
	orders.t[1] = once * column;
	orders.t[2] = once * once / 2 * column + fit->r * fit->r / 4 * column * exponential_rest(2 * depth);
	orders.r[1] = -fit->r / 2 * expm1(-2 * depth);
	orders.r[2] = fit->r * fit->t / 2 * two_or_more(2 * depth);
	share_out(orders.t, orders.t_total - orders.t[0]);
	share_out(orders.r, orders.r_total);
	return orders;
}

/* Incidences and weights of a Gauss-Legendre quadrature in mu, for the flux of diffuse light. */
static struct paper_fit incidence_fit[INCIDENCE_COUNT];
static double incidence_weight[INCIDENCE_COUNT];
static pthread_once_t incidence_once = PTHREAD_ONCE_INIT;

static void fill_incidences(void)
{
	double mu[INCIDENCE_COUNT], weight[INCIDENCE_COUNT];
	quadrature_gauss(INCIDENCE_COUNT, mu, weight);
	for (int i = 0; i < INCIDENCE_COUNT; i++) {
		incidence_fit[i] = paper_fit_at(acos(mu[i]));
		incidence_weight[i] = 2 * mu[i] * weight[i];
	}
}

double paper_spherical_transmittance(double thickness_m)
{
	pthread_once(&incidence_once, fill_incidences);
	double sum = 0;
	for (int i = 0; i < INCIDENCE_COUNT; i++)
		sum += incidence_weight[i] * paper_transmittance(&incidence_fit[i], thickness_m);
	return sum;
}
