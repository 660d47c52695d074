#include "server/compare_query.h"

#include "renderer/image/regions.h"
#include "server/scene_json.h"
#include "server/scene_rules.h"
#include "server/variant_name.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { POINTER_SIZE = 512 };

static const struct {
	const char *name;
	uint8_t bits;
} known_regions[] = {{"all", REGION_ALL}, {"cloud", REGION_CLOUD}, {"sky", REGION_SKY}, {"ground", REGION_GROUND}};
enum { KNOWN_REGIONS = sizeof known_regions / sizeof *known_regions };

/* --- places in the body ------------------------------------------------------------------------------------------------------------------
 */

/* Undoes pointer_append's escapes in a token of `length`; cut when too long, which then names nothing. */
static void read_token(const char *token, size_t length, char name[static POINTER_SIZE])
{
	size_t used = 0;
	for (size_t i = 0; i < length && used < POINTER_SIZE - 1; i++) {
		if (token[i] == '~' && i + 1 < length)
			name[used++] = token[++i] == '0' ? '~' : '/';
		else
			name[used++] = token[i];
	}
	name[used] = '\0';
}

/* Does a patch say anything of the member? */
static bool patches(const json_t *patch, const char *member)
{
	while (*member == '/' && json_is_object(patch)) {
		char name[POINTER_SIZE];
		const size_t length = strcspn(member + 1, "/");
		read_token(member + 1, length, name);
		patch = json_object_get(patch, name);
		member += 1 + length;
	}
	return patch != NULL;
}

void compare_query_pointer(const json_t *root, int variant, const char *member, char *pointer, size_t size)
{
	const json_t *patch = json_array_get(json_object_get(root, "variants"), (size_t)variant);
	if (*member && patches(patch, member))
		snprintf(pointer, size, "/variants/%d%s", variant, member);
	else
		snprintf(pointer, size, "/scene%s", member);
}

/* `alone`: what is wrong with the scene without variants, or NULL where that is not known. */
static void add_errors(const json_t *root, int variant, const struct problem *of_scene, const struct problem *alone,
		       struct problem *problem)
{
	for (size_t i = 0; i < of_scene->error_count && i < PROBLEM_ERRORS_MAX; i++) {
		const struct problem_error *error = &of_scene->errors[i];
		const char *member = error->pointer ? error->pointer : "", *detail = error->detail ? error->detail : "is wrong";
		char pointer[POINTER_SIZE];
		compare_query_pointer(root, variant, member, pointer, sizeof pointer);
		if (alone && strncmp(pointer, "/scene", strlen("/scene")) == 0 && !problem_mentions(alone, member))
			problem_add(problem, pointer, "%s, with what /variants/%d changes", detail, variant);
		else
			problem_add(problem, pointer, "%s", detail);
	}
}

void compare_query_add(const json_t *root, int variant, const struct problem *of_scene, struct problem *problem)
{
	add_errors(root, variant, of_scene, NULL, problem);
	if (of_scene->kind != PROBLEM_NONE && of_scene->kind != PROBLEM_INVALID)
		problem_set(problem, of_scene->kind, "%s", of_scene->detail);
}

/* --- names
 * -------------------------------------------------------------------------------------------------------------------------------- */

/* Names of variants and rectangles become names of layers in files. */
static bool read_name(const json_t *value, const char *pointer, char name[static COMPARE_NAME_SIZE], struct problem *problem)
{
	static const char plain[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
	const char *text = json_is_string(value) ? json_string_value(value) : "";
	const size_t length = strlen(text);
	if (length >= 1 && length < COMPARE_NAME_SIZE && strspn(text, plain) == length) {
		memcpy(name, text, length + 1);
		return true;
	}
	problem_add(problem, pointer, "must be a name of 1 to %d letters, digits, '-' and '_'", COMPARE_NAME_SIZE - 1);
	return false;
}

static bool is_taken(const struct compare_query *query, const struct compare_variant *variant)
{
	for (const struct compare_variant *other = query->variant; other < query->variant + query->variant_count; other++)
		if (other != variant && strcmp(other->name, variant->name) == 0)
			return true;
	return false;
}

/* The name of the variant's model where it changes nothing else, or what it changes. false: nothing, and the model's name is taken. */
static bool choose_name(const struct compare_query *query, struct compare_variant *variant, const json_t *patch)
{
	enum { ROOM = COMPARE_NAME_SIZE - 3 };
	const struct scene_model *model = &variant->input.scene.model;
	const char *own = model->name == MODEL_SLAB ? scene_shading_names[model->shading] : scene_model_names[model->name];
	char changes[COMPARE_NAME_SIZE];
	variant_name_of_patch(patch, changes, sizeof changes);
	snprintf(variant->name, sizeof variant->name, "%s", own);
	if (variant_changes_only_model(patch) && !is_taken(query, variant))
		return true;
	if (!*changes)
		return false;
	snprintf(variant->name, sizeof variant->name, "%s", changes);
	for (char number = '2'; is_taken(query, variant); number++) /* ends: there are few variants */
		snprintf(variant->name, sizeof variant->name, "%.*s-%c", ROOM, changes, number);
	return true;
}

static void read_given_name(const json_t *patch, int index, struct compare_query *query, struct problem *problem)
{
	struct compare_variant *variant = &query->variant[index];
	const json_t *name = json_object_get(patch, "name");
	char pointer[64];
	snprintf(pointer, sizeof pointer, "/variants/%d/name", index);
	if (name && read_name(name, pointer, variant->name, problem) && is_taken(query, variant))
		problem_add(problem, pointer, "is needed: \"%s\" is the name of another variant", variant->name);
}

/* Those that change the model alone choose before the others, so that the plain names are theirs. */
static void name_variants(const json_t *variants, struct compare_query *query, struct problem *problem)
{
	size_t i;
	json_t *patch;
	json_array_foreach((json_t *)variants, i, patch) read_given_name(patch, (int)i, query, problem);
	for (int model = 1; model >= 0; model--)
		json_array_foreach((json_t *)variants, i, patch)
		{
			char pointer[64];
			if (!json_is_object(patch) || json_object_get(patch, "name") || variant_changes_only_model(patch) != model)
				continue;
			snprintf(pointer, sizeof pointer, "/variants/%zu/name", i);
			if (!choose_name(query, &query->variant[i], patch))
				problem_add(problem, pointer, "is needed: \"%s\" is the name of another variant", query->variant[i].name);
		}
}

static int find_variant(const struct compare_query *query, const char *name)
{
	for (int i = 0; i < query->variant_count; i++)
		if (strcmp(query->variant[i].name, name) == 0)
			return i;
	return -1;
}

/* --- variants
 * ----------------------------------------------------------------------------------------------------------------------------- */

/* RFC 7396. Takes `target` over and returns what it becomes. */
static json_t *merge_patch(json_t *target, const json_t *patch)
{
	const char *name;
	json_t *value;
	if (!json_is_object(patch)) {
		json_decref(target);
		return json_deep_copy(patch);
	}
	if (!json_is_object(target)) {
		json_decref(target);
		target = json_object();
	}
	json_object_foreach((json_t *)patch, name, value)
	{
		if (json_is_null(value))
			json_object_del(target, name);
		else
			json_object_set_new(target, name, merge_patch(json_incref(json_object_get(target, name)), value));
	}
	return target;
}

/* What is compared is scene light, whatever the scene's output would be by itself. */
static void set_layers(struct scene *scene)
{
	scene->output.format = IMAGE_EXR;
	scene->output.layers = 1u << LAYER_COLOR;
	if (scene->model.name == MODEL_REFERENCE)
		scene->output.layers |= 1u << LAYER_STANDARD_ERROR;
}

/* The scene with a patch laid over it. */
static void read_scene(const json_t *root, const json_t *patch, struct scene_input *input, struct problem *own)
{
	const json_t *base = json_object_get(root, "scene");
	json_t *scene = merge_patch(base ? json_deep_copy(base) : json_object(), patch);
	*input = scene_input_default();
	json_object_del(scene, "name"); /* the variant's */
	scene_json_read(scene, input, own);
	set_layers(&input->scene);
	scene_rules_apply(input, own);
	json_decref(scene);
}

/* Where something is wrong, tells whether the variant made it so. */
static void read_variant_scene(const json_t *root, int index, const json_t *patch, struct compare_query *query, struct problem *problem)
{
	struct problem own = {0}, alone = {0};
	struct scene_input unchanged;
	json_t *nothing = json_object();
	read_scene(root, patch, &query->variant[index].input, &own);
	if (own.error_count > 0)
		read_scene(root, nothing, &unchanged, &alone);
	add_errors(root, index, &own, &alone, problem);
	if (own.kind != PROBLEM_NONE && own.kind != PROBLEM_INVALID)
		problem_set(problem, own.kind, "%s", own.detail);
	json_decref(nothing);
	problem_finish(&alone);
	problem_finish(&own);
}

/* A null takes a member away before the scene is read, so that only here it is seen to be none. */
static void check_nulls(const json_t *patch, int index, struct problem *problem)
{
	const char *section, *name;
	json_t *members, *value;
	json_object_foreach((json_t *)patch, section, members)
	{
		char pointer[POINTER_SIZE], member[POINTER_SIZE];
		snprintf(pointer, sizeof pointer, "/variants/%d", index);
		pointer_append(pointer, sizeof pointer, section);
		if (json_is_null(members) && strcmp(section, "name") != 0 && !scene_section_exists(section))
			problem_add(problem, pointer, "is not a member of a scene");
		json_object_foreach(members, name, value)
		{
			snprintf(member, sizeof member, "%s", pointer);
			pointer_append(member, sizeof member, name);
			if (json_is_null(value) && scene_section_exists(section) && !scene_field_find(section, name))
				problem_add(problem, member, "is not a member of a scene");
		}
	}
}

static void read_variant(const json_t *root, int index, struct compare_query *query, struct problem *problem)
{
	const json_t *patch = json_array_get(json_object_get(root, "variants"), (size_t)index);
	char pointer[64];
	snprintf(pointer, sizeof pointer, "/variants/%d", index);
	if (!json_is_object(patch)) {
		problem_add(problem, pointer, "must be an object");
		return;
	}
	read_variant_scene(root, index, patch, query, problem);
	check_nulls(patch, index, problem);
	snprintf(pointer, sizeof pointer, "/variants/%d/output", index);
	if (json_object_get(patch, "output"))
		problem_add(problem, pointer, "all variants have the scene's output");
}

static void read_variants(const json_t *root, struct compare_query *query, struct problem *problem)
{
	const json_t *variants = json_object_get(root, "variants");
	const size_t count = json_array_size(variants);
	if (!json_is_array(variants) || count < COMPARE_VARIANTS_MIN || count > COMPARE_VARIANTS_MAX) {
		problem_add(problem, "/variants", "must be a list of %d to %d variants", COMPARE_VARIANTS_MIN, COMPARE_VARIANTS_MAX);
		return;
	}
	query->variant_count = (int)count;
	/* Variants have one, which read_scene takes away. */
	if (json_object_get(json_object_get(root, "scene"), "name"))
		problem_add(problem, "/scene/name", "is not a member of a scene");
	for (int i = 0; i < query->variant_count; i++)
		read_variant(root, i, query, problem);
	name_variants(variants, query, problem);
}

/* The model reference where one is, else the first. */
static void choose_truth(const json_t *root, struct compare_query *query, struct problem *problem)
{
	const json_t *given = json_object_get(root, "reference");
	for (int i = query->variant_count - 1; i >= 0; i--)
		if (query->variant[i].input.scene.model.name == MODEL_REFERENCE)
			query->truth = i;
	if (!given)
		return;
	const int named = json_is_string(given) ? find_variant(query, json_string_value(given)) : -1;
	if (named < 0)
		problem_add(problem, "/reference", "must be the name of a variant");
	else
		query->truth = named;
}

static void check_sizes(const struct compare_query *query, struct problem *problem)
{
	const struct scene_output *truth = &query->variant[query->truth].input.scene.output;
	for (int i = 0; i < query->variant_count; i++) {
		const struct scene_output *output = &query->variant[i].input.scene.output;
		char pointer[64];
		snprintf(pointer, sizeof pointer, "/variants/%d/camera", i);
		if (output->width != truth->width || output->height != truth->height)
			problem_add(problem, pointer, "makes a picture of %d x %d, and that of %s has %d x %d", output->width,
				    output->height, query->variant[query->truth].name, truth->width, truth->height);
	}
	const long long pixels = (long long)truth->width * truth->height * query->variant_count;
	if (pixels > COMPARE_PIXELS_MAX)
		problem_add(problem, "/scene/output", "width x height x variants is %lld pixels: at most %d", pixels, COMPARE_PIXELS_MAX);
}

/* --- regions
 * ------------------------------------------------------------------------------------------------------------------------------ */

static bool is_inside_layer(const struct scene *scene)
{
	const double z = scene->camera.position_m[2], base = scene->clouds.base_m;
	return scene_has_clouds(scene) && z >= base && z <= base + scene->clouds.thickness_m;
}

static bool read_side(const json_t *value, double low, double high, int *number)
{
	const double given = json_number_value(value);
	if (!json_is_number(value) || given != floor(given) || given < low || given > high)
		return false;
	*number = (int)given;
	return true;
}

/* The index of a region that every picture has, or -1. */
static int known_region(const char *name)
{
	for (int i = 0; i < KNOWN_REGIONS; i++)
		if (strcmp(name, known_regions[i].name) == 0)
			return i;
	return -1;
}

/* {"name": "sun", "rectangle": [x, y, width, height]} */
static void read_rectangle(const json_t *value, const char *pointer, const struct scene_output *output, struct compare_region *region,
			   struct problem *problem)
{
	const json_t *sides = json_object_get(value, "rectangle");
	const char *name;
	json_t *member;
	char at[POINTER_SIZE];
	json_object_foreach((json_t *)value, name, member)
	{
		snprintf(at, sizeof at, "%s", pointer);
		pointer_append(at, sizeof at, name);
		if (strcmp(name, "name") != 0 && strcmp(name, "rectangle") != 0)
			problem_add(problem, at, "is not a member of a region");
	}
	snprintf(at, sizeof at, "%s/name", pointer);
	if (read_name(json_object_get(value, "name"), at, region->name, problem) && known_region(region->name) >= 0)
		problem_add(problem, at, "is the name of a part of every picture");
	snprintf(at, sizeof at, "%s/rectangle", pointer);
	region->is_rectangle = true;
	region->bits = REGION_ALL;
	const bool good = json_array_size(sides) == 4 && read_side(json_array_get(sides, 0), 0, output->width - 1, &region->x) &&
			  read_side(json_array_get(sides, 1), 0, output->height - 1, &region->y) &&
			  read_side(json_array_get(sides, 2), 1, output->width - region->x, &region->width) &&
			  read_side(json_array_get(sides, 3), 1, output->height - region->y, &region->height);
	if (!good)
		problem_add(problem, at, "must be [x, y, width, height] in pixels, inside the picture of %d x %d", output->width,
			    output->height);
}

static void read_region(const json_t *value, const char *pointer, const struct scene_output *output, struct compare_region *region,
			struct problem *problem)
{
	if (json_is_object(value)) {
		read_rectangle(value, pointer, output, region, problem);
		return;
	}
	const int known = json_is_string(value) ? known_region(json_string_value(value)) : -1;
	if (known >= 0) {
		snprintf(region->name, sizeof region->name, "%s", known_regions[known].name);
		region->bits = known_regions[known].bits;
		return;
	}
	problem_add(problem, pointer, "must be one of all, cloud, sky, ground, or {\"name\", \"rectangle\": [x, y, width, height]}");
}

static void read_listed_regions(const json_t *regions, const struct scene_output *output, struct compare_query *query,
				struct problem *problem)
{
	const size_t count = json_array_size(regions);
	if (count < 1 || count > COMPARE_REGIONS_MAX) {
		problem_add(problem, "/regions", "must be a list of 1 to %d regions", COMPARE_REGIONS_MAX);
		return;
	}
	for (size_t i = 0; i < count; i++) {
		struct compare_region *region = &query->region[query->region_count++];
		char pointer[64];
		snprintf(pointer, sizeof pointer, "/regions/%zu", i);
		read_region(json_array_get(regions, i), pointer, output, region, problem);
		for (struct compare_region *other = query->region; other < region; other++)
			if (*region->name && strcmp(other->name, region->name) == 0)
				problem_add(problem, pointer, "is named twice");
	}
}

/* Inside of the layer everything is cloud, near or far, and the slab that would tell them apart has no view. */
static void read_regions(const json_t *root, struct compare_query *query, struct problem *problem)
{
	const json_t *regions = json_object_get(root, "regions");
	const struct scene *scene = &query->variant[query->truth].input.scene;
	const bool inside = is_inside_layer(scene);
	if (regions)
		read_listed_regions(regions, &scene->output, query, problem);
	for (int i = 0; !regions && i < (inside ? 1 : KNOWN_REGIONS); i++) {
		struct compare_region *region = &query->region[query->region_count++];
		snprintf(region->name, sizeof region->name, "%s", known_regions[i].name);
		region->bits = known_regions[i].bits;
	}
	for (int i = 0; i < query->region_count; i++)
		query->has_masks |= query->region[i].bits != REGION_ALL;
	if (inside && query->has_masks)
		problem_add(problem, "/regions", "the camera is inside the cloud layer, where there are only all and rectangles");
}

/* --- the whole
 * ---------------------------------------------------------------------------------------------------------------------------- */

void compare_query_read(const json_t *root, struct compare_query *query, struct problem *problem)
{
	static const char *const members[] = {"scene", "variants", "reference", "regions", NULL};
	const char *name;
	json_t *value;
	memset(query, 0, sizeof *query);
	if (!json_is_object(root)) {
		problem_add(problem, "", "must be an object");
		return;
	}
	json_object_foreach((json_t *)root, name, value)
	{
		char pointer[POINTER_SIZE] = "";
		pointer_append(pointer, sizeof pointer, name);
		if (name_index(members, name) < 0)
			problem_add(problem, pointer, "is not a member of a comparison");
	}
	const json_t *scene = json_object_get(root, "scene");
	if (scene && !json_is_object(scene)) {
		problem_add(problem, "/scene", "must be an object");
		return;
	}
	read_variants(root, query, problem);
	if (query->variant_count == 0 || problem_mentions(problem, "/variants"))
		return;
	choose_truth(root, query, problem);
	check_sizes(query, problem);
	if (!problem_mentions(problem, "/scene"))
		read_regions(root, query, problem);
}

struct scene compare_query_mask(const struct compare_query *query)
{
	struct scene mask = query->variant[query->truth].input.scene;
	const enum optics_model optics = mask.model.optics;
	mask.model = scene_default().model;
	mask.model.optics = optics;
	mask.output.layers = REGIONS_LAYERS;
	return mask;
}
