/* The GLSL library compiled for the processor: noise by its statistics. */
#include "tests/unit/glsl_shim.h"

#include <complex>
#include <cstdarg>
#include <csetjmp>
#include <cstdint>
#include <set>
extern "C" {
#include <cmocka.h>
}

namespace glsl
{
namespace cloud
{
#include "shaders/lib/noise.glsl"
} // namespace cloud
} // namespace glsl

using namespace glsl::cloud;
using glsl::uint;
using glsl::vec2;
using glsl::vec4;

#define assert_near(a, b, tolerance)                                                                                                       \
	do {                                                                                                                               \
		const double a_ = (double)(a), b_ = (double)(b), t_ = (double)(tolerance);                                                 \
		if (!(std::fabs(a_ - b_) <= t_))                                                                                           \
			fail_msg("%s = %.9g, expected %.9g within %.3g", #a, a_, b_, t_);                                                  \
	} while (0)

static void hash_spreads(void **)
{
	/* Each bit of the result flips with half of the flips of each bit of the argument. */
	for (int bit = 0; bit < 32; bit++) {
		int flips[32] = {};
		for (uint x = 0; x < 4000; x++) {
			const uint difference = noise_hash(x * 2654435761u) ^ noise_hash((x * 2654435761u) ^ (1u << bit));
			for (int i = 0; i < 32; i++)
				flips[i] += difference >> i & 1;
		}
		for (int i = 0; i < 32; i++)
			assert_near(flips[i], 2000, 200);
	}
	double sum = 0;
	for (uint x = 0; x < 100000; x++) {
		const float unit = noise_unit(noise_hash(x));
		assert_true(unit >= 0 && unit < 1);
		sum += (double)unit;
	}
	assert_near(sum / 100000, 0.5, 0.004);
}

static void wrap_is_the_remainder(void **)
{
	for (int period : {1, 2, 3, 7, 48, 640, 81920})
		for (int i = -200000; i <= 200000; i += 7) {
			const int wanted = ((i % period) + period) % period;
			assert_int_equal(noise_wrap(i, period), wanted);
		}
}

static void lattices_repeat(void **)
{
	for (int i = 0; i < 300; i++) {
		const vec2 p(noise_unit(noise_hash((uint)i)) * 6, noise_unit(noise_hash((uint)i + 999u)) * 6);
		/* Whole periods are added, which floats hold to 1e-6 of a cell. */
		assert_near(noise_gradient(p, 6, 3u, 0.3f), noise_gradient(p + vec2(6, -12), 6, 3u, 0.3f), 1e-4);
		assert_near(noise_turbulence(p / 6.f, 6, 5, 3u, 0.3f), noise_turbulence(p / 6.f + vec2(-1, 2), 6, 5, 3u, 0.3f), 2e-3);
		const vec2 here = noise_centres(p, 6, 3u, 2.f, 0.4f, 0.8f), there = noise_centres(p + vec2(-6, 6), 6, 3u, 2.f, 0.4f, 0.8f);
		assert_near(here.x, there.x, 1e-4);
		assert_near(here.y, there.y, 1e-4);
	}
}

struct statistics {
	double mean, variance;
};

template <class Function> static statistics measure(Function function)
{
	const int side = 400;
	double sum = 0, squares = 0;
	for (int y = 0; y < side; y++)
		for (int x = 0; x < side; x++) {
			const double v = (double)function(vec2(((float)x + 0.5f) / side, ((float)y + 0.5f) / side));
			sum += v;
			squares += v * v;
		}
	const double n = side * side;
	return {sum / n, squares / n - sum * sum / (n * n)};
}

/* Of gradient noise: four corners, each with its weight squared times the mean square of its ramp, 3.9^2 * 4 A B with A and B the integrals
 * of (1 - w)^2 and of (1 - w)^2 x^2. That is 0.71, a standard deviation of 0.84. */
static double gradient_variance()
{
	double a = 0, b = 0;
	for (int i = 0; i < 1000; i++) {
		const double x = (i + 0.5) / 1000, rest = 1 - x * x * x * (x * (x * 6 - 15) + 10);
		a += rest * rest / 1000;
		b += rest * rest * x * x / 1000;
	}
	return 3.9 * 3.9 * 4 * a * b;
}

static void variance_is_near_one(void **)
{
	double gradient = 0, turbulence = 0;
	const double wanted = gradient_variance();
	for (uint seed = 1; seed <= 4; seed++) {
		const statistics g = measure([seed](vec2 p) { return noise_gradient(p * 97.f, 97, seed, 0.f); });
		const statistics t = measure([seed](vec2 p) { return noise_turbulence(p, 24, 6, seed, 0.f); });
		assert_near(g.mean, 0, 0.03);
		assert_near(t.mean, 0, 0.05);
		gradient += 0.25 * g.variance;
		turbulence += 0.25 * t.variance;
	}
	print_message("variance of gradient noise %.3f, of turbulence %.3f\n", gradient, turbulence);
	assert_near(gradient, wanted, 0.02);
	assert_near(turbulence, wanted, 0.04);
	assert_near(std::sqrt(turbulence), 1, 0.2);
}

/* Power along lines: octaves from period 4 to 128 cycles a line follow k^(-5/3). Slope by least squares over octave bands. */
static void turbulence_has_a_kolmogorov_spectrum(void **)
{
	const int samples = 512, lines = 48;
	std::vector<double> power(samples / 2, 0.);
	for (int line = 0; line < lines; line++) {
		std::vector<double> values;
		for (int i = 0; i < samples; i++)
			values.push_back(
				(double)noise_turbulence(vec2(((float)i + 0.5f) / samples, ((float)line + 0.3f) / lines), 4, 7, 9u, 0.f));
		for (int k = 1; k < samples / 2; k++) {
			std::complex<double> sum = 0;
			for (int i = 0; i < samples; i++)
				sum += values[(size_t)i] * std::polar((double)1, -2 * M_PI * (double)((long)k * i % samples) / samples);
			power[(size_t)k] += std::norm(sum);
		}
	}
	double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
	for (int low = 6; low < 96; low *= 2) {
		double band = 0;
		for (int k = low; k < 2 * low; k++)
			band += power[(size_t)k] / low;
		const double x = std::log((double)low), y = std::log(band);
		n++, sx += x, sy += y, sxx += x * x, sxy += x * y;
	}
	const double slope = (n * sxy - sx * sy) / (n * sxx - sx * sx);
	print_message("spectrum of turbulence along lines: k^%.2f\n", slope);
	assert_near(slope, -5. / 3, 0.25);
}

/* Centres: somewhere one is near, the second is never nearer than the first, and nothing jumps as lives begin and end. */
static void cells_live_without_jumps(void **)
{
	double nearest = 9, farthest = 0, jump = 0;
	for (int i = 0; i < 4000; i++) {
		const vec2 p(noise_unit(noise_hash((uint)i)) * 9, noise_unit(noise_hash((uint)i + 5555u)) * 9);
		vec2 before(0);
		for (int step = 0; step < 40; step++) {
			/* Across the end of a whole life, late enough that a single number would not do. */
			const bool next = step >= 20;
			const vec2 now =
				noise_centres(p, 9, 7u, next ? 400001.f : 400000.f, (float)step * 0.002f + (next ? -0.04f : 0.96f), 0.9f);
			assert_true(now.x >= 0 && now.y >= now.x);
			nearest = std::fmin(nearest, (double)now.x);
			farthest = std::fmax(farthest, (double)now.x);
			if (step > 0)
				jump = std::fmax(jump,
						 std::fmax(std::fabs((double)(now.x - before.x)), std::fabs((double)(now.y - before.y))));
			before = now;
		}
	}
	assert_true(nearest < 0.01 && farthest <= 1);
	/* A centre that weakens by 1 over a quarter of its life passes at most this much in a step. */
	assert_true(jump < 1.5 * 0.002 / 0.25 * 1.1);
}

/* A slanting lattice on a tile: every point has one stand-in, the same whole tiles away, and there are as many as the determinant says. */
static void slanting_lattices_repeat(void **)
{
	for (const vec4 &lattice : {vec4(7, 0, 0, 5), vec4(9, -4, 3, 11), vec4(60, -25, 31, 82)}) {
		const int cells = (int)(lattice.x * lattice.w - lattice.y * lattice.z);
		std::set<std::pair<int, int>> points;
		for (int y = -150; y < 150; y++)
			for (int x = -150; x < 150; x++) {
				const vec2 point((float)x, (float)y), stand_in = noise_lattice_wrap(point, lattice);
				const vec2 again =
					noise_lattice_wrap(point + vec2(2 * lattice.x - lattice.y, 2 * lattice.z - lattice.w), lattice);
				assert_true(again.x == stand_in.x && again.y == stand_in.y);
				points.insert({(int)stand_in.x, (int)stand_in.y});
			}
		assert_int_equal(points.size(), cells);
		for (int i = 0; i < 200; i++) {
			const vec2 p(noise_unit(noise_hash((uint)i)) * 9, noise_unit(noise_hash((uint)i + 999u)) * 9);
			assert_near(noise_tufts(p, lattice, 5u, 3.f, 0.2f, 0.7f, 0.3f),
				    noise_tufts(p + vec2(lattice.y, lattice.w), lattice, 5u, 3.f, 0.2f, 0.7f, 0.3f), 1e-4);
		}
	}
}

/* Tufts are lumps between 0 and little above 1, change from place to place without steps, and steadily over the ends of lives. */
static void tufts_live_without_jumps(void **)
{
	const vec4 lattice(9, -4, 3, 11);
	double least = 9, most = 0, jump = 0, step = 0, change = 0;
	for (int i = 0; i < 3000; i++) {
		const vec2 p(noise_unit(noise_hash((uint)i)) * 9, noise_unit(noise_hash((uint)i + 5555u)) * 9);
		const auto at = [lattice](vec2 place, double time) {
			return (double)noise_tufts(place, lattice, 7u, std::floor((float)time), (float)(time - std::floor(time)), 0.8f,
						   0.3f);
		};
		for (int k = 0; k < 20; k++)
			jump = std::fmax(jump, std::fabs(at(p, 400.9 + 0.01 * k) - at(p, 400.91 + 0.01 * k)));
		const double value = at(p, 400.9);
		step = std::fmax(step, std::fabs(at(p + vec2(0.004f, 0.003f), 400.9) - value));
		change += std::fabs(at(p, 402.9) - value) / 3000;
		least = std::fmin(least, value);
		most = std::fmax(most, value);
	}
	print_message("tufts from %.2f to %.2f\n", least, most);
	assert_true(least >= 0 && least < 0.4 && most > 0.8 && most < 1.3);
	assert_true(jump < 0.03);
	assert_true(step < 0.02);
	assert_true(change > 0.05);
}

/* Values at lattice points: mean 0, variance 1, whatever their age, and steady over the ends of lives. */
static void values_live_without_jumps(void **)
{
	const int count = 20000;
	for (float fraction : {0.f, 0.13f, 0.5f, 0.98f}) {
		double sum = 0, squares = 0, jump = 0;
		for (uint i = 0; i < (uint)count; i++) {
			const uint hash = noise_hash(i);
			const float value = noise_living(hash, 77.f, fraction);
			const float later =
				fraction < 0.97f ? noise_living(hash, 77.f, fraction + 0.01f) : noise_living(hash, 78.f, fraction - 0.99f);
			sum += (double)value;
			squares += (double)(value * value);
			jump = std::fmax(jump, std::fabs((double)(later - value)));
		}
		assert_near(sum / count, 0, 0.03);
		assert_near(squares / count, 1, 0.05);
		assert_true(jump < 0.12);
	}
	/* Another life, another value. */
	int same = 0;
	for (uint i = 0; i < 1000; i++)
		same += std::fabs((double)(noise_living(noise_hash(i), 5.f, 0.2f) - noise_living(noise_hash(i), 8.f, 0.2f))) < 0.02;
	assert_true(same < 60);
}

int main()
{
	const CMUnitTest tests[] = {
		cmocka_unit_test(hash_spreads),
		cmocka_unit_test(wrap_is_the_remainder),
		cmocka_unit_test(lattices_repeat),
		cmocka_unit_test(variance_is_near_one),
		cmocka_unit_test(turbulence_has_a_kolmogorov_spectrum),
		cmocka_unit_test(cells_live_without_jumps),
		cmocka_unit_test(slanting_lattices_repeat),
		cmocka_unit_test(tufts_live_without_jumps),
		cmocka_unit_test(values_live_without_jumps),
	};
	return cmocka_run_group_tests(tests, nullptr, nullptr);
}
