#include "clients/compare_table.h"

#include <math.h>
#include <string.h>

/* NaN for null and what is missing. */
static double number(const json_t *object, const char *name)
{
	const json_t *value = json_object_get(object, name);
	return json_is_number(value) ? json_number_value(value) : NAN;
}

static void print_share(FILE *to, double share)
{
	if (isnan(share))
		fprintf(to, " %8s", "-");
	else
		fprintf(to, " %8.2f", 100 * share);
}

static void print_number(FILE *to, double value)
{
	if (isnan(value))
		fprintf(to, " %8s", "-");
	else
		fprintf(to, " %8.4f", value);
}

static const char *text(const json_t *object, const char *name)
{
	const char *value = json_string_value(json_object_get(object, name));
	return value ? value : "";
}

static void print_line(FILE *to, const json_t *region, const json_t *variant)
{
	const json_t *figures = json_object_get(json_object_get(variant, "regions"), text(region, "name"));
	const json_t *flip = json_object_get(figures, "flip");
	fprintf(to, "%-10.32s %9.0f  %-12.32s", text(region, "name"), number(region, "pixels"), text(variant, "name"));
	print_share(to, number(figures, "bias"));
	print_share(to, number(figures, "bias_standard_error"));
	print_share(to, number(figures, "rms"));
	print_share(to, number(figures, "noise"));
	print_share(to, number(figures, "noise_corrected_rms"));
	print_share(to, number(figures, "noise_corrected_rms_standard_error"));
	print_number(to, number(flip, "mean"));
	print_number(to, number(flip, "max"));
	fputc('\n', to);
}

/* Samples that a reference really has, where it says so. */
static void print_samples(FILE *to, const json_t *variant)
{
	const json_t *samples = json_object_get(variant, "samples");
	if (json_is_integer(samples))
		fprintf(to, "%s: %lld samples%s\n", text(variant, "name"), (long long)json_integer_value(samples),
			json_is_true(json_object_get(variant, "partial")) ? ", cut short" : "");
}

bool compare_table_print(FILE *to, const json_t *comparison)
{
	const json_t *regions = json_object_get(comparison, "regions"), *variants = json_object_get(comparison, "variants");
	const char *truth = text(comparison, "reference");
	size_t r, v;
	json_t *region, *variant;
	if (!json_is_array(regions) || !json_is_array(variants) || !*truth)
		return false;
	fprintf(to, "against %s, %.0f x %.0f\n", truth, number(comparison, "width"), number(comparison, "height"));
	json_array_foreach(variants, v, variant) print_samples(to, variant);
	fprintf(to, "%-10s %9s  %-12s %8s %8s %8s %8s %8s %8s %8s %8s\n", "region", "pixels", "variant", "bias %", "+- %", "rms %",
		"noise %", "less it", "+- %", "FLIP", "largest");
	json_array_foreach(regions, r, region) json_array_foreach(variants, v, variant) if (strcmp(text(variant, "name"), truth) != 0)
		print_line(to, region, variant);
	return true;
}
