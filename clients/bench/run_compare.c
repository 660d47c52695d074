#include "clients/bench/run_compare.h"

#include "clients/bench/draws.h"
#include "clients/scene_edit.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { DRAWS = 4000, FEW = 10 /* answers beyond a percentile below which it says little */ };
static const double TAIL = 0.025; /* on either side of the interval */

/* A run: its report and the histogram of its good answers, cumulated. */
struct run {
	json_t *report;
	double *value_ns;
	uint64_t *until; /* how many values up to this one */
	size_t buckets;
	double count;
};

struct estimate {
	double old_value, new_value, ratio, low, high;
	bool few;
};

/* --- reading ----------------------------------------------------------------------------------------------------------------------------
 */

static bool read_buckets(struct run *run, const json_t *histogram)
{
	uint64_t sum = 0;
	run->buckets = json_array_size(histogram);
	run->value_ns = calloc(run->buckets + 1, sizeof *run->value_ns);
	run->until = calloc(run->buckets + 1, sizeof *run->until);
	for (size_t i = 0; run->value_ns && run->until && i < run->buckets; i++) {
		const json_t *pair = json_array_get(histogram, i);
		sum += (uint64_t)json_integer_value(json_array_get(pair, 1));
		run->value_ns[i] = json_number_value(json_array_get(pair, 0));
		run->until[i] = sum;
	}
	run->count = (double)sum;
	return run->value_ns && run->until && run->buckets > 0 && sum > 0;
}

static bool read_run(const char *path, struct run *run)
{
	run->report = scene_read(path);
	if (!run->report)
		return false;
	if (read_buckets(run, json_object_get(json_object_get(run->report, "good"), "histogram")))
		return true;
	client_error("%s: no run of stratus bench --json with good answers", path);
	return false;
}

static void finish_run(struct run *run)
{
	json_decref(run->report);
	free(run->value_ns);
	free(run->until);
}

/* --- draws ------------------------------------------------------------------------------------------------------------------------------
 */

static double draw_normal(struct draws *draws)
{
	const double u = 1 - draws_next(draws), v = draws_next(draws);
	return sqrt(-2 * log(u)) * cos(2 * M_PI * v);
}

/* Gamma of shape >= 1: Marsaglia and Tsang 2000. */
static double draw_gamma(struct draws *draws, double shape)
{
	const double d = shape - 1.0 / 3, c = 1 / sqrt(9 * d);
	for (;;) {
		const double x = draw_normal(draws), v = pow(1 + c * x, 3);
		if (v > 0 && log(1 - draws_next(draws)) < 0.5 * x * x + d - d * v + d * log(v))
			return d * v;
	}
}

static double draw_beta(struct draws *draws, double a, double b)
{
	const double x = draw_gamma(draws, a);
	return x / (x + draw_gamma(draws, b));
}

static double value_at(const struct run *run, double share)
{
	const double wanted = ceil(share * run->count);
	size_t low = 0, high = run->buckets - 1;
	while (low < high) {
		const size_t middle = (low + high) / 2;
		if ((double)run->until[middle] >= wanted)
			high = middle;
		else
			low = middle + 1;
	}
	return run->value_ns[low] * 1e-6;
}

static int ascending(const void *a, const void *b)
{
	const double x = *(const double *)a, y = *(const double *)b;
	return (x > y) - (x < y);
}

static void set_interval(struct estimate *estimate, double ratios[static DRAWS])
{
	qsort(ratios, DRAWS, sizeof *ratios, ascending);
	estimate->ratio = estimate->new_value / estimate->old_value;
	estimate->low = ratios[(int)(TAIL * DRAWS)];
	estimate->high = ratios[(int)((1 - TAIL) * DRAWS)];
}

static double draw_percentile(struct draws *draws, const struct run *run, double share)
{
	const double k = ceil(share * run->count);
	return value_at(run, draw_beta(draws, k, run->count + 1 - k));
}

static struct estimate estimate_percentile(const struct run *old_run, const struct run *new_run, double share)
{
	struct draws draws = draws_begin((uint64_t)(share * 1e6));
	struct estimate estimate = {.old_value = value_at(old_run, share), .new_value = value_at(new_run, share)};
	double ratios[DRAWS];
	for (int i = 0; i < DRAWS; i++)
		ratios[i] = draw_percentile(&draws, new_run, share) / draw_percentile(&draws, old_run, share);
	set_interval(&estimate, ratios);
	estimate.few = (1 - share) * fmin(old_run->count, new_run->count) < FEW;
	return estimate;
}

/* Of values with standard errors. */
static struct estimate estimate_normal(double old_value, double old_error, double new_value, double new_error)
{
	struct draws draws = draws_begin(7);
	struct estimate estimate = {.old_value = old_value, .new_value = new_value};
	double ratios[DRAWS];
	for (int i = 0; i < DRAWS; i++) {
		const double drawn = new_value + new_error * draw_normal(&draws);
		ratios[i] = drawn / (old_value + old_error * draw_normal(&draws));
	}
	set_interval(&estimate, ratios);
	return estimate;
}

/* --- the table --------------------------------------------------------------------------------------------------------------------------
 */

static double member(const json_t *report, const char *object, const char *name)
{
	return json_number_value(json_object_get(object ? json_object_get(report, object) : report, name));
}

static json_t *row(const char *name, const struct estimate *estimate)
{
	const char *verdict = estimate->few ? "too few" : estimate->low > 1 ? "more" : estimate->high < 1 ? "less" : "no difference seen";
	return json_pack("{s:s, s:f, s:f, s:f, s:f, s:f, s:s}", "name", name, "old", estimate->old_value, "new", estimate->new_value,
			 "ratio", estimate->ratio, "low", estimate->low, "high", estimate->high, "verdict", verdict);
}

static json_t *compare(const struct run *old_run, const struct run *new_run)
{
	static const struct {
		const char *name;
		double share;
	} shares[] = {{"p50 ms", 0.5}, {"p90 ms", 0.9}, {"p99 ms", 0.99}, {"p99.9 ms", 0.999}, {"p99.99 ms", 0.9999}};
	const double old_rate = member(old_run->report, NULL, "good_per_s"), new_rate = member(new_run->report, NULL, "good_per_s");
	json_t *rows = json_array();
	/* A number of answers is as uncertain as its root. */
	struct estimate estimate = estimate_normal(old_rate, old_rate / sqrt(old_run->count), new_rate, new_rate / sqrt(new_run->count));
	json_array_append_new(rows, row("good per s", &estimate));
	estimate = estimate_normal(1000 * member(old_run->report, "good", "mean_s"),
				   1000 * member(old_run->report, "good", "deviation_s") / sqrt(old_run->count),
				   1000 * member(new_run->report, "good", "mean_s"),
				   1000 * member(new_run->report, "good", "deviation_s") / sqrt(new_run->count));
	json_array_append_new(rows, row("mean ms", &estimate));
	for (size_t i = 0; i < sizeof shares / sizeof *shares; i++) {
		estimate = estimate_percentile(old_run, new_run, shares[i].share);
		json_array_append_new(rows, row(shares[i].name, &estimate));
	}
	return rows;
}

static void print_counts(const char *name, const struct run *run)
{
	const char *kind;
	json_t *count;
	printf("%s: %.0f answered well", name, run->count);
	json_object_foreach(json_object_get(run->report, "status"), kind, count)
		printf(", %s: %lld", kind, (long long)json_integer_value(count));
	json_object_foreach(json_object_get(run->report, "error"), kind, count) if (json_integer_value(count) > 0)
		printf(", %s: %lld", kind, (long long)json_integer_value(count));
	putchar('\n');
}

static void print_table(const json_t *rows)
{
	size_t i;
	json_t *one;
	printf("\n%-12s %11s %11s %8s   %-17s\n", "", "old", "new", "ratio", "95 % interval");
	json_array_foreach(rows, i, one)
	{
		printf("%-12s %11.3f %11.3f %8.3f   %.3f .. %-8.3f  %s\n", json_string_value(json_object_get(one, "name")),
		       json_real_value(json_object_get(one, "old")), json_real_value(json_object_get(one, "new")),
		       json_real_value(json_object_get(one, "ratio")), json_real_value(json_object_get(one, "low")),
		       json_real_value(json_object_get(one, "high")), json_string_value(json_object_get(one, "verdict")));
	}
}

/* Loads that differ are told apart from daemons that do. */
static void warn_of_loads(const struct run *old_run, const struct run *new_run)
{
	json_t *old_load = json_copy(json_object_get(old_run->report, "load")),
	       *new_load = json_copy(json_object_get(new_run->report, "load"));
	json_object_del(old_load, "seed");
	json_object_del(new_load, "seed");
	if (!json_equal(old_load, new_load))
		fputs("stratus: the loads were not the same\n", stderr);
	json_decref(old_load);
	json_decref(new_load);
}

int run_compare(const char *old_path, const char *new_path, bool as_json)
{
	struct run old_run = {0}, new_run = {0};
	const bool good = read_run(old_path, &old_run) && read_run(new_path, &new_run);
	if (good) {
		json_t *rows = compare(&old_run, &new_run);
		warn_of_loads(&old_run, &new_run);
		if (as_json) {
			json_dumpf(rows, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(9));
			putchar('\n');
		} else {
			print_counts("old", &old_run);
			print_counts("new", &new_run);
			print_table(rows);
		}
		json_decref(rows);
	}
	finish_run(&old_run);
	finish_run(&new_run);
	if (!good)
		return CLIENT_USAGE;
	return client_end_output();
}
