/* stratus sun: where the sun stands, at a time or over a day. */
#include "clients/commands.h"
#include "clients/sun_position.h"

#include <jansson.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

/* The upper limb on the horizon, through the refraction of a standard atmosphere (34') and with a radius of 16': what almanacs call rise
 * and set. */
static const double RISE_DEG = -0.833;

struct sun_options {
	struct place place;
	const char *time, *day;
	double step_min;
	bool json;
};

static json_t *row_of(const char *what, double unix_s, const struct sun_position *position)
{
	char time[SUN_TIME_SIZE];
	sun_time_write(unix_s, time);
	json_t *row =
		json_pack("{s:s, s:f, s:f}", "time", time, "elevation_deg", position->elevation_deg, "azimuth_deg", position->azimuth_deg);
	if (what)
		json_object_set_new(row, "event", json_string(what));
	return row;
}

/* Rows stand in the order of time; UTC sorts as text does. */
static void insert(json_t *table, json_t *row)
{
	const char *time = json_string_value(json_object_get(row, "time"));
	size_t at = 0;
	while (at < json_array_size(table) && strcmp(json_string_value(json_object_get(json_array_get(table, at), "time")), time) <= 0)
		at++;
	json_array_insert_new(table, at, row);
}

static int add_time(const struct client *client, const struct sun_options *options, const char *what, double unix_s, json_t *table)
{
	struct sun_position position;
	const int status = sun_position_ask(client, &options->place, unix_s, &position);
	if (status == CLIENT_OK)
		insert(table, row_of(what, unix_s, &position));
	return status;
}

static int add_passage(const struct client *client, const struct sun_options *options, double noon_s, bool rising, json_t *table)
{
	bool passes;
	double unix_s;
	const int status = sun_passage_ask(client, &options->place, noon_s, rising, RISE_DEG, &passes, &unix_s);
	return status == CLIENT_OK && passes ? add_time(client, options, rising ? "sunrise" : "sunset", unix_s, table) : status;
}

static int add_day(const struct client *client, const struct sun_options *options, double noon_s, json_t *table)
{
	const double step_s = options->step_min * 60;
	int status = add_passage(client, options, noon_s, true, table);
	if (status == CLIENT_OK)
		status = add_passage(client, options, noon_s, false, table);
	/* Whole steps of UTC within the day of the place. */
	for (double at_s = step_s * (double)(long long)((noon_s - 43200) / step_s + 1); status == CLIENT_OK && at_s <= noon_s + 43200;
	     at_s += step_s)
		status = add_time(client, options, NULL, at_s, table);
	return status;
}

static void print_table(const json_t *table)
{
	size_t i;
	json_t *row;
	printf("%-24s %10s %10s\n", "time", "elevation", "azimuth");
	json_array_foreach(table, i, row)
	{
		const char *what = json_string_value(json_object_get(row, "event"));
		printf("%-24s %10.3f %10.3f%s%s\n", json_string_value(json_object_get(row, "time")),
		       json_real_value(json_object_get(row, "elevation_deg")), json_real_value(json_object_get(row, "azimuth_deg")),
		       what ? "  " : "", what ? what : "");
	}
}

static int print(const struct sun_options *options, const json_t *table)
{
	if (options->json) {
		json_dumpf(options->day ? table : json_array_get(table, 0), stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(9));
		putchar('\n');
	} else {
		print_table(table);
	}
	return client_end_output();
}

static int run_sun(struct client *client, void *given, char **words)
{
	struct sun_options *options = given;
	double unix_s = (double)time(NULL);
	(void)words;
	if (options->time && options->day) {
		client_error("--time or --day, one of them");
		return CLIENT_USAGE;
	}
	if (!place_is_given(&options->place) || (options->time && !sun_time_read(options->time, &unix_s)) ||
	    (options->day && !sun_noon_read(options->day, options->place.longitude_deg, &unix_s)))
		return CLIENT_USAGE;
	json_t *table = json_array();
	int status = options->day ? add_day(client, options, unix_s, table) : add_time(client, options, NULL, unix_s, table);
	if (status == CLIENT_OK)
		status = print(options, table);
	json_decref(table);
	return status;
}

static const struct option_row rows[] = {
	PLACE_ROWS(struct sun_options, place),
	TEXT_ROW("time", 0, "TIME", WORDS_ANY, struct sun_options, time,
		 "2026-06-21T12:00:00Z or with an offset, +02:00; now unless given"),
	TEXT_ROW("day", 0, "DATE", WORDS_ANY, struct sun_options, day, "a table of the day, with sunrise and sunset"),
	NUMBER_ROW("step", "MINUTES", 1, 720, struct sun_options, step_min, "of the table (60)"),
	FLAG_ROW("json", 0, struct sun_options, json, "print JSON"),
	{0}};

static const struct sun_options defaults = {.place = PLACE_NONE, .step_min = 60};

const struct command command_sun = {
	.name = "sun",
	.arguments = "",
	.summary = "tell where the sun stands at a time and place",
	.remarks = "Degrees above the horizon, without refraction, and clockwise from north. Times are UTC; a day is that of the place's "
		   "sun.\n"
		   "Sunrise and sunset are when the upper limb is seen on the horizon, through the air: at -0.833 degrees.\n",
	.options = rows,
	.size = sizeof(struct sun_options),
	.defaults = &defaults,
	.run = run_sun,
};
