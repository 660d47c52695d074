/* The sea and the ground as they are seen: Fresnel, slopes, glitter and waves against closed forms and published values, compiled for the
 * processor. No OpenGL. */
extern "C" {
#include "renderer/scene.h"
#include "renderer/stages/sea.h"
}
#include "tests/unit/glsl_shim.h"

#include <cstdarg>
#include <csetjmp>
#include <cstdint>
#include <cstdio>
extern "C" {
#include <cmocka.h>
}

#define VIEW_GROUND 0
namespace glsl
{
namespace bare
{
#include "shaders/lib/ground.glsl"
#include "shaders/lib/ground_near.glsl"
#include "shaders/lib/sea.glsl"
} // namespace bare
#include "tests/unit/glsl_again.h"
#undef VIEW_GROUND
#define VIEW_GROUND 1
namespace grown
{
#include "shaders/lib/ground_near.glsl"
} // namespace grown
} // namespace glsl

using namespace glsl::bare;
using glsl::vec2;
using glsl::vec3;
using glsl::vec4;

static const double pi = 3.14159265358979;

/* --- slopes -------------------------------------------------------------------------------------------------------------------- */

static void normal_distribution_is_known(void **)
{
	for (double u = -4; u <= 6; u += 0.1) {
		const double below = 0.5 * std::erfc(-u / std::sqrt(2.0)), density = std::exp(-0.5 * u * u) / std::sqrt(2 * pi);
		assert_float_equal(normal_below((float)u), below, 2e-4);
		assert_float_equal(normal_density((float)u), density, 1e-6);
		assert_float_equal(normal_ramp((float)u), std::fmax(u * below + density, 1e-6), 1e-3);
	}
	/* Far from grazing a rough surface shows its flat area. */
	assert_float_equal(normal_ramp(100.0f), 100, 1e-3);
}

/* --- Fresnel -------------------------------------------------------------------------------------------------------------------- */

static void fresnel_is_known(void **)
{
	assert_float_equal(sea_fresnel(1), std::pow(0.34 / 2.34, 2), 1e-6);
	assert_float_equal(sea_fresnel(0), 1, 1e-6);
	/* At Brewster's angle one polarisation is gone: half of ((n^2 - 1) / (n^2 + 1))^2. */
	const double n2 = 1.34 * 1.34;
	assert_float_equal(sea_fresnel((float)std::cos(std::atan(1.34))), 0.5 * std::pow((n2 - 1) / (n2 + 1), 2), 1e-6);
	/* A flat sea sends back 0.066 of uniform light (Burt 1954; 0.0666 for n = 1.34). */
	double sum = 0;
	for (int i = 0; i < 2000; i++) {
		const double mu = (i + 0.5) / 2000;
		sum += 2 * mu * (double)sea_fresnel((float)mu) / 2000;
	}
	assert_float_equal(sum, 0.0666, 0.001);
}

/* --- glitter -------------------------------------------------------------------------------------------------------------------- */

static vec3 direction(double zenith_deg, double azimuth_deg)
{
	const double z = zenith_deg * pi / 180, a = azimuth_deg * pi / 180;
	return vec3((float)(std::sin(z) * std::sin(a)), (float)(std::sin(z) * std::cos(a)), (float)std::cos(z));
}

static sea_slopes rough_sea(double wind)
{
	sea_slopes s;
	s.resolved = vec2(0.0f);
	s.covariance = vec3((float)(0.003 + 1.92e-3 * wind), 0.0f, (float)(3.16e-3 * wind));
	s.total = s.covariance;
	return s;
}

/* Flux upwards by a beam of irradiance 1 across it. */
static double glitter_flux(const sea_slopes &s, vec3 to_sun)
{
	enum { ZENITHS = 240, AZIMUTHS = 360 };
	double sum = 0;
	for (int i = 0; i < ZENITHS; i++)
		for (int k = 0; k < AZIMUTHS; k++) {
			const double mu = (i + 0.5) / ZENITHS;
			const vec3 v = direction(std::acos(mu) * 180 / pi, (k + 0.5) * 360 / AZIMUTHS);
			sum += (double)sea_glint(s, v, to_sun) * mu * 2 * pi / (ZENITHS * AZIMUTHS);
		}
	return sum;
}

/* Flux that the facets mirror upwards, each on its own: the integral over slopes. */
static double facet_flux(const sea_slopes &s, vec3 to_sun)
{
	enum { STEPS = 300 };
	const double sx = std::sqrt((double)s.covariance.x), sy = std::sqrt((double)s.covariance.z), reach = 5;
	double sum = 0;
	for (int i = 0; i < STEPS; i++)
		for (int k = 0; k < STEPS; k++) {
			const double x = reach * (2 * (i + 0.5) / STEPS - 1), y = reach * (2 * (k + 0.5) / STEPS - 1);
			const vec3 normal((float)(sx * x), (float)(sy * y), 1.0f);
			const double lit = (double)glm::dot(normal, to_sun), cosine = lit / (double)glm::length(normal);
			const double up = 2 * cosine / (double)glm::length(normal) - (double)to_sun.z;
			if (lit > 0 && up > 0)
				sum += std::exp(-0.5 * (x * x + y * y)) / (2 * pi) * (double)sea_fresnel((float)cosine) * lit * 4 * reach *
				       reach / (STEPS * STEPS);
		}
	return sum;
}

static void glitter_holds_the_reflected_flux(void **)
{
	for (double wind = 2; wind <= 14; wind += 6)
		for (double zenith = 0; zenith <= 60; zenith += 15) {
			const sea_slopes s = rough_sea(wind);
			const vec3 sun = direction(zenith, 30);
			const double found = glitter_flux(s, sun), facets = facet_flux(s, sun);
			const double flat = (double)sun.z * (double)sea_fresnel(sun.z);
			print_message("wind %2.0f m/s, sun zenith %2.0f: glitter %.5f, facets %.5f, flat sea %.5f\n", wind, zenith, found,
				      facets, flat);
			/* What facets mirror onto others, more with wind and at a slant, is lost. */
			assert_float_equal(found / facets, 1, zenith < 50 && wind <= 8 ? 0.015 : 0.1);
			assert_true(found < 1.01 * facets);
			if (zenith <= 30 && wind <= 8)
				assert_float_equal(found / flat, 1, 0.05);
		}
}

/* The pattern's ridge: no slope sends more sun than that of the mirror where the sun is high, and at a slant it leans towards the viewer.
 */
static void glitter_peaks_where_facets_mirror(void **)
{
	const sea_slopes s = rough_sea(8);
	const vec3 sun = direction(30, 0);
	double best = 0, at = 0;
	for (double zenith = -80; zenith <= 80; zenith += 0.5) {
		const vec3 v = direction(std::fabs(zenith), zenith < 0 ? 0 : 180);
		const double found = (double)sea_glint(s, v, sun);
		if (found > best)
			best = found, at = zenith;
	}
	print_message("sun at 30 degrees: brightest at %.1f\n", at);
	assert_true(at > 28 && at < 40);
}

/* --- the mirrored sky -------------------------------------------------------------------------------------------------------------- */

static void disc_has_equal_areas(void **)
{
	for (double zenith = 0.5; zenith < 89; zenith += 4)
		for (double azimuth = 0; azimuth < 360; azimuth += 25) {
			const vec3 d = direction(zenith, azimuth), back = sea_sky_direction(sea_sky_coordinates(d));
			assert_float_equal(glm::length(d - back), 0, 1e-4);
			const vec2 p = (sea_sky_coordinates(d) - 0.5f) * 2.0f / 0.96f;
			assert_float_equal(glm::dot(p, p), 1 - std::cos(zenith * pi / 180), 1e-5);
		}
}

/* Under a sky of radiance 1 the whole rough sea sends back 0.05 to 0.066 of what it receives (Payne 1972: 0.06 under overcast; Burt 1954
 * for roughened water), never more than 1 in any direction, and at the horizon less than a flat mirror would. */
static void sea_under_a_uniform_sky(void **)
{
	glsl::image::level texel = {1, 1, {vec4(1.0f)}};
	auto image = std::make_shared<glsl::image>();
	image->levels.push_back(texel);
	glsl::sea_sky = image;
	glsl::sea_state = vec4(0.0f);
	for (double wind = 2; wind <= 14; wind += 4) {
		const sea_slopes s = rough_sea(wind);
		double sum = 0, grazing = 0;
		for (int i = 0; i < 400; i++) {
			const double mu = (i + 0.5) / 400;
			const vec3 v = direction(std::acos(mu) * 180 / pi, 70);
			const double found = (double)sea_radiance(s, v, vec3(0, 0, 1), vec3(0.0f), vec3(0.0f)).y;
			assert_true(found >= 0 && found <= 1);
			sum += 2 * mu * found / 400;
			if (i == 2)
				grazing = found;
		}
		print_message("wind %2.0f m/s: %.4f of uniform light, %.3f at 0.4 degrees\n", wind, sum, grazing);
		assert_true(sum > 0.048 && sum < 0.068);
		assert_true(grazing < 0.75 && grazing > 0.15);
	}
	glsl::sea_sky = nullptr;
}

/* --- waves ---------------------------------------------------------------------------------------------------------------------- */

static scene_block waves_of(double wind, double time, double x)
{
	struct scene scene = scene_default();
	scene_block block = {};
	scene.clouds.wind_mps[0] = wind;
	scene.clouds.wind_mps[1] = 0;
	scene.clouds.time_s = time;
	scene.camera.position_m[0] = x;
	sea_fill_block(&block, &scene);
	return block;
}

/* Slopes resolved and not keep Cox and Munk's variance together, from pixels of a centimetre to such of kilometres, in any wind. */
static void waves_keep_the_variance(void **)
{
	enum { PLACES = 20000 };
	for (double wind = 2; wind <= 15; wind += 6.5)
		for (double pixel = 0.01; pixel < 3000; pixel *= 16) {
			const double wanted[2] = {3.16e-3 * wind, 0.003 + 1.92e-3 * wind};
			double resolved[2] = {0, 0}, rest[2] = {0, 0};
			glsl::set_scene_block(waves_of(wind, 0, 0));
			for (int i = 0; i < PLACES; i++) {
				const double u = i * 0.7548776662, v = i * 0.5698402910;
				const vec2 place((float)(9000 * (u - std::floor(u))), (float)(9000 * (v - std::floor(v))));
				const sea_slopes s = sea_slopes_at(place, vec2(0, 1), (float)pixel, (float)(3 * pixel));
				resolved[0] += (double)s.resolved.x * (double)s.resolved.x / PLACES;
				resolved[1] += (double)s.resolved.y * (double)s.resolved.y / PLACES;
				rest[0] += (double)s.covariance.x / PLACES;
				rest[1] += (double)s.covariance.z / PLACES;
			}
			print_message("wind %4.1f m/s, pixel %7.2f m: resolved %.4f + %.4f, rest %.4f + %.4f\n", wind, pixel, resolved[0],
				      resolved[1], rest[0], rest[1]);
			for (int k = 0; k < 2; k++) {
				assert_float_equal(resolved[k] + rest[k], wanted[k], 0.05 * wanted[k]);
				assert_true(rest[k] > 0.2 * wanted[k]);
			}
			if (pixel > 100)
				assert_true(resolved[0] + resolved[1] < 1e-4);
		}
}

/* Each wave runs as gravity and capillarity have it, at any time alike, and stays where it is when the camera moves. */
static void waves_run_as_on_deep_water(void **)
{
	for (double time = 0; time <= 1e7; time = time * 30 + 10) {
		const scene_block a = waves_of(10, time, 0), b = waves_of(10, time + 0.01, 0), c = waves_of(10, time, 37);
		for (int i = 0; i < ::SEA_WAVES; i++) {
			const double nx = (double)a.sea_waves[i][0], k = 2 * pi * std::hypot(nx, (double)a.sea_waves[i][1]);
			const double turned = std::remainder((double)a.sea_waves[i][2] - (double)b.sea_waves[i][2], 1);
			/* Tension of water over its density: 7.2e-5 m3/s2. */
			assert_float_equal(turned, 0.01 * std::sqrt(9.81 * k + 7.2e-5 * k * k * k) / (2 * pi), 2e-5 + 2e-4 * turned);
			const double moved = std::remainder((double)c.sea_waves[i][2] - (double)a.sea_waves[i][2] - 37 * nx, 1);
			assert_float_equal(moved, 0, 2e-4);
			assert_true(k > 0.03 && k < 2 * pi / 0.05);
		}
	}
}

/* The height that the waves add up to is that of a full-grown sea: 0.21 U^2/g from trough to crest, the highest third of them (Pierson and
 * Moskowitz 1964), for the wind at 19.5 m, 1.026 times that at 10 m. */
static void waves_are_as_high_as_the_wind_makes_them(void **)
{
	for (double wind = 5; wind <= 15; wind += 5) {
		const scene_block block = waves_of(wind, 0, 0);
		double variance = 0;
		for (int i = 0; i < ::SEA_WAVES; i++)
			variance += 0.5 * std::pow((double)block.sea_waves[i][3] / (2 * pi), 2);
		const double found = 4 * std::sqrt(variance), published = 0.21 * std::pow(1.026 * wind, 2) / 9.81;
		print_message("wind %2.0f m/s: significant height %.2f m, published %.2f\n", wind, found, published);
		assert_float_equal(found / published, 1, 0.2);
	}
}

/* The glitter's mean over the water is Cox and Munk's, whatever part of the waves the pixels resolve. */
static void glitter_is_the_same_from_any_distance(void **)
{
	enum { PLACES = 40000 };
	glsl::set_scene_block(waves_of(8, 0, 0));
	const sea_slopes rough = sea_slopes_at(vec2(0.0f), vec2(0, 1), 1e6f, 1e6f);
	for (double zenith = 0; zenith <= 75; zenith += 25)
		for (double sun = 10; sun <= 70; sun += 30)
			for (double pixel = 0.01; pixel < 200; pixel *= 20) {
				const vec3 to_viewer = direction(zenith, 0), to_sun = direction(sun, 170);
				const double wanted = (double)sea_glint(rough, to_viewer, to_sun);
				double mean = 0;
				for (int i = 0; i < PLACES; i++) {
					const double u = i * 0.7548776662, v = i * 0.5698402910;
					const vec2 place((float)(9000 * (u - std::floor(u))), (float)(9000 * (v - std::floor(v))));
					const sea_slopes s =
						sea_slopes_at(place, vec2(0, 1), (float)pixel, (float)(pixel / (double)to_viewer.z));
					mean += (double)sea_glint(s, to_viewer, to_sun) / PLACES;
				}
				print_message("viewer at %2.0f degrees, sun at %2.0f, pixel %6.2f m: %.4f, Cox and Munk %.4f\n", zenith,
					      sun, pixel, mean, wanted);
				/* Over what the sun sends off the middle of its glitter, where slopes are rare: a thousandth. */
				assert_float_equal(mean, wanted, 0.04 * wanted + 1e-4);
			}
}

/* From some kilometres up only the longest waves are longer than pixels, a few that stand out as stripes: they are roughness by then. */
static void far_sea_has_no_stripes(void **)
{
	enum { PLACES = 4000 };
	glsl::set_scene_block(waves_of(8, 0, 0));
	for (double pixel = 5; pixel < 30; pixel *= 1.7) {
		double square = 0;
		for (int i = 0; i < PLACES; i++) {
			const double u = i * 0.7548776662, v = i * 0.5698402910;
			const vec2 place((float)(9000 * (u - std::floor(u))), (float)(9000 * (v - std::floor(v))));
			const vec2 slope = sea_slopes_at(place, vec2(0, 1), (float)pixel, (float)(1.5 * pixel)).resolved;
			square += (double)glm::dot(slope, slope) / PLACES;
		}
		const double share = square / (0.003 + 5.08e-3 * 8);
		print_message("pixel %4.1f m: resolved share of the slopes' variance %.4f\n", pixel, share);
		assert_true(share < 0.004);
	}
}

/* Across the glitter seen from 4 km the mean over gusts is Cox and Munk's, and it breaks up: at its flanks light changes from place to
 * place by more than in its middle. */
static void glitter_breaks_up_at_its_edges(void **)
{
	enum { PLACES = 20000 };
	glsl::set_scene_block(waves_of(8, 0, 0));
	const sea_slopes rough = sea_slopes_at(vec2(0.0f), vec2(0, 1), 1e7f, 1e7f);
	const vec3 to_viewer = direction(50, 0);
	double deviation[7];
	for (int k = 0; k < 7; k++) {
		const vec3 to_sun = direction(50, 180 - 10 * k);
		const double wanted = (double)sea_glint(rough, to_viewer, to_sun);
		double mean = 0, square = 0;
		for (int i = 0; i < PLACES; i++) {
			const double u = i * 0.7548776662, v = i * 0.5698402910;
			const vec2 place((float)(40000 * (u - std::floor(u))), (float)(40000 * (v - std::floor(v))));
			const double found = (double)sea_glint(sea_slopes_at(place, vec2(0, 1), 6.0f, 10.0f), to_viewer, to_sun);
			mean += found / PLACES;
			square += found * found / PLACES;
		}
		deviation[k] = std::sqrt(square - mean * mean) / mean;
		print_message("%2d degrees aside: %.5f, Cox and Munk %.5f, deviation %.3f\n", 10 * k, mean, wanted, deviation[k]);
		assert_float_equal(mean, wanted, 0.06 * wanted + 1e-4);
	}
	assert_true(deviation[0] < 0.2 && deviation[4] > 1.2 * deviation[0]);
}

/* --- the ground close by ---------------------------------------------------------------------------------------------------------- */

static void ground_noise_is_normalised(void **)
{
	enum { PLACES = 40000 };
	double mean = 0, square = 0, slopes[2] = {0, 0};
	for (int i = 0; i < PLACES; i++) {
		const double u = i * 0.7548776662, v = i * 0.5698402910;
		const vec2 place((float)(300 * (u - std::floor(u))), (float)(300 * (v - std::floor(v)))), size(1.3f, 0.7f);
		const vec3 n = ground_noise(ground_lattice_at(vec2(15000, 8000), place, size), 5u);
		mean += (double)n.z / PLACES;
		square += (double)n.z * (double)n.z / PLACES;
		slopes[0] += (double)n.x * (double)n.x / PLACES;
		slopes[1] += (double)n.y * (double)n.y / PLACES;
		/* Derivatives over the lattice, in the same units. */
		if (i % 100 == 0) {
			const float e = 1e-3f;
			const vec3 to = ground_noise(ground_lattice_at(vec2(15000, 8000), place + vec2(e * size.x, 0.0f), size), 5u);
			assert_float_equal((to.z - n.z) / e / 5.7f * 1.96f, n.x, 0.05 + 0.03 * std::fabs((double)n.x));
		}
	}
	assert_float_equal(mean, 0, 0.02);
	assert_float_equal(square, 1, 0.06);
	assert_float_equal(slopes[0], 1, 0.06);
	assert_float_equal(slopes[1], 1, 0.06);
}

static void set_ground(double contrast, double slope, double stretch, double sun_elevation)
{
	glsl::ground_patch = vec4(1024.0f, (float)contrast, (float)slope, (float)stretch);
	const vec3 sun = direction(90 - sun_elevation, 140);
	glsl::sun_direction = vec4(sun.x, sun.y, sun.z, 0.00465f);
	glsl::camera_position = vec4(3000.0f, 4000.0f, 2.0f, 1.5e-3f);
}

/* Of what the ground close by is multiplied with, over a ring of it. */
struct detail_figures {
	double beam, light, drier; /* means */
	double contrast;           /* deviation of `light` */
};

template <typename Point, typename Detail> static detail_figures figures_of(double distance, double sun_elevation, Detail detail)
{
	enum { PLACES = 20000 };
	detail_figures f = {};
	double square = 0;
	for (int i = 0; i < PLACES; i++) {
		const double u = i * 0.7548776662, v = i * 0.5698402910;
		const double azimuth = 2 * pi * (u - std::floor(u)), t = distance * (1 + 0.5 * (v - std::floor(v)));
		/* From many places, since patches are some metres wide. */
		glsl::camera_position.x = (float)(20000 * (i * 0.4142135624 - std::floor(i * 0.4142135624)));
		glsl::camera_position.y = (float)(20000 * (i * 0.7320508076 - std::floor(i * 0.7320508076)));
		Point p;
		p.offset = vec2((float)(t * std::sin(azimuth)), (float)(t * std::cos(azimuth)));
		p.across = (float)(1.5e-3 * t);
		p.mu_v = (float)(2 / std::hypot(t, 2.0));
		p.mu_sun = (float)std::sin(sun_elevation * pi / 180);
		const vec3 found = detail(p);
		f.beam += (double)found.x / PLACES;
		f.light += (double)found.y / PLACES;
		f.drier += (double)found.z / PLACES;
		square += (double)found.y * (double)found.y / PLACES;
	}
	f.contrast = std::sqrt(square - f.light * f.light);
	return f;
}

static detail_figures figures_of_bare(double distance, double sun_elevation)
{
	set_ground(0.16, 0.16, 1, sun_elevation);
	return figures_of<ground_point>(distance, sun_elevation, [](const ground_point &p) { return ground_detail(p); });
}

static detail_figures figures_of_grown(double distance, double sun_elevation)
{
	using glsl::grown::ground_point;
	set_ground(0.32, 0, 1, sun_elevation);
	return figures_of<ground_point>(distance, sun_elevation, [](const ground_point &p) { return glsl::grown::ground_detail(p); });
}

/* The published albedos stay what they are, wherever the ring lies and however low the sun. */
static void detail_changes_no_mean(void **)
{
	for (double distance = 3; distance < 5000; distance *= 6)
		for (double elevation = 3; elevation < 90; elevation *= 3) {
			const detail_figures bare = figures_of_bare(distance, elevation), grown = figures_of_grown(distance, elevation);
			print_message("%6.0f m, sun %2.0f degrees: bare %.3f, %.3f; grown %.3f, drier by %.3f\n", distance, elevation,
				      bare.beam, bare.light, grown.light, grown.drier);
			assert_float_equal(bare.beam, 1, 0.03);
			assert_float_equal(bare.light, 1, 0.03);
			assert_float_equal(grown.beam, 1, 1e-6);
			assert_float_equal(grown.light, 1, 0.03);
			assert_float_equal(grown.drier, 0, 0.02);
		}
}

/* Tufts are large against a pixel close by and small far away, where a pixel is the mean of many: what grows looks ever smoother. */
static void grass_is_smooth_far_away(void **)
{
	const double close = figures_of_grown(10, 40).contrast, middle = figures_of_grown(100, 40).contrast,
		     far = figures_of_grown(1000, 40).contrast;
	print_message("contrast of grass at 10, 100, 1000 m: %.3f, %.3f, %.3f\n", close, middle, far);
	assert_true(close > 0.15 && close < 0.5);
	assert_true(middle < 0.8 * close && far < 0.6 * middle);
}

/* --- regions ------------------------------------------------------------------------------------------------------------------ */

static void home_shows_the_picture_as_it_is(void **)
{
	for (int i = 0; i < 20000; i++) {
		const double u = i * 0.7548776662, v = i * 0.5698402910;
		const vec2 place((float)(u - std::floor(u)) - 0.25f, (float)(v - std::floor(v)) - 0.25f);
		assert_float_equal(glm::length(ground_region_at(place) - vec3(place, 0.0f)), 0, 1e-6);
	}
}

/* How alike the picture and the one a whole number of pictures away look, by the correlation of a pattern that repeats with the picture: 1
 * where it only repeats, as it did. The share of any part of the picture in what is seen stays what it is. */
static void picture_is_not_seen_to_repeat(void **)
{
	enum { SIDE = 160, PLACES = 12 * SIDE };
	static double pattern[PLACES][SIDE];
	double mean = 0, square = 0, tone = 0, tone_square = 0;
	for (int x = 0; x < PLACES; x++)
		for (int y = 0; y < SIDE; y++) {
			const vec3 at = ground_region_at(vec2(20.0f + (float)x / SIDE, 7.0f + (float)y / SIDE));
			pattern[x][y] = std::cos(2 * pi * (double)(3 * at.x + at.y)) + std::cos(2 * pi * (double)(2 * at.y - at.x));
			mean += pattern[x][y] / (PLACES * SIDE);
			square += pattern[x][y] * pattern[x][y] / (PLACES * SIDE);
			tone += (double)at.z / (PLACES * SIDE);
			tone_square += (double)at.z * (double)at.z / (PLACES * SIDE);
		}
	print_message("pattern: mean %.3f, variance %.3f; tone: mean %.3f, variance %.3f\n", mean, square, tone, tone_square);
	assert_float_equal(mean, 0, 0.1);
	assert_float_equal(square, 1, 0.1);
	assert_float_equal(tone, 0, 0.15);
	assert_float_equal(tone_square, 1, 0.3);
	double all = 0;
	for (int away = 1; away < 12; away++) {
		double sum = 0;
		for (int x = 0; x + away * SIDE < PLACES; x++)
			for (int y = 0; y < SIDE; y++)
				sum += pattern[x][y] * pattern[x + away * SIDE][y] / square / ((PLACES - away * SIDE) * SIDE);
		print_message("%2d pictures away: correlation %.3f\n", away, sum);
		assert_true(std::fabs(sum) < 0.5);
		all += std::fabs(sum) / 11;
	}
	assert_true(all < 0.2);
}

int main()
{
	const CMUnitTest tests[] = {
		cmocka_unit_test(normal_distribution_is_known),
		cmocka_unit_test(fresnel_is_known),
		cmocka_unit_test(glitter_holds_the_reflected_flux),
		cmocka_unit_test(glitter_peaks_where_facets_mirror),
		cmocka_unit_test(disc_has_equal_areas),
		cmocka_unit_test(sea_under_a_uniform_sky),
		cmocka_unit_test(waves_keep_the_variance),
		cmocka_unit_test(waves_run_as_on_deep_water),
		cmocka_unit_test(waves_are_as_high_as_the_wind_makes_them),
		cmocka_unit_test(glitter_is_the_same_from_any_distance),
		cmocka_unit_test(far_sea_has_no_stripes),
		cmocka_unit_test(glitter_breaks_up_at_its_edges),
		cmocka_unit_test(ground_noise_is_normalised),
		cmocka_unit_test(detail_changes_no_mean),
		cmocka_unit_test(grass_is_smooth_far_away),
		cmocka_unit_test(home_shows_the_picture_as_it_is),
		cmocka_unit_test(picture_is_not_seen_to_repeat),
	};
	return cmocka_run_group_tests(tests, nullptr, nullptr);
}
