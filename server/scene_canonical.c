#include "server/scene_canonical.h"

#include "server/number_text.h"
#include "server/rfc3339.h"
#include "server/scene_fields.h"
#include "server/text.h"

#include <stdlib.h>
#include <string.h>

enum style { STYLE_JSON, STYLE_QUERY };

static void write_number(double value, struct text *text)
{
	char number[NUMBER_TEXT_SIZE];
	number_format(value, number);
	text_add(text, number);
}

/* A choice that is said by leaving the member out has no word. */
static void write_word(const char *word, enum style style, struct text *text)
{
	text_printf(text, style == STYLE_JSON ? "\"%s\"" : "%s", word ? word : "");
}

static void write_choices(const struct scene_field *field, uint32_t set, enum style style, struct text *text)
{
	const char *separator = "";
	for (int i = 0; field->choices[i]; i++) {
		if (!(set >> i & 1))
			continue;
		text_add(text, separator);
		write_word(field->choices[i], style, text);
		separator = ",";
	}
}

static void write_numbers(const double *numbers, int count, struct text *text)
{
	for (int i = 0; i < count; i++) {
		text_add(text, i ? "," : "");
		write_number(numbers[i], text);
	}
}

static void write_value(const struct scene_field *field, const struct scene_input *input, enum style style, struct text *text)
{
	const void *value = (const char *)input + field->offset;
	char time[RFC3339_SIZE];
	bool list = field->type == FIELD_NUMBERS || field->type == FIELD_CHOICES;
	if (list && style == STYLE_JSON)
		text_add(text, "[");
	switch (field->type) {
	case FIELD_NUMBER_OR_AUTO:
		if (*(const bool *)((const char *)input + field->auto_offset))
			write_word("auto", style, text);
		else
			write_number(*(const double *)value, text);
		break;
	case FIELD_TIME:
		rfc3339_format(*(const double *)value, time);
		write_word(time, style, text);
		break;
	case FIELD_NUMBER:
		write_number(*(const double *)value, text);
		break;
	case FIELD_NUMBERS:
		write_numbers(value, field->count, text);
		break;
	case FIELD_INTEGER:
		text_printf(text, "%d", *(const int *)value);
		break;
	case FIELD_SEED:
		text_printf(text, "%u", *(const uint32_t *)value);
		break;
	case FIELD_BOOLEAN:
		text_add(text, *(const bool *)value ? "true" : "false");
		break;
	case FIELD_CHOICE:
		write_word(field->choices[*(const unsigned *)value], style, text);
		break;
	case FIELD_CHOICES:
		write_choices(field, *(const uint32_t *)value, style, text);
		break;
	case FIELD_NAME:
	case FIELD_ASSET:
	case FIELD_HASH:
		write_word(value, style, text);
		break;
	}
	if (list && style == STYLE_JSON)
		text_add(text, "]");
}

/* Panoramas look everywhere, and only a cubemap of one face has that face. */
static bool is_meaningful_to_camera(const char *name, const struct scene_camera *camera)
{
	if (strcmp(name, "position_m") == 0 || strcmp(name, "projection") == 0)
		return true;
	if (strcmp(name, "face") == 0)
		return camera->projection == PROJECTION_CUBEMAP && camera->face != FACE_ALL;
	return camera->projection == PROJECTION_PERSPECTIVE;
}

static bool is_one_of(const char *name, const char *const *names)
{
	return name_index(names, name) >= 0;
}

/* The reference has no shading to choose and follows light between ground and clouds to its end, so that neither makes two pictures of one;
 * how long it goes on is its own affair. */
static bool is_meaningful_to_model(const struct scene_field *field, enum model_name model)
{
	static const char *const sampling[] = {"samples", "time_budget_ms", "seed", "partial", NULL};
	if (strcmp(field->section, "radiosity") == 0)
		return model != MODEL_REFERENCE;
	if (is_one_of(field->name, sampling))
		return model == MODEL_REFERENCE;
	return model != MODEL_REFERENCE || strcmp(field->name, "shading") != 0;
}

/* Has the member a meaning in this scene? Those without are refused when given (but for those that any scene may keep beside the model
 * reference), so the canonical form must not hold them. */
static bool is_meaningful(const struct scene_field *field, const struct scene *scene)
{
	static const char *const procedural[] = {"type", "seed", "coverage", "albedo", NULL};
	const bool clouds = strcmp(field->section, "clouds") == 0, ground = strcmp(field->section, "ground") == 0;
	static const struct scene_map_choice none;
	const struct scene_map_choice *map = clouds ? &scene->clouds.map : ground ? &scene->ground.map : &none;
	if (field->flags & (FIELD_INPUT_ONLY | FIELD_LATER))
		return false;
	if (field->type == FIELD_ASSET || field->type == FIELD_HASH)
		return field->type == FIELD_ASSET ? *map->name : *map->hash;
	if (*map->name && is_one_of(field->name, procedural))
		return false;
	if (strcmp(field->section, "sun") == 0) {
		const bool is_angle = strcmp(field->name, "elevation_deg") == 0 || strcmp(field->name, "azimuth_deg") == 0;
		return is_angle != scene->sun.by_time;
	}
	if (strcmp(field->section, "model") == 0 && strcmp(field->name, "paths") == 0)
		return scene->model.paths != SCENE_PATHS_ALL;
	if (strcmp(field->section, "model") == 0 || strcmp(field->section, "radiosity") == 0)
		return is_meaningful_to_model(field, scene->model.name);
	if (strcmp(field->section, "ground") == 0 && strcmp(field->name, "albedo") == 0)
		return scene->ground.type == GROUND_LAMBERT;
	if (strcmp(field->section, "camera") == 0)
		return is_meaningful_to_camera(field->name, &scene->camera);
	return true;
}

/* Writes the sections for which `wanted` is true; NULL: all. */
static void write_json(const struct scene *scene, bool (*wanted)(const struct scene_field *field), struct text *text)
{
	const struct scene_input input = {.scene = *scene};
	const char *section = NULL;
	text_add(text, "{");
	for (const struct scene_field *field = scene_fields; field->section; field++) {
		if (!is_meaningful(field, scene) || (wanted && !wanted(field)))
			continue;
		if (!section || strcmp(section, field->section) != 0) {
			text_printf(text, "%s\"%s\":{", section ? "}," : "", field->section);
			section = field->section;
		} else {
			text_add(text, ",");
		}
		text_printf(text, "\"%s\":", field->name);
		write_value(field, &input, STYLE_JSON, text);
	}
	text_add(text, section ? "}}" : "}");
}

char *scene_canonical(const struct scene *scene)
{
	struct text text = {0};
	write_json(scene, NULL, &text);
	return text_take(&text);
}

/* Defaults beside this scene's projection. */
static struct scene_input usual_input(const struct scene *scene)
{
	struct scene_input input = scene_input_default();
	input.scene.output.width = scene_camera_shape(&scene->camera).width;
	input.scene.output.height = scene_camera_shape(&scene->camera).height;
	return input;
}

char *scene_canonical_query(const struct scene *scene)
{
	const struct scene_input input = {.scene = *scene}, defaults = usual_input(scene);
	struct text text = {0};
	for (const struct scene_field *field = scene_fields; field->section; field++) {
		struct text value = {0}, usual = {0};
		if (!is_meaningful(field, scene))
			continue;
		if (field->type == FIELD_HASH)
			continue; /* the address names the asset, whatever that holds when it is asked */
		write_value(field, &input, STYLE_QUERY, &value);
		write_value(field, &defaults, STYLE_QUERY, &usual);
		/* Time and place stand together or not at all. */
		bool differs = value.failed || usual.failed || strcmp(value.data, usual.data) != 0 ||
			       (scene->sun.by_time && strcmp(field->section, "sun") == 0);
		if (differs)
			text_printf(&text, "%s%s.%s=%s", text.length ? "&" : "", field->section, field->name,
				    value.failed ? "" : value.data);
		text.failed |= value.failed || usual.failed;
		text_finish(&value);
		text_finish(&usual);
	}
	return text_take(&text);
}

static bool is_shared_between_frames(const struct scene_field *field)
{
	return strcmp(field->section, "dsd") == 0 || strcmp(field->section, "atmosphere") == 0 ||
	       (strcmp(field->section, "model") == 0 && strcmp(field->name, "optics") == 0);
}

void scene_canonical_key(const struct scene *scene, char key[static DIGEST_SIZE])
{
	struct text text = {0};
	write_json(scene, is_shared_between_frames, &text);
	key[0] = '\0';
	if (!text.failed)
		digest_of(text.data, text.length, key);
	text_finish(&text);
}
