/* Illuminance at the camera against pictures of the whole hemisphere above it, summed pixel by pixel. */
#include "tests/unit/test_renderer_common.h"

#include "renderer/stages/colour.h"

/* Pixels fine enough that what they average of the cloud edges does not matter: 0.14 degrees. */
enum { SIDE = 640 };

/* Horizontal illuminance by all that a square picture of 90 degrees shows above the horizontal, lux: radiance times cosine times the solid
 * angle of each pixel, step^2 / (1 + u^2 + v^2)^1.5. */
static double lux_of_side(struct scene scene, double azimuth_deg, double elevation_deg)
{
	scene.camera.azimuth_deg = azimuth_deg;
	scene.camera.elevation_deg = elevation_deg;
	struct frame frame = render(&scene);
	double lux = 0;
	for (int y = 0; y < SIDE; y++)
		for (int x = 0; x < SIDE; x++) {
			const double step = 2.0 / SIDE, u = step * (x + 0.5) - 1, v = 1 - step * (y + 0.5);
			double direction[3];
			ray_of(&scene, x, y, direction);
			const double light = luminance_of(&frame, LAYER_COLOR, x, y) - luminance_of(&frame, LAYER_SUN_DIRECT, x, y);
			lux += 1000 * light * fmax(direction[2], 0) * step * step / pow(1 + u * u + v * v, 1.5);
		}
	frame_finish(&frame);
	return lux;
}

static double lux_of_sky(const struct scene *scene)
{
	double lux = lux_of_side(*scene, 0, 90);
	for (int side = 0; side < 4; side++)
		lux += lux_of_side(*scene, 90 * side, 0);
	return lux;
}

static struct scene all_around(void)
{
	struct scene scene = small_scene(SIDE, SIDE, LAYER(COLOR) | LAYER(SUN_DIRECT));
	scene.camera.vertical_fov_deg = 90;
	return scene;
}

/* Beam and sky of clear air against the pixels, and the beam against the extraterrestrial sun through the air's known optical thickness. */
static void clear_skies_add_up(void **state)
{
	(void)state;
	static const double elevations[] = {3, 20, 55, 90};
	for (int i = 0; i < 4; i++) {
		struct scene scene = all_around();
		scene.clouds.type = CLOUD_NONE;
		scene.sun.elevation_deg = elevations[i];
		struct frame frame = render(&scene);
		const double ratio = frame.diffuse_illuminance_lux / lux_of_sky(&scene);
		print_message("sun at %2.0f: %.0f lux direct, %.0f diffuse, %.4f of the pixels'\n", elevations[i],
			      frame.direct_illuminance_lux, frame.diffuse_illuminance_lux, ratio);
		assert_float_equal(ratio, 1, 0.01);
		assert_float_equal(frame.global_illuminance_lux, frame.direct_illuminance_lux + frame.diffuse_illuminance_lux, 1e-6);
		if (elevations[i] == 90) {
			/* Rayleigh (Bodhaine et al. 1999) and aerosol of 0.1 at 550 nm; ozone takes some percent more. */
			static const double rayleigh[3] = {0.0471, 0.0930, 0.2115}, nm[3] = {650, 550, 450};
			double bands[3];
			for (int band = 0; band < 3; band++)
				bands[band] = colour_solar_irradiance[band] * exp(-rayleigh[band] - 0.1 * pow(nm[band] / 550, -0.8));
			assert_in_range(1000 * frame.direct_illuminance_lux / colour_luminance(bands), 940, 1000);
		}
		frame_finish(&frame);
	}
}

static void broken_skies_add_up(void **state)
{
	(void)state;
	static const double elevations[] = {8, 35, 60};
	for (int i = 0; i < 6; i++) {
		struct scene scene = all_around();
		scene.sun.elevation_deg = elevations[i % 3];
		scene.clouds.coverage = i < 3 ? 0.5 : 0.85;
		scene.clouds.seed = (uint32_t)(3 + i);
		scene.camera.position_m[0] = 3000 * i;
		struct frame frame = render(&scene);
		const double ratio = frame.diffuse_illuminance_lux / lux_of_sky(&scene);
		print_message("sun at %2.0f, cover %.2f: %.0f lux direct, %.0f diffuse, %.4f of the pixels'\n", scene.sun.elevation_deg,
			      scene.clouds.coverage, frame.direct_illuminance_lux, frame.diffuse_illuminance_lux, ratio);
		assert_float_equal(ratio, 1, 0.01);
		frame_finish(&frame);
	}
}

/* The camera's own place counts: under a cloud there is no beam, in a gap all of it. The disc in the picture is dimmed alike. */
static void the_beam_is_that_of_the_place(void **state)
{
	(void)state;
	int in_sun = 0, in_shade = 0;
	for (int i = 0; i < 12; i++) {
		struct scene scene = small_scene(64, 64, LAYER(SUN_DIRECT) | LAYER(OPTICAL_THICKNESS));
		scene.clouds.coverage = 0.5;
		scene.sun.elevation_deg = scene.camera.elevation_deg = 45;
		scene.camera.azimuth_deg = scene.sun.azimuth_deg;
		scene.camera.position_m[0] = 1700 * i;
		scene.camera.vertical_fov_deg = 2;
		struct frame frame = render(&scene);
		double lux = 0;
		const double step = 2 * tan(DEGREE) / 64;
		for (int y = 0; y < 64; y++)
			for (int x = 0; x < 64; x++)
				lux += 1000 * luminance_of(&frame, LAYER_SUN_DIRECT, x, y) * step * step * sin(45 * DEGREE);
		print_message("at %5.0f m: %.0f lux by the beam, %.0f in the picture\n", scene.camera.position_m[0],
			      frame.direct_illuminance_lux, lux);
		assert_float_equal(lux, frame.direct_illuminance_lux, 0.06 * frame.direct_illuminance_lux + 50);
		in_sun += frame.direct_illuminance_lux > 50000;
		in_shade += frame.direct_illuminance_lux < 500;
		frame_finish(&frame);
	}
	assert_true(in_sun > 0 && in_shade > 0);
}

/* The same figures for every direction, size and layer of a picture from one place, and a clear sky's above the clouds. */
static void the_picture_does_not_matter(void **state)
{
	(void)state;
	struct scene scene = small_scene(32, 32, LAYER(COLOR));
	struct frame first = render(&scene);
	scene.camera.azimuth_deg = 300;
	scene.camera.elevation_deg = -30;
	scene.output.width = 80;
	scene.output.layers = LAYER(SKY);
	struct frame second = render(&scene);
	assert_true(first.global_illuminance_lux == second.global_illuminance_lux);
	frame_finish(&second);
	frame_finish(&first);

	scene.camera.position_m[2] = 5000;
	first = render(&scene);
	scene.clouds.coverage = 1;
	second = render(&scene);
	/* More cloud below makes the air above a little brighter, the beam stays. */
	assert_float_equal(first.direct_illuminance_lux, second.direct_illuminance_lux, 1);
	assert_in_range(1000 * second.diffuse_illuminance_lux / first.diffuse_illuminance_lux, 1000, 1200);
	frame_finish(&second);
	frame_finish(&first);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(clear_skies_add_up),
		cmocka_unit_test(broken_skies_add_up),
		cmocka_unit_test(the_beam_is_that_of_the_place),
		cmocka_unit_test(the_picture_does_not_matter),
	};
	return RUN_WITH_RENDERER(tests);
}
