#include "renderer/optics/quadrature.h"

#include <math.h>

/* P_count(z) and its derivative by the three-term recurrence. */
static void legendre_with_slope(int count, double z, double *value, double *slope)
{
	double before = 0, now = 1;
	for (int l = 0; l < count; l++) {
		double next = ((2 * l + 1) * z * now - l * before) / (l + 1);
		before = now;
		now = next;
	}
	*value = now;
	*slope = count * (z * now - before) / (z * z - 1);
}

void quadrature_gauss(int count, double *node, double *weight)
{
	for (int i = 0; i < (count + 1) / 2; i++) {
		/* Tricomi's estimate is good to O(count^-4), so that Newton's method ends after one to three steps. */
		double n = count;
		double z = cos(M_PI * (i + 0.75) / (n + 0.5)) * (1 - 1 / (8 * n * n) + 1 / (8 * n * n * n));
		double value, slope, step;
		int left = 6;
		do {
			legendre_with_slope(count, z, &value, &slope);
			step = value / slope;
			z -= step;
		} while (fabs(step) > 1e-14 && --left > 0);
		node[i] = (1 - z) / 2;
		node[count - 1 - i] = (1 + z) / 2;
		weight[i] = weight[count - 1 - i] = 1 / ((1 - z * z) * slope * slope);
	}
}
