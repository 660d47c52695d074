/* Pictures against discrete ordinates (tests/data/sky.json, ground.json): the clear sky, and the base of a deck over white ground. */
#include "tests/unit/test_renderer_common.h"

#include "renderer/stages/colour.h"

#include <jansson.h>

static json_t *load(const char *path)
{
	json_error_t error;
	json_t *json = json_load_file(path, 0, &error);
	if (!json)
		fail_msg("%s: %s", path, error.text);
	return json;
}

static double number_at(const json_t *array, size_t i)
{
	return json_number_value(json_array_get(array, i));
}

/* Radiances in the bands out of colour: the inverse of the 3 x 3 matrix by Cramer's rule. */
static double determinant(const double m[3][3])
{
	return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
	       m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
}

static void bands_of(const double rgb[3], double bands[3])
{
	double matrix[3][3];
	colour_band_matrix(matrix);
	for (int band = 0; band < 3; band++) {
		double replaced[3][3];
		memcpy(replaced, matrix, sizeof replaced);
		for (int i = 0; i < 3; i++)
			replaced[i][band] = rgb[i];
		bands[band] = determinant(replaced) / determinant(matrix);
	}
}

/* --- clear sky ---------------------------------------------------------------------------------------------------------------------- */

static const char *const band_names[3] = {"650", "550", "450"};
static const char *const sun_zeniths[] = {"0.5", "30", "60", "75"};

static struct scene clear_scene(double sun_zenith)
{
	struct scene scene = small_scene(16, 16, LAYER(SKY) | LAYER(SUN_DIRECT));
	scene.clouds.type = CLOUD_NONE;
	scene.ground.type = GROUND_BLACK;
	scene.atmosphere = (struct scene_atmosphere){0, 0};
	scene.camera.position_m[2] = 0.1;
	scene.camera.vertical_fov_deg = 0.5;
	scene.sun.elevation_deg = 90 - sun_zenith;
	return scene;
}

/* Mean of a picture's layer in the bands. */
static void mean_bands(const struct frame *frame, enum layer layer, double bands[3])
{
	double rgb[3] = {0};
	const int count = frame->width * frame->height;
	for (int i = 0; i < count; i++)
		for (int channel = 0; channel < 3; channel++)
			rgb[channel] += pixel_of(frame, layer, i % frame->width, i / frame->width)[channel] / count;
	bands_of(rgb, bands);
}

static const json_t *table_of(const json_t *sky, int band, const char *sun_zenith)
{
	const json_t *table = json_object_get(json_object_get(sky, "rayleigh_only_black_ground"), band_names[band]);
	return json_object_get(json_object_get(table, "by_sun_zenith"), sun_zenith);
}

struct errors {
	double worst, squares;
	int count;
};

static void add_error(struct errors *errors, double relative)
{
	errors->worst = fmax(errors->worst, fabs(relative));
	errors->squares += relative * relative;
	errors->count++;
}

static void compare_sky(const json_t *sky, const char *sun_zenith, struct errors errors[3])
{
	const json_t *zeniths = json_object_get(sky, "view_zenith"), *azimuths = json_object_get(sky, "azimuth_from_sun");
	struct scene scene = clear_scene(atof(sun_zenith));
	for (size_t row = 0; row < json_array_size(zeniths) && number_at(zeniths, row) <= 75; row++)
		for (size_t column = 0; column < json_array_size(azimuths); column++) {
			double bands[3];
			scene.camera.elevation_deg = 90 - number_at(zeniths, row);
			scene.camera.azimuth_deg = scene.sun.azimuth_deg + number_at(azimuths, column);
			struct frame frame = render(&scene);
			mean_bands(&frame, LAYER_SKY, bands);
			frame_finish(&frame);
			for (int band = 0; band < 3; band++) {
				const json_t *radiance = json_object_get(table_of(sky, band, sun_zenith), "radiance");
				const double wanted = number_at(json_array_get(radiance, row), column) * colour_solar_irradiance[band];
				add_error(&errors[band], bands[band] / wanted - 1);
			}
		}
}

static void clear_sky_against_discrete_ordinates(void **state)
{
	(void)state;
	json_t *sky = load("tests/data/sky.json");
	for (size_t i = 0; i < 4; i++) {
		struct errors errors[3] = {{0}};
		compare_sky(sky, sun_zeniths[i], errors);
		for (int band = 0; band < 3; band++) {
			const double rms = sqrt(errors[band].squares / errors[band].count);
			print_message("sun zenith %s, %s nm: sky off by %.1f %% rms, %.1f %% at worst\n", sun_zeniths[i], band_names[band],
				      100 * rms, 100 * errors[band].worst);
			assert_int_equal(errors[band].count, 30);
			assert_true(errors[band].worst < 0.045);
		}
	}
	json_decref(sky);
}

/* The sun through the air: the disc's light over a picture, over what arrives above the air. */
static void direct_sun_against_discrete_ordinates(void **state)
{
	(void)state;
	json_t *sky = load("tests/data/sky.json");
	for (size_t i = 0; i < 4; i++) {
		struct scene scene = clear_scene(atof(sun_zeniths[i]));
		double bands[3];
		scene.output.width = scene.output.height = 256;
		scene.camera.vertical_fov_deg = 1;
		scene.camera.azimuth_deg = scene.sun.azimuth_deg;
		scene.camera.elevation_deg = scene.sun.elevation_deg;
		struct frame frame = render(&scene);
		mean_bands(&frame, LAYER_SUN_DIRECT, bands);
		frame_finish(&frame);
		const double solid_angle = 4 * tan(0.5 * DEGREE) * tan(0.5 * DEGREE);
		for (int band = 0; band < 3; band++) {
			const double found = bands[band] * solid_angle / colour_solar_irradiance[band];
			const double wanted =
				json_number_value(json_object_get(table_of(sky, band, sun_zeniths[i]), "direct_normal_transmittance"));
			print_message("sun zenith %s, %s nm: transmittance %.4f, discrete ordinates %.4f\n", sun_zeniths[i],
				      band_names[band], found, wanted);
			/* At 75 deg the Earth's curve takes 2 % of the air mass away. */
			assert_float_equal(found, wanted, 0.02 * wanted);
		}
	}
	json_decref(sky);
}

/* --- cloud over white ground -----------------------------------------------------------------------------------------------------------
 */

enum { DECK_SIDE = 128 };

static const enum layer base_layers[] = {LAYER_ORDER0, LAYER_ORDER1, LAYER_ORDER2, LAYER_MULTIPLE, LAYER_CLOUD_SKY, LAYER_CLOUD_GROUND};

static void add_base(const struct frame *frame, double *sum, int *count)
{
	for (int i = 0; i < DECK_SIDE * DECK_SIDE; i++) {
		if (fabs(pixel_of(frame, LAYER_OPTICAL_THICKNESS, i % DECK_SIDE, i / DECK_SIDE)[0] - 8) > 0.25)
			continue;
		for (int k = 0; k < 6; k++)
			*sum += luminance_of(frame, base_layers[k], i % DECK_SIDE, i / DECK_SIDE);
		++*count;
	}
}

/* Radiance of the base straight up where the deck's optical thickness is near 8, without what the air adds. */
static double base_radiance(double sun_zenith, double albedo)
{
	struct scene scene = small_scene(DECK_SIDE, DECK_SIDE, LAYER(OPTICAL_THICKNESS));
	for (int i = 0; i < 6; i++)
		scene.output.layers |= 1u << base_layers[i];
	scene.clouds.type = CLOUD_STRATUS;
	scene.clouds.coverage = 1;
	scene.clouds.thickness_m = 260;
	scene.clouds.base_m = 1000;
	scene.atmosphere = (struct scene_atmosphere){0, 0};
	scene.ground.type = GROUND_LAMBERT;
	for (int channel = 0; channel < 3; channel++)
		scene.ground.albedo[channel] = albedo;
	scene.sun.elevation_deg = 90 - sun_zenith;
	scene.camera.elevation_deg = 90;
	scene.camera.vertical_fov_deg = 40;
	double sum = 0;
	int count = 0;
	for (int place = 0; place < 16; place++) {
		scene.camera.position_m[0] = scene.clouds.tile_m * (place & 3) / 4;
		scene.camera.position_m[1] = scene.clouds.tile_m * (place >> 2) / 4;
		struct frame frame = render(&scene);
		add_base(&frame, &sum, &count);
		frame_finish(&frame);
	}
	assert_true(count > 100);
	return sum / count;
}

static double reference_radiance(const json_t *ground, double sun_zenith, double albedo)
{
	const json_t *rows = json_object_get(json_object_get(ground, "base_radiance_seen_from_below"), "rows");
	for (size_t i = 0; i < json_array_size(rows); i++) {
		const json_t *row = json_array_get(rows, i);
		if (number_at(row, 0) == 8 && number_at(row, 1) == sun_zenith && fabs(number_at(row, 2) - albedo) < 1e-6)
			return number_at(row, 3);
	}
	fail_msg("no row for sun zenith %g, albedo %g", sun_zenith, albedo);
	return 0;
}

static void white_ground_lights_the_base(void **state)
{
	(void)state;
	json_t *ground = load("tests/data/ground.json");
	for (double zenith = 30; zenith <= 60; zenith += 30) {
		const double found = base_radiance(zenith, 0.85) / base_radiance(zenith, 0.06);
		const double wanted = reference_radiance(ground, zenith, 0.85) / reference_radiance(ground, zenith, 0.06);
		print_message("base over ground of albedo 0.85 to 0.06, sun zenith %g: %.3f, discrete ordinates %.3f\n", zenith, found,
			      wanted);
		assert_float_equal(found / wanted, 1, 0.2);
	}
	json_decref(ground);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(clear_sky_against_discrete_ordinates),
		cmocka_unit_test(direct_sun_against_discrete_ordinates),
		cmocka_unit_test(white_ground_lights_the_base),
	};
	return RUN_WITH_RENDERER(tests);
}
