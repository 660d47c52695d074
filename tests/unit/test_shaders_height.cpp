/* The height field of views from above, compiled for the processor, against brute force: what a ray meets of it, the shadow that it throws
 * over itself, and where the sun's flux goes. */
#include "tests/unit/glsl_shim.h"

#include <cstdarg>
#include <csetjmp>
#include <cstdint>
#include <cstdio>
#include <functional>
extern "C" {
#include <cmocka.h>
}

#define HEIGHT_NEAR 0
namespace glsl
{
namespace levels
{
#include "shaders/passes/height_levels.glsl"
} // namespace levels
#include "tests/unit/glsl_again.h"
namespace shadow
{
#include "shaders/passes/height_shadow.glsl"
} // namespace shadow
#include "tests/unit/glsl_again.h"
namespace received
{
#include "shaders/passes/height_received.glsl"
} // namespace received
#include "tests/unit/glsl_again.h"
namespace soften
{
#include "shaders/passes/height_soften.glsl"
} // namespace soften
#include "tests/unit/glsl_again.h"
namespace march
{
#include "shaders/lib/height_march.glsl"
} // namespace march
} // namespace glsl

using glsl::ivec2;
using glsl::vec2;
using glsl::vec3;
using glsl::vec4;

static const double pi = 3.14159265358979, tile = 20000, thickness = 400, base = 1000, kappa = 0.02;
enum { SIDE = 1024, LIGHT_SIDE = 512 };

/* Deterministic numbers within 0..1. */
static double random_unit()
{
	static uint32_t state = 12345;
	state = state * 1664525u + 1013904223u;
	return (double)(state >> 8) / 16777216.0;
}

/* --- fields ------------------------------------------------------------------------------------------------------------------------- */

/* A closed deck of billows, a few hundred metres to a few kilometres wide. */
static double billows(double x, double y)
{
	static const int waves[][2] = {{3, 1}, {-2, 5}, {9, 4}, {7, -11}, {17, 6}, {-21, 13}, {31, -8}, {5, 37}};
	double sum = 0;
	for (int i = 0; i < 8; i++)
		sum += std::sin(2 * pi * (waves[i][0] * x + waves[i][1] * y) / tile + i) / (1.5 + 0.35 * i);
	return thickness * std::fmin(1, std::fmax(0, 0.62 + 0.12 * sum));
}

/* Cells with gaps between them. */
static double cells(double x, double y)
{
	const double bumps =
		std::sin(2 * pi * 8 * x / tile) * std::sin(2 * pi * 7 * y / tile) + 0.25 * std::sin(2 * pi * (23 * x + 19 * y) / tile);
	return thickness * std::pow(std::fmin(1, std::fmax(0, bumps)), 0.75);
}

/* One wall, 600 m thick, from south to north. */
static double wall(double x, double)
{
	return 0.25 * thickness + (std::fabs(x - 0.5 * tile) < 300 ? 0.7 * thickness : 0);
}

static glsl::sampler2D run_pass(void (*pass)(ivec2), int size, bool nearest = false, int output = 0)
{
	auto image = std::make_shared<glsl::image>();
	image->repeat_x = image->repeat_y = true;
	image->nearest = nearest;
	image->levels.push_back({size, size, {}});
	for (int y = 0; y < size; y++)
		for (int x = 0; x < size; x++) {
			pass(ivec2(x, y));
			image->levels[0].texels.push_back(glsl::stored[output]);
		}
	return image;
}

/* Box-filtered levels, as OpenGL makes them. */
static glsl::sampler2D with_levels(const glsl::sampler2D &of)
{
	auto image = std::make_shared<glsl::image>(*of);
	for (int size = of->levels[0].width / 2; size >= 1; size /= 2) {
		const std::vector<vec4> &below = image->levels.back().texels;
		std::vector<vec4> texels;
		for (int y = 0; y < size; y++)
			for (int x = 0; x < size; x++) {
				const size_t at = (size_t)(4 * y * size + 2 * x);
				texels.push_back(0.25f * (below[at] + below[at + 1] + below[at + 2 * (size_t)size] +
							  below[at + 2 * (size_t)size + 1]));
			}
		image->levels.push_back({size, size, texels});
	}
	return image;
}

/* The pyramid as renderer/stages/field.c makes it. */
static void make_field(const std::function<double(double, double)> &height)
{
	auto heights = std::make_shared<glsl::image>();
	heights->levels.push_back({SIDE, SIDE, {}});
	for (int y = 0; y < SIDE; y++)
		for (int x = 0; x < SIDE; x++)
			heights->levels[0].texels.push_back(vec4((float)height((x + 0.5) * tile / SIDE, (y + 0.5) * tile / SIDE), 0, 0, 1));
	glsl::cloud_layer = vec4(base, thickness, tile, 1);
	glsl::cloud_drift = vec4(0);
	glsl::cloud_puffs = vec4(0, 1000, SIDE, 0);
	glsl::extinction_scaled = vec4((float)kappa);
	auto field = std::make_shared<glsl::image>();
	field->repeat_x = field->repeat_y = true;
	glsl::height_below = heights;
	for (int level = 0; SIDE >> level >= 1; level++) {
		glsl::arguments[0] = vec4((float)(level == 0 ? SIDE : SIDE >> (level - 1)), level == 0, 0, 0);
		const glsl::sampler2D made = run_pass(glsl::levels::pass, SIDE >> level);
		field->levels.push_back(made->levels[0]);
		glsl::height_below = made;
	}
	glsl::height_table = field;
}

static void set_sun(double elevation_deg, double azimuth_deg)
{
	const double e = elevation_deg * pi / 180, a = azimuth_deg * pi / 180;
	glsl::sun_direction = vec4(std::cos(e) * std::sin(a), std::cos(e) * std::cos(a), std::sin(e), 0.00465);
}

static double top_at(double x, double y)
{
	return (double)glsl::march::height_at(vec2((float)x, (float)y), 1.0f);
}

/* --- rays ---------------------------------------------------------------------------------------------------------------------------- */

struct ray {
	vec3 direction;
	vec2 range;
};

static ray random_ray(double height)
{
	ray ray;
	do {
		const double down = -0.02 - 0.9 * random_unit() * random_unit(), azimuth = 2 * pi * random_unit(),
			     flat = std::sqrt(1 - down * down);
		ray.direction = vec3(flat * std::sin(azimuth), flat * std::cos(azimuth), down);
		glsl::camera_position = vec4(tile * random_unit(), tile * random_unit(), height, 1e-4);
		ray.range = glsl::march::height_range(ray.direction);
	} while (ray.range.x > ray.range.y);
	return ray;
}

/* Transmittance in steps of metres; where the first cloud begins (the end where there is none), and where what is seen of all stands in the
 * mean. */
struct truth {
	double clear, first, mean;
};

static truth brute_force(const ray &ray, double step)
{
	truth truth = {1, (double)ray.range.y, 0};
	for (double t = (double)ray.range.x; t < (double)ray.range.y; t += step) {
		const vec4 from = glsl::camera_position;
		const double z = (double)glsl::march::sphere_height(from.z, ray.direction.z, (float)t) - base;
		if (z >= top_at((double)from.x + t * (double)ray.direction.x, (double)from.y + t * (double)ray.direction.y))
			continue;
		if (truth.clear == 1)
			truth.first = t;
		const double seen = truth.clear * (1 - std::exp(-kappa * step));
		truth.mean += seen * t;
		truth.clear -= seen;
	}
	truth.mean /= std::fmax(1 - truth.clear, 1e-9);
	return truth;
}

static void rays_meet_what_brute_force_meets(void **)
{
	const std::function<double(double, double)> fields[] = {billows, cells};
	for (const auto &field : fields) {
		make_field(field);
		double squares = 0, worst = 0;
		int astray = 0;
		const int count = 300;
		for (int i = 0; i < count; i++) {
			const ray ray = random_ray(i % 2 ? 3000 : 1450);
			const truth truth = brute_force(ray, 1);
			vec2 range = ray.range;
			range.x = std::fmax(range.x, glsl::march::height_block_start(ray.direction, range, 6 * glsl::camera_position.w, 0));
			const glsl::march::height_path path = glsl::march::height_march(ray.direction, range, glsl::camera_position.w);
			const double error = std::fabs((double)path.clear - truth.clear);
			assert_true(path.clear >= 0 && path.clear <= 1 && std::fabs(path.clear + path.weight.x + path.weight.y - 1) < 1e-4);
			squares += error * error / count;
			worst = std::fmax(worst, error);
			if (truth.clear < 0.5) {
				const double mean = (double)glm::dot(path.weight, path.distance) / (1 - (double)path.clear);
				astray += std::fabs(mean - truth.mean) > 2 / kappa + 0.01 * mean;
			}
		}
		print_message("transmittance of rays against brute force: rms %.4f, worst %.3f; %d of %d seen a mean free path or a "
			      "percent off\n",
			      std::sqrt(squares), worst, astray, count);
		assert_true(std::sqrt(squares) < 0.01);
		/* Along the limb of the Earth a ray's steps run out. */
		assert_true(astray <= 0.02 * count);
	}
}

/* No ray of a block meets cloud before the block's start. */
static void blocks_start_before_all_their_rays(void **)
{
	make_field(cells);
	double gained = 0;
	for (int i = 0; i < 150; i++) {
		const ray middle = random_ray(i % 3 ? 2500 : 1500);
		const double radius = 0.01;
		const double start = (double)glsl::march::height_block_start(middle.direction, middle.range, (float)radius, 0);
		assert_true(std::isfinite(start));
		for (int k = 0; k < 8; k++) {
			const double angle = 2 * pi * k / 8;
			const vec3 side = glm::normalize(glm::cross(middle.direction, vec3(0, 0, 1))),
				   up = glm::cross(side, middle.direction);
			ray ray;
			ray.direction = glm::normalize(middle.direction + (float)(radius * std::cos(angle)) * side +
						       (float)(radius * std::sin(angle)) * up);
			ray.range = glsl::march::height_range(ray.direction);
			if (ray.range.x > ray.range.y)
				continue;
			const double first = brute_force(ray, 2).first;
			assert_true(start <= first + 2);
			gained += (std::fmax(start, (double)ray.range.x) - (double)ray.range.x) / (first - (double)ray.range.x + 1) /
				  (150 * 8);
		}
	}
	print_message("blocks of rays spare %.0f %% of the way\n", 100 * gained);
	assert_true(gained > 0.2);
}

/* Along the horizon and past it, from just above the top and from space. */
static void grazing_rays_are_finite(void **)
{
	make_field(cells);
	for (double height : {1400.5, 1410., 12000., 30000.})
		for (double offset : {-0.3, -0.01, -1e-3, -1e-5, 0., 1e-5, 1e-3, 0.1}) {
			glsl::camera_position = vec4(500, 700, height, 1e-3);
			const double down = std::fmax(-1, (double)glsl::march::sphere_horizon((float)height) + offset);
			const vec3 direction(std::sqrt(1 - down * down), 0, down);
			const vec2 range = glsl::march::height_range(direction);
			if (range.x > range.y)
				continue;
			const float start = glsl::march::height_block_start(direction, range, 0.006f, 0);
			const glsl::march::height_path path =
				glsl::march::height_march(direction, vec2(std::fmax(start, range.x), range.y), 1e-3f);
			assert_true(std::isfinite(path.clear) && std::isfinite(path.distance.x) && std::isfinite(path.distance.y));
			assert_true(path.weight.x + path.weight.y == 0 || path.distance.x + path.distance.y > 0);
		}
}

/* --- the sun on the field ------------------------------------------------------------------------------------------------------------ */

static const double smoothing = 200;

/* As renderer/stages/height_light.c runs the passes. */
static void light_field()
{
	const double rise = (double)glsl::shadow::height_sun_rise();
	double distance = 0.75 * tile / LIGHT_SIDE;
	for (bool first = true;; first = false) {
		glsl::arguments[0] = vec4(distance / tile, distance * rise, first, 0);
		glsl::shadow_below = run_pass(glsl::shadow::pass, LIGHT_SIDE);
		if (!first)
			distance *= 2;
		if (distance >= std::fmin(thickness / rise, tile))
			break;
	}
	glsl::shadow_table = glsl::shadow_below;
	glsl::received_table = with_levels(run_pass(glsl::received::pass, LIGHT_SIDE));
	glsl::arguments[0] = vec4(0.3 * smoothing, smoothing, 0.4, 0.2 * smoothing);
	glsl::height_light = run_pass(glsl::soften::pass, LIGHT_SIDE);
	glsl::height_near_light = run_pass(glsl::soften::pass, LIGHT_SIDE, false, 1);
}

static const vec4 &light_texel(int x, int y)
{
	return glsl::height_light->levels[0].texels[(size_t)y * LIGHT_SIDE + (size_t)x];
}

static void shadows_are_those_of_brute_force(void **)
{
	make_field(billows);
	for (double elevation : {35., 10., 4.}) {
		set_sun(elevation, 37);
		light_field();
		const double rise = std::tan(elevation * pi / 180), dx = std::sin(37 * pi / 180), dy = std::cos(37 * pi / 180);
		double squares = 0;
		const int count = 500;
		for (int i = 0; i < count; i++) {
			const int px = (int)(LIGHT_SIDE * random_unit()), py = (int)(LIGHT_SIDE * random_unit());
			const double x = (px + 0.5) * tile / LIGHT_SIDE, y = (py + 0.5) * tile / LIGHT_SIDE;
			double shadow = -1e9;
			for (double d = 0.75 * tile / LIGHT_SIDE; d < thickness / rise; d += 10)
				shadow = std::fmax(shadow, top_at(x + d * dx, y + d * dy) - d * rise);
			shadow = std::fmax(shadow, top_at(x, y));
			squares += std::pow((double)light_texel(px, py).z - shadow, 2) / count;
		}
		print_message("sun at %.0f deg: height of the shadow against brute force, rms %.1f m\n", elevation, std::sqrt(squares));
		assert_true(std::sqrt(squares) < 0.03 * thickness);
	}
}

/* The wall's shadow lies on the side away from the sun, as long as it is high over the tangent; the side towards the sun receives more. */
static void a_wall_throws_its_shadow(void **)
{
	make_field(wall);
	for (double azimuth : {90., 270.}) {
		set_sun(8, azimuth);
		light_field();
		const int away = azimuth == 90. ? -1 : 1, row = 100;
		const double texel = tile / LIGHT_SIDE, length = 0.7 * thickness / std::tan(8 * pi / 180);
		const auto column = [&](double from_middle) { return LIGHT_SIDE / 2 + (int)std::lround(away * from_middle / texel); };
		const auto sunlit = [&](double from_middle) {
			return (double)glsl::received::height_sunlit(0.25f * (float)thickness, light_texel(column(from_middle), row).z, 0);
		};
		assert_true(sunlit(300 + 0.85 * length) < 0.05 && sunlit(300 + 0.3 * length) < 0.05);
		assert_true(sunlit(300 + 1.2 * length) > 0.95 && sunlit(-300 - 0.3 * length) > 0.95);
		const double facing = (double)light_texel(column(-280), row).w,
			     behind = (double)light_texel(column(300 + 0.5 * length), row).w;
		print_message("sun in azimuth %.0f: wall's lit side receives %.2f, its shadow %.2f of a plane\n", azimuth, facing, behind);
		assert_true(facing > 2 && behind < 0.3);
	}
}

/* A closed deck receives what a plane does, however it is shaped; broken cloud no less than its columns alone. */
static void slopes_share_the_flux_out(void **)
{
	for (double elevation : {60., 30., 10., 4.}) {
		double mean[2], columns = 0;
		for (int i = 0; i < 2; i++) {
			make_field(i == 0 ? std::function<double(double, double)>(billows) : cells);
			set_sun(elevation, 200);
			light_field();
			double sum = 0, caught = 0, contrast = 0, near_sum = 0, near_contrast = 0;
			for (int y = 0; y < LIGHT_SIDE; y++)
				for (int x = 0; x < LIGHT_SIDE; x++) {
					const double share =
						(double)glsl::received_table->levels[0].texels[(size_t)y * LIGHT_SIDE + (size_t)x].y;
					const double received = (double)light_texel(x, y).w;
					assert_true(std::isfinite(received) && received >= 0);
					sum += share * received / (LIGHT_SIDE * LIGHT_SIDE);
					caught += share / (LIGHT_SIDE * LIGHT_SIDE);
					contrast += share * std::pow(received - 1, 2) / (LIGHT_SIDE * LIGHT_SIDE);
					const double near =
						(double)glsl::height_near_light->levels[0].texels[(size_t)y * LIGHT_SIDE + (size_t)x].x;
					assert_true(std::isfinite(near) && near >= 0);
					near_sum += share * near / (LIGHT_SIDE * LIGHT_SIDE);
					near_contrast += share * std::pow(near - 1, 2) / (LIGHT_SIDE * LIGHT_SIDE);
				}
			mean[i] = sum;
			columns = caught;
			print_message("sun at %2.0f deg, %s: flux caught %.4f, by columns alone %.4f; it varies by %.0f %%\n", elevation,
				      i == 0 ? "deck" : "cells", sum, caught, 100 * std::sqrt(contrast / caught));
			/* Light that keeps near is no more, but varies more. */
			assert_true(std::fabs(near_sum / sum - 1) < 0.03);
			assert_true(near_contrast > contrast);
			if (i == 0)
				assert_true(std::fabs(sum / caught - 1) < 0.03);
		}
		assert_true(mean[1] >= columns * 0.999 && mean[1] <= 1.01);
	}
}

/* Far from the camera lookups are shifted (field_warp.glsl): smoothly, nowhere folding back, and so that areas stay. Near it they are not,
 * nor without waves. */
static void warps_keep_areas(void **)
{
	double sum = 0, deepest = 1, steepest = 0, shift = 0;
	int count = 0;
	glsl::cloud_warp = vec4(0.3f, 0.8f, 0.1f, 1);
	for (double y = -12; y < 12; y += 0.05)
		for (double x = -12; x < 12; x += 0.05) {
			const double d = 0.01;
			const vec2 at = glsl::march::field_warp(vec2(x, y));
			const vec2 dx = glsl::march::field_warp(vec2(x + d, y)) - at, dy = glsl::march::field_warp(vec2(x, y + d)) - at;
			if (std::hypot(x, y) < 0.48)
				assert_true(at == vec2(0) && dx == vec2(0) && dy == vec2(0));
			const double a = (double)dx.x / d, b = (double)dy.x / d, e = (double)dx.y / d, f = (double)dy.y / d;
			const double area = (1 + a) * (1 + f) - b * e;
			sum += area;
			deepest = std::fmin(deepest, area);
			steepest = std::fmax(steepest, std::sqrt(a * a + b * b + e * e + f * f));
			shift = std::fmax(shift, (double)glm::length(at));
			count++;
		}
	print_message("areas %.4f in the mean, %.2f at least; slopes up to %.2f; shifts up to %.2f tiles\n", sum / count, deepest, steepest,
		      shift);
	assert_true(std::fabs(sum / count - 1) < 0.01);
	assert_true(deepest > 0.4 && steepest < 0.9 && shift > 0.15);
	glsl::cloud_warp.w = 0;
	assert_true(glsl::march::field_warp(vec2(3, 4)) == vec2(0));
}

int main()
{
	const CMUnitTest tests[] = {
		cmocka_unit_test(warps_keep_areas),
		cmocka_unit_test(rays_meet_what_brute_force_meets),
		cmocka_unit_test(blocks_start_before_all_their_rays),
		cmocka_unit_test(grazing_rays_are_finite),
		cmocka_unit_test(shadows_are_those_of_brute_force),
		cmocka_unit_test(a_wall_throws_its_shadow),
		cmocka_unit_test(slopes_share_the_flux_out),
	};
	return cmocka_run_group_tests(tests, nullptr, nullptr);
}
