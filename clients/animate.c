/* stratus animate: a scene over time, as a film or as frames. */
#include "clients/batch_run.h"
#include "clients/commands.h"
#include "clients/file_type.h"
#include "clients/film.h"
#include "clients/film_run.h"
#include "clients/member_range.h"
#include "clients/scene_edit.h"
#include "clients/scene_source.h"
#include "clients/sun_position.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { FRAMES_MAX = 1000000 };

/* The sun's course of a day begins and ends in civil twilight, when the sky is still worth a picture. */
static const double TWILIGHT_DEG = -6;

struct animate_options {
	struct scene_source source;
	struct pool_settings pool;
	const char *output;
	double duration_s, frames_per_s, speed;
	struct text_list ramps;
	struct place place;
	const char *day, *from, *until;
	bool anew;
};

/* When the sun of the first and of the last frame stands where it does. */
struct course {
	bool moves;
	double begin_s, end_s; /* since 1970 */
};

static bool is_complete(const struct animate_options *options)
{
	struct member_range range;
	if (!options->output)
		client_error("animate wants -o FILM.mp4, FILM.webm or FOLDER");
	else if (file_type_is_picture(options->output) && !film_is_named(options->output))
		client_error("%s: animate writes .mp4 and .webm, or frames into a folder", options->output);
	else if ((options->from != NULL) != (options->until != NULL) || (options->day && options->from))
		client_error("the sun moves over a --day or --from a time --until another");
	else if (options->duration_s * options->frames_per_s > FRAMES_MAX)
		client_error("that are more than %d frames", FRAMES_MAX);
	else {
		for (int i = 0; i < options->ramps.count; i++)
			if (!member_range_read(options->ramps.text[i], &range)) {
				client_error("--ramp wants member=from..to, not \"%s\"", options->ramps.text[i]);
				return false;
			}
		return !(options->day || options->from) || place_is_given(&options->place);
	}
	return false;
}

static int find_day(const struct client *client, const struct animate_options *options, struct course *course)
{
	double noon_s;
	bool rises, sets;
	struct sun_position noon = {0};
	if (!sun_noon_read(options->day, options->place.longitude_deg, &noon_s))
		return CLIENT_USAGE;
	int status = sun_position_ask(client, &options->place, noon_s, &noon);
	if (status == CLIENT_OK)
		status = sun_passage_ask(client, &options->place, noon_s, true, TWILIGHT_DEG, &rises, &course->begin_s);
	if (status == CLIENT_OK)
		status = sun_passage_ask(client, &options->place, noon_s, false, TWILIGHT_DEG, &sets, &course->end_s);
	if (status != CLIENT_OK)
		return status;
	if (noon.elevation_deg < TWILIGHT_DEG) {
		client_error("there is no day on %s there: the sun comes up to %.1f degrees", options->day, noon.elevation_deg);
		return CLIENT_USAGE;
	}
	if (!rises)
		course->begin_s = noon_s - 43200;
	if (!sets)
		course->end_s = noon_s + 43200;
	return CLIENT_OK;
}

static int find_course(const struct client *client, const struct animate_options *options, struct course *course)
{
	course->moves = options->day || options->from;
	if (options->day)
		return find_day(client, options, course);
	if (options->from && !(sun_time_read(options->from, &course->begin_s) && sun_time_read(options->until, &course->end_s)))
		return CLIENT_USAGE;
	return CLIENT_OK;
}

/* --- frames -----------------------------------------------------------------------------------------------------------------------------
 */

static bool set_value(json_t *scene, const char *member, json_t *value)
{
	char *text = value ? json_dumps(value, JSON_ENCODE_ANY | JSON_REAL_PRECISION(9)) : NULL, *assignment = NULL;
	const bool good = text && asprintf(&assignment, "%s=%s", member, text) >= 0 && scene_set(scene, assignment);
	free(assignment);
	free(text);
	json_decref(value);
	return good;
}

static double start_of(const json_t *base)
{
	return json_number_value(json_object_get(json_object_get(base, "clouds"), "time_s"));
}

static bool set_sun(json_t *scene, const struct place *place, double unix_s)
{
	char time[SUN_TIME_SIZE];
	sun_time_write(unix_s, time);
	return json_object_set_new(scene, "sun",
				   json_pack("{s:s, s:f, s:f}", "time", time, "latitude_deg", place->latitude_deg, "longitude_deg",
					     place->longitude_deg)) == 0;
}

/* The scene of frame i of `count`; NULL after a message. */
static json_t *scene_of_frame(const struct animate_options *options, const struct course *course, const json_t *base, int i, int count)
{
	const double share = count > 1 ? (double)i / (count - 1) : 0;
	const double clouds_s = start_of(base) + options->speed * i / options->frames_per_s;
	json_t *scene = json_deep_copy(base);
	bool good = scene && set_value(scene, "clouds.time_s", json_real(clouds_s)) && scene_set_format(scene, ".png", false);
	if (course->moves)
		good = good && set_sun(scene, &options->place, course->begin_s + share * (course->end_s - course->begin_s));
	for (int r = 0; good && r < options->ramps.count; r++) {
		struct member_range range;
		member_range_read(options->ramps.text[r], &range);
		good = set_value(scene, range.member, member_range_at(&range, share));
	}
	if (good)
		return scene;
	json_decref(scene);
	return NULL;
}

static bool make_frames(const struct animate_options *options, const struct course *course, const json_t *base, struct scene_list *list)
{
	const int count = (int)(options->duration_s * options->frames_per_s + 0.5);
	bool good = true;
	for (int i = 0; good && i < (count > 0 ? count : 1); i++) {
		char name[16];
		snprintf(name, sizeof name, "%06d", i + 1);
		json_t *scene = scene_of_frame(options, course, base, i, count);
		good = scene && scene_list_add(list, name, scene, NULL);
	}
	return good;
}

/* A longer film was made into the folder before: who takes all of its frames gets the end of that one too. */
static void tell_of_frames_beyond(const struct client *client, const char *folder, int count)
{
	char *path;
	if (client->quiet || asprintf(&path, "%s/%06d.png", folder, count + 1) < 0)
		return;
	if (access(path, F_OK) == 0)
		fprintf(stderr, "%s and what follows it are of an earlier film and stay; this one has %d frames\n", path, count);
	free(path);
}

static int shoot(const struct client *client, const struct animate_options *options, const struct scene_list *list)
{
	if (film_is_named(options->output)) {
		const struct film_settings settings = {options->pool, options->output, options->frames_per_s};
		return film_run(client, &settings, list);
	}
	const struct batch_settings settings = {.pool = options->pool, .folder = options->output, .what = "frames", .anew = options->anew};
	tell_of_frames_beyond(client, options->output, list->count);
	return batch_run(client, &settings, list);
}

static int run_animate(struct client *client, void *given, char **words)
{
	struct animate_options *options = given;
	struct scene_list list = {0};
	struct course course = {0};
	json_t *base = NULL;
	if (!scene_source_take(&options->source, words[0]) || !is_complete(options))
		return CLIENT_USAGE;
	int status = scene_source_load(client, &options->source, &base);
	if (status == CLIENT_OK)
		status = find_course(client, options, &course);
	if (status == CLIENT_OK && !make_frames(options, &course, base, &list))
		status = CLIENT_USAGE;
	if (status == CLIENT_OK)
		status = shoot(client, options, &list);
	scene_list_finish(&list);
	json_decref(base);
	return status;
}

static const struct option_row rows[] = {
	TEXT_ROW("output", 'o', "FILE", WORDS_FILE, struct animate_options, output,
		 "a film (.mp4 is H.264, .webm is VP9; both want ffmpeg), or a folder for PNG frames and their manifest"),
	NUMBER_ROW("duration", "S", 0.001, 86400, struct animate_options, duration_s, "length of the film in seconds (10)"),
	NUMBER_ROW("fps", "N", 0.1, 240, struct animate_options, frames_per_s, "frames a second (25)"),
	NUMBER_ROW("speed", "N", 0, 1e6, struct animate_options, speed,
		   "seconds that clouds live and drift in one of the film (60), from the scene's clouds.time_s on"),
	LIST_ROW("ramp", "member=FROM..TO", WORDS_MEMBER, struct animate_options, ramps,
		 "a number that goes evenly from the first frame to the last: sun.elevation_deg=20..-4; repeatable"),
	PLACE_ROWS(struct animate_options, place),
	TEXT_ROW("day", 0, "DATE", WORDS_ANY, struct animate_options, day,
		 "the sun's course there on a day (2026-06-21), from dawn to dusk: while it is above -6 degrees"),
	TEXT_ROW("from", 0, "TIME", WORDS_ANY, struct animate_options, from, "or its course there from a time, 2026-06-21T16:00:00Z,"),
	TEXT_ROW("until", 0, "TIME", WORDS_ANY, struct animate_options, until, "until another"),
	SCENE_SOURCE_ROWS(struct animate_options, source),
	POOL_ROWS(struct animate_options, pool),
	FLAG_ROW("anew", 0, struct animate_options, anew, "of a folder: make also the frames that the manifest says are made"),
	{0}};

static const struct animate_options defaults = {
	.pool = POOL_DEFAULTS, .duration_s = 10, .frames_per_s = 25, .speed = 60, .place = PLACE_NONE};

const struct command command_animate = {
	.name = "animate",
	.arguments = "[SCENE.json|-]",
	.summary = "render a scene over time, into a film or frames",
	.remarks =
		"Clouds live and drift; the sun goes its way over a day, and numbers of the scene along ramps, where that is asked for.\n"
		"All frames have the exposure that their light asks for. A folder that was begun goes on where it stopped; a film is "
		"written\n"
		"whole or not at all.\n",
	.options = rows,
	.size = sizeof(struct animate_options),
	.defaults = &defaults,
	.words_max = 1,
	.words = WORDS_FILE,
	.run = run_animate,
};
