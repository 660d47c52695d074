/* The sides of clouds seen from below, compiled for the processor, against brute force: what a slanted view and the sun's beam meet of the
 * layer, and that light which is spread sideways is neither made nor lost. */
#include "tests/unit/glsl_shim.h"

#include <cmath>
#include <csetjmp>
#include <cstdarg>
#include <cstdint>
#include <cstdio>
#include <functional>
extern "C" {
#include <cmocka.h>
}

#define uniform static
namespace glsl
{
namespace columns_pass
{
#include "shaders/passes/side_columns.glsl"
} // namespace columns_pass
#include "tests/unit/glsl_again.h"
namespace spread_pass
{
#include "shaders/passes/side_spread.glsl"
#include "shaders/lib/side_low.glsl"
} // namespace spread_pass
} // namespace glsl

using glsl::ivec2;
using glsl::vec2;
using glsl::vec3;
using glsl::vec4;

static const double pi = 3.14159265358979, tile = 20000, deepest = 400, kappa = 0.02;
enum { SIDE = 256 };

/* Deterministic numbers within 0..1. */
static double random_unit()
{
	static uint32_t state = 12345;
	state = state * 1664525u + 1013904223u;
	return (double)(state >> 8) / 16777216.0;
}

/* --- layers ------------------------------------------------------------------------------------------------------------------------- */

static double even(double, double)
{
	return 0.6 * deepest;
}

/* Cells with gaps between them. */
static double cells(double x, double y)
{
	const double bumps =
		std::sin(2 * pi * 8 * x / tile) * std::sin(2 * pi * 7 * y / tile) + 0.25 * std::sin(2 * pi * (13 * x + 9 * y) / tile);
	return deepest * std::pow(std::fmin(1, std::fmax(0, bumps)), 0.75);
}

/* One wall, 2 km thick, from south to north. */
static double wall(double x, double)
{
	return std::fabs(x - 0.5 * tile) < 1000 ? 0.9 * deepest : 0;
}

/* --- the tables --------------------------------------------------------------------------------------------------------------------- */

static std::shared_ptr<glsl::image> picture(const std::function<vec4(int, int)> &texel)
{
	auto image = std::make_shared<glsl::image>();
	image->repeat_x = image->repeat_y = true;
	image->levels.push_back({SIDE, SIDE, {}});
	for (int y = 0; y < SIDE; y++)
		for (int x = 0; x < SIDE; x++)
			image->levels[0].texels.push_back(texel(x, y));
	for (int size = SIDE / 2; size >= 1; size /= 2) {
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

static glsl::sampler2D run_pass(void (*pass)(ivec2))
{
	return picture([&](int x, int y) {
		pass(ivec2(x, y));
		return glsl::stored[0];
	});
}

/* The packed form (shaders/lib/packed.glsl). */
static glsl::sampler2D packed(const glsl::image &of)
{
	auto image = std::make_shared<glsl::image>();
	image->nearest = true;
	image->levels.push_back({SIDE + SIDE / 2, SIDE, std::vector<vec4>((size_t)(SIDE + SIDE / 2) * SIDE, vec4(0))});
	for (size_t level = 0; level < of.levels.size(); level++) {
		const int size = SIDE >> level, left = level ? SIDE : 0, top = level ? SIDE - 2 * size : 0;
		const auto texel = [&](int x, int y) { return of.levels[level].texels[(size_t)(y % size * size + x % size)].x; };
		for (int y = 0; y < size; y++)
			for (int x = 0; x < size; x++)
				image->levels[0].texels[(size_t)((top + y) * (SIDE + SIDE / 2) + left + x)] =
					vec4(texel(x, y), texel(x + 1, y), texel(x, y + 1), texel(x + 1, y + 1));
	}
	return image;
}

static void make(const std::function<double(double, double)> &height, double elevation_deg, double azimuth_deg)
{
	const double e = elevation_deg * pi / 180, a = azimuth_deg * pi / 180;
	glsl::sun_direction = vec4(std::cos(e) * std::sin(a), std::cos(e) * std::cos(a), std::sin(e), 0.0047);
	glsl::cloud_layer = vec4(1000, deepest, tile, 1);
	glsl::cloud_drift = vec4(0);
	glsl::extinction_scaled = vec4((float)kappa);
	glsl::slab_light = vec4(1, 0, 0.6 * deepest, 0.15 * 2 * kappa);
	const auto heights =
		picture([&](int x, int y) { return vec4((float)height((x + 0.5) * tile / SIDE, (y + 0.5) * tile / SIDE), 0, 0, 1); });
	glsl::thickness_packed = packed(*heights);
	glsl::columns_pass::thickness = heights;
	glsl::arguments[0] = vec4(SIDE, 0, 0, 0);
	const glsl::sampler2D columns = run_pass(glsl::columns_pass::pass);
	glsl::spread_pass::columns = columns;
	glsl::arguments[0] = vec4(0.3 * 0.6 * deepest, 0.6 * deepest, 0.4, SIDE);
	glsl::side_light = run_pass(glsl::spread_pass::pass);
}

static vec4 light_at(int x, int y)
{
	return glsl::side_light->levels[0].texels[(size_t)y * SIDE + (size_t)x];
}

/* Cloud on a straight way up from the base, m of height. */
static double passed(const std::function<double(double, double)> &height, double x, double y, double east, double north)
{
	const double step = 1;
	double sum = 0;
	for (double z = 0.5 * step; z < deepest; z += step)
		sum += height(x + east * z, y + north * z) > z ? step : 0;
	return sum;
}

/* --- tests -------------------------------------------------------------------------------------------------------------------------- */

/* Nothing is changed where there are no sides. */
static void an_even_layer_is_a_slab(void **)
{
	for (double elevation : {80., 30., 6.}) {
		make(even, elevation, 50);
		for (double mu : {1., 0.5, 0.13}) {
			const double found = even(0, 0);
			const glsl::spread_pass::side_view view =
				glsl::spread_pass::side_view_at(vec2(1234, 9876), vec2(0.3f, -0.8f), (float)mu, vec2(0));
			const glsl::spread_pass::side_lit lit = glsl::spread_pass::side_lit_at(view, 1, (float)found, (float)found);
			assert_float_equal(view.entry, 0, 0.01);
			assert_float_equal(lit.thickness, found, 0.02);
			assert_float_equal(lit.sun, found, 0.02);
			assert_float_equal(lit.smooth_m, found, 0.02);
			assert_float_equal(lit.light, 1, 1e-3);
		}
	}
}

/* Nor to low views. */
static void an_even_layer_is_a_slab_to_low_views(void **)
{
	for (double elevation : {80., 30., 6.}) {
		make(even, elevation, 50);
		for (double mu : {0.33, 0.13, 0.03}) {
			const float found = (float)even(0, 0);
			const glsl::spread_pass::side_low view =
				glsl::spread_pass::side_low_at(vec2(1234, 9876), vec2(0.3f, -0.8f), (float)mu, 10);
			const glsl::spread_pass::side_lit lit = glsl::spread_pass::side_low_lit(view, 10, found);
			assert_float_equal(lit.thickness, found, 0.1);
			assert_float_equal(lit.sun, found, 0.1);
			assert_float_equal(lit.smooth_m, found, 0.1);
			assert_float_equal(lit.light, 1, 2e-3);
			assert_float_equal(lit.upright, 0, 1e-3);
		}
	}
}

/* Nor of layers whose slices are thinner than what edges are made soft over. */
static void a_thin_even_layer_is_a_slab(void **)
{
	for (double deep : {50., 100., 200.})
		for (double share : {0.01, 0.05, 0.2, 0.5, 1.}) {
			make([=](double, double) { return share * deep; }, 35, 50);
			glsl::cloud_layer.y = (float)deep;
			for (double mu : {0.99, 0.5, 0.13}) {
				const glsl::spread_pass::side_view view =
					glsl::spread_pass::side_view_at(vec2(1234, 9876), vec2(0.3f, -0.8f), (float)mu, vec2(0));
				assert_float_equal(view.thickness, share * deep, 0.01);
				assert_float_equal(view.entry, 0, 0.01);
			}
			for (double mu : {0.33, 0.13, 0.03}) {
				const glsl::spread_pass::side_low view =
					glsl::spread_pass::side_low_at(vec2(1234, 9876), vec2(0.3f, -0.8f), (float)mu, 10);
				assert_float_equal(view.thickness.x, share * deep, 0.05);
				assert_float_equal(view.thickness.y, share * deep, 0.05);
				assert_float_equal(view.height, 0, 0.01);
			}
		}
}

/* Evening out is a mean: the layer stays as thick as it is. */
static void spreading_keeps_the_mean(void **)
{
	make(cells, 35, 120);
	double before = 0, after = 0, contrast[2] = {0, 0};
	for (int y = 0; y < SIDE; y++)
		for (int x = 0; x < SIDE; x++) {
			const double h = cells((x + 0.5) * tile / SIDE, (y + 0.5) * tile / SIDE), smooth = light_at(x, y).x;
			before += h / (SIDE * SIDE);
			after += smooth / (SIDE * SIDE);
			contrast[0] += h * h / (SIDE * SIDE);
			contrast[1] += smooth * smooth / (SIDE * SIDE);
		}
	print_message("mean thickness %.2f m, evened out %.2f m; its variance %.0f and %.0f m2\n", before, after,
		      contrast[0] - before * before, contrast[1] - after * after);
	assert_true(std::fabs(after / before - 1) < 1e-3);
	assert_true(contrast[1] - after * after < 0.95 * (contrast[0] - before * before));
}

/* The beam's way to the base, and its mean: slanted columns share the layer out as upright ones do. */
static void beams_pass_what_brute_force_passes(void **)
{
	for (double elevation : {65., 35., 15.}) {
		const double azimuth = 120, slope = 1 / std::tan(elevation * pi / 180);
		make(cells, elevation, azimuth);
		double squares = 0, mean = 0, upright = 0;
		const int count = 2000;
		for (int i = 0; i < count; i++) {
			const int px = (int)(SIDE * random_unit()), py = (int)(SIDE * random_unit());
			const double truth = passed(cells, (px + 0.5) * tile / SIDE, (py + 0.5) * tile / SIDE,
						    slope * std::sin(azimuth * pi / 180), slope * std::cos(azimuth * pi / 180));
			squares += std::pow((double)light_at(px, py).w - truth, 2) / count;
		}
		for (int y = 0; y < SIDE; y++)
			for (int x = 0; x < SIDE; x++) {
				mean += (double)light_at(x, y).w / (SIDE * SIDE);
				upright += cells((x + 0.5) * tile / SIDE, (y + 0.5) * tile / SIDE) / (SIDE * SIDE);
			}
		print_message("sun at %.0f deg: thickness on the beam against brute force, rms %.1f m; mean %.2f m, upright %.2f m\n",
			      elevation, std::sqrt(squares), mean, upright);
		assert_true(std::sqrt(squares) < 0.06 * deepest);
		assert_true(std::fabs(mean / upright - 1) < 0.01);
	}
}

/* The same for views, which look at four heights alone. */
static void views_meet_what_brute_force_meets(void **)
{
	make(cells, 35, 120);
	for (double mu : {0.9, 0.6, 0.35}) {
		const double slope = std::sqrt(1 - mu * mu) / mu;
		double squares = 0, flat = 0, mean = 0, wanted = 0;
		const int count = 4000;
		for (int i = 0; i < count; i++) {
			const double x = tile * random_unit(), y = tile * random_unit(), a = 2 * pi * random_unit();
			const double truth = passed(cells, x, y, slope * std::sin(a), slope * std::cos(a));
			const glsl::spread_pass::side_view view = glsl::spread_pass::side_view_at(
				vec2((float)x, (float)y), vec2((float)std::sin(a), (float)std::cos(a)), (float)mu, vec2(0));
			const double found = view.thickness;
			squares += std::pow(found - truth, 2) / count;
			flat += std::pow(cells(x, y) - truth, 2) / count;
			mean += found / count;
			wanted += truth / count;
		}
		print_message(
			"cosine %.2f: thickness on the view, rms %.1f m, of the place at the base alone %.1f m; mean %.1f of %.1f m\n", mu,
			std::sqrt(squares), std::sqrt(flat), mean, wanted);
		assert_true(std::sqrt(squares) < 0.6 * std::sqrt(flat) + 8);
		assert_true(std::fabs(mean / wanted - 1) < 0.06);
	}
}

/* And low ones, at many: how much there is, and where what is seen begins. Cells are a kilometre wide, which a view of cosine 0.05 passes
 * several of. */
static void low_views_meet_what_brute_force_meets(void **)
{
	make(cells, 35, 120);
	for (double mu : {0.33, 0.2, 0.1, 0.05}) {
		const double slope = std::sqrt(1 - mu * mu) / mu;
		double squares = 0, flat = 0, mean = 0, wanted = 0, heights = 0, height = 0;
		int sides = 0;
		const int count = 4000;
		for (int i = 0; i < count; i++) {
			const double x = tile * random_unit(), y = tile * random_unit(), a = 2 * pi * random_unit();
			double truth = 0, seen = 0, sum = 0, begins = 0, last = -0.25;
			for (double z = 0.25; z < deepest; z += 0.5)
				if (cells(x + slope * std::sin(a) * z, y + slope * std::cos(a) * z) > z) {
					const double weight = std::exp(-kappa * truth / mu);
					begins = z - last > 0.75 ? z : begins;
					last = z;
					truth += 0.5;
					seen += weight;
					sum += weight * begins;
				}
			const glsl::spread_pass::side_low view = glsl::spread_pass::side_low_at(
				vec2((float)x, (float)y), vec2((float)std::sin(a), (float)std::cos(a)), (float)mu, 10);
			const double found = 0.5 * (view.thickness.x + view.thickness.y);
			squares += std::pow(found - truth, 2) / count;
			flat += std::pow(cells(x, y) - truth, 2) / count;
			mean += found / count;
			wanted += truth / count;
			if (truth > 20) {
				heights += std::pow(view.height - sum / seen, 2);
				height += sum / seen;
				sides++;
			}
		}
		print_message("cosine %.2f: thickness on the view, rms %.1f m, of the place at the base alone %.1f m; mean %.1f of %.1f m; "
			      "height seen, %.0f m at the mean, rms %.1f m\n",
			      mu, std::sqrt(squares), std::sqrt(flat), mean, wanted, height / sides, std::sqrt(heights / sides));
		assert_true(std::sqrt(squares) < 0.4 * std::sqrt(flat));
		assert_true(std::fabs(mean / wanted - 1) < 0.06);
		assert_true(std::sqrt(heights / sides) < 0.1 * deepest);
	}
}

/* A wall that stands before the sun lets light through; one that the sun stands before sends it back, the more the lower the sun is. */
static void low_views_see_a_lit_and_a_dark_wall(void **)
{
	for (double elevation : {50., 25.}) {
		float light[2];
		for (int behind = 0; behind < 2; behind++) {
			make(wall, elevation, behind ? 90 : 270);
			light[behind] = 0;
			/* Looking east, the view enters the western side half way up; its steps end elsewhere for each camera. */
			const int cameras = 10;
			for (int camera = 0; camera < cameras; camera++) {
				glsl::camera_position.x = (float)(0.5 * deepest * camera / cameras);
				const double mu = 0.2, slope = std::sqrt(1 - mu * mu) / mu, x = 0.5 * tile - 1000 - slope * 0.45 * deepest;
				const glsl::spread_pass::side_low view =
					glsl::spread_pass::side_low_at(vec2((float)x, 8000), vec2(1, 0), (float)mu, 10);
				const glsl::spread_pass::side_lit lit = glsl::spread_pass::side_low_lit(view, 10, 0.9f * (float)deepest);
				assert_float_equal(view.height, 0.45 * deepest, 0.12 * deepest);
				assert_true(lit.upright > 0.8f);
				light[behind] += lit.light * glsl::spread_pass::side_transmitted(lit.smooth_m) / cameras;
			}
		}
		glsl::camera_position.x = 0;
		print_message("sun at %.0f deg: light of the wall %.2f towards the sun, %.2f away from it\n", elevation, (double)light[0],
			      (double)light[1]);
		assert_true(light[0] > 1.5 * light[1]);
		assert_float_equal(light[1], glsl::spread_pass::side_transmitted(0.5f * (float)deepest), 0.25);
	}
}

/* Where views go over from columns to low ones: what one of them does not see lends no light to what the other sees. */
static void what_is_not_seen_lends_no_light(void **)
{
	glsl::spread_pass::side_lit none = {}, seen = {};
	none.light = 0.4f;
	seen.thickness = seen.inside = 80;
	seen.sun = 130;
	seen.smooth_m = 150;
	seen.light = 0.7f;
	seen.upright = 1;
	const glsl::spread_pass::side_lit mixed[2] = {glsl::spread_pass::side_mixed(none, seen, 0.1f),
						      glsl::spread_pass::side_mixed(seen, none, 0.9f)};
	for (const glsl::spread_pass::side_lit &lit : mixed) {
		assert_float_equal(lit.thickness, 8, 1e-4);
		assert_float_equal(lit.sun, seen.sun, 1e-3);
		assert_float_equal(lit.smooth_m, seen.smooth_m, 1e-3);
		assert_float_equal(lit.light, seen.light, 1e-5);
		assert_float_equal(lit.upright, 1, 1e-5);
	}
	none.thickness = 40;
	assert_float_equal(glsl::spread_pass::side_mixed(none, seen, 0.5f).sun, seen.sun * 80 / 120, 1e-3);
}

/* A pixel whose upper half passes over a bank and whose lower half meets it lets half of the light through. */
static void a_low_view_sees_both_sides_of_an_edge(void **)
{
	const double mu = 0.2, footprint = 40, quarter = 0.25 * footprint / std::sqrt(mu);
	const auto bank = [](double x, double) { return x > 4000 && x < 9000 ? 0.5 * deepest : 0.0; };
	make(bank, 40, 270);
	const auto passed = [&](double x, double size) {
		const glsl::spread_pass::side_low view =
			glsl::spread_pass::side_low_at(vec2((float)x, 5000), vec2(1, 0), (float)mu, (float)size);
		/* Without detail. */
		const float level = std::floor(std::fmax(std::log2((float)size * glsl::spread_pass::SIDE_SIZE / (float)tile), 0.0f) + 0.5f);
		const float there = glsl::spread_pass::packed_linear(glsl::thickness_packed, view.place / (float)tile,
								     (int)glsl::spread_pass::SIDE_SIZE, level);
		const glsl::spread_pass::side_lit lit = glsl::spread_pass::side_low_lit(view, (float)size, there);
		return std::exp(-(double)lit.thickness * (double)view.sharpness);
	};
	int half = 0;
	for (double x = 1500; x < 10500; x += 3) {
		const double whole = passed(x, footprint), parts = 0.5 * (passed(x - quarter, 0.1) + passed(x + quarter, 0.1));
		assert_float_equal(whole, parts, 0.06);
		half += whole > 0.4 && whole < 0.6;
	}
	/* Both edges are in so many pixels as they are long. */
	assert_true(half * 3 > 2 * quarter);
}

/* A layer of no thickness has light that is a number. */
static void a_layer_of_no_height_is_seen(void **)
{
	make([](double, double) { return 0.0; }, 40, 270);
	const float height = glsl::cloud_layer.y;
	glsl::cloud_layer.y = 0;
	const glsl::spread_pass::side_low view = glsl::spread_pass::side_low_at(vec2(4000, 5000), vec2(1, 0), 0.2f, 10);
	const glsl::spread_pass::side_lit lit = glsl::spread_pass::side_low_lit(view, 10, 0);
	glsl::cloud_layer.y = height;
	assert_true(std::isfinite(lit.thickness) && std::isfinite(lit.inside) && std::isfinite(lit.sun));
	assert_true(std::isfinite(lit.smooth_m) && std::isfinite(lit.light) && std::isfinite(lit.upright));
}

/* A bank before a wall that is in the sun: where the view leaves the one for the other, light goes over in steps smaller than the
 * difference, since a bank lets through the more the less of it is met. */
static void light_goes_over_from_a_base_to_the_side_behind(void **)
{
	const auto layer = [](double x, double) {
		return x > 4000 && x < 4600 ? 0.15 * deepest : x > 5600 && x < 9000 ? 0.9 * deepest : 0.0;
	};
	make(layer, 40, 270);
	double last = -1, least = 1e9, most = 0, largest = 0;
	for (double x = 4200; x < 5000; x += 0.5) {
		const glsl::spread_pass::side_low view = glsl::spread_pass::side_low_at(vec2((float)x, 5000), vec2(1, 0), 0.2f, 10);
		const auto lit_at = [&](const glsl::spread_pass::side_low &seen) {
			return glsl::spread_pass::side_low_lit(seen, 10, (float)layer((double)seen.place.x, 0));
		};
		glsl::spread_pass::side_lit lit = lit_at(view);
		if (view.other > glsl::spread_pass::SIDE_LOW_OTHER)
			lit = glsl::spread_pass::side_both(lit, lit_at(glsl::spread_pass::side_low_other(view)), vec2(view.other));
		const double light = (double)(lit.light * glsl::spread_pass::side_transmitted(lit.smooth_m));
		if (last >= 0)
			largest = std::fmax(largest, std::fabs(light - last));
		least = std::fmin(least, light);
		most = std::fmax(most, light);
		last = light;
	}
	print_message("from a base to a side light goes from %.2f to %.2f, by %.3f at most in half a metre\n", least, most, largest);
	assert_true(most - least > 0.05);
	assert_true(largest < 0.25 * (most - least));
}

/* A low bank with a wall behind it, the sun at the viewer's back: at no height of the view is it dark, though the mean of what is seen lies
 * in the gap. */
static void low_views_see_a_bank_before_a_wall(void **)
{
	const auto layer = [](double x, double) {
		return x > 4000 && x < 4600 ? 0.15 * deepest : x > 5600 && x < 9000 ? 0.9 * deepest : 0.0;
	};
	double least = 1e9;
	int seen = 0;
	make(layer, 40, 270);
	for (double x = 3000; x < 5600; x += 0.5) {
		const glsl::spread_pass::side_low view = glsl::spread_pass::side_low_at(vec2((float)x, 5000), vec2(1, 0), 0.2f, 10);
		const double there = layer((double)view.place.x, 0);
		const glsl::spread_pass::side_lit lit = glsl::spread_pass::side_low_lit(view, 10, (float)there);
		if (lit.thickness < 60)
			continue;
		seen++;
		least = std::fmin(least, (double)(lit.light * glsl::spread_pass::side_transmitted(lit.smooth_m)));
	}
	print_message("%d views of a bank before a wall: light of %.2f at least\n", seen, least);
	assert_true(seen > 500);
	assert_true(least > 0.35);
}

/* Of a wall the side towards the sun is bright, the one away from it dark, and a little within still more than far inside. */
static void a_wall_has_a_bright_side(void **)
{
	for (double azimuth : {90., 270.}) {
		make(wall, 30, azimuth);
		const int towards = azimuth == 90. ? 1 : -1;
		const auto at = [&](double from_middle) {
			return light_at(SIDE / 2 + (int)std::floor(towards * from_middle * SIDE / tile), 100);
		};
		print_message("sun in azimuth %.0f: light of the wall's base %.2f at the lit side, %.2f inside, %.2f at the other; of its "
			      "sides %.2f and %.2f\n",
			      azimuth, (double)at(850).y, (double)at(0).y, (double)at(-850).y, (double)at(950).z, (double)at(-950).z);
		assert_true(at(850).y > 1.2 * at(0).y);
		assert_true(at(-850).y < 1.1 * at(0).y);
		assert_true(at(950).z > 1.1 * at(-950).z);
		assert_float_equal(at(0).y, glsl::spread_pass::side_transmitted(0.9f * (float)deepest), 0.05);
	}
}

/* Detail neither ends the rim of a side with an edge nor leaves holes in its shade: it is in proportion to what is met there. */
static void rims_are_thin(void **)
{
	make(cells, 25, 120);
	for (double detail : {-60., 60.}) {
		double thickest = 0, least_sun = 1e9;
		int rims = 0;
		for (double x = 0; x < tile; x += 1) {
			const glsl::spread_pass::side_view view =
				glsl::spread_pass::side_view_at(vec2((float)x, 5200), vec2(1, 0), 0.45f, vec2(0));
			const double base = cells((double)view.place.x, (double)view.place.y);
			const float thickness = base > 0 ? (float)std::fmax(base + detail, 0) : 0;
			const glsl::spread_pass::side_lit lit = glsl::spread_pass::side_lit_at(view, 1, thickness, thickness);
			if (view.thickness < 5 && base > 60) {
				rims++;
				thickest = std::fmax(thickest, (double)lit.thickness);
			}
			if (thickness > 60)
				least_sun = std::fmin(least_sun, (double)lit.sun);
		}
		print_message("detail of %.0f m: %d rims of less than 5 m are %.2f m thick at most; the beam meets %.2f m at least where a "
			      "column has 60 m\n",
			      detail, rims, thickest, least_sun);
		assert_true(rims > 10);
		assert_true(thickest < 12);
		assert_true(least_sun > 0.5);
	}
}

int main()
{
	const CMUnitTest tests[] = {
		cmocka_unit_test(an_even_layer_is_a_slab),
		cmocka_unit_test(a_thin_even_layer_is_a_slab),
		cmocka_unit_test(an_even_layer_is_a_slab_to_low_views),
		cmocka_unit_test(spreading_keeps_the_mean),
		cmocka_unit_test(beams_pass_what_brute_force_passes),
		cmocka_unit_test(views_meet_what_brute_force_meets),
		cmocka_unit_test(rims_are_thin),
		cmocka_unit_test(a_wall_has_a_bright_side),
		cmocka_unit_test(low_views_meet_what_brute_force_meets),
		cmocka_unit_test(low_views_see_a_lit_and_a_dark_wall),
		cmocka_unit_test(what_is_not_seen_lends_no_light),
		cmocka_unit_test(a_low_view_sees_both_sides_of_an_edge),
		cmocka_unit_test(a_layer_of_no_height_is_seen),
		cmocka_unit_test(light_goes_over_from_a_base_to_the_side_behind),
		cmocka_unit_test(low_views_see_a_bank_before_a_wall),
	};
	return cmocka_run_group_tests(tests, nullptr, nullptr);
}
