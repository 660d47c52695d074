/* Layers of one azimuthal mode by adding-doubling. Private to renderer/optics.
 *
 * Radiance at the nodes mu_i of a Gauss quadrature with weights w_i over 0..1, in the symmetric form J_i = sqrt(w_i mu_i) I_i, so that
 * reflection and transmission of a homogeneous layer are symmetric matrices: out = R in and out = T in, T with the unscattered light.
 * With M = diag(mu) the transfer equation reads, t downward,
 *   dD/dt = -(M^-1 - S+) D + S- U,   -dU/dt = -(M^-1 - S+) U + S- D,   S+-_ij = 1/2 sqrt(w_i w_j / (mu_i mu_j)) p_m(mu_i, +-mu_j),
 * with p_m(mu, nu) = sum_l (2l+1) chi_l Y_l^m(mu) Y_l^m(nu), Y_l^m = sqrt((l-m)!/(l+m)!) P_l^m, and P = sum_m (2 - [m = 0]) p_m cos(m phi).
 * (J. E. Hansen and L. D. Travis 1974, Space Sci. Rev. 16, 527; W. J. Wiscombe 1976, JQSRT 16, 637.)
 */
#ifndef STRATUS_RENDERER_OPTICS_SLAB_LAYER_H
#define STRATUS_RENDERER_OPTICS_SLAB_LAYER_H

#include <stdbool.h>

enum {
	LAYER_SIZE = 16,                /* nodes of the quadrature */
	LAYER_MOMENTS = 2 * LAYER_SIZE, /* streams, and moments that they carry */
	LAYER_OUTPUT = 24               /* directions that light comes from and goes to: more than nodes, to interpolate between */
};

typedef double layer_matrix[LAYER_SIZE][LAYER_SIZE] __attribute__((aligned(64)));
typedef double layer_columns[LAYER_SIZE][LAYER_OUTPUT] __attribute__((aligned(64)));
typedef double layer_outputs[LAYER_OUTPUT][LAYER_OUTPUT] __attribute__((aligned(64)));

/* Directions; the same for all. Outputs are nodes of a quadrature of their own, without a part in the sums over directions; their
 * symmetric form is J = sqrt(mu) I. */
struct layer_nodes {
	double mu[LAYER_SIZE], weight[LAYER_SIZE];
	double output_mu[LAYER_OUTPUT], output_weight[LAYER_OUTPUT];
};
void layer_nodes_fill(struct layer_nodes *nodes);

/* Y_l^m(mu) for l = 0 .. LAYER_MOMENTS - 1; 0 for l < mode. */
void layer_harmonics(int mode, double mu, double value[LAYER_MOMENTS]);

/* What one mode scatters: S+ and S- between nodes, from outputs to nodes, and between outputs. */
struct layer_scattering {
	layer_matrix forward, backward;
	layer_columns forward_in, backward_in;
	layer_outputs forward_through, backward_through;
};

/* moment[LAYER_MOMENTS] of the (truncated) phase function. */
void layer_scattering_fill(const struct layer_nodes *nodes, int mode, const double *moment, struct layer_scattering *scattering);

struct slab_layer {
	layer_matrix r, t;                  /* between nodes; t with the unscattered light */
	layer_columns r_in, t_in;           /* from an output direction to a node, scattered light alone */
	layer_outputs r_through, t_through; /* between output directions, scattered light alone */
	double direct[LAYER_OUTPUT];        /* exp(-depth/mu) */
	double depth;
};

/* A layer of a small depth by Wiscombe's diamond start, which conserves energy exactly: error (depth/mu)^2/12, relative. */
void layer_start(struct slab_layer *layer, const struct layer_nodes *nodes, const struct layer_scattering *scattering, double depth);

/* Two of the layer on each other: R + T R G T and T G T with G = (1 - R R)^-1, and the same for light from and to the outputs. false when
 * 1 - R R is not positive, which no conservative or absorbing layer does. */
bool layer_double(struct slab_layer *layer, const struct layer_nodes *nodes);

/* Of the vectors that this processor doubles layers with, on which the last bits depend: 16, 32 or 64. */
int layer_vector_bytes(void);

/* Largest element of t and t_in. */
double layer_transmits(const struct slab_layer *layer);

/* layer_double for a layer that transmits nothing: twice its depth, the same reflection. */
void layer_deepen(struct slab_layer *layer, const struct layer_nodes *nodes);

/* Orders of scattering 0, 1, 2 of mode 0: coefficients of the powers of z when every scattering is multiplied by z. Forward scattering
 * that was taken out of the phase function (fraction f) counts as scattering: extinction is (1 - z f)/(1 - f) per scaled depth. */
struct layer_orders {
	double t0[LAYER_SIZE]; /* diagonal */
	layer_matrix r1, r2, t1, t2;
};
void layer_orders_start(struct layer_orders *orders, const struct layer_nodes *nodes, const struct layer_scattering *scattering,
			double truncated, double depth);
void layer_orders_double(struct layer_orders *orders);

#endif
