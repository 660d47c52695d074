/* A straight line through what was measured of late: y = fixed + each x, for positive x and y. One thread at a time.
 *
 * Least squares of the errors over x, with weights that fade by a tenth with each measurement; neither part is ever negative. A measurement
 * more than fourfold off what is expected, after three of them, counts as fourfold off.
 */
#ifndef STRATUS_SERVER_LINE_FIT_H
#define STRATUS_SERVER_LINE_FIT_H

/* Zero: nothing measured. */
struct line_fit {
	double weight, u, uu, r, ur; /* sums over u = 1/x and r = y/x */
	int count;
	double last_ms; /* time of the last measurement */
};

void line_fit_add(struct line_fit *fit, double x, double y, double now_ms);

/* The value at x; 0 before the first measurement. */
double line_fit_at(const struct line_fit *fit, double x);

#endif
