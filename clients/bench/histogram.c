#include "clients/bench/histogram.h"

#include <math.h>
#include <stdlib.h>

/* Each power of two is cut into 256 parts: a bucket is at most 1/256 of its value wide. */
enum { PART_BITS = 8, PARTS = 1 << PART_BITS, VALUE_BITS = 42, BUCKETS = (VALUE_BITS - PART_BITS + 1) * PARTS };

struct histogram {
	uint64_t total;
	int64_t largest;
	double sum, sum_of_squares;
	uint64_t count[BUCKETS];
};

struct histogram *histogram_create(void)
{
	return calloc(1, sizeof(struct histogram));
}

void histogram_destroy(struct histogram *histogram)
{
	free(histogram);
}

/* Values below PARTS have a bucket each; above, the upper PART_BITS bits behind the first one choose within its power of two. */
static int bucket_of(int64_t ns)
{
	if (ns < PARTS)
		return (int)ns;
	const int power = 63 - __builtin_clzll((unsigned long long)ns) - PART_BITS;
	return (power + 1) * PARTS + (int)(ns >> power) - PARTS;
}

static int64_t last_of_bucket(int bucket)
{
	if (bucket < PARTS)
		return bucket;
	const int power = bucket / PARTS - 1;
	return ((int64_t)(bucket % PARTS + PARTS + 1) << power) - 1;
}

void histogram_record(struct histogram *histogram, int64_t ns)
{
	const int64_t most = ((int64_t)1 << VALUE_BITS) - 1;
	const int64_t value = ns < 0 ? 0 : ns > most ? most : ns;
	histogram->count[bucket_of(value)]++;
	histogram->total++;
	histogram->sum += (double)value;
	histogram->sum_of_squares += (double)value * (double)value;
	if (value > histogram->largest)
		histogram->largest = value;
}

uint64_t histogram_count(const struct histogram *histogram)
{
	return histogram->total;
}

int64_t histogram_at(const struct histogram *histogram, double share)
{
	const double wanted = ceil(share * (double)histogram->total);
	uint64_t below = 0;
	for (int i = 0; i < BUCKETS; i++) {
		below += histogram->count[i];
		if (below > 0 && (double)below >= wanted) {
			const int64_t last = last_of_bucket(i);
			return last < histogram->largest ? last : histogram->largest;
		}
	}
	return histogram->largest;
}

double histogram_mean(const struct histogram *histogram)
{
	return histogram->total ? histogram->sum / (double)histogram->total : 0;
}

double histogram_deviation(const struct histogram *histogram)
{
	const double mean = histogram_mean(histogram);
	const double variance = histogram->total ? histogram->sum_of_squares / (double)histogram->total - mean * mean : 0;
	return variance > 0 ? sqrt(variance) : 0;
}

bool histogram_next(const struct histogram *histogram, int *bucket, int64_t *value_ns, uint64_t *count)
{
	while (*bucket < BUCKETS && histogram->count[*bucket] == 0)
		(*bucket)++;
	if (*bucket == BUCKETS)
		return false;
	const int64_t last = last_of_bucket(*bucket);
	*value_ns = last < histogram->largest ? last : histogram->largest;
	*count = histogram->count[(*bucket)++];
	return true;
}
