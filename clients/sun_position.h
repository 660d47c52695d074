/* Where the sun stands, as the daemon says, and the time of day that has it somewhere. */
#ifndef STRATUS_CLIENTS_SUN_POSITION_H
#define STRATUS_CLIENTS_SUN_POSITION_H

#include "clients/client.h"

struct place {
	double latitude_deg, longitude_deg; /* east positive */
};

struct sun_position {
	double elevation_deg, azimuth_deg;
};

enum { SUN_TIME_SIZE = 32 };

/* Rows for the table of a command whose options hold a struct place; the defaults are no places. */
/* clang-format off */
#define PLACE_ROWS(type, member)                                                                                                         \
	NUMBER_ROW("latitude", "DEG", -90, 90, type, member.latitude_deg, "of the place, north positive"),                               \
	NUMBER_ROW("longitude", "DEG", -180, 180, type, member.longitude_deg, "of the place, east positive")
/* clang-format on */
#define PLACE_NONE                                                                                                                         \
	{                                                                                                                                  \
		1000, 1000                                                                                                                 \
	}
bool place_is_given(const struct place *place);

/* RFC 3339, such as 2026-06-21T12:00:00Z or 2026-06-21T14:00:00+02:00, as seconds since 1970. false after a message. */
bool sun_time_read(const char *text, double *unix_s);
/* A date (2026-06-21) as noon of the mean sun at a longitude. false after a message. */
bool sun_noon_read(const char *date, double longitude_deg, double *unix_s);
/* UTC, with milliseconds when there are any. */
void sun_time_write(double unix_s, char text[static SUN_TIME_SIZE]);

/* Both are an enum client_exit, after a message when it is not CLIENT_OK. */
int sun_position_ask(const struct client *client, const struct place *place, double unix_s, struct sun_position *position);

/* When, in the half day before noon (rising) or after it, the sun passes an elevation, within seconds. *passes is false when it does not;
 * *unix_s is then noon. */
int sun_passage_ask(const struct client *client, const struct place *place, double noon_unix_s, bool rising, double elevation_deg,
		    bool *passes, double *unix_s);

#endif
