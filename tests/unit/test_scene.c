/* Camera axes, which pictures and file headers share. */
#include "renderer/scene.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

static void check(double azimuth, double elevation, double roll, const double right[3], const double up[3])
{
	const struct scene_camera camera = {.azimuth_deg = azimuth, .elevation_deg = elevation, .roll_deg = roll};
	double axes[3][3];
	scene_camera_axes(&camera, axes);
	for (int i = 0; i < 3; i++) {
		assert_float_equal(axes[0][i], right[i], 1e-9);
		assert_float_equal(axes[1][i], up[i], 1e-9);
	}
	/* Right-handed: right x up points backwards. */
	for (int i = 0; i < 3; i++) {
		const int j = (i + 1) % 3, k = (i + 2) % 3;
		assert_float_equal(axes[0][j] * axes[1][k] - axes[0][k] * axes[1][j], -axes[2][i], 1e-9);
	}
}

static void level_camera_looks_where_azimuth_says(void **state)
{
	(void)state;
	const double east[3] = {1, 0, 0}, south[3] = {0, -1, 0}, zenith[3] = {0, 0, 1}, nadir[3] = {0, 0, -1};
	check(0, 0, 0, east, zenith);
	check(90, 0, 0, south, zenith);
	/* A quarter turn of the picture clockwise: what was right is at the bottom, so the camera's right shows the zenith. */
	check(0, 0, 90, zenith, (const double[3]){-1, 0, 0});
	check(0, 0, -90, nadir, east);
}

static void poles_have_north_at_the_top(void **state)
{
	(void)state;
	const double east[3] = {1, 0, 0}, west[3] = {-1, 0, 0}, north[3] = {0, 1, 0};
	for (double azimuth = 0; azimuth <= 360; azimuth += 70) {
		check(azimuth, 90, 0, west, north);
		check(azimuth, -90, 0, east, north);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(level_camera_looks_where_azimuth_says),
		cmocka_unit_test(poles_have_north_at_the_top),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
