/* Fourier transforms of periodic square pictures of complex values, in place. Any thread. */
#ifndef STRATUS_RENDERER_STAGES_FOURIER_H
#define STRATUS_RENDERER_STAGES_FOURIER_H

enum { FOURIER_SIDE_MAX = 512 };

/* Tables for one side. Read-only once filled. */
struct fourier {
	int side;
	float cosine[FOURIER_SIDE_MAX / 2], sine[FOURIER_SIDE_MAX / 2]; /* of 2 pi i / side */
};

/* side: a power of two, 2..FOURIER_SIDE_MAX. */
void fourier_init(struct fourier *fourier, int side);

/* sum over x, y of f(x, y) exp(-2 pi i (kx x + ky y) / side). re, im, apart in memory: side x side, rows of x before, of ky after: the
 * value of (kx, ky) stands where fourier_frequency(row) = kx and fourier_frequency(column) = ky. */
void fourier_forward(const struct fourier *fourier, float *re, float *im);

/* Back, side^2 times what it was. */
void fourier_inverse(const struct fourier *fourier, float *re, float *im);

/* Wave number of a row or column of the transform, -side/2 .. side/2 - 1 waves over the picture. */
int fourier_frequency(int side, int index);

#endif
