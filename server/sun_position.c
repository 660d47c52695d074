#include "server/sun_position.h"

#include <libnova/dynamical_time.h>
#include <libnova/julian_day.h>
#include <libnova/nutation.h>
#include <libnova/precession.h>
#include <libnova/sidereal_time.h>
#include <libnova/solar.h>
#include <libnova/transform.h>
#include <math.h>
#include <pthread.h>

/* Horizontal parallax and aberration of the sun at its mean distance. */
#define SUN_PARALLAX_DEG   (8.794 / 3600)
#define SUN_ABERRATION_DEG (20.4898 / 3600)

#define RADIANS (M_PI / 180)

static pthread_mutex_t libnova_mutex = PTHREAD_MUTEX_INITIALIZER;

/* Apparent right ascension and declination of date, in degrees; jde: dynamical time.
 *
 * libnova's ln_get_solar_equ_coords would do, but it leaves the ecliptic longitude at the equinox of J2000 (0.014 degrees a year), so the
 * steps are made here. */
static struct ln_equ_posn sun_equatorial(double jde)
{
	struct ln_helio_posn geometric;
	struct ln_nutation nutation;
	struct ln_equ_posn j2000, mean;
	struct ln_lnlat_posn ecliptic;
	ln_get_solar_geom_coords(jde, &geometric);
	/* libnova takes the nutation of its last call again when that was less than 0.1 days apart; the same time must give the same
	 * position whatever was asked before, to the last bit. */
	ln_get_nutation(jde + 1000, &nutation);
	ln_get_nutation(jde, &nutation);
	ln_get_equ_from_ecl(&(struct ln_lnlat_posn){.lng = geometric.L, .lat = geometric.B}, JD2000, &j2000);
	ln_get_equ_prec(&j2000, jde, &mean);
	ln_get_ecl_from_equ(&mean, jde, &ecliptic);

	double longitude = (ecliptic.lng + nutation.longitude - SUN_ABERRATION_DEG / geometric.R) * RADIANS;
	double latitude = ecliptic.lat * RADIANS;
	double obliquity = (nutation.ecliptic + nutation.obliquity) * RADIANS;
	return (struct ln_equ_posn){
		.ra = atan2(sin(longitude) * cos(obliquity) - tan(latitude) * sin(obliquity), cos(longitude)) / RADIANS,
		.dec = asin(sin(latitude) * cos(obliquity) + cos(latitude) * sin(obliquity) * sin(longitude)) / RADIANS,
	};
}

struct scene_sun sun_position_at(double julian_day, double latitude_deg, double longitude_deg)
{
	pthread_mutex_lock(&libnova_mutex);
	struct ln_equ_posn sun = sun_equatorial(ln_get_jde(julian_day));
	double sidereal_deg = ln_get_apparent_sidereal_time(julian_day) * 15;
	pthread_mutex_unlock(&libnova_mutex);

	double hour_angle = (sidereal_deg + longitude_deg - sun.ra) * RADIANS;
	double latitude = latitude_deg * RADIANS, declination = sun.dec * RADIANS;
	double east = -cos(declination) * sin(hour_angle);
	double north = sin(declination) * cos(latitude) - cos(declination) * cos(hour_angle) * sin(latitude);
	double up = sin(declination) * sin(latitude) + cos(declination) * cos(hour_angle) * cos(latitude);
	double azimuth = atan2(east, north) / RADIANS;
	return (struct scene_sun){
		.by_time = true,
		.julian_day = julian_day,
		.latitude_deg = latitude_deg,
		.longitude_deg = longitude_deg,
		.elevation_deg = atan2(up, hypot(east, north)) / RADIANS - SUN_PARALLAX_DEG * hypot(east, north),
		.azimuth_deg = azimuth < 0 ? azimuth + 360 : azimuth,
	};
}
