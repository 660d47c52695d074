#include "clients/bench/report.h"

static const struct {
	const char *title, *name;
	double share;
} columns[] = {{"p50", "p50", 0.5},       {"p90", "p90", 0.9},          {"p99", "p99", 0.99},
	       {"p99.9", "p99_9", 0.999}, {"p99.99", "p99_99", 0.9999}, {"max", "max", 1}};

enum { COLUMNS = sizeof columns / sizeof *columns };

static uint64_t answers(const struct load_result *result)
{
	return histogram_count(result->good) + histogram_count(result->refused) + histogram_count(result->other);
}

static uint64_t errors(const struct load_result *result)
{
	uint64_t sum = 0;
	for (int i = 0; i < LOAD_ERROR_COUNT; i++)
		sum += result->error[i];
	return sum;
}

/* 0 of a load that was interrupted before it was measured. */
static double rate_over(double count, double seconds)
{
	return seconds > 0 ? count / seconds : 0;
}

/* Good answers over the time in which they came: the planned time, or longer when they dragged on behind it. */
static double goodput(const struct load_result *result)
{
	const double seconds = result->good_seconds_end > result->seconds ? result->good_seconds_end : result->seconds;
	return rate_over((double)histogram_count(result->good), seconds);
}

/* --- for people --------------------------------------------------------------------------------------------------------------------- */

static void print_titles(FILE *to, const char *what)
{
	fprintf(to, "\n%-18s %9s %9s", what, "count", "mean");
	for (int i = 0; i < COLUMNS; i++)
		fprintf(to, " %9s", columns[i].title);
	fputc('\n', to);
}

static void print_row(FILE *to, const char *name, const struct histogram *histogram)
{
	if (histogram_count(histogram) == 0)
		return;
	fprintf(to, "%-18.18s %9llu %9.2f", name, (unsigned long long)histogram_count(histogram), histogram_mean(histogram) * 1e-6);
	for (int i = 0; i < COLUMNS; i++)
		fprintf(to, " %9.2f", (double)histogram_at(histogram, columns[i].share) * 1e-6);
	fputc('\n', to);
}

static void print_load(FILE *to, const struct load_settings *settings)
{
	if (settings->rate > 0)
		fprintf(to, "open load: %g requests/s, %s, up to %d connections", settings->rate,
			settings->random_arrivals ? "at random" : "evenly", settings->connections);
	else
		fprintf(to, "closed load: %d connections", settings->connections);
	fprintf(to, "; %g s after %g s of warm-up\n", settings->duration_s, settings->warm_up_s);
}

static void print_counts(FILE *to, const struct load_result *result)
{
	fprintf(to, "asked %.2f/s, answered well %.2f/s, %.2f MB/s; ", rate_over((double)result->planned, result->seconds), goodput(result),
		rate_over(1e-6 * (double)result->bytes, result->seconds));
	for (int status = 0; status < LOAD_STATUS_MAX; status++)
		if (result->status[status])
			fprintf(to, "%d: %llu  ", status, (unsigned long long)result->status[status]);
	for (int i = 0; i < LOAD_ERROR_COUNT; i++)
		if (result->error[i])
			fprintf(to, "%s: %llu  ", load_error_names[i], (unsigned long long)result->error[i]);
	fputc('\n', to);
	if (result->late)
		fprintf(to, "%llu requests waited here for a connection: more --connections would have been needed\n",
			(unsigned long long)result->late);
}

void report_print(FILE *to, const struct load_settings *settings, const struct mix *mix, const struct load_result *result)
{
	print_load(to, settings);
	print_counts(to, result);
	print_titles(to, settings->rate > 0 ? "ms, since due" : "ms");
	print_row(to, "good", result->good);
	if (mix_kind_count(mix) > 1)
		for (int i = 0; i < mix_kind_count(mix); i++) {
			char name[MIX_NAME_SIZE + 2];
			snprintf(name, sizeof name, "  %s", mix_kind_name(mix, i));
			print_row(to, name, result->kind[i]);
		}
	print_row(to, "refused 429, 503", result->refused);
	print_row(to, "other answers", result->other);
	if (result->stages > 0)
		print_titles(to, "ms in the daemon");
	for (int i = 0; i < result->stages; i++)
		print_row(to, result->stage[i].name, result->stage[i].latency);
	fprintf(to, "\n%d connections; the load itself took %.1f %% of a processor\n", result->connections,
		100 * rate_over(result->processor_s, settings->warm_up_s + result->seconds));
}

/* --- for programs -------------------------------------------------------------------------------------------------------------------- */

/* [nanoseconds, how many up to them and above the ones before] */
static json_t *histogram_json(const struct histogram *histogram)
{
	json_t *buckets = json_array();
	int64_t value_ns;
	uint64_t count;
	for (int bucket = 0; histogram_next(histogram, &bucket, &value_ns, &count);)
		json_array_append_new(buckets, json_pack("[I, I]", (json_int_t)value_ns, (json_int_t)count));
	return buckets;
}

static json_t *latency_json(const struct histogram *histogram)
{
	const uint64_t count = histogram_count(histogram);
	json_t *object = json_pack("{s:I}", "count", (json_int_t)count);
	if (count == 0)
		return object;
	json_object_set_new(object, "mean_s", json_real(histogram_mean(histogram) * 1e-9));
	json_object_set_new(object, "deviation_s", json_real(histogram_deviation(histogram) * 1e-9));
	for (int i = 0; i < COLUMNS; i++) {
		char name[16];
		snprintf(name, sizeof name, "%s_s", columns[i].name);
		json_object_set_new(object, name, json_real((double)histogram_at(histogram, columns[i].share) * 1e-9));
	}
	json_object_set_new(object, "histogram", histogram_json(histogram));
	return object;
}

static json_t *statuses_json(const struct load_result *result)
{
	json_t *object = json_object();
	for (int status = 0; status < LOAD_STATUS_MAX; status++) {
		char name[8];
		snprintf(name, sizeof name, "%d", status);
		if (result->status[status])
			json_object_set_new(object, name, json_integer((json_int_t)result->status[status]));
	}
	return object;
}

static json_t *errors_json(const struct load_result *result)
{
	json_t *object = json_object();
	for (int i = 0; i < LOAD_ERROR_COUNT; i++)
		json_object_set_new(object, load_error_names[i], json_integer((json_int_t)result->error[i]));
	return object;
}

json_t *report_json(const struct load_settings *settings, const struct mix *mix, const struct load_result *result)
{
	json_t *kinds = json_object(), *stages = json_object();
	for (int i = 0; i < mix_kind_count(mix); i++)
		json_object_set_new(kinds, mix_kind_name(mix, i), latency_json(result->kind[i]));
	for (int i = 0; i < result->stages; i++)
		json_object_set_new(stages, result->stage[i].name, latency_json(result->stage[i].latency));
	json_t *load = json_pack("{s:s, s:f, s:s, s:i, s:f, s:f, s:f, s:I}", "kind", settings->rate > 0 ? "open" : "closed", "rate_per_s",
				 settings->rate, "arrivals", settings->random_arrivals ? "random" : "even", "connections",
				 settings->connections, "warm_up_s", settings->warm_up_s, "duration_s", settings->duration_s, "timeout_s",
				 settings->timeout_s, "seed", (json_int_t)settings->seed);
	return json_pack("{s:o, s:f, s:I, s:I, s:f, s:I, s:I, s:f, s:f, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:I, s:i, s:I, s:f}", "load",
			 load, "measured_s", result->seconds, "unanswered", (json_int_t)result->unanswered, "asked",
			 (json_int_t)result->planned, "asked_per_s", rate_over((double)result->planned, result->seconds), "answers",
			 (json_int_t)answers(result), "errors", (json_int_t)errors(result), "good_per_s", goodput(result), "good_until_s",
			 result->good_seconds_end, "status", statuses_json(result), "error", errors_json(result), "good",
			 latency_json(result->good), "refused", latency_json(result->refused), "other", latency_json(result->other), "kind",
			 kinds, "stage", stages, "bytes", (json_int_t)result->bytes, "connections", result->connections, "late",
			 (json_int_t)result->late, "processor_s", result->processor_s);
}
