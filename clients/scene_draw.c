#include "clients/bench/draws.h"
#include "clients/scene_edit.h"
#include "clients/scene_list.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A value that nine digits tell exactly, so that what a manifest says is what was asked for. */
static json_t *draw_number(double low, double high, double share)
{
	char text[32];
	snprintf(text, sizeof text, "%.9g", low + share * (high - low));
	return json_real(strtod(text, NULL));
}

/* "LOW..HIGH". NULL: it is none. */
static json_t *draw_range(const char *text, double share)
{
	const char *dots = strstr(text, "..");
	char *low_text = dots ? strndup(text, (size_t)(dots - text)) : NULL;
	json_t *low = low_text ? json_loads(low_text, JSON_DECODE_ANY, NULL) : NULL, *value = NULL;
	json_t *high = dots ? json_loads(dots + 2, JSON_DECODE_ANY, NULL) : NULL;
	if (json_is_integer(low) && json_is_integer(high) && json_integer_value(low) <= json_integer_value(high)) {
		const double count = (double)(json_integer_value(high) - json_integer_value(low)) + 1;
		value = json_integer(json_integer_value(low) + (json_int_t)floor(share * count));
	} else if (json_is_number(low) && json_is_number(high) && json_number_value(low) <= json_number_value(high)) {
		value = draw_number(json_number_value(low), json_number_value(high), share);
	}
	free(low_text);
	json_decref(low);
	json_decref(high);
	return value;
}

/* "ONE,ANOTHER" */
static json_t *draw_choice(const char *text, double share)
{
	int count = 1, chosen;
	for (const char *at = text; *at; at++)
		count += *at == ',';
	for (chosen = (int)(share * count); chosen > 0; chosen--)
		text = strchr(text, ',') + 1;
	char *one = strndup(text, strcspn(text, ","));
	json_t *value = one ? json_loads(one, JSON_DECODE_ANY, NULL) : NULL;
	if (one && !value)
		value = json_string(one);
	free(one);
	return value;
}

/* Draws one member and sets it. false after a message. */
static bool vary_member(json_t *scene, json_t *labels, const char *vary, struct draws *draws)
{
	const char *equals = strchr(vary, '=');
	const double share = draws_next(draws);
	if (!equals || equals == vary || !equals[1] || strpbrk(equals, "[{\"")) {
		client_error("--vary wants member=low..high or member=one,another, not \"%s\"", vary);
		return false;
	}
	const bool is_range = strstr(equals, "..") != NULL;
	json_t *value = is_range ? draw_range(equals + 1, share) : draw_choice(equals + 1, share);
	char *text = value ? json_dumps(value, JSON_ENCODE_ANY | JSON_REAL_PRECISION(9)) : NULL, *assignment = NULL;
	bool good = text && asprintf(&assignment, "%.*s=%s", (int)(equals - vary), vary, text) >= 0;
	if (!value)
		client_error("--vary %s: two numbers, the lower first, or words are wanted", vary);
	good = good && scene_set(scene, assignment);
	if (good) {
		assignment[equals - vary] = '\0';
		good = json_object_set(labels, assignment, value) == 0;
	}
	free(assignment);
	free(text);
	json_decref(value);
	return good;
}

int scene_list_draw(const json_t *base, const struct text_list *vary, int count, double seed, struct scene_list *list)
{
	struct draws draws = draws_begin((uint64_t)seed);
	bool good = true;
	for (int i = 0; good && i < count; i++) {
		char name[16];
		json_t *scene = json_deep_copy(base), *labels = json_object();
		snprintf(name, sizeof name, "%06d", i + 1);
		for (int v = 0; good && v < vary->count; v++)
			good = vary_member(scene, labels, vary->text[v], &draws);
		if (good) {
			good = scene_list_add(list, name, scene, labels);
		} else {
			json_decref(scene);
			json_decref(labels);
		}
	}
	if (!good)
		scene_list_finish(list);
	return good ? CLIENT_OK : CLIENT_USAGE;
}
