/* How often each latency came: log-linear buckets, as HdrHistogram has them, so that the rarest are told as exactly as the usual. One
 * thread.
 */
#ifndef STRATUS_CLIENTS_BENCH_HISTOGRAM_H
#define STRATUS_CLIENTS_BENCH_HISTOGRAM_H

#include <stdbool.h>
#include <stdint.h>

struct histogram;

/* Empty. NULL when out of memory. */
struct histogram *histogram_create(void);
/* Takes NULL. */
void histogram_destroy(struct histogram *histogram);

/* ns: from 0; beyond 70 minutes it counts as that. */
void histogram_record(struct histogram *histogram, int64_t ns);

uint64_t histogram_count(const struct histogram *histogram);

/* The value that a share (0..1) of the values does not exceed, high by 0.4 % at most; share 1: the largest, exactly. 0 when empty. */
int64_t histogram_at(const struct histogram *histogram, double share);
/* Exactly. 0 when empty. */
double histogram_mean(const struct histogram *histogram);
double histogram_deviation(const struct histogram *histogram);

/* The next bucket that holds values, from *bucket on, which starts at 0 and is moved behind it; false when there is none. value_ns: the
 * largest that it takes. */
bool histogram_next(const struct histogram *histogram, int *bucket, int64_t *value_ns, uint64_t *count);

#endif
