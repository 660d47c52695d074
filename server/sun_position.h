/* Where the sun stands, by libnova. Any thread (libnova keeps its last results in static variables: calls are serialised here). */
#ifndef STRATUS_SERVER_SUN_POSITION_H
#define STRATUS_SERVER_SUN_POSITION_H

#include "renderer/scene.h"

/* julian_day: universal time. latitude_deg -90..90 north, longitude_deg -180..180 east. Topocentric (with the sun's parallax), geometric:
 * not refracted; time and place come along. Elevation -90..90, azimuth 0..360 clockwise from north. */
struct scene_sun sun_position_at(double julian_day, double latitude_deg, double longitude_deg);

#endif
