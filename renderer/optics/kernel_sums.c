#include "renderer/optics/kernel_sums.h"

/* The loop is written once, as a macro over the vector width, since GCC lowers vector types before it inlines or clones functions:
 * neither target_clones nor an inline function taking the width would reach the wider registers. 8 independent sums hide the latency of
 * the multiply-add, whose operands come from the first-level cache. */
#define DEFINE_SUMS_ADD(name, lanes, attributes)                                                                                           \
	attributes static void name(struct sums *sums, const struct sums_term *terms, const struct sums_angles *angles, int count)         \
	{                                                                                                                                  \
		typedef double vector __attribute__((vector_size(8 * (lanes)), may_alias));                                                \
		for (int lane = 0; lane < SUMS_LANES; lane += (lanes)) {                                                                   \
			vector s0 = *(vector *)&sums->value[0][lane], s1 = *(vector *)&sums->value[1][lane];                               \
			vector s2 = *(vector *)&sums->value[2][lane], s3 = *(vector *)&sums->value[3][lane];                               \
			vector s4 = *(vector *)&sums->value[4][lane], s5 = *(vector *)&sums->value[5][lane];                               \
			vector s6 = *(vector *)&sums->value[6][lane], s7 = *(vector *)&sums->value[7][lane];                               \
			for (int i = 0; i < count; i += 2) {                                                                               \
				const struct sums_term *odd = &terms[i], *even = odd + 1;                                                  \
				vector p = *(const vector *)&angles[i].p[lane], q = *(const vector *)&angles[i].q[lane];                   \
				s0 += odd->plus_re * p;                                                                                    \
				s1 += odd->plus_im * p;                                                                                    \
				s2 += odd->minus_re * q;                                                                                   \
				s3 += odd->minus_im * q;                                                                                   \
				s4 += odd->plus_re * q;                                                                                    \
				s5 += odd->plus_im * q;                                                                                    \
				s6 += odd->minus_re * p;                                                                                   \
				s7 += odd->minus_im * p;                                                                                   \
				p = *(const vector *)&angles[i + 1].p[lane];                                                               \
				q = *(const vector *)&angles[i + 1].q[lane];                                                               \
				s0 += even->plus_re * p;                                                                                   \
				s1 += even->plus_im * p;                                                                                   \
				s2 += even->minus_re * q;                                                                                  \
				s3 += even->minus_im * q;                                                                                  \
				s4 -= even->plus_re * q;                                                                                   \
				s5 -= even->plus_im * q;                                                                                   \
				s6 -= even->minus_re * p;                                                                                  \
				s7 -= even->minus_im * p;                                                                                  \
			}                                                                                                                  \
			*(vector *)&sums->value[0][lane] = s0;                                                                             \
			*(vector *)&sums->value[1][lane] = s1;                                                                             \
			*(vector *)&sums->value[2][lane] = s2;                                                                             \
			*(vector *)&sums->value[3][lane] = s3;                                                                             \
			*(vector *)&sums->value[4][lane] = s4;                                                                             \
			*(vector *)&sums->value[5][lane] = s5;                                                                             \
			*(vector *)&sums->value[6][lane] = s6;                                                                             \
			*(vector *)&sums->value[7][lane] = s7;                                                                             \
		}                                                                                                                          \
	}

DEFINE_SUMS_ADD(sums_add_128, 2, )

#ifdef __x86_64__
DEFINE_SUMS_ADD(sums_add_256, 4, __attribute__((target("avx2,fma"))))
DEFINE_SUMS_ADD(sums_add_512, 8, __attribute__((target("avx512f"))))
#endif

void sums_add(struct sums *sums, const struct sums_term *terms, const struct sums_angles *angles, int count)
{
#ifdef __x86_64__
	if (__builtin_cpu_supports("avx512f")) {
		sums_add_512(sums, terms, angles, count);
		return;
	}
	if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) {
		sums_add_256(sums, terms, angles, count);
		return;
	}
#endif
	sums_add_128(sums, terms, angles, count);
}
