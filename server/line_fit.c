#include "server/line_fit.h"

#include <math.h>

#define FADING 0.9
#define ODD    4.0
/* Variance of 1/x over its squared mean, below which what was measured tells no fixed part. */
#define SPREAD 0.02
enum { SETTLED = 3 };

void line_fit_add(struct line_fit *fit, double x, double y, double now_ms)
{
	const double expected = line_fit_at(fit, x);
	if (fit->count >= SETTLED && expected > 0)
		y = fmin(fmax(y, expected / ODD), expected * ODD);
	const double u = 1 / x, r = y / x;
	fit->weight = FADING * fit->weight + 1;
	fit->u = FADING * fit->u + u;
	fit->uu = FADING * fit->uu + u * u;
	fit->r = FADING * fit->r + r;
	fit->ur = FADING * fit->ur + u * r;
	fit->count++;
	fit->last_ms = now_ms;
}

double line_fit_at(const struct line_fit *fit, double x)
{
	if (!fit->count)
		return 0;
	const double u = fit->u / fit->weight, r = fit->r / fit->weight;
	const double variance = fit->uu / fit->weight - u * u;
	const double fixed = variance > SPREAD * u * u ? (fit->ur / fit->weight - u * r) / variance : 0;
	const double each = r - fixed * u;
	if (fixed <= 0)
		return r * x;
	return each > 0 ? fixed + each * x : fit->ur / fit->uu;
}
