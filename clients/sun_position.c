#include "clients/sun_position.h"

#include "clients/http.h"
#include "clients/problem.h"

#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

enum { HALF_DAY_S = 43200, HALVINGS = 13 /* of half a day: 5 s are left */ };

bool place_is_given(const struct place *place)
{
	if (place->latitude_deg <= 90 && place->longitude_deg <= 180)
		return true;
	client_error("--latitude and --longitude are wanted");
	return false;
}

/* --- times ---------------------------------------------------------------------------------------------------------------------------- */

bool sun_time_read(const char *text, double *unix_s)
{
	struct tm time = {0};
	const char *end = strptime(text, "%Y-%m-%dT%H:%M:%S%z", &time);
	if (!end || *end) {
		client_error("a time is 2026-06-21T12:00:00Z or 2026-06-21T14:00:00+02:00, not \"%s\"", text);
		return false;
	}
	const long offset_s = time.tm_gmtoff;
	*unix_s = (double)(timegm(&time) - offset_s);
	return true;
}

bool sun_noon_read(const char *date, double longitude_deg, double *unix_s)
{
	struct tm time = {0};
	const char *end = strptime(date, "%Y-%m-%d", &time);
	if (!end || *end) {
		client_error("a day is 2026-06-21, not \"%s\"", date);
		return false;
	}
	*unix_s = (double)timegm(&time) + HALF_DAY_S - floor(longitude_deg / 15 * 3600);
	return true;
}

void sun_time_write(double unix_s, char text[static SUN_TIME_SIZE])
{
	const double ms = round(unix_s * 1000);
	const time_t whole = (time_t)floor(ms / 1000);
	const int rest = (int)(ms - 1000 * (double)whole);
	struct tm time;
	gmtime_r(&whole, &time);
	size_t length = strftime(text, SUN_TIME_SIZE, "%Y-%m-%dT%H:%M:%S", &time);
	if (rest)
		length += (size_t)snprintf(text + length, SUN_TIME_SIZE - length, ".%03d", rest);
	snprintf(text + length, SUN_TIME_SIZE - length, "Z");
}

/* --- asking -----------------------------------------------------------------------------------------------------------------------------
 */

static bool read_position(const struct http_response *response, struct sun_position *position)
{
	json_t *answer = json_loadb(response->body, response->size, 0, NULL);
	const bool good =
		json_unpack(answer, "{s:F, s:F}", "elevation_deg", &position->elevation_deg, "azimuth_deg", &position->azimuth_deg) == 0;
	json_decref(answer);
	return good;
}

int sun_position_ask(const struct client *client, const struct place *place, double unix_s, struct sun_position *position)
{
	char time[SUN_TIME_SIZE], path[160];
	struct http_response response;
	sun_time_write(unix_s, time);
	snprintf(path, sizeof path, "/v1/sun?time=%s&latitude_deg=%.9g&longitude_deg=%.9g", time, place->latitude_deg,
		 place->longitude_deg);
	int status = http_send(client, &(struct http_request){.path = path}, &response);
	if (status == CLIENT_OK && response.status != 200) {
		problem_print(&response);
		status = CLIENT_REFUSED;
	} else if (status == CLIENT_OK && !read_position(&response, position)) {
		client_error("%s does not say where the sun is", client->server);
		status = CLIENT_REFUSED;
	}
	http_response_finish(&response);
	return status;
}

int sun_passage_ask(const struct client *client, const struct place *place, double noon_unix_s, bool rising, double elevation_deg,
		    bool *passes, double *unix_s)
{
	double above_s = noon_unix_s, below_s = noon_unix_s + (rising ? -HALF_DAY_S : HALF_DAY_S);
	struct sun_position noon, midnight, middle;
	*unix_s = noon_unix_s;
	*passes = false;
	int status = sun_position_ask(client, place, above_s, &noon);
	if (status == CLIENT_OK)
		status = sun_position_ask(client, place, below_s, &midnight);
	if (status != CLIENT_OK || noon.elevation_deg < elevation_deg || midnight.elevation_deg >= elevation_deg)
		return status;
	for (int i = 0; i < HALVINGS && status == CLIENT_OK; i++) {
		const double time_s = (above_s + below_s) / 2;
		status = sun_position_ask(client, place, time_s, &middle);
		if (middle.elevation_deg >= elevation_deg)
			above_s = time_s;
		else
			below_s = time_s;
	}
	*passes = status == CLIENT_OK;
	*unix_s = round((above_s + below_s) / 2);
	return status;
}
