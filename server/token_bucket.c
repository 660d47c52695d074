#include "server/token_bucket.h"

#include <math.h>

#define MINUTE_MS 60000.0

void token_bucket_init(struct token_bucket *bucket, double per_minute, double now_ms)
{
	*bucket = (struct token_bucket){.per_minute = per_minute, .level = per_minute, .filled_ms = now_ms};
}

static void fill(struct token_bucket *bucket, double now_ms)
{
	if (now_ms > bucket->filled_ms && isfinite(bucket->per_minute))
		bucket->level = fmin(bucket->level + (now_ms - bucket->filled_ms) / MINUTE_MS * bucket->per_minute, bucket->per_minute);
	bucket->filled_ms = fmax(now_ms, bucket->filled_ms);
}

void token_bucket_change(struct token_bucket *bucket, double per_minute, double now_ms)
{
	fill(bucket, now_ms);
	const double taken = isfinite(bucket->per_minute) ? bucket->per_minute - bucket->level : 0;
	bucket->per_minute = per_minute;
	bucket->level = per_minute - taken;
}

double token_bucket_take(struct token_bucket *bucket, double amount, double now_ms)
{
	if (!isfinite(bucket->per_minute))
		return 0;
	fill(bucket, now_ms);
	const double missing = fmin(amount, bucket->per_minute) - bucket->level;
	if (missing > 0)
		return missing / bucket->per_minute * MINUTE_MS;
	bucket->level -= amount;
	return 0;
}

void token_bucket_give_back(struct token_bucket *bucket, double amount)
{
	if (isfinite(bucket->per_minute))
		bucket->level = fmin(bucket->level + amount, bucket->per_minute);
}
