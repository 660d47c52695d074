/* The GLSL library compiled for the processor: rays over the sphere, air, camera and sky tables, against independent values. */
extern "C" {
#include "renderer/camera.h"
#include "renderer/scene.h"
#include "renderer/stages/view.h"
}
#include "tests/unit/glsl_shim.h"

#include <cstdarg>
#include <csetjmp>
#include <cstdint>
extern "C" {
#include <cmocka.h>
}

namespace glsl
{
namespace air
{
#include "shaders/lib/camera.glsl"
#include "shaders/lib/scattering.glsl"
#include "shaders/lib/sky_table.glsl"
} // namespace air

/* The camera once for each projection. */
#include "tests/unit/glsl_again.h"
#undef VIEW_PROJECTION
#define VIEW_PROJECTION 1
namespace fisheye
{
#include "shaders/lib/camera.glsl"
} // namespace fisheye
#include "tests/unit/glsl_again.h"
#undef VIEW_PROJECTION
#define VIEW_PROJECTION 2
namespace equirectangular
{
#include "shaders/lib/camera.glsl"
} // namespace equirectangular
} // namespace glsl

using namespace glsl::air;
using glsl::ivec2;
using glsl::vec2;
using glsl::vec3;
using glsl::vec4;

using real = long double;
static const double earth = 6371000.;

#define assert_near(a, b, tolerance)                                                                                                       \
	do {                                                                                                                               \
		const double a_ = (double)(a), b_ = (double)(b), t_ = (double)(tolerance);                                                 \
		if (!(std::fabs(a_ - b_) <= t_))                                                                                           \
			fail_msg("%s = %.9g, expected %.9g within %.3g", #a, a_, b_, t_);                                                  \
	} while (0)

/* --- rays over the sphere -------------------------------------------------------------------------------------------------------- */

/* Height after distance t, in a precision where squaring radii does no harm. */
static double exact_height(double h, double mu, double t)
{
	const real r = (real)earth + h;
	return (double)(std::sqrt(r * r + 2 * r * mu * t + (real)t * t) - (real)earth);
}

static void spheres_are_met(void **)
{
	const float heights[] = {0.f, 2.f, 150.f, 1200.f, 9000.f, 29000.f}, targets[] = {0.f, 100.f, 1500.f, 12000.f, 99000.f};
	int met = 0;
	for (float h : heights)
		for (float target : targets)
			for (int i = -200; i <= 200; i++) {
				const float mu = (float)i / 200.f, up = sphere_distance_up(h, mu, target),
					    down = sphere_distance_down(h, mu, target);
				/* Centimetres of height; rays through the Earth are nobody's. */
				if (up >= 0 && target > h && mu >= sphere_horizon(h)) {
					assert_near(exact_height(h, mu, up), target, 0.02 + 1e-6 * target);
					met++;
				}
				if (down >= 0) {
					assert_true(target <= h && mu < 0);
					assert_near(exact_height(h, mu, down), target, 0.02 + 1e-6 * h);
					assert_near(sphere_height(h, mu, down), target, 0.02 + 1e-6 * h);
					met++;
				}
			}
	assert_true(met > 4000);
}

static void spheres_are_missed(void **)
{
	/* From 10 km the horizon lies at a dip of acos(R/(R+h)); a ray just above it misses the ground, one just below meets it. */
	for (double h : {2., 1000., 10000., 30000.}) {
		const double horizon = -std::sin(std::acos(earth / (earth + h)));
		assert_near(sphere_horizon((float)h), horizon, 3e-5 * -horizon);
		assert_true(sphere_distance_down((float)h, (float)(horizon * 0.999), 0.f) < 0);
		assert_true(sphere_distance_down((float)h, (float)(horizon * 1.001), 0.f) > 0);
	}
	assert_true(sphere_distance_up(5000.f, -0.5f, 1000.f) > 0);
	assert_true(sphere_distance_up(5000.f, 0.5f, 1000.f) < 0);
}

static void heights_and_verticals_along_a_ray(void **)
{
	for (double h : {0., 300., 12000.})
		for (double mu : {-0.01, 0., 0.02, 0.5, 1.})
			for (double t : {1., 1e3, 5e4, 8e5}) {
				const double height = exact_height(h, mu, t);
				assert_near(sphere_height((float)h, (float)mu, (float)t), height,
					    0.02 + 2e-6 * std::fabs(height) + 1e-7 * t);
				assert_near(sphere_cosine((float)h, (float)mu, (float)t, (float)height),
					    ((earth + h) * mu + t) / (earth + height), 2e-6);
			}
}

/* --- air --------------------------------------------------------------------------------------------------------------------------- */

/* Bodhaine et al. 1999 for the whole air at sea level, and nothing else in it. */
static const double rayleigh_thickness[3] = {0.04715, 0.09297, 0.2115};

/* The integral of the density over that at the ground: 9.2 km below 10 km, 6.5 km above. */
static const double rayleigh_column = 9200 * (1 - std::exp(-10 / 9.2)) + 6500 * std::exp(-10 / 9.2);

static void set_clean_air(double aerosol_depth)
{
	struct scene_block block = {};
	for (int band = 0; band < 3; band++) {
		block.rayleigh[band] = (float)(rayleigh_thickness[band] / rayleigh_column);
		block.aerosol[band] = (float)(aerosol_depth / 1200.);
		block.ozone[band] = 0;
		block.solar_irradiance[band] = 1;
	}
	block.rayleigh[3] = 9200;
	block.aerosol[3] = 1200;
	block.ozone[3] = 25000;
	block.sun_direction[3] = 0.00465f;
	glsl::set_scene_block(block);
}

static void air_straight_up(void **)
{
	set_clean_air(0);
	const vec4 depth = atmosphere_optical_thickness(0, 1, sphere_distance_up(0, 1, ATMOSPHERE_HEIGHT), 512);
	for (int band = 0; band < 3; band++)
		assert_near(depth[band], rayleigh_thickness[band], 3e-4 * rayleigh_thickness[band]);
	/* Aerosol: optical depth by definition; ozone: the integral of the tent is its half-width. */
	set_clean_air(0.3);
	const vec4 hazy = atmosphere_optical_thickness(0, 1, ATMOSPHERE_HEIGHT, 4000);
	assert_near(hazy.y - depth.y, 0.3, 1e-3);
	/* The way through aerosol in metres of its density at the ground: its scale height. */
	assert_near(hazy.w, 1200, 2);
	double tent = 0;
	for (int i = 0; i < 10000; i++)
		tent += 10. * (double)ozone_profile((float)(i * 10 + 5));
	assert_near(tent, 15000, 1);
}

/* Kasten and Young's relative air mass at zenith angles 60, 80, 85 deg; at the horizon it is 38 with refraction, which shortens the way
 * into thinner air, and Chapman's function of the lowest air's scale height, sqrt(pi R H / 2), without the bend at 10 km. */
static void rayleigh_follows_the_density_of_air(void **)
{
	/* US Standard Atmosphere 1976, kg/m3 at km. */
	const double heights[] = {0, 5, 10, 15, 20, 25, 30, 40, 50},
		     densities[] = {1.225, 0.7364, 0.4135, 0.1948, 0.08891, 0.04008, 0.01841, 0.003996, 0.001027};
	/* Its column is 10332 kg/m2. */
	set_clean_air(0);
	for (int i = 0; i < 9; i++) {
		const double share = (double)atmosphere_rayleigh((float)(1000 * heights[i])).y / rayleigh_thickness[1];
		assert_near(share * 10332 / densities[i], 1, 0.30);
	}
}

static void air_slantwise(void **)
{
	set_clean_air(0);
	const double angles[] = {60, 80, 85}, masses[] = {1.994, 5.60, 10.4};
	for (int i = 0; i < 3; i++) {
		const float mu = (float)std::cos(angles[i] * M_PI / 180);
		const vec4 depth = atmosphere_optical_thickness(0, mu, sphere_distance_up(0, mu, ATMOSPHERE_HEIGHT), 2000);
		assert_near((double)depth.y / rayleigh_thickness[1], masses[i], 0.03 * masses[i]);
	}
	const vec4 horizon = atmosphere_optical_thickness(0, 0, sphere_distance_up(0, 0, ATMOSPHERE_HEIGHT), 4000);
	assert_near((double)horizon.y / rayleigh_thickness[1], std::sqrt(M_PI * earth * 9200 / 2) / rayleigh_column, 1.5);
}

/* Way through air whose density falls off by one exponential, over its scale height: Chapman's function for large x = R/H (Green and Martin
 * 1966). */
static double chapman(double scale, double cosine)
{
	const double x = earth / scale, y = cosine * std::sqrt(x / 2);
	return std::sqrt(M_PI * x / 2) * std::exp(y * y) * std::erfc(y);
}

/* The sun near the horizon: its ways through air after Kasten and Young 1989, which are bent, at 1 degree by enough to be some percent
 * longer than straight ones; and through haze after Chapman. By them the red that its light is left with. */
static void low_suns_redden(void **)
{
	double before = 0;
	for (double elevation : {10., 5., 3., 1.}) {
		const double sine = std::sin(elevation * M_PI / 180);
		const double mass = 1 / (sine + 0.50572 * std::pow(elevation + 6.07995, -1.6364)), haze_mass = chapman(1200, sine);
		const float end = sphere_distance_up(0, (float)sine, ATMOSPHERE_HEIGHT);
		set_clean_air(0);
		const vec4 clean = atmosphere_optical_thickness(0, (float)sine, end, 4000);
		set_clean_air(0.1);
		const vec4 hazy = atmosphere_optical_thickness(0, (float)sine, end, 4000);
		const double bent = elevation < 2 ? 0.06 : 0.03;
		assert_near(clean.y / rayleigh_thickness[1] / mass, 1, bent);
		assert_near((hazy.y - clean.y) / 0.1 / haze_mass, 1, 0.01);
		/* Red over blue, as an optical thickness: bands differ by what Rayleigh's law says. */
		const double reddening = (double)(clean.z - clean.x);
		assert_near(reddening / (mass * (rayleigh_thickness[2] - rayleigh_thickness[0])), 1, bent);
		assert_true(reddening > before);
		before = reddening;
	}
	/* At 1 degree red passes 50 times better than blue. */
	assert_in_range((int)std::exp(before), 50, 90);
}

/* Integral over the sphere of a function of the scattering angle's cosine, and of that times the cosine. */
template <class Function> static void moments(Function function, double &norm, double &mean)
{
	const int steps = 20000;
	norm = mean = 0;
	for (int i = 0; i < steps; i++) {
		const double c = -1 + 2 * (i + 0.5) / steps, weight = 2 * M_PI * 2 / steps * (double)function((float)c);
		norm += weight;
		mean += weight * c;
	}
}

static void phase_functions_are_normalised(void **)
{
	double norm, mean;
	moments([](float c) { return phase_rayleigh(c); }, norm, mean);
	assert_near(norm, 1, 1e-5);
	assert_near(mean, 0, 1e-5);
	for (double g : {0., 0.3, 0.7, 0.9}) {
		moments([g](float c) { return phase_aerosol(c, (float)g); }, norm, mean);
		assert_near(norm, 1, 2e-4);
		/* Cornette and Shanks: g (3/5) (4 + g^2)/(2 + g^2). */
		assert_near(mean, 0.6 * g * (4 + g * g) / (2 + g * g), 3e-4);
	}
	assert_near((double)phase_rayleigh(1) / (double)phase_rayleigh(0), 2, 1e-6);
}

/* Legendre moments of the aerosol's phase function against integrals. */
static void aerosol_moments_are_integrals(void **)
{
	for (float g : {0.3f, 0.7f, 0.85f}) {
		const vec4 left = aerosol_smooth_moments(g);
		const double peak = 1 - (double)left.x;
		float power = 1;
		for (int l = 1; l < 12; l++) {
			power *= g;
			double sum = 0;
			const int steps = 20000;
			for (int i = 0; i < steps; i++) {
				const double c = -1 + 2 * (i + 0.5) / steps;
				double before = 1, legendre = c;
				for (int k = 2; k <= l; k++) {
					const double next = ((2 * k - 1) * c * legendre - (k - 1) * before) / k;
					before = legendre, legendre = next;
				}
				sum += 4 * M_PI / steps * legendre * (double)phase_aerosol((float)c, g);
			}
			assert_near(aerosol_moment((float)l, g, power), sum, 1e-3);
			if (l < 4)
				assert_near((double)left[l], sum - peak, 1e-3);
			if (l == 4)
				assert_near(peak, sum, 1e-3);
		}
	}
}

/* Delta-M scaling leaves 1 - f, the parts sum to the whole, and what the peak scatters twice and thrice is as much as once. */
static void aerosol_parts_keep_the_energy(void **)
{
	for (float g : {0.5f, 0.7f}) {
		const double peak = 1 - (double)aerosol_smooth_moments(g).x;
		const double wanted[] = {1 - peak, peak, peak, peak};
		for (int part = 0; part < 4; part++) {
			double norm, mean;
			moments([g, part](float c) { return phase_aerosol_parts(c, g)[part]; }, norm, mean);
			assert_near(norm, wanted[part], 1e-3);
		}
		for (float c = -1; c <= 1; c += 0.125f) {
			const vec4 parts = phase_aerosol_parts(c, g);
			assert_near(parts.x + parts.y, phase_aerosol(c, g), 1e-5);
		}
	}
}

/* Light of the peak scattered any number of times: whatever the depth, of a beam exp(-depth) goes on unscattered and the rest of it comes
 * out, in the smooth part or the peak's. */
static void forward_events_keep_the_energy(void **)
{
	const float g = 0.7f, left = aerosol_smooth_moments(g).x;
	for (float depth : {0.001f, 0.1f, 0.5f, 2.f, 8.f}) {
		double norm, mean;
		moments([&](float c) { return scattering_by_aerosol(phase_aerosol_parts(c, g), left, vec3(depth)).x; }, norm, mean);
		/* Of the mean event along the way; the smooth part is not attenuated by forward events. */
		const double wanted = (double)left + (1 - (double)left) * (1 - std::exp(-(double)depth)) / (double)depth;
		assert_near(norm, wanted, 0.004);
	}
}

/* The harmonics and their weights are those of the addition theorem: sums over them are the Legendre polynomials of the angle between. */
static void harmonics_obey_the_addition_theorem(void **)
{
	uint64_t state = 5;
	const auto chance = [&state] { return (float)((state = state * 6364136223846793005u + 1442695040888963407u) >> 40) / 16777216.f; };
	for (int i = 0; i < 1000; i++) {
		/* Mean over both sides of the plane of symmetry, as tables hold it. */
		const float up = 2 * chance() - 1, turn = 6.2831853f * chance(), other_up = 2 * chance() - 1,
			    other_turn = 6.2831853f * chance();
		const float flat = sqrt(1 - up * up), other_flat = sqrt(1 - other_up * other_up);
		const float ahead = flat * std::cos(turn), other_ahead = other_flat * std::cos(other_turn);
		const float y2 = 1 - up * up - ahead * ahead, other_y2 = 1 - other_up * other_up - other_ahead * other_ahead;
		double second = 0, third = 0;
		for (int side = 0; side < 2; side++) {
			const double c = (double)(up * other_up) +
					 (double)(flat * other_flat) * std::cos((double)turn - (side ? -1. : 1.) * (double)other_turn);
			second += 0.5 * (1.5 * c * c - 0.5);
			third += 0.5 * (2.5 * c * c - 1.5) * c;
		}
		const vec3 a = HARMONICS_SECOND * harmonics_second(up, ahead, y2) * harmonics_second(other_up, other_ahead, other_y2);
		const vec4 b = HARMONICS_THIRD * harmonics_third(up, ahead, y2) * harmonics_third(other_up, other_ahead, other_y2);
		assert_near(a.x + a.y + a.z, second, 1e-5);
		assert_near(b.x + b.y + b.z + b.w, third, 1e-5);
	}
}

static void transmittance_mapping_round_trip(void **)
{
	for (int row = 0; row < 64; row++)
		for (int column = 0; column < 256; column++) {
			const vec2 at = (vec2((float)column, (float)row) + 0.5f) / TRANSMITTANCE_SIZE;
			const vec2 p = transmittance_parameters(at), back = transmittance_coordinates(p.x, p.y);
			assert_true(p.x >= 0 && p.x <= ATMOSPHERE_HEIGHT * 1.00001f && std::fabs(p.y) <= 1);
			/* In texels; the topmost row is a single point. */
			if (row < 63)
				assert_near(back.x * 256, at.x * 256, 0.06);
			assert_near(back.y * 64, at.y * 64, 0.02);
		}
}

static void multiscatter_mapping_round_trip(void **)
{
	for (int row = 0; row < 16; row++)
		for (int column = 0; column < 40; column++) {
			const vec2 at = (vec2((float)column, (float)row) + 0.5f) / MULTISCATTER_SIZE;
			const vec2 p = multiscatter_parameters(at), back = multiscatter_coordinates(p.x, p.y);
			assert_near(back.x, at.x, 1e-4);
			assert_near(back.y, at.y, 1e-4);
		}
}

/* --- sky tables ---------------------------------------------------------------------------------------------------------------------- */

/* Texel -> direction -> coordinates: the same texel, for cameras and suns of any height. */
static void sky_mapping_round_trip(void **)
{
	for (float height : {2.f, 1500.f, 12000.f})
		for (double elevation : {-3., 5., 40., 80.}) {
			const double e = elevation * M_PI / 180, a = 2.1;
			glsl::camera_position = vec4(0, 0, height, 0);
			glsl::sun_direction = vec4(std::cos(e) * std::sin(a), std::cos(e) * std::cos(a), std::sin(e), 0.005f);
			for (int row = 0; row < 160; row++)
				for (int column = 0; column < 96; column++) {
					const vec2 p = sky_table_parameters(ivec2(column, row));
					const double flat = std::sqrt(std::fmax(0., 1. - (double)p.x * (double)p.x));
					if (flat < 1e-3 || row == 0 || row == 80)
						continue; /* straight up and down have no azimuth, the horizon has two rows */
					const double turn = a + std::acos(std::fmax(-1., std::fmin(1., (double)p.y)));
					const vec3 direction(flat * std::sin(turn), flat * std::cos(turn), p.x);
					const vec2 at = sky_table_coordinates(direction) * SKY_TABLE_SIZE - 0.5f;
					/* The columns next to the sun are closer than float cosines tell apart. */
					assert_near(at.x, column, column < 6 ? 3.5 : 0.25);
					assert_near(at.y, row, 0.05);
				}
		}
}

/* --- camera ----------------------------------------------------------------------------------------------------------------------------
 */

static void set_camera(double azimuth, double elevation, double roll, double fov)
{
	struct scene scene = scene_default();
	struct scene_block block = {};
	scene.camera.azimuth_deg = azimuth;
	scene.camera.elevation_deg = elevation;
	scene.camera.roll_deg = roll;
	scene.camera.vertical_fov_deg = fov;
	scene.output.width = 200;
	scene.output.height = 100;
	view_fill_block(&block, &scene);
	glsl::set_scene_block(block);
}

static vec3 direction_of(double azimuth, double elevation)
{
	const double a = azimuth * M_PI / 180, e = elevation * M_PI / 180;
	return vec3(std::cos(e) * std::sin(a), std::cos(e) * std::cos(a), std::sin(e));
}

static void assert_direction(vec3 a, vec3 b)
{
	assert_near(glm::length(a - b), 0, 2e-6);
}

static void camera_looks_where_it_should(void **)
{
	for (double azimuth : {0., 90., 200., 359.})
		for (double elevation : {-90., -30., 0., 45., 90.})
			for (double roll : {-180., -20., 0., 77.}) {
				set_camera(azimuth, elevation, roll, 60);
				assert_direction(camera_ray(vec2(100, 50)), direction_of(azimuth, elevation));
			}
	set_camera(90, 0, 0, 60);
	/* East: south to the right, up above; half the field of view to the upper and lower edges. */
	assert_direction(camera_ray(vec2(100, 0)), direction_of(90, 30));
	assert_direction(camera_ray(vec2(100, 100)), direction_of(90, -30));
	const double half = std::atan(2 * std::tan(M_PI / 6)) * 180 / M_PI;
	assert_direction(camera_ray(vec2(200, 50)), direction_of(90 + half, 0));
	assert_direction(camera_ray(vec2(0, 50)), direction_of(90 - half, 0));
}

/* A roll of +90 turns the picture clockwise: what was up is then at the right. */
static void roll_turns_the_picture_clockwise(void **)
{
	set_camera(0, 0, 90, 60);
	const vec3 right_edge = camera_ray(vec2(150, 50)), upper = camera_ray(vec2(100, 0));
	assert_true(right_edge.z > 0.4f);
	assert_near(right_edge.x, 0, 1e-6);
	/* and what was at the left, the west, is up. */
	assert_true(upper.x < -0.4f);
	assert_near(upper.z, 0, 1e-6);
}

/* At the poles the top of the picture is north, whatever the azimuth. */
static void up_at_the_poles(void **)
{
	for (double azimuth : {0., 70., 140., 360.}) {
		for (double pole : {-90., 90.}) {
			set_camera(azimuth, pole, 0, 60);
			const vec3 top = camera_ray(vec2(100, 0));
			assert_true(top.y > 0.4f);
			assert_near(top.x, 0, 1e-6);
		}
	}
}

/* No row of the sky's table is far from the next: finest at the horizon, and not only the sine even at the poles. */
static void sky_rows_are_dense(void **)
{
	for (double height : {2., 12000.}) {
		glsl::camera_position = vec4(0, 0, (float)height, 0);
		for (int half = 0; half < 2; half++) {
			double widest = 0, before = 0;
			for (int row = 0; row < 80; row++) {
				const double sine = (double)sky_table_parameters(ivec2(0, 80 * half + row)).x;
				const double elevation = std::asin(sine) * 180 / M_PI;
				if (row == 1)
					assert_true(std::fabs(elevation - before) < 0.02);
				if (row > 0)
					widest = std::fmax(widest, std::fabs(elevation - before));
				before = elevation;
			}
			assert_near(std::fabs(before), 90, 0.05);
			assert_true(widest < 2.5);
		}
	}
}

/* The shader's mappings are those of renderer/camera.c. */
static void projections_agree_with_the_processor(void **)
{
	static vec3 (*const rays[PROJECTION_COUNT])(vec2) = {glsl::air::camera_ray, glsl::fisheye::camera_ray,
							     glsl::equirectangular::camera_ray, glsl::air::camera_ray};
	static bool (*const shows[PROJECTION_COUNT])(vec2) = {glsl::air::camera_shows, glsl::fisheye::camera_shows,
							      glsl::equirectangular::camera_shows, glsl::air::camera_shows};
	for (int projection = 0; projection < PROJECTION_COUNT; projection++) {
		struct scene scene = scene_default();
		scene_block block = {};
		scene.camera.projection = (enum projection)projection;
		scene.camera.roll_deg = 20;
		scene.camera.face = FACE_NEG_Y;
		scene.output.width = projection == PROJECTION_EQUIRECTANGULAR ? 180 : 90;
		scene.output.height = 90;
		const camera_view view = camera_view_of(&scene, 0);
		view_fill_block(&block, &scene);
		glsl::set_scene_block(block);
		assert_near(block.camera_position[3], camera_pixel_angle(&view), 1e-9);
		for (int y = 0; y < view.height; y++)
			for (int x = 0; x < view.width; x++) {
				const double at[2] = {x + 0.5, y + 0.5};
				double wanted[3];
				const bool shown = camera_direction(&view, at, wanted);
				const vec3 found = rays[projection](vec2((float)at[0], (float)at[1]));
				assert_direction(found, vec3((float)wanted[0], (float)wanted[1], (float)wanted[2]));
				assert_int_equal(shows[projection](vec2((float)at[0], (float)at[1])), shown);
			}
	}
}

int main()
{
	const CMUnitTest tests[] = {
		cmocka_unit_test(spheres_are_met),
		cmocka_unit_test(spheres_are_missed),
		cmocka_unit_test(heights_and_verticals_along_a_ray),
		cmocka_unit_test(air_straight_up),
		cmocka_unit_test(rayleigh_follows_the_density_of_air),
		cmocka_unit_test(air_slantwise),
		cmocka_unit_test(low_suns_redden),
		cmocka_unit_test(phase_functions_are_normalised),
		cmocka_unit_test(aerosol_moments_are_integrals),
		cmocka_unit_test(aerosol_parts_keep_the_energy),
		cmocka_unit_test(forward_events_keep_the_energy),
		cmocka_unit_test(harmonics_obey_the_addition_theorem),
		cmocka_unit_test(transmittance_mapping_round_trip),
		cmocka_unit_test(multiscatter_mapping_round_trip),
		cmocka_unit_test(sky_mapping_round_trip),
		cmocka_unit_test(camera_looks_where_it_should),
		cmocka_unit_test(roll_turns_the_picture_clockwise),
		cmocka_unit_test(up_at_the_poles),
		cmocka_unit_test(projections_agree_with_the_processor),
		cmocka_unit_test(sky_rows_are_dense),
	};
	return cmocka_run_group_tests(tests, nullptr, nullptr);
}
