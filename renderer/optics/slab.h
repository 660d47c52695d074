/* Light reflected and transmitted by a homogeneous plane-parallel layer of droplets over black ground, solved for all orders of scattering.
 *
 * The phase function is truncated by delta-M (W. J. Wiscombe 1977, J. Atmos. Sci. 34, 1408): P = f P_F + (1-f) P_D with f = chi_32, depth
 * tau' = (1-f) tau. Orders 2 and more of (P_D, tau') come from adding-doubling with 32 streams, one azimuthal mode at a time
 * (renderer/optics/slab_layer.h). The first order is exact in the angle, after T. Nakajima and M. Tanaka 1988, JQSRT 40, 51, extended so
 * that it holds the aureole as well:
 *   reflected    F0/(4 pi) mu_l/(mu_l+mu_v) (1 - exp(-s))  [S_r P/(1-f) + C_r(Theta, s)],   s = tau'/mu_l + tau'/mu_v
 *   transmitted  F0/(4 pi) mu_l/(mu_l-mu_v) (exp(-tau'/mu_l) - exp(-tau'/mu_v)) [S_t P/(1-f) + C_t(Theta, s)],
 *                s: mean slant depth tau'
 * C_r and C_t put what delta-M took out back exactly once (renderer/optics/slab_residual.h); both vanish in thin layers, where S_r and S_t
 * are 1.
 *
 * Units and conventions. tau: vertical optical thickness of the full phase function, >= 0; above SLAB_DEPTH_MAX by the asymptotic theory of
 * thick conservative layers. mu_l, mu_v: cosines 0..1 of sun and view with the vertical. azimuth: between the headings of the light before
 * and after, radians: 0 goes on forward (sun in front of the viewer), pi comes back (sun behind): pi minus azimuth(V) - azimuth(L) of the
 * HTTP interface. Radiance is for F0 = 1 through a plane normal to the beam and never holds the unscattered beam. Everything is finite
 * everywhere; arguments outside their range are clamped to it.
 */
#ifndef STRATUS_RENDERER_OPTICS_SLAB_H
#define STRATUS_RENDERER_OPTICS_SLAB_H

#include "renderer/optics/optics.h"

enum {
	SLAB_NODE_COUNT = 24, /* Gauss nodes in mu that tables interpolate between; those of the solver are 16 per hemisphere */
	SLAB_PAIR_COUNT = SLAB_NODE_COUNT * (SLAB_NODE_COUNT + 1) / 2,
	SLAB_MODE_COUNT = 32,  /* all that 32 streams carry: with 24, light that grazes thin layers rings in azimuth by 10 % */
	SLAB_DEPTH_COUNT = 64, /* four per octave */
	SLAB_RESIDUAL_DEPTH_COUNT = 32,
	SLAB_RESIDUAL_ANGLE_COUNT = 256
};

#define SLAB_DEPTH_MIN 0.01 /* of the table; below it the shapes no longer change */
#define SLAB_DEPTH_MAX 551.0

enum slab_side { SLAB_REFLECTED, SLAB_TRANSMITTED, SLAB_SIDE_COUNT };

struct slab_band {
	double truncated; /* f, 0..1 */

	/* Orders >= 2 of mode m, per pair of nodes i >= j at i (i+1)/2 + j: I = mu_l F0/pi (1 - exp(-tau'/mu_l)) (1 - exp(-tau'/mu_v)) K,
	 * K = sum_m K_m cos(m azimuth), times sin_l sin_v for odd m, its square for even m > 0: at the zenith there is no azimuth. */
	float order2[SLAB_SIDE_COUNT][SLAB_DEPTH_COUNT][SLAB_MODE_COUNT][SLAB_PAIR_COUNT];

	/* Plane albedo, and transmittance less exp(-tau'/mu), over 1 - exp(-tau'/mu), at the nodes. */
	double flux[SLAB_SIDE_COUNT][SLAB_DEPTH_COUNT][SLAB_NODE_COUNT];
	/* Spherical albedo and transmittance (with the unscattered light). */
	double spherical[SLAB_SIDE_COUNT][SLAB_DEPTH_COUNT];

	double extrapolation; /* q: transmittance of thick layers is proportional to 1/(tau + q) */
	double asymmetry;     /* largest relative difference of matrix elements that reciprocity makes equal, before they were averaged */

	/* C_r and C_t at angles and depths of renderer/optics/slab_residual.h. */
	float residual[SLAB_SIDE_COUNT][SLAB_RESIDUAL_DEPTH_COUNT][SLAB_RESIDUAL_ANGLE_COUNT];
};

/* Plain data without pointers, 15 MB, so that it can be kept in a file. Read-only once made; may be shared between threads. */
struct slab_solution {
	double mu[SLAB_NODE_COUNT], weight[SLAB_NODE_COUNT];
	struct slab_band band[BAND_COUNT];
};

/* Solves the three bands on `threads` threads (1..16, the caller's included), 70 ms on two with AVX-512, 130 without vectors wider
 * than SSE2. Last bits depend on the processor's vectors, not on the number of threads. NULL (and a log line) when out of memory
 * or when a band does not come out finite. Any thread; ended by slab_destroy. */
struct slab_solution *slab_solve(const struct optics *optics, int threads);
/* slab_solve in memory of the caller's, whatever is in it. false (and a log line) when a band does not come out finite. */
bool slab_solve_into(const struct optics *optics, int threads, struct slab_solution *solution);
void slab_destroy(struct slab_solution *solution);

/* Of the vectors that this processor solves with: 16, 32 or 64. */
int slab_vector_bytes(void);

/* --- radiance; any thread ------------------------------------------------------------------------------------------------------ */

/* All orders but the unscattered beam, >= 0. optics: those that were solved. */
double slab_radiance(const struct slab_solution *solution, const struct optics *optics, int band, enum slab_side side, double tau,
		     double mu_l, double mu_v, double azimuth);

/* Its two parts: the first order of P_D with all that the peak taken out adds to it (the aureole is light of any order, turned by P_F
 * alone), and orders >= 2 of P_D. */
double slab_radiance_single(const struct slab_solution *solution, const struct optics *optics, int band, enum slab_side side, double tau,
			    double mu_l, double mu_v, double azimuth);
double slab_radiance_multiple(const struct slab_solution *solution, int band, enum slab_side side, double tau, double mu_l, double mu_v,
			      double azimuth);

/* Orders >= 2 as a series in azimuth, for many azimuths of one pair of directions: 12 us, and 0.1 us for an azimuth of it. */
struct slab_series {
	double mode[SLAB_MODE_COUNT];
};
void slab_multiple_series(const struct slab_solution *solution, int band, enum slab_side side, double tau, double mu_l, double mu_v,
			  struct slab_series *series);
double slab_series_radiance(const struct slab_series *series, double azimuth);

/* Cosine of the scattering angle, -1..1. mu_l and mu_v in 0..1, azimuth finite. */
double slab_scattering_cosine(enum slab_side side, double mu_l, double mu_v, double azimuth);

/* --- fluxes; any thread -------------------------------------------------------------------------------------------------------- */

/* Fractions of the incident flux. Reflected and transmitted fractions are sums of their own; nothing is normalised. */
struct slab_flux {
	double reflected;   /* plane albedo */
	double transmitted; /* plane transmittance, direct beam included */
	double direct;      /* exp(-tau/mu_l) */
};
struct slab_flux slab_flux_at(const struct slab_solution *solution, int band, double tau, double mu_l);

/* The same at `count` depths under one angle, at less than count times the cost. */
void slab_flux_row(const struct slab_solution *solution, int band, double mu_l, const double *tau, int count, struct slab_flux *flux);

/* Under uniform diffuse light; direct is the unscattered part, 2 E_3(tau). */
struct slab_flux slab_flux_spherical(const struct slab_solution *solution, int band, double tau);

/* Its reflected part alone, 20 times faster. */
double slab_spherical_albedo(const struct slab_solution *solution, int band, double tau);

/* Fractions of the incident flux by number of scatterings 0, 1, 2, 3 and more; r[0] is 0. */
struct slab_orders {
	double r[4], t[4];
};

enum slab_phase { SLAB_PHASE_FULL, SLAB_PHASE_MODIFIED };

/* By successive orders, for one layer: 0.5 ms. The first is exact; the others of the modified phase function, whose edge at 5 degrees 32
 * streams blur, are good to 2e-4 (a few percent of what thin layers of small droplets send back). tau is that of the full phase function, >
 * 0, also where the modified one is asked for, whose own is (1 - P_f) tau. mu_l at least 1e-3 (clamped). */
struct slab_orders slab_orders_at(const struct optics *optics, int band, enum slab_phase phase, double tau, double mu_l);

/* --- a renderer's table -------------------------------------------------------------------------------------------------------- */

enum { SLAB_SLICE_DEPTH_COUNT = SLAB_DEPTH_COUNT + 1, SLAB_SLICE_VIEW_COUNT = 32, SLAB_SLICE_AZIMUTH_COUNT = 32 };

/* K of orders >= 2 for one mu_l and one side, bands as the last index: view i at slab_slice_zenith(i), azimuth j at
 * slab_slice_azimuth(j), depth k at slab_slice_depth = k. Made for linear interpolation in these indices, all bands at once.
 * 0.8 MB. */
struct slab_slice {
	double mu_l;
	enum slab_side side;
	double depth_ratio[BAND_COUNT]; /* optical thickness of the band over the one that the table is read with */
	float k[SLAB_SLICE_DEPTH_COUNT][SLAB_SLICE_VIEW_COUNT][SLAB_SLICE_AZIMUTH_COUNT][BAND_COUNT];
};

/* Fills a table; 3 ms; any thread. depth_ratio as above, 0.5 .. 2. */
void slab_slice_fill(const struct slab_solution *solution, enum slab_side side, double mu_l, const double depth_ratio[BAND_COUNT],
		     struct slab_slice *slice);

/* Radiance of orders >= 2 from the table as a shader would look it up; tau is that which the table is read with, at 550 nm. */
double slab_slice_radiance(const struct slab_solution *solution, const struct slab_slice *slice, int band, double tau, double mu_v,
			   double azimuth);

/* Zenith angle of a view index, 0..pi/2, denser towards the horizon: pi/2 sin(pi/2 i/(SLAB_SLICE_VIEW_COUNT-1)), and its inverse. */
double slab_slice_zenith(double view);
double slab_slice_view(double mu_v);

/* Azimuth of an index, 0..pi, denser in front: pi (t + t^2)/2, t = j/(SLAB_SLICE_AZIMUTH_COUNT-1), and the index of a cosine of it. */
double slab_slice_azimuth(double index);
double slab_slice_azimuth_index(double cosine);

/* Index of a depth at 550 nm: slab_depth_coordinate as far as that goes; from there to the last, which is infinitely deep, linear in the
 * transmittance. */
double slab_slice_depth(const struct slab_solution *solution, double tau);

/* --- coordinates --------------------------------------------------------------------------------------------------------------- */

/* 0..SLAB_DEPTH_COUNT-1 over SLAB_DEPTH_MIN..SLAB_DEPTH_MAX, logarithmic, and its inverse. */
double slab_depth_coordinate(double tau);
double slab_depth(double coordinate);

#endif
