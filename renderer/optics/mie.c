#include "renderer/optics/mie.h"

#include <math.h>

int mie_term_count(double x)
{
	/* Wiscombe 1980, "Improved Mie scattering algorithms", eq. 5; his three ranges differ by less than the two terms added here. */
	return (int)(x + 4.05 * cbrt(x) + 2.0) + 2;
}

/* The downward recurrence of the logarithmic derivative forgets its arbitrary start only where n > z = m x, at a rate that grows from
 * nothing at n = z over a width of cbrt(z); below z an error stays for good. (The usual margin of 15 costs four digits at z = 1500.) */
static int log_derivative_start(double x, double m)
{
	double z = m * x;
	int count = mie_term_count(x), inside = (int)(z + 8 * cbrt(z));
	return (count > inside ? count : inside) + 16;
}

int mie_scratch_count(double x, double m)
{
	return log_derivative_start(x, m) + 1;
}

/* derivative[n] = psi_n'(z) / psi_n(z). Downward, since upward loses all digits beyond n = z. */
static void log_derivatives(double z, double *derivative, int start)
{
	derivative[start] = 0;
	for (int n = start; n > 0; n--) {
		double ratio = n / z;
		derivative[n - 1] = ratio - 1 / (derivative[n] + ratio);
	}
}

/* p / (p + i q) for real p, q: the form that a_n and b_n take when m is real. */
static double complex unit_fraction(double p, double q)
{
	double scale = p / (p * p + q * q);
	return p * scale - q * scale * I;
}

void mie_terms(double x, double m, struct mie_term *terms, double *scratch)
{
	log_derivatives(m * x, scratch, log_derivative_start(x, m));
	/* Riccati-Bessel functions psi_n = x j_n(x) and chi_n = -x y_n(x); xi_n = psi_n - i chi_n. */
	double psi_before = cos(x), psi = sin(x);
	double chi_before = -sin(x), chi = cos(x);
	int count = mie_term_count(x);
	for (int n = 1; n <= count; n++) {
		double psi_next = (2 * n - 1) / x * psi - psi_before;
		double chi_next = (2 * n - 1) / x * chi - chi_before;
		double electric = scratch[n] / m + n / x;
		double magnetic = scratch[n] * m + n / x;
		terms[n - 1].a = unit_fraction(electric * psi_next - psi, -(electric * chi_next - chi));
		terms[n - 1].b = unit_fraction(magnetic * psi_next - psi, -(magnetic * chi_next - chi));
		psi_before = psi;
		psi = psi_next;
		chi_before = chi;
		chi = chi_next;
	}
}

static double product_re(double complex u, double complex v)
{
	return creal(u) * creal(v) + cimag(u) * cimag(v);
}

struct mie_efficiency mie_efficiency(double x, const struct mie_term *terms, int count)
{
	double extinction = 0, scattering = 0, moment = 0;
	for (int n = count; n > 0; n--) {
		const struct mie_term *t = &terms[n - 1];
		extinction += (2 * n + 1) * (creal(t->a) + creal(t->b));
		scattering += (2 * n + 1) * (product_re(t->a, t->a) + product_re(t->b, t->b));
		moment += (2 * n + 1) / (n * (n + 1.0)) * product_re(t->a, t->b);
		if (n < count)
			moment += n * (n + 2.0) / (n + 1.0) * (product_re(t->a, t[1].a) + product_re(t->b, t[1].b));
	}
	double scale = 2 / (x * x);
	return (struct mie_efficiency){scale * extinction, scale * scattering, 2 * moment / scattering};
}

void mie_amplitudes(const struct mie_term *terms, int count, double cos_theta, double complex amplitude[2])
{
	double pi_before = 0, pi = 1; /* the angular function, not the number */
	amplitude[0] = amplitude[1] = 0;
	for (int n = 1; n <= count; n++) {
		double tau = n * cos_theta * pi - (n + 1) * pi_before;
		double factor = (2 * n + 1) / (n * (n + 1.0));
		amplitude[0] += factor * (terms[n - 1].a * pi + terms[n - 1].b * tau);
		amplitude[1] += factor * (terms[n - 1].a * tau + terms[n - 1].b * pi);
		double pi_next = ((2 * n + 1) * cos_theta * pi - (n + 1) * pi_before) / n;
		pi_before = pi;
		pi = pi_next;
	}
}

double mie_phase(double x, double scattering_efficiency, const double complex amplitude[2])
{
	double intensity = product_re(amplitude[0], amplitude[0]) + product_re(amplitude[1], amplitude[1]);
	return 2 * intensity / (x * x * scattering_efficiency);
}
