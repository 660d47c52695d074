/* The radiosity's switch and its settings in whole pictures. */
#include "tests/unit/test_renderer_common.h"

static const enum layer untouched[] = {LAYER_SUN_DIRECT,        LAYER_ORDER0,    LAYER_ORDER1, LAYER_ORDER2,
				       LAYER_MULTIPLE,          LAYER_CLOUD_SKY, LAYER_SKY,    LAYER_TRANSMITTANCE,
				       LAYER_OPTICAL_THICKNESS, LAYER_DISTANCE};

static struct scene over_ice(double height)
{
	struct scene scene = small_scene(64, 48, LAYER(GROUND) | LAYER(CLOUD_GROUND) | LAYER(AIR));
	for (size_t i = 0; i < sizeof untouched / sizeof *untouched; i++)
		scene.output.layers |= 1u << untouched[i];
	scene.ground.type = GROUND_SEA_ICE;
	scene.clouds.coverage = 0.9;
	scene.camera.elevation_deg = height < scene.clouds.base_m ? 5 : -30;
	scene.camera.position_m[2] = height;
	return scene;
}

static double mean_luminance(const struct frame *frame, enum layer layer)
{
	double sum = 0;
	for (int i = 0; i < frame->width * frame->height; i++)
		sum += luminance_of(frame, layer, i % frame->width, i / frame->width) / (frame->width * frame->height);
	return sum;
}

/* Without it the base gets nothing of the ground's light and the ground nothing of what the base would return; all else is the same. */
static void switched_off_takes_the_exchange_alone(void **state)
{
	(void)state;
	for (double height = 2; height < 5000; height += 4000) {
		struct scene scene = over_ice(height);
		struct frame on = render(&scene);
		scene.radiosity.enabled = false;
		struct frame off = render(&scene);
		for (size_t i = 0; i < sizeof untouched / sizeof *untouched; i++)
			for (int k = 0; k < 64 * 48; k++)
				assert_memory_equal(pixel_of(&on, untouched[i], k % 64, k / 64),
						    pixel_of(&off, untouched[i], k % 64, k / 64), 3 * sizeof(float));
		print_message("from %4.0f m: base by the ground's light %.4f, without %.4f; ground %.4f, without %.4f\n", height,
			      mean_luminance(&on, LAYER_CLOUD_GROUND), mean_luminance(&off, LAYER_CLOUD_GROUND),
			      mean_luminance(&on, LAYER_GROUND), mean_luminance(&off, LAYER_GROUND));
		assert_true(mean_luminance(&on, LAYER_CLOUD_GROUND) > 0.1);
		assert_true(mean_luminance(&off, LAYER_CLOUD_GROUND) == 0);
		assert_true(mean_luminance(&on, LAYER_GROUND) > 1.1 * mean_luminance(&off, LAYER_GROUND));
		assert_true(off.radiosity_passes == 0 && off.radiosity_residual == 0);
		/* Still lit from above: by the beam, and by what the base sends by itself. */
		assert_true(off.direct_illuminance_lux == on.direct_illuminance_lux);
		assert_true(off.diffuse_illuminance_lux > 1000);
		frame_finish(&off);
		frame_finish(&on);
	}
}

static void no_passes_are_the_same_as_off(void **state)
{
	(void)state;
	struct scene scene = over_ice(2);
	scene.radiosity.max_passes = 0;
	struct frame none = render(&scene);
	scene.radiosity.enabled = false;
	struct frame off = render(&scene);
	assert_int_equal(none.bytes, off.bytes);
	assert_memory_equal(none.pixels, off.pixels, none.bytes);
	frame_finish(&off);
	frame_finish(&none);
}

static void passes_go_on_to_the_tolerance(void **state)
{
	(void)state;
	struct scene scene = over_ice(2);
	int before = 0;
	for (double tolerance = 0.1; tolerance > 5e-7; tolerance /= 10) {
		scene.radiosity.tolerance = tolerance;
		struct frame frame = render(&scene);
		assert_true(frame.radiosity_residual <= tolerance);
		assert_true(frame.radiosity_passes >= before);
		assert_true(frame.radiosity_residuals[frame.radiosity_passes - 1] == frame.radiosity_residual);
		if (frame.radiosity_passes > 1)
			assert_true(frame.radiosity_residuals[frame.radiosity_passes - 2] > tolerance);
		before = frame.radiosity_passes;
		frame_finish(&frame);
	}
	assert_in_range(before, 4, 12);
	scene.radiosity.max_passes = 2;
	struct frame frame = render(&scene);
	assert_int_equal(frame.radiosity_passes, 2);
	assert_true(frame.radiosity_residual > scene.radiosity.tolerance);
	frame_finish(&frame);
}

static void ground_colour(enum ground_type ground, double rgb[3])
{
	struct scene scene = over_ice(2);
	scene.ground.type = ground;
	scene.camera.elevation_deg = 40;
	struct frame frame = render(&scene);
	for (int i = 0; i < 64 * 48; i++)
		for (int channel = 0; channel < 3; channel++)
			rgb[channel] += (double)pixel_of(&frame, LAYER_CLOUD_GROUND, i % 64, i / 64)[channel];
	frame_finish(&frame);
}

/* The base takes on the colour of what lies below: over country warmer and greener than over snow, which is white. */
static void ground_colours_the_base(void **state)
{
	(void)state;
	double country[3] = {0}, snow[3] = {0};
	ground_colour(GROUND_COUNTRY, country);
	ground_colour(GROUND_SNOW, snow);
	print_message("the ground's light on the base, blue over green: country %.2f, snow %.2f\n", country[2] / country[1],
		      snow[2] / snow[1]);
	assert_true(country[2] / country[1] < 0.6 * snow[2] / snow[1]);
	assert_true(snow[1] > 3 * country[1]);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(switched_off_takes_the_exchange_alone),
		cmocka_unit_test(no_passes_are_the_same_as_off),
		cmocka_unit_test(passes_go_on_to_the_tolerance),
		cmocka_unit_test(ground_colours_the_base),
	};
	return RUN_WITH_RENDERER(tests);
}
