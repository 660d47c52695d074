#include "tests/validate/air_photons.h"

#include <math.h>
#include <stdbool.h>

static const double earth_radius = 6371000, top_height = 100000;

/* --- what air is ------------------------------------------------------------------------------------------------------------------- */

struct coefficients {
	double rayleigh, aerosol, ozone; /* extinction, 1/m */
};

/* Per metre of height, of integral 1. */
static double rayleigh_density(double height)
{
	const double left = exp(-10.0 / 9.2), column = 9200 * (1 - left) + 6500 * left;
	return (height < 10000 ? exp(-height / 9200) : left * exp((10000 - height) / 6500)) / column;
}

static struct coefficients coefficients_at(const struct air *air, double height)
{
	return (struct coefficients){.rayleigh = air->rayleigh * rayleigh_density(height),
				     .aerosol = air->aerosol / 1200 * exp(-height / 1200),
				     .ozone = air->ozone / 15000 * fmax(0, 1 - fabs(height - 25000) / 15000)};
}

static double extinction_at(const struct air *air, double height)
{
	const struct coefficients c = coefficients_at(air, height);
	return c.rayleigh + c.aerosol + c.ozone;
}

static double phase_rayleigh(double cosine)
{
	return 3 / (16 * M_PI) * (1 + cosine * cosine);
}

static double phase_aerosol(double cosine, double g)
{
	return 3 / (8 * M_PI) * (1 - g * g) / (2 + g * g) * (1 + cosine * cosine) / pow(1 + g * g - 2 * g * cosine, 1.5);
}

/* --- geometry: places are vectors from the centre of the Earth ------------------------------------------------------------------------ */

static double dot(const double a[3], const double b[3])
{
	return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void move(double place[3], const double direction[3], double distance)
{
	for (int i = 0; i < 3; i++)
		place[i] += distance * direction[i];
}

static double height_of(const double place[3])
{
	return fmax(0, sqrt(dot(place, place)) - earth_radius);
}

/* Distance to where a ray leaves the air, upwards or into the ground. */
static double distance_to_end(const double place[3], const double direction[3], bool *ground)
{
	const double b = dot(place, direction), r2 = dot(place, place);
	const double inner = b * b - (r2 - earth_radius * earth_radius), outer = b * b - (r2 - pow(earth_radius + top_height, 2));
	*ground = b < 0 && inner > 0;
	return *ground ? fmax(0, -b - sqrt(inner)) : -b + sqrt(fmax(outer, 0));
}

static double optical_thickness(const struct air *air, const double place[3], const double direction[3], double distance, int steps)
{
	double sum = 0, previous = 0;
	for (int i = 1; i <= steps; i++) {
		const double unit = (double)i / steps, next = distance * unit * unit, t = 0.5 * (previous + next);
		double at[3] = {place[0], place[1], place[2]};
		move(at, direction, t);
		sum += extinction_at(air, height_of(at)) * (next - previous);
		previous = next;
	}
	return sum;
}

static double sun_transmittance(const struct air *air, const double place[3], const double sun[3])
{
	bool ground;
	const double distance = distance_to_end(place, sun, &ground);
	return ground ? 0 : exp(-optical_thickness(air, place, sun, distance, 64));
}

double air_sun_transmittance(const struct air *air, double height, double sun_zenith)
{
	const double place[3] = {0, 0, earth_radius + height}, sun[3] = {sin(sun_zenith), 0, cos(sun_zenith)};
	return sun_transmittance(air, place, sun);
}

/* --- chance ------------------------------------------------------------------------------------------------------------------------- */

/* SplitMix64 (Steele, Lea, Flood 2014). */
static double random_unit(uint64_t *state)
{
	uint64_t z = *state += 0x9e3779b97f4a7c15;
	z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9;
	z = (z ^ z >> 27) * 0x94d049bb133111eb;
	return (double)((z ^ z >> 31) >> 11) * 0x1p-53;
}

/* Turns a direction by an angle about a random azimuth. */
static void turn(double direction[3], double cosine, uint64_t *state)
{
	const double azimuth = 2 * M_PI * random_unit(state), sine = sqrt(fmax(0, 1 - cosine * cosine));
	const double d[3] = {direction[0], direction[1], direction[2]};
	/* An axis across it. */
	const int least = fabs(d[0]) < fabs(d[1]) ? (fabs(d[0]) < fabs(d[2]) ? 0 : 2) : (fabs(d[1]) < fabs(d[2]) ? 1 : 2);
	double u[3] = {0}, v[3];
	for (int i = 0; i < 3; i++)
		u[i] = (i == least) - d[least] * d[i];
	const double length = sqrt(dot(u, u));
	for (int i = 0; i < 3; i++)
		u[i] /= length;
	for (int i = 0; i < 3; i++)
		v[i] = d[(i + 1) % 3] * u[(i + 2) % 3] - d[(i + 2) % 3] * u[(i + 1) % 3];
	for (int i = 0; i < 3; i++)
		direction[i] = cosine * d[i] + sine * (cos(azimuth) * u[i] + sin(azimuth) * v[i]);
}

/* Cosine of a scattering angle: isotropic, or Henyey and Greenstein's, kept with the odds (1 + c^2)/2. */
static double scattering_cosine(double g, uint64_t *state)
{
	for (;;) {
		const double u = random_unit(state), s = (1 - g * g) / (1 - g + 2 * g * u);
		const double cosine = fabs(g) < 1e-6 ? 2 * u - 1 : fmin(1, fmax(-1, (1 + g * g - s * s) / (2 * g)));
		if (random_unit(state) < 0.5 * (1 + cosine * cosine))
			return cosine;
	}
}

/* --- one photon ---------------------------------------------------------------------------------------------------------------------- */

/* Goes to the next event (Woodcock tracking by the extinction at the lowest point). */
enum event { SCATTERED, MET_GROUND, LEFT };

static enum event go_on(const struct air *air, double place[3], const double direction[3], uint64_t *state)
{
	bool ground;
	const double distance = distance_to_end(place, direction, &ground), b = dot(place, direction);
	const double r2 = dot(place, place), lowest = ground ? 0 : b < 0 ? fmax(0, sqrt(r2 - b * b) - earth_radius) : height_of(place);
	const double most = air->rayleigh * rayleigh_density(lowest) + air->aerosol / 1200 * exp(-lowest / 1200) + air->ozone / 15000;
	for (double t = 0;;) {
		t -= log(1 - random_unit(state)) / most;
		if (t >= distance) {
			move(place, direction, distance);
			return ground ? MET_GROUND : LEFT;
		}
		double at[3] = {place[0], place[1], place[2]};
		move(at, direction, t);
		if (random_unit(state) * most < extinction_at(air, height_of(at))) {
			move(place, direction, t);
			return SCATTERED;
		}
	}
}

/* Light of the sun scattered here along the photon's way back; goes on in a new direction. Returns what is left of the weight. */
static double scatter(const struct air *air, const double place[3], double direction[3], const double sun[3], double weight, double *sum,
		      uint64_t *state)
{
	const struct coefficients c = coefficients_at(air, height_of(place));
	const double haze = c.aerosol * air->aerosol_albedo, scattering = c.rayleigh + haze, cosine = dot(direction, sun);
	weight *= scattering / (c.rayleigh + c.aerosol + c.ozone);
	*sum += weight * sun_transmittance(air, place, sun) *
		(c.rayleigh * phase_rayleigh(cosine) + haze * phase_aerosol(cosine, air->aerosol_asymmetry)) / scattering;
	const bool by_haze = random_unit(state) * scattering < haze;
	turn(direction, scattering_cosine(by_haze ? air->aerosol_asymmetry : 0, state), state);
	return weight;
}

static double reflect(const struct air *air, const double place[3], double direction[3], const double sun[3], double weight, double *sum,
		      uint64_t *state)
{
	double up[3];
	const double r = sqrt(dot(place, place));
	for (int i = 0; i < 3; i++)
		up[i] = place[i] / r;
	weight *= air->ground_albedo;
	if (dot(up, sun) > 0)
		*sum += weight / M_PI * dot(up, sun) * sun_transmittance(air, place, sun);
	for (int i = 0; i < 3; i++)
		direction[i] = up[i];
	turn(direction, sqrt(random_unit(state)), state);
	return weight;
}

static double follow(const struct air *air, double place[3], double direction[3], const double sun[3], enum event event, double weight,
		     uint64_t *state)
{
	double sum = 0;
	while (event != LEFT && weight > 0) {
		weight = (event == SCATTERED ? scatter : reflect)(air, place, direction, sun, weight, &sum, state);
		/* Russian roulette. */
		if (weight < 0.05) {
			if (random_unit(state) > weight / 0.05)
				break;
			weight = 0.05;
		}
		event = go_on(air, place, direction, state);
	}
	return sum;
}

/* --- many ------------------------------------------------------------------------------------------------------------------------------
 */

enum { WAY = 2000 };

/* Optical thickness up to WAY + 1 points of the first way, evenly spaced in the root of the distance. */
static void tabulate(const struct air *air, const double place[3], const double direction[3], double distance, double thickness[WAY + 1])
{
	thickness[0] = 0;
	for (int i = 1; i <= WAY; i++) {
		const double from = distance * pow((i - 1.0) / WAY, 2), to = distance * pow((double)i / WAY, 2);
		double at[3] = {place[0], place[1], place[2]};
		move(at, direction, 0.5 * (from + to));
		thickness[i] = thickness[i - 1] + extinction_at(air, height_of(at)) * (to - from);
	}
}

static double distance_at(const double thickness[WAY + 1], double distance, double wanted)
{
	int low = 0, high = WAY;
	while (high - low > 1) {
		const int middle = (low + high) / 2;
		*(thickness[middle] <= wanted ? &low : &high) = middle;
	}
	const double part = (wanted - thickness[low]) / fmax(thickness[high] - thickness[low], 1e-300);
	const double from = distance * pow((double)low / WAY, 2), to = distance * pow((double)high / WAY, 2);
	return from + part * (to - from);
}

struct air_radiance air_photons_radiance(const struct air *air, double height, const double direction[3], double sun_zenith, int photons,
					 uint64_t *state)
{
	const double sun[3] = {sin(sun_zenith), 0, cos(sun_zenith)}, start[3] = {0, 0, earth_radius + height};
	bool ground;
	const double distance = distance_to_end(start, direction, &ground);
	double thickness[WAY + 1], sum = 0, squares = 0;
	tabulate(air, start, direction, distance, thickness);
	/* All are scattered on the first way, spread evenly over it; where the ground ends it, as many meet that besides. */
	const double met = 1 - exp(-thickness[WAY]);
	for (int i = 0; i < photons; i++) {
		double place[3] = {start[0], start[1], start[2]}, d[3] = {direction[0], direction[1], direction[2]};
		const double unit = (i + random_unit(state)) / photons;
		move(place, d, distance_at(thickness, distance, -log(1 - unit * met)));
		double light = met * follow(air, place, d, sun, SCATTERED, 1, state);
		if (ground) {
			double at[3] = {start[0], start[1], start[2]}, to[3] = {direction[0], direction[1], direction[2]};
			move(at, to, distance);
			light += (1 - met) * follow(air, at, to, sun, MET_GROUND, 1, state);
		}
		sum += light;
		squares += light * light;
	}
	const double mean = sum / photons;
	return (struct air_radiance){mean, sqrt(fmax(0, squares / photons - mean * mean) / (photons - 1))};
}
