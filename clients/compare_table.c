#include "clients/compare_table.h"

#include <math.h>
#include <string.h>

/* As long as the daemon's names get; another server's may be longer. */
enum { NAME_MAX_WIDTH = 32 };

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

/* Of the longest name that is printed, so that columns stand below their heads. */
static int name_width(const json_t *named, const char *but, size_t least)
{
	size_t width = least, i;
	json_t *one;
	json_array_foreach((json_t *)named, i, one)
	{
		const char *name = text(one, "name");
		const size_t length = strlen(name);
		if (strcmp(name, but) != 0 && length > width)
			width = length < NAME_MAX_WIDTH ? length : NAME_MAX_WIDTH;
	}
	return (int)width;
}

static void print_line(FILE *to, const json_t *region, const json_t *variant, const int widths[static 2])
{
	const json_t *figures = json_object_get(json_object_get(variant, "regions"), text(region, "name"));
	const json_t *flip = json_object_get(figures, "flip");
	fprintf(to, "%-*.*s %9.0f  %-*.*s", widths[0], NAME_MAX_WIDTH, text(region, "name"), number(region, "pixels"), widths[1],
		NAME_MAX_WIDTH, text(variant, "name"));
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
	const int widths[] = {name_width(regions, "", 10), name_width(variants, truth, 12)};
	fprintf(to, "%-*s %9s  %-*s %8s %8s %8s %8s %8s %8s %8s %8s\n", widths[0], "region", "pixels", widths[1], "variant", "bias %",
		"+- %", "rms %", "noise %", "less it", "+- %", "FLIP", "largest");
	json_array_foreach(regions, r, region) json_array_foreach(variants, v, variant) if (strcmp(text(variant, "name"), truth) != 0)
		print_line(to, region, variant, widths);
	return true;
}
