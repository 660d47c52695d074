#include "renderer/optics/slab_layer.h"

#include "renderer/optics/quadrature.h"

#include <math.h>
#include <string.h>

enum { N = LAYER_SIZE, E = LAYER_OUTPUT };

/* Plain loops of fixed size, inlined into one function per instruction set below, where the compiler turns them into vectors. */
#define INLINE static inline __attribute__((always_inline))

void layer_nodes_fill(struct layer_nodes *nodes)
{
	quadrature_gauss(N, nodes->mu, nodes->weight);
	quadrature_gauss(E, nodes->output_mu, nodes->output_weight);
}

void layer_harmonics(int mode, double mu, double value[LAYER_MOMENTS])
{
	double now = 1, before = 0, sine = sqrt(fmax(1 - mu * mu, 0));
	for (int k = 1; k <= mode; k++)
		now *= sine * sqrt((2 * k - 1) / (2.0 * k));
	memset(value, 0, LAYER_MOMENTS * sizeof *value);
	double mm = (double)mode * mode;
	for (int l = mode; l < LAYER_MOMENTS; l++) {
		value[l] = now;
		double next = ((2 * l + 1) * mu * now - sqrt((double)l * l - mm) * before) / sqrt((l + 1.0) * (l + 1.0) - mm);
		before = now;
		now = next;
	}
}

/* S+ and S- from direction b to direction a, of a given weight product. */
static void scatter(int mode, const double *moment, const double *a, const double *b, double scale, double *forward, double *backward)
{
	double even = 0, odd = 0; /* in l - mode */
	for (int l = mode; l < LAYER_MOMENTS; l += 2)
		even += (2 * l + 1) * moment[l] * a[l] * b[l];
	for (int l = mode + 1; l < LAYER_MOMENTS; l += 2)
		odd += (2 * l + 1) * moment[l] * a[l] * b[l];
	*forward = scale * (even + odd);
	*backward = scale * (even - odd);
}

void layer_scattering_fill(const struct layer_nodes *nodes, int mode, const double *moment, struct layer_scattering *scattering)
{
	double inner[N][LAYER_MOMENTS], outer[E][LAYER_MOMENTS], inner_scale[N], outer_scale[E];
	for (int i = 0; i < N; i++) {
		layer_harmonics(mode, nodes->mu[i], inner[i]);
		inner_scale[i] = sqrt(nodes->weight[i] / nodes->mu[i] / 2);
	}
	for (int i = 0; i < E; i++) {
		layer_harmonics(mode, nodes->output_mu[i], outer[i]);
		outer_scale[i] = sqrt(1 / nodes->output_mu[i] / 2);
	}
	for (int i = 0; i < N; i++) {
		for (int j = 0; j < N; j++)
			scatter(mode, moment, inner[i], inner[j], inner_scale[i] * inner_scale[j], &scattering->forward[i][j],
				&scattering->backward[i][j]);
		for (int j = 0; j < E; j++)
			scatter(mode, moment, inner[i], outer[j], inner_scale[i] * outer_scale[j], &scattering->forward_in[i][j],
				&scattering->backward_in[i][j]);
	}
	for (int i = 0; i < E; i++)
		for (int j = 0; j < E; j++)
			scatter(mode, moment, outer[i], outer[j], outer_scale[i] * outer_scale[j], &scattering->forward_through[i][j],
				&scattering->backward_through[i][j]);
}

/* --- matrices ------------------------------------------------------------------------------------------------------------------ */

/* product = a b, four rows at a time in registers, strips of columns that fit them. */
#define DEFINE_MULTIPLY(name, left, right, result, rows, columns, strip, element)                                                          \
	INLINE void name(const left a, const right b, result product)                                                                      \
	{                                                                                                                                  \
		for (int i = 0; i < (rows); i += 4)                                                                                        \
			for (int first = 0; first < (columns); first += (strip)) {                                                         \
				double s0[strip] = {0}, s1[strip] = {0}, s2[strip] = {0}, s3[strip] = {0};                                 \
				for (int k = 0; k < N; k++)                                                                                \
					for (int j = 0; j < (strip); j++) {                                                                \
						double value = b[k][first + j];                                                            \
						s0[j] += element(a, i, k) * value;                                                         \
						s1[j] += element(a, i + 1, k) * value;                                                     \
						s2[j] += element(a, i + 2, k) * value;                                                     \
						s3[j] += element(a, i + 3, k) * value;                                                     \
					}                                                                                                  \
				memcpy(&product[i][first], s0, sizeof s0);                                                                 \
				memcpy(&product[i + 1][first], s1, sizeof s1);                                                             \
				memcpy(&product[i + 2][first], s2, sizeof s2);                                                             \
				memcpy(&product[i + 3][first], s3, sizeof s3);                                                             \
			}                                                                                                                  \
	}
#define STRAIGHT(a, i, k)   a[i][k]
#define TRANSPOSED(a, i, k) a[k][i]

DEFINE_MULTIPLY(multiply, layer_matrix, layer_matrix, layer_matrix, N, N, N, STRAIGHT)
DEFINE_MULTIPLY(multiply_columns, layer_matrix, layer_columns, layer_columns, N, E, E, STRAIGHT)
DEFINE_MULTIPLY(multiply_outputs, layer_columns, layer_columns, layer_outputs, E, E, E, TRANSPOSED) /* a^T b */

/* L of a = L L^T, its lower triangle in place and its diagonal inverted. */
INLINE bool factor(layer_matrix a)
{
	bool positive = true;
	for (int k = 0; k < N; k++) {
		positive &= a[k][k] > 0;
		double inverse = 1 / sqrt(a[k][k]), column[N];
		for (int i = 0; i < N; i++)
			column[i] = a[k][i] * inverse; /* a is symmetric: its row k, still whole right of the diagonal */
		for (int i = k + 1; i < N; i++)
			for (int j = 0; j < N; j++)
				a[i][j] -= column[i] * column[j];
		for (int i = 0; i < N; i++)
			a[k][i] = i > k ? column[i] : 0; /* row k of L^T */
		a[k][k] = inverse;
	}
	return positive;
}

/* b = a^-1 b, a factored; b has `columns` columns. */
#define SOLVE(a, b, columns)                                                                                                               \
	do {                                                                                                                               \
		for (int k = 0; k < N; k++) {                                                                                              \
			for (int j = 0; j < (columns); j++)                                                                                \
				b[k][j] *= a[k][k];                                                                                        \
			for (int i = k + 1; i < N; i++)                                                                                    \
				for (int j = 0; j < (columns); j++)                                                                        \
					b[i][j] -= a[k][i] * b[k][j];                                                                      \
		}                                                                                                                          \
		for (int k = N - 1; k >= 0; k--) {                                                                                         \
			for (int i = k + 1; i < N; i++)                                                                                    \
				for (int j = 0; j < (columns); j++)                                                                        \
					b[k][j] -= a[k][i] * b[i][j];                                                                      \
			for (int j = 0; j < (columns); j++)                                                                                \
				b[k][j] *= a[k][k];                                                                                        \
		}                                                                                                                          \
	} while (0)

/* Light that falls in from the outputs: down and up where the two layers meet, and what leaves them. */
INLINE void double_outputs(struct slab_layer *layer, const layer_matrix factored)
{
	layer_columns lit, down, up;
	layer_outputs a, b;
	const double *direct = layer->direct;
	for (int i = 0; i < N; i++)
		for (int j = 0; j < E; j++)
			lit[i][j] = layer->r_in[i][j] * direct[j];
	multiply_columns(layer->r, lit, down);
	for (int i = 0; i < N; i++)
		for (int j = 0; j < E; j++)
			down[i][j] += layer->t_in[i][j];
	SOLVE(factored, down, E);
	multiply_columns(layer->r, down, up);
	for (int i = 0; i < N; i++)
		for (int j = 0; j < E; j++)
			up[i][j] += lit[i][j];

	/* T_in^T up + E R_in^T down, and T_in^T down + E R_in^T up, each with what the direct light does. */
	multiply_outputs(layer->t_in, up, a);
	multiply_outputs(layer->r_in, down, b);
	for (int i = 0; i < E; i++)
		for (int j = 0; j < E; j++)
			layer->r_through[i][j] += direct[i] * (layer->r_through[i][j] * direct[j] + b[i][j]) + a[i][j];
	multiply_outputs(layer->t_in, down, a);
	multiply_outputs(layer->r_in, up, b);
	for (int i = 0; i < E; i++)
		for (int j = 0; j < E; j++)
			layer->t_through[i][j] = (direct[i] + direct[j]) * layer->t_through[i][j] + a[i][j] + direct[i] * b[i][j];

	multiply_columns(layer->t, up, lit);
	multiply_columns(layer->t, down, up);
	for (int i = 0; i < N; i++)
		for (int j = 0; j < E; j++) {
			layer->r_in[i][j] += lit[i][j];
			layer->t_in[i][j] = up[i][j] + layer->t_in[i][j] * direct[j];
		}
}

INLINE bool double_layer(struct slab_layer *layer)
{
	layer_matrix system, between, up, added;
	multiply(layer->r, layer->r, system);
	for (int i = 0; i < N; i++)
		for (int j = 0; j < N; j++)
			system[i][j] = (i == j) - system[i][j];
	bool ok = factor(system);
	double_outputs(layer, system);
	memcpy(between, layer->t, sizeof between);
	SOLVE(system, between, N);
	multiply(layer->r, between, up);
	multiply(layer->t, up, added);
	multiply(layer->t, between, up);
	memcpy(layer->t, up, sizeof up);
	for (int i = 0; i < N; i++)
		for (int j = 0; j < N; j++)
			layer->r[i][j] += added[i][j];
	return ok;
}

static bool double_128(struct slab_layer *layer)
{
	return double_layer(layer);
}

#ifdef __x86_64__
__attribute__((target("avx2,fma"))) static bool double_256(struct slab_layer *layer)
{
	return double_layer(layer);
}

/* clang knows no preference here. */
#ifdef __clang__
#define TARGET_512 "avx512f"
#else
#define TARGET_512 "avx512f,prefer-vector-width=512"
#endif
__attribute__((target(TARGET_512))) static bool double_512(struct slab_layer *layer)
{
	return double_layer(layer);
}
#endif

int layer_vector_bytes(void)
{
#ifdef __x86_64__
	if (__builtin_cpu_supports("avx512f"))
		return 64;
	if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
		return 32;
#endif
	return 16;
}

static bool double_matrices(struct slab_layer *layer)
{
	switch (layer_vector_bytes()) {
#ifdef __x86_64__
	case 64:
		return double_512(layer);
	case 32:
		return double_256(layer);
#endif
	default:
		return double_128(layer);
	}
}

static void set_depth(struct slab_layer *layer, const struct layer_nodes *nodes, double depth)
{
	layer->depth = depth;
	for (int i = 0; i < E; i++)
		layer->direct[i] = exp(-depth / nodes->output_mu[i]);
}

bool layer_double(struct slab_layer *layer, const struct layer_nodes *nodes)
{
	bool ok = double_matrices(layer);
	set_depth(layer, nodes, 2 * layer->depth);
	return ok;
}

double layer_transmits(const struct slab_layer *layer)
{
	double largest = 0;
	for (int i = 0; i < N; i++) {
		for (int j = 0; j < N; j++)
			largest = fmax(largest, fabs(layer->t[i][j]));
		for (int j = 0; j < E; j++)
			largest = fmax(largest, fabs(layer->t_in[i][j]));
	}
	return largest;
}

void layer_deepen(struct slab_layer *layer, const struct layer_nodes *nodes)
{
	memset(layer->t, 0, sizeof layer->t);
	memset(layer->t_in, 0, sizeof layer->t_in);
	memset(layer->t_through, 0, sizeof layer->t_through);
	set_depth(layer, nodes, 2 * layer->depth);
}

/* --- thin layers --------------------------------------------------------------------------------------------------------------- */

/* T + R (sign 1) or T - R (sign -1). */
struct diamond {
	layer_matrix nodes;
	layer_columns in;
	layer_outputs through;
};

/* With the equation taken at the mean of both faces, sums and differences of what goes down and up separate:
 *   T +- R = (1 + X)^-1 (1 - X) = 2 (1 + X)^-1 - 1,   X = depth/2 (M^-1 - S+ -+ S-).
 * Outputs, which have no weight, receive and send but pass nothing on. */
static void diamond_fill(const struct layer_nodes *nodes, const struct layer_scattering *scattering, double depth, double sign,
			 struct diamond *diamond)
{
	layer_matrix system;
	layer_columns source;
	double half = depth / 2, pass[E];
	for (int i = 0; i < N; i++)
		for (int j = 0; j < N; j++) {
			double loss = i == j ? 1 / nodes->mu[i] : 0;
			system[i][j] = (i == j) + half * (loss - scattering->forward[i][j] - sign * scattering->backward[i][j]);
			diamond->nodes[i][j] = i == j;
		}
	factor(system);
	SOLVE(system, diamond->nodes, N);
	for (int j = 0; j < E; j++)
		pass[j] = 1 / (1 + half / nodes->output_mu[j]);
	for (int i = 0; i < N; i++)
		for (int j = 0; j < E; j++)
			source[i][j] = half * (scattering->forward_in[i][j] + sign * scattering->backward_in[i][j]) * pass[j];
	multiply_columns(diamond->nodes, source, diamond->in);
	multiply_outputs(source, diamond->in, diamond->through);
	for (int i = 0; i < E; i++)
		for (int j = 0; j < E; j++)
			diamond->through[i][j] +=
				half * (scattering->forward_through[i][j] + sign * scattering->backward_through[i][j]) * pass[i] * pass[j];
	/* The factor 2 of 2 (1 + X)^-1 - 1 is left to layer_start, with its mean of both signs. */
}

void layer_start(struct slab_layer *layer, const struct layer_nodes *nodes, const struct layer_scattering *scattering, double depth)
{
	struct diamond sum, difference;
	diamond_fill(nodes, scattering, depth, 1, &sum);
	diamond_fill(nodes, scattering, depth, -1, &difference);
	set_depth(layer, nodes, depth);
	for (int i = 0; i < N; i++) {
		for (int j = 0; j < N; j++) {
			layer->t[i][j] = sum.nodes[i][j] + difference.nodes[i][j] - (i == j);
			layer->r[i][j] = sum.nodes[i][j] - difference.nodes[i][j];
		}
		for (int j = 0; j < E; j++) {
			layer->t_in[i][j] = sum.in[i][j] + difference.in[i][j];
			layer->r_in[i][j] = sum.in[i][j] - difference.in[i][j];
		}
	}
	for (int i = 0; i < E; i++)
		for (int j = 0; j < E; j++) {
			layer->t_through[i][j] = sum.through[i][j] + difference.through[i][j];
			layer->r_through[i][j] = sum.through[i][j] - difference.through[i][j];
		}
}

/* --- orders -------------------------------------------------------------------------------------------------------------------- */

/* The diamond start as a series in z: X = D0 - z B, so that (1 + X)^-1 = D + z D B D + z^2 D B D B D with D = (1 + D0)^-1. */
static void diamond_orders(const struct layer_nodes *nodes, const struct layer_scattering *scattering, double truncated, double depth,
			   double sign, layer_matrix first, layer_matrix second)
{
	layer_matrix b;
	double d[N];
	for (int i = 0; i < N; i++) {
		double extinction = depth / 2 / ((1 - truncated) * nodes->mu[i]);
		d[i] = 1 / (1 + extinction);
		for (int j = 0; j < N; j++)
			b[i][j] = depth / 2 * (scattering->forward[i][j] + sign * scattering->backward[i][j]);
		b[i][i] += truncated * extinction;
	}
	for (int i = 0; i < N; i++)
		for (int j = 0; j < N; j++)
			first[i][j] = d[i] * b[i][j];
	multiply(first, first, second);
	for (int i = 0; i < N; i++)
		for (int j = 0; j < N; j++) {
			first[i][j] *= 2 * d[j];
			second[i][j] *= 2 * d[j];
		}
}

void layer_orders_start(struct layer_orders *orders, const struct layer_nodes *nodes, const struct layer_scattering *scattering,
			double truncated, double depth)
{
	layer_matrix sum1, sum2, difference1, difference2;
	diamond_orders(nodes, scattering, truncated, depth, 1, sum1, sum2);
	diamond_orders(nodes, scattering, truncated, depth, -1, difference1, difference2);
	for (int i = 0; i < N; i++) {
		double x = depth / 2 / ((1 - truncated) * nodes->mu[i]);
		orders->t0[i] = (1 - x) / (1 + x);
		for (int j = 0; j < N; j++) {
			orders->t1[i][j] = (sum1[i][j] + difference1[i][j]) / 2;
			orders->r1[i][j] = (sum1[i][j] - difference1[i][j]) / 2;
			orders->t2[i][j] = (sum2[i][j] + difference2[i][j]) / 2;
			orders->r2[i][j] = (sum2[i][j] - difference2[i][j]) / 2;
		}
	}
}

void layer_orders_double(struct layer_orders *orders)
{
	layer_matrix rr, tt, tr;
	multiply(orders->r1, orders->r1, rr);
	multiply(orders->t1, orders->t1, tt);
	multiply(orders->t1, orders->r1, tr);
	for (int i = 0; i < N; i++)
		for (int j = 0; j < N; j++) {
			double ti = orders->t0[i], tj = orders->t0[j];
			orders->r2[i][j] += ti * orders->r2[i][j] * tj + tr[i][j] * tj + ti * tr[j][i];
			orders->r1[i][j] += ti * orders->r1[i][j] * tj;
			orders->t2[i][j] = (ti + tj) * orders->t2[i][j] + tt[i][j] + ti * rr[i][j] * tj;
			orders->t1[i][j] *= ti + tj;
		}
	for (int i = 0; i < N; i++)
		orders->t0[i] *= orders->t0[i];
}
