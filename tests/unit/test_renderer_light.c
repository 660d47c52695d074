/* Light where physics puts it: the sun, glory and fogbow at the angles of the phase function, pseudo-specular and forward glow. */
#include "tests/unit/test_renderer_common.h"

#include "renderer/optics/optics.h"
#include "renderer/stages/colour.h"

/* --- the sun ------------------------------------------------------------------------------------------------------------------------ */

/* Centre of light of a layer, in pixels. */
static void centre_of_light(const struct frame *frame, enum layer layer, double at[2])
{
	double sum = 0;
	at[0] = at[1] = 0;
	for (int y = 0; y < frame->height; y++)
		for (int x = 0; x < frame->width; x++) {
			const double light = luminance_of(frame, layer, x, y);
			sum += light;
			at[0] += light * (x + 0.5);
			at[1] += light * (y + 0.5);
		}
	assert_true(sum > 0);
	at[0] /= sum;
	at[1] /= sum;
}

static void sun_is_where_it_stands(void **state)
{
	(void)state;
	/* Sun, and how far from it the camera looks: azimuth, elevation, roll. */
	static const double cases[][5] = {{0, 20, 0, 0, 0},       {140, 35, 8, -5, 0},   {275, 5, -10, 6, 30},  {90, 60, 12, 4, -75},
					  {359.5, 12, 5, 3, 180}, {210, 80, 30, -2, 15}, {45, 1.5, -6, 5, -120}};
	for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
		struct scene scene = small_scene(160, 120, LAYER(SUN_DIRECT) | LAYER(COLOR));
		double direction[3], wanted[2], found[2];
		scene.clouds.type = CLOUD_NONE;
		scene.sun.azimuth_deg = cases[i][0];
		scene.sun.elevation_deg = cases[i][1];
		scene.camera.azimuth_deg = fmod(cases[i][0] + cases[i][2] + 360, 360);
		scene.camera.elevation_deg = cases[i][1] + cases[i][3];
		scene.camera.roll_deg = cases[i][4];
		scene.camera.vertical_fov_deg = 30;
		struct frame frame = render(&scene);
		direction_of(scene.sun.azimuth_deg, scene.sun.elevation_deg, direction);
		assert_true(project(&scene, direction, wanted));
		centre_of_light(&frame, LAYER_SUN_DIRECT, found);
		assert_float_equal(found[0], wanted[0], 0.5);
		assert_float_equal(found[1], wanted[1], 0.5);

		double brightest = 0;
		int at[2] = {0};
		for (int y = 0; y < frame.height; y++)
			for (int x = 0; x < frame.width; x++)
				if (luminance_of(&frame, LAYER_COLOR, x, y) > brightest) {
					brightest = luminance_of(&frame, LAYER_COLOR, x, y);
					at[0] = x, at[1] = y;
				}
		assert_true(hypot(at[0] + 0.5 - wanted[0], at[1] + 0.5 - wanted[1]) < 1.5);
		frame_finish(&frame);
	}
}

/* What the disc sends is the irradiance on a plane normal to the beam, whatever the picture's resolution. */
static void disc_holds_the_beam(void **state)
{
	(void)state;
	for (int size = 48; size <= 384; size *= 2) {
		struct scene scene = small_scene(size, size, LAYER(SUN_DIRECT));
		scene.clouds.type = CLOUD_NONE;
		scene.sun.elevation_deg = scene.camera.elevation_deg = 40;
		scene.camera.vertical_fov_deg = 12;
		struct frame frame = render(&scene);
		const double step = 2 * tan(6 * DEGREE) / size;
		double lux = 0;
		for (int y = 0; y < size; y++)
			for (int x = 0; x < size; x++) {
				const double u = step * (x + 0.5 - size / 2.0), v = step * (y + 0.5 - size / 2.0);
				lux += 1000 * luminance_of(&frame, LAYER_SUN_DIRECT, x, y) * step * step / pow(1 + u * u + v * v, 1.5);
			}
		const double wanted = frame.direct_illuminance_lux / sin(40 * DEGREE);
		print_message("disc over %d pixels a side: %.4f of the beam\n", size, lux / wanted);
		assert_float_equal(lux / wanted, 1, 0.002);
		frame_finish(&frame);
	}
}

static void sky_mirrors_about_the_sun(void **state)
{
	(void)state;
	for (double elevation = 3; elevation < 90; elevation += 28) {
		struct scene scene = small_scene(96, 64, LAYER(SKY));
		scene.clouds.type = CLOUD_NONE;
		scene.sun.elevation_deg = elevation;
		scene.sun.azimuth_deg = scene.camera.azimuth_deg = 213;
		scene.camera.elevation_deg = 35;
		struct frame frame = render(&scene);
		for (int y = 0; y < 64; y++)
			for (int x = 0; x < 48; x++) {
				const double left = luminance_of(&frame, LAYER_SKY, x, y),
					     right = luminance_of(&frame, LAYER_SKY, 95 - x, y);
				assert_float_equal(left, right, 1e-3 * right);
			}
		frame_finish(&frame);
	}
}

/* --- glory and fogbow ------------------------------------------------------------------------------------------------------------------
 */

/* Phase function as luminance sees it, in sunlight. */
static double visible_phase(const struct optics *optics, double angle)
{
	double light[3];
	for (int band = 0; band < 3; band++)
		light[band] = colour_solar_irradiance[band] * optics_phase(optics, band, angle);
	return colour_luminance(light);
}

enum { RING_BINS = 400 };

/* Mean of the single scattering over rings around the antisolar point, from above on a deck; freed of the slab's own factor mu_l/(mu_l +
 * mu_v). Bins of `width` degrees. */
static void antisolar_rings(double fov, double width, double rings[RING_BINS])
{
	struct scene scene = small_scene(400, 400, LAYER(ORDER1) | LAYER(OPTICAL_THICKNESS));
	scene.clouds.type = CLOUD_STRATUS;
	scene.clouds.coverage = 1;
	scene.clouds.thickness_m = 900;
	scene.sun.elevation_deg = 65;
	scene.sun.azimuth_deg = 30;
	scene.camera.azimuth_deg = 210;
	scene.camera.elevation_deg = -65;
	scene.camera.position_m[2] = 4000;
	scene.camera.vertical_fov_deg = fov;
	scene.atmosphere.aerosol_optical_depth = 0;
	struct frame frame = render(&scene);
	double antisolar[3], counts[RING_BINS] = {0};
	memset(rings, 0, RING_BINS * sizeof *rings);
	direction_of(210, -65, antisolar);
	for (int y = 0; y < 400; y++)
		for (int x = 0; x < 400; x++) {
			double ray[3];
			ray_of(&scene, x, y, ray);
			const int bin = (int)(acos(fmin(1, dot3(ray, antisolar))) / DEGREE / width);
			if (bin >= RING_BINS || ray[2] > -0.3 || pixel_of(&frame, LAYER_OPTICAL_THICKNESS, x, y)[0] < 3)
				continue;
			const double mu_l = sin(65 * DEGREE);
			rings[bin] += luminance_of(&frame, LAYER_ORDER1, x, y) * (mu_l - ray[2]) / mu_l;
			counts[bin]++;
		}
	for (int i = 0; i < RING_BINS; i++)
		rings[i] = counts[i] > 0 ? rings[i] / counts[i] : 0;
	frame_finish(&frame);
}

/* Angle from the antisolar point, in degrees within low..high, where a function of the bins is largest. */
static double angle_of_maximum(const double bins[RING_BINS], double width, double low, double high)
{
	int best = (int)(low / width);
	for (int i = best; i < (int)(high / width); i++)
		if (bins[i] > bins[best])
			best = i;
	return (best + 0.5) * width;
}

static void compare_rings(double fov, double width, double low, double high, double angle_error, double profile_error, const char *what)
{
	const struct scene scene = scene_default();
	struct optics *optics = optics_create(kernel, &scene.dsd, OPTICS_MIE);
	double rings[RING_BINS], phase[RING_BINS], mean_ratio = 0, worst = 0;
	assert_non_null(optics);
	antisolar_rings(fov, width, rings);
	for (int i = 0; i < RING_BINS; i++)
		phase[i] = visible_phase(optics, M_PI - (i + 0.5) * width * DEGREE);
	optics_destroy(optics);
	const int first = (int)(low / width), last = (int)(high / width);
	for (int i = first; i < last; i++)
		mean_ratio += rings[i] / phase[i] / (last - first);
	for (int i = first; i < last; i++)
		worst = fmax(worst, fabs(rings[i] / phase[i] / mean_ratio - 1));
	const double found = angle_of_maximum(rings, width, low, high), wanted = angle_of_maximum(phase, width, low, high);
	print_message("%s: brightest at %.2f deg from the antisolar point, phase function's maximum %.2f; profiles differ by %.1f %%\n",
		      what, found, wanted, 100 * worst);
	assert_true(wanted > low + width && wanted < high - width);
	assert_float_equal(found, wanted, angle_error);
	assert_true(worst < profile_error);
}

static void glory_rings_the_antisolar_point(void **state)
{
	(void)state;
	compare_rings(16, 0.1, 1.0, 5.5, 0.11, 0.02, "glory");
}

static void fogbow_stands_at_its_angle(void **state)
{
	(void)state;
	compare_rings(100, 0.5, 30, 46, 0.51, 0.04, "fogbow");
}

/* --- towards the sun and away from it
 * ----------------------------------------------------------------------------------------------------- */

static double mean_light(const struct scene *scene, uint32_t layers)
{
	double sum = 0;
	struct frame frame = render(scene);
	for (int layer = 0; layer < LAYER_COUNT; layer++)
		for (int i = 0; layers & 1u << layer && i < frame.width * frame.height; i++)
			sum += luminance_of(&frame, (enum layer)layer, i % frame.width, i / frame.width) / (frame.width * frame.height);
	frame_finish(&frame);
	return sum;
}

/* The paper's pseudo-specular effect: clouds seen from above are brighter towards a low sun. */
static void low_sun_shines_off_the_tops(void **state)
{
	(void)state;
	const uint32_t orders = LAYER(ORDER1) | LAYER(ORDER2);
	struct scene scene = small_scene(80, 40, orders);
	scene.sun.elevation_deg = 12;
	scene.camera.position_m[2] = 2500;
	scene.camera.elevation_deg = -14;
	scene.camera.vertical_fov_deg = 16;
	scene.camera.azimuth_deg = scene.sun.azimuth_deg;
	const double towards = mean_light(&scene, orders);
	scene.camera.azimuth_deg = scene.sun.azimuth_deg + 180;
	const double away = mean_light(&scene, orders);
	print_message("tops towards a sun at 12 deg over tops away from it, orders 1 and 2: %.2f\n", towards / away);
	assert_true(towards > 1.5 * away);
}

/* Straight down on a deck in a low sun: how the light that is scattered often goes along with slopes towards the east and the north, as
 * correlations. */
static void slopes_in_sun(double sun_azimuth, double correlation[2])
{
	enum { SIDE = 160 };
	const uint32_t layers = LAYER(MULTIPLE) | LAYER(OPTICAL_THICKNESS);
	struct scene scene = small_scene(SIDE, SIDE, layers);
	scene.clouds.coverage = 1;
	scene.sun.elevation_deg = 12;
	scene.sun.azimuth_deg = sun_azimuth;
	scene.camera.position_m[2] = 6000;
	scene.camera.azimuth_deg = 0;
	scene.camera.elevation_deg = -90;
	struct frame frame = render(&scene);
	for (int axis = 0; axis < 2; axis++) {
		double n = 0, light = 0, slope = 0, light2 = 0, slope2 = 0, both = 0;
		for (int y = 2; y < SIDE - 2; y++)
			for (int x = 2; x < SIDE - 2; x++) {
				/* East is to the right, north up. */
				const int dx = axis == 0 ? 2 : 0, dy = axis == 0 ? 0 : -2;
				const double a = luminance_of(&frame, LAYER_MULTIPLE, x, y);
				const double b = (double)pixel_of(&frame, LAYER_OPTICAL_THICKNESS, x - dx, y - dy)[0] -
						 (double)pixel_of(&frame, LAYER_OPTICAL_THICKNESS, x + dx, y + dy)[0];
				n++, light += a, slope += b, light2 += a * a, slope2 += b * b, both += a * b;
			}
		correlation[axis] = (both - light * slope / n) / sqrt((light2 - light * light / n) * (slope2 - slope * slope / n));
	}
	frame_finish(&frame);
}

static void slopes_towards_the_sun_are_brighter(void **state)
{
	(void)state;
	static const double suns[][3] = {{90, 1, 0}, {270, -1, 0}, {0, 0, 1}, {180, 0, -1}};
	for (size_t i = 0; i < sizeof suns / sizeof *suns; i++) {
		double found[2];
		slopes_in_sun(suns[i][0], found);
		print_message("sun in azimuth %.0f: light goes with slopes to the east by %.2f, to the north by %.2f\n", suns[i][0],
			      found[0], found[1]);
		for (int axis = 0; axis < 2; axis++) {
			if (suns[i][1 + axis] != 0)
				assert_true(found[axis] * suns[i][1 + axis] > 0.3);
			else
				assert_float_equal(found[axis], 0, 0.2);
		}
	}
}

/* Thin cloud close to the sun glows. */
static void thin_edges_glow_near_the_sun(void **state)
{
	(void)state;
	const uint32_t layers = LAYER(ORDER0) | LAYER(ORDER1) | LAYER(OPTICAL_THICKNESS);
	struct scene scene = small_scene(160, 120, layers);
	scene.clouds.coverage = 0.5;
	scene.sun.elevation_deg = scene.camera.elevation_deg = 40;
	scene.camera.vertical_fov_deg = 100;
	double sun[3], near[2] = {0}, far[2] = {0};
	struct frame frame = render(&scene);
	direction_of(scene.sun.azimuth_deg, 40, sun);
	for (int i = 0; i < 160 * 120; i++) {
		double ray[3];
		ray_of(&scene, i % 160, i / 160, ray);
		const double angle = acos(fmin(1, dot3(ray, sun))) / DEGREE,
			     tau = pixel_of(&frame, LAYER_OPTICAL_THICKNESS, i % 160, i / 160)[0];
		if (tau < 0.2 || tau > 2)
			continue;
		double *to = angle > 6 && angle < 14 ? near : angle > 40 ? far : NULL;
		if (to) {
			to[0] +=
				luminance_of(&frame, LAYER_ORDER0, i % 160, i / 160) + luminance_of(&frame, LAYER_ORDER1, i % 160, i / 160);
			to[1]++;
		}
	}
	frame_finish(&frame);
	assert_true(near[1] > 10 && far[1] > 10);
	print_message("thin edges 6 to 14 deg from the sun over those beyond 40 deg: %.1f\n", near[0] / near[1] / (far[0] / far[1]));
	assert_true(near[0] / near[1] > 5 * far[0] / far[1]);
}

/* --- the horizon --------------------------------------------------------------------------------------------------------------------- */

/* The ground's edge lies at a depression of acos(R / (R + h)): the row where the ground layer ends, to a pixel. */
static void horizon_lies_where_the_earth_curves(void **state)
{
	(void)state;
	for (int clouds = 0; clouds < 2; clouds++)
		for (int i = 0; i < 5; i++) {
			static const double heights[] = {2, 100, 1000, 5000, 12000};
			struct scene scene = small_scene(16, 240, LAYER(DISTANCE) | LAYER(SKY) | LAYER(GROUND) | LAYER(AIR));
			const double depression = acos(6371000. / (6371000 + heights[i])) / DEGREE;
			scene.clouds.type = clouds ? CLOUD_STRATOCUMULUS : CLOUD_NONE;
			scene.clouds.coverage = 0;
			scene.camera.position_m[2] = heights[i];
			scene.camera.elevation_deg = -depression;
			scene.camera.vertical_fov_deg = 4;
			scene.sun.azimuth_deg = 300;
			struct frame frame = render(&scene);
			int last_sky = -1;
			for (int y = 0; y < 240; y++) {
				/* Below the horizon the ray ends at a distance; above it nothing is met. */
				if (pixel_of(&frame, LAYER_DISTANCE, 8, y)[0] == 0)
					last_sky = y;
				else if (last_sky == y - 1)
					print_message(
						"clouds %d, %g m: horizon at row %.1f, expected 120; distance %.1f km, tangent %.1f\n",
						clouds, heights[i], y + 0.0, 1e-3 * (double)pixel_of(&frame, LAYER_DISTANCE, 8, y)[0],
						1e-3 * sqrt(heights[i] * (2 * 6371000. + heights[i])));
				for (int k = 0; k < 3; k++)
					assert_true(isfinite(pixel_of(&frame, LAYER_AIR, 8, y)[k]));
			}
			assert_true(abs(last_sky + 1 - 120) <= 1);
			frame_finish(&frame);
		}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(sun_is_where_it_stands),
		cmocka_unit_test(disc_holds_the_beam),
		cmocka_unit_test(sky_mirrors_about_the_sun),
		cmocka_unit_test(glory_rings_the_antisolar_point),
		cmocka_unit_test(fogbow_stands_at_its_angle),
		cmocka_unit_test(low_sun_shines_off_the_tops),
		cmocka_unit_test(thin_edges_glow_near_the_sun),
		cmocka_unit_test(slopes_towards_the_sun_are_brighter),
		cmocka_unit_test(horizon_lies_where_the_earth_curves),
	};
	return RUN_WITH_RENDERER(tests);
}
