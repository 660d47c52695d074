#include "renderer/optics/paper_slab.h"

#include <math.h>

/* Thicker is as good as infinite, and its square does not overflow. */
#define THICKNESS_MAX 1e30

double paper_transmittance(const struct paper_fit *fit, double thickness_m)
{
	double h = fmin(fmax(thickness_m, 0), THICKNESS_MAX);
	double correction = fit->b + (1 - fit->b) * exp(-fit->c * h);
	double transmittance = correction * fit->beta / (h * (1 - fit->beta) + fit->beta);
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

struct paper_first_orders paper_first_orders_at(const struct paper_fit *fit, double thickness_m)
{
	double depth = fit->kappa_c * fmin(fmax(thickness_m, 0), THICKNESS_MAX), once = fit->t * depth, column = exp(-depth);
	return (struct paper_first_orders){
		.t = {0, once * column, once * once / 2 * column + fit->r * fit->r / 4 * column * exponential_rest(2 * depth)},
		.r = {0, -fit->r / 2 * expm1(-2 * depth), fit->r * fit->t / 2 * two_or_more(2 * depth)},
	};
}

struct paper_orders paper_orders_at(const struct paper_fit *fit, double thickness_m, double slant_depth_modified)
{
	const struct paper_first_orders first = paper_first_orders_at(fit, thickness_m);
	struct paper_orders orders = {.t = {exp(-fmax(slant_depth_modified, 0)), first.t[1], first.t[2]}, .r = {0, first.r[1], first.r[2]}};
	orders.t_total = fmax(paper_transmittance(fit, thickness_m), orders.t[0]);
	orders.r_total = 1 - orders.t_total;
	share_out(orders.t, orders.t_total - orders.t[0]);
	share_out(orders.r, orders.r_total);
	return orders;
}
