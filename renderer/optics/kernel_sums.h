/* The inner loop of the kernel table: Mie sums over n for a block of angles at once. Private to renderer/optics.
 *
 * With A_n, B_n = (2n+1)/(n(n+1)) (a_n +- b_n) and p_n, q_n = pi_n +- tau_n, at an angle theta
 *   S1 + S2 = sum A_n p_n,               S1 - S2 = sum B_n q_n,
 * and, because pi_n and tau_n have opposite parity, at pi - theta
 *   S1 + S2 = sum (-1)^(n+1) A_n q_n,    S1 - S2 = sum (-1)^(n+1) B_n p_n.
 */
#ifndef STRATUS_RENDERER_OPTICS_KERNEL_SUMS_H
#define STRATUS_RENDERER_OPTICS_KERNEL_SUMS_H

enum { SUMS_LANES = 8 }; /* angles of a block: a 512-bit vector of doubles, or two or four narrower ones */

/* A_n and B_n. */
struct sums_term {
	double plus_re, plus_im, minus_re, minus_im;
};

struct sums_angles {
	_Alignas(64) double p[SUMS_LANES], q[SUMS_LANES];
};

/* Real and imaginary parts of S1 + S2 and S1 - S2 at theta, then both at pi - theta. */
struct sums {
	_Alignas(64) double value[8][SUMS_LANES];
};

/* Adds `count` terms, count even; terms[0] is of an odd n. Picks the processor's widest vectors. Any thread. */
void sums_add(struct sums *sums, const struct sums_term *terms, const struct sums_angles *angles, int count);

#endif
