/* The picture from below by tables (renderer/stages/view_up.h) against the same picture by the programs that make layers, which know no
 * tables of the layer's light: luminance within half a percent rms, and within 2 % at the 99.9th percentile. */
#include "tests/unit/test_renderer_common.h"

enum { WIDTH = 160, HEIGHT = 120, PIXELS = WIDTH * HEIGHT };

static int ascending(const void *a, const void *b)
{
	const double x = *(const double *)a, y = *(const double *)b;
	return (x > y) - (x < y);
}

/* Color as the only layer comes from tables, among others it does not. */
static void compare(struct scene *scene, const char *what)
{
	static double difference[PIXELS];
	const int width = scene->output.width, pixels = width * scene->output.height;
	double squares = 0, bias = 0;
	scene->output.layers = LAYER(COLOR);
	struct frame fast = render(scene);
	scene->output.layers = LAYER(COLOR) | LAYER(AIR);
	struct frame exact = render(scene);
	for (int i = 0; i < pixels; i++) {
		const double a = luminance_of(&fast, LAYER_COLOR, i % width, i / width);
		const double b = luminance_of(&exact, LAYER_COLOR, i % width, i / width);
		difference[i] = fabs(a - b) / fmax(b, 1e-9); /* beyond the circle of a fisheye both are black */
		squares += difference[i] * difference[i];
		bias += (a - b) / fmax(b, 1e-9);
	}
	qsort(difference, (size_t)pixels, sizeof *difference, ascending);
	const double rms = sqrt(squares / pixels), high = difference[(int)(0.999 * pixels)];
	print_message("%s: rms %.3f %%, 99.9th percentile %.2f %%, largest %.1f %%, mean %+.3f %%\n", what, 100 * rms, 100 * high,
		      100 * difference[pixels - 1], 100 * bias / pixels);
	assert_true(rms < 0.005 && high < 0.02);
	frame_finish(&fast);
	frame_finish(&exact);
}

static struct scene towards_sun(double elevation_deg)
{
	struct scene scene = small_scene(WIDTH, HEIGHT, 0);
	scene.sun.elevation_deg = elevation_deg;
	scene.sun.azimuth_deg = scene.camera.azimuth_deg + 10;
	scene.camera.elevation_deg = fmin(fmax(elevation_deg - 5, 20), 85);
	return scene;
}

static void suns(void **state)
{
	static const double elevations_deg[] = {5.5, 7, 10, 18, 35, 60, 88};
	(void)state;
	for (size_t i = 0; i < sizeof elevations_deg / sizeof *elevations_deg; i++) {
		char what[64];
		struct scene scene = towards_sun(elevations_deg[i]);
		snprintf(what, sizeof what, "sun at %g degrees", elevations_deg[i]);
		compare(&scene, what);
		scene.camera.azimuth_deg += 180;
		snprintf(what, sizeof what, "sun at %g degrees, behind", elevations_deg[i]);
		compare(&scene, what);
	}
}

static void droplets_and_cover(void **state)
{
	static const double radii_um[] = {3, 7, 20}, covers[] = {0.35, 0.8, 1};
	(void)state;
	for (int i = 0; i < 9; i++) {
		char what[64];
		struct scene scene = towards_sun(30);
		scene.dsd.effective_radius_um = radii_um[i % 3];
		scene.clouds.coverage = covers[i / 3];
		scene.clouds.type = i % 2 ? CLOUD_STRATUS : CLOUD_STRATOCUMULUS;
		snprintf(what, sizeof what, "%g um, cover %g", radii_um[i % 3], covers[i / 3]);
		compare(&scene, what);
	}
}

static void layers_and_places(void **state)
{
	(void)state;
	struct scene scene = towards_sun(40);
	scene.clouds.thickness_m = 60;
	compare(&scene, "thin");
	scene.clouds.thickness_m = 1500;
	compare(&scene, "thick");
	scene.clouds.base_m = 6000;
	scene.clouds.thickness_m = 200;
	scene.ground.type = GROUND_SNOW;
	compare(&scene, "high over snow");
	scene.camera.position_m[2] = 4000;
	compare(&scene, "from a mountain");
	scene.camera.elevation_deg = 90;
	compare(&scene, "zenith");
	scene.camera.roll_deg = 40;
	scene.camera.elevation_deg = 30;
	compare(&scene, "rolled");
	scene.camera.vertical_fov_deg = 4;
	compare(&scene, "telephoto");
}

static void projections(void **state)
{
	(void)state;
	struct scene scene = towards_sun(25);
	scene.camera.projection = PROJECTION_FISHEYE;
	scene.output.width = scene.output.height = HEIGHT;
	compare(&scene, "fisheye");
	scene.camera.projection = PROJECTION_EQUIRECTANGULAR;
	scene.output.width = WIDTH;
	scene.output.height = WIDTH / 2;
	compare(&scene, "equirectangular");
}

int main(void)
{
	const struct CMUnitTest tests[] = {cmocka_unit_test(suns), cmocka_unit_test(droplets_and_cover),
					   cmocka_unit_test(layers_and_places), cmocka_unit_test(projections)};
	return RUN_WITH_RENDERER(tests);
}
