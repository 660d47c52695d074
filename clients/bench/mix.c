#include "clients/bench/mix.h"

#include "clients/bench/draws.h"
#include "clients/scene_edit.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct mix_kind {
	char name[MIX_NAME_SIZE];
	double weight;
	char *path;    /* of a GET; NULL: a POST of the scene */
	json_t *scene; /* an object */
	json_t *vary;  /* member: [low, high], or NULL */
	char *bytes;   /* of a request that is always the same */
	size_t size;
};

struct mix {
	struct mix_kind kind[MIX_KINDS_MAX];
	int count;
	double weight; /* of all */
	char *host, *headers;
	struct draws draws;
};

/* Lets go what mix_prepare made. */
static void finish_preparation(struct mix *mix)
{
	for (int i = 0; i < mix->count; i++) {
		free(mix->kind[i].bytes);
		mix->kind[i].bytes = NULL;
	}
	free(mix->host);
	free(mix->headers);
	mix->host = mix->headers = NULL;
}

void mix_destroy(struct mix *mix)
{
	if (!mix)
		return;
	for (int i = 0; i < mix->count; i++) {
		free(mix->kind[i].path);
		json_decref(mix->kind[i].scene);
		json_decref(mix->kind[i].vary);
	}
	finish_preparation(mix);
	free(mix);
}

/* --- reading --------------------------------------------------------------------------------------------------------------------- */

static bool is_range(const json_t *range)
{
	const json_t *low = json_array_get(range, 0), *high = json_array_get(range, 1);
	return json_array_size(range) == 2 && json_is_number(low) && json_is_number(high) &&
	       json_number_value(low) <= json_number_value(high);
}

static const char *check_vary(const json_t *vary)
{
	const char *member;
	json_t *range;
	if (!json_is_object(vary))
		return "vary is an object of members, each with its two bounds";
	json_object_foreach((json_t *)vary, member,
			    range) if (!is_range(range)) return "vary gives each member two numbers, the lower first";
	return NULL;
}

/* What is wrong with a line, NULL when nothing is; the kind is then filled. */
static const char *read_kind(json_t *line, int number, struct mix_kind *kind)
{
	const char *member;
	json_t *value;
	kind->weight = 1;
	snprintf(kind->name, sizeof kind->name, "%d", number);
	json_object_foreach(line, member, value)
	{
		if (strcmp(member, "name") == 0 && json_is_string(value))
			snprintf(kind->name, sizeof kind->name, "%s", json_string_value(value));
		else if (strcmp(member, "weight") == 0 && json_is_number(value) && json_number_value(value) > 0)
			kind->weight = json_number_value(value);
		else if (strcmp(member, "scene") == 0 && json_is_object(value))
			kind->scene = json_incref(value);
		else if (strcmp(member, "vary") == 0 && !check_vary(value))
			kind->vary = json_incref(value);
		else if (strcmp(member, "path") == 0 && json_is_string(value) && json_string_value(value)[0] == '/' &&
			 !strpbrk(json_string_value(value), " \r\n"))
			kind->path = strdup(json_string_value(value));
		else
			return strcmp(member, "vary") == 0 ? check_vary(value)
							   : "has name, weight (above 0), and scene (with vary) or path (from /)";
	}
	if ((kind->scene != NULL) == (kind->path != NULL))
		return "has either a scene or a path";
	if (kind->vary && kind->path)
		return "can vary a scene, not a path";
	return NULL;
}

/* A number as the JSON that the server reads, whole when its bounds are. */
static json_t *draw_value(struct draws *draws, const json_t *range)
{
	const json_t *low = json_array_get(range, 0), *high = json_array_get(range, 1);
	if (json_is_integer(low) && json_is_integer(high)) {
		const double count = (double)(json_integer_value(high) - json_integer_value(low)) + 1;
		return json_integer(json_integer_value(low) + (json_int_t)floor(draws_next(draws) * count));
	}
	return json_real(json_number_value(low) + draws_next(draws) * (json_number_value(high) - json_number_value(low)));
}

/* The kind's scene with its members drawn; NULL and a message when a member cannot be set. */
static json_t *draw_scene(struct draws *draws, const struct mix_kind *kind)
{
	json_t *scene = json_deep_copy(kind->scene), *range;
	const char *member;
	json_object_foreach(kind->vary, member, range)
	{
		char assignment[256];
		json_t *value = draw_value(draws, range);
		char *text = value ? json_dumps(value, JSON_ENCODE_ANY | JSON_REAL_PRECISION(9)) : NULL;
		snprintf(assignment, sizeof assignment, "%s=%s", member, text ? text : "");
		const bool set = scene && text && scene_set(scene, assignment);
		free(text);
		json_decref(value);
		if (!set) {
			json_decref(scene);
			return NULL;
		}
	}
	return scene;
}

static struct mix *mix_create(void)
{
	return calloc(1, sizeof(struct mix));
}

/* One line of a file; *number counts the lines. false after a message. */
static bool take_line(struct mix *mix, const char *path, int number, char *text)
{
	json_error_t error;
	text += strspn(text, " \t\r\n");
	if (!*text || *text == '#')
		return true;
	json_t *line = json_loads(text, JSON_REJECT_DUPLICATES, &error);
	const char *wrong = !line ? error.text : !json_is_object(line) ? "is a JSON object" : NULL;
	if (!wrong && mix->count == MIX_KINDS_MAX)
		wrong = "comes after 32 others, which are as many as there may be";
	if (!wrong) {
		struct mix_kind *kind = &mix->kind[mix->count++];
		wrong = read_kind(line, number, kind);
		/* What cannot be drawn is told here, before any load. */
		json_t *trial = wrong || !kind->vary ? NULL : draw_scene(&mix->draws, kind);
		if (!wrong && kind->vary && !trial)
			wrong = "varies a member that its scene cannot have";
		json_decref(trial);
		mix->weight += kind->weight;
	}
	if (wrong)
		client_error("%s: line %d: a kind of request %s", path, number, wrong);
	json_decref(line);
	return !wrong;
}

int mix_read(const char *path, struct mix **mix)
{
	const bool standard = strcmp(path, "-") == 0;
	FILE *file = standard ? stdin : fopen(path, "r");
	char *line = NULL;
	size_t room = 0;
	bool good = file && (*mix = mix_create());
	if (!good)
		client_error("%s: %s", path, strerror(errno));
	for (int number = 1; good && getline(&line, &room, file) >= 0; number++)
		good = take_line(*mix, path, number, line);
	if (good && (*mix)->count == 0) {
		client_error("%s: there is no request in it", path);
		good = false;
	}
	free(line);
	if (file && !standard)
		fclose(file);
	if (!good) {
		mix_destroy(*mix);
		*mix = NULL;
	}
	return good ? CLIENT_OK : CLIENT_USAGE;
}

static struct mix *mix_of(const char *name)
{
	struct mix *mix = mix_create();
	if (mix) {
		mix->count = 1;
		mix->weight = mix->kind[0].weight = 1;
		snprintf(mix->kind[0].name, sizeof mix->kind[0].name, "%s", name);
	}
	return mix;
}

struct mix *mix_of_scene(const json_t *scene, const json_t *vary)
{
	struct mix *mix = mix_of("scene");
	if (!mix)
		return NULL;
	struct mix_kind *kind = &mix->kind[0];
	kind->scene = json_deep_copy(scene);
	kind->vary = json_object_size(vary) > 0 ? json_deep_copy(vary) : NULL;
	json_t *trial = kind->scene ? draw_scene(&mix->draws, kind) : NULL;
	json_decref(trial);
	if (trial)
		return mix;
	mix_destroy(mix);
	return NULL;
}

struct mix *mix_of_path(const char *path)
{
	struct mix *mix = mix_of(path);
	if (mix && !(mix->kind[0].path = strdup(path))) {
		mix_destroy(mix);
		return NULL;
	}
	return mix;
}

/* --- drawing --------------------------------------------------------------------------------------------------------------------- */

static bool write_get(const struct mix *mix, const char *path, char **bytes, size_t *size)
{
	const int length = asprintf(bytes, "GET %s HTTP/1.1\r\nHost: %s\r\n%s\r\n", path, mix->host, mix->headers);
	*size = (size_t)length;
	return length > 0;
}

static bool write_post(const struct mix *mix, const json_t *scene, char **bytes, size_t *size)
{
	char *body = scene ? json_dumps(scene, JSON_COMPACT) : NULL;
	const int length = !body ? -1
				 : asprintf(bytes,
					    "POST /v1/render HTTP/1.1\r\nHost: %s\r\nContent-Type: application/json\r\n"
					    "Content-Length: %zu\r\n%s\r\n%s",
					    mix->host, strlen(body), mix->headers, body);
	free(body);
	*size = (size_t)length;
	return length > 0;
}

bool mix_prepare(struct mix *mix, const char *host, const char *headers, uint64_t seed)
{
	finish_preparation(mix);
	mix->host = strdup(host);
	mix->headers = strdup(headers);
	mix->draws = draws_begin(seed);
	bool good = mix->host && mix->headers;
	for (int i = 0; good && i < mix->count; i++) {
		struct mix_kind *kind = &mix->kind[i];
		if (kind->path)
			good = write_get(mix, kind->path, &kind->bytes, &kind->size);
		else if (!kind->vary)
			good = write_post(mix, kind->scene, &kind->bytes, &kind->size);
	}
	return good;
}

int mix_kind_count(const struct mix *mix)
{
	return mix->count;
}

const char *mix_kind_name(const struct mix *mix, int kind)
{
	return mix->kind[kind].name;
}

static int draw_kind(struct mix *mix)
{
	double place = mix->count > 1 ? draws_next(&mix->draws) * mix->weight : 0;
	int kind = 0;
	while (kind + 1 < mix->count && place >= mix->kind[kind].weight)
		place -= mix->kind[kind++].weight;
	return kind;
}

bool mix_draw(struct mix *mix, struct mix_request *request)
{
	const int index = draw_kind(mix);
	const struct mix_kind *kind = &mix->kind[index];
	*request = (struct mix_request){.kind = index, .bytes = kind->bytes, .size = kind->size, .shared = true};
	if (kind->bytes)
		return true;
	json_t *scene = draw_scene(&mix->draws, kind);
	request->shared = false;
	const bool good = write_post(mix, scene, &request->bytes, &request->size);
	json_decref(scene);
	if (!good)
		request->bytes = NULL;
	return good;
}

void mix_request_finish(struct mix_request *request)
{
	if (!request->shared)
		free(request->bytes);
	*request = (struct mix_request){0};
}
