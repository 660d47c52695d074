/* Numbers that look random and come the same way every time: splitmix64 (Steele, Lea, Flood 2014). One thread. */
#ifndef STRATUS_CLIENTS_BENCH_DRAWS_H
#define STRATUS_CLIENTS_BENCH_DRAWS_H

#include <stdint.h>

struct draws {
	uint64_t state;
};

static inline struct draws draws_begin(uint64_t seed)
{
	return (struct draws){seed};
}

/* From 0, below 1. */
static inline double draws_next(struct draws *draws)
{
	uint64_t z = draws->state += 0x9e3779b97f4a7c15u;
	z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
	z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
	return (double)((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

#endif
