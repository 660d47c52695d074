#include "clients/bench/draws.h"
#include "clients/member_range.h"
#include "clients/scene_edit.h"
#include "clients/scene_list.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* "member=LOW..HIGH". NULL: it is none. */
static json_t *draw_range(const char *text, double share)
{
	struct member_range range;
	if (!member_range_read(text, &range) || range.from > range.to)
		return NULL;
	return range.whole ? json_integer((json_int_t)(range.from + floor(share * (range.to - range.from + 1))))
			   : member_range_at(&range, share);
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
	json_t *value = is_range ? draw_range(vary, share) : draw_choice(equals + 1, share);
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
