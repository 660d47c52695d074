/* The ground in pictures: published albedos, shadows where the parallax says, a sea that mirrors. Skipped where no OpenGL context comes up.
 */
#include "renderer/camera.h"
#include "renderer/gl/context.h"
#include "renderer/stages/ground.h"
#include "renderer/stages/sea.h"
#include "tests/unit/test_renderer_common.h"

#include <epoxy/gl.h>

/* --- albedos --------------------------------------------------------------------------------------------------------------------- */

/* Ranges that the sources in shaders/lib/ground_paint.glsl span, at 650, 550 and 450 nm. */
static const struct {
	enum ground_type type;
	double low[3], high[3];
} published[] = {
	{GROUND_GRASS, {0.04, 0.08, 0.03}, {0.13, 0.14, 0.07}},  {GROUND_COUNTRY, {0.04, 0.06, 0.03}, {0.20, 0.20, 0.10}},
	{GROUND_SOIL, {0.10, 0.08, 0.05}, {0.30, 0.22, 0.15}},   {GROUND_SAND, {0.30, 0.25, 0.15}, {0.50, 0.42, 0.32}},
	{GROUND_SEA, {0.03, 0.03, 0.03}, {0.10, 0.10, 0.10}},    {GROUND_SEA_ICE, {0.45, 0.5, 0.5}, {0.80, 0.85, 0.87}},
	{GROUND_SNOW, {0.85, 0.87, 0.88}, {0.98, 0.985, 0.985}}, {GROUND_BLACK, {0, 0, 0}, {0, 0, 0}},
	{GROUND_LAMBERT, {0.5, 0.3, 0.1}, {0.5, 0.3, 0.1}},
};

static struct scene ground_scene(enum ground_type type)
{
	static const double lambert[3] = {0.5, 0.3, 0.1};
	struct scene scene = scene_default();
	scene.ground.type = type;
	if (type == GROUND_LAMBERT)
		memcpy(scene.ground.albedo, lambert, sizeof lambert);
	return scene;
}

static void mean_albedo_of(const struct scene *scene, double mean[3])
{
	const struct pass_compiler compiler = {.kind = PASS_FRAGMENT};
	struct stage_context context = {.cache = cache_create(64 << 20)};
	struct ground_stage stage;
	struct ground_maps maps;
	glCreateBuffers(1, &context.block_buffer);
	glNamedBufferStorage(context.block_buffer, sizeof context.block, NULL, GL_DYNAMIC_STORAGE_BIT);
	ground_stage_init(&stage, &compiler);
	assert_true(ground_stage_run(&stage, &context, scene, &maps));
	memcpy(mean, maps.mean, sizeof maps.mean);
	ground_stage_finish(&stage);
	cache_destroy(context.cache);
	glDeleteBuffers(1, &context.block_buffer);
}

static void mean_albedos_are_published_ones(void **state)
{
	(void)state;
	for (size_t i = 0; i < sizeof published / sizeof *published; i++) {
		const struct scene scene = ground_scene(published[i].type);
		double mean[3], largest = 0;
		mean_albedo_of(&scene, mean);
		print_message("%-8s %.3f %.3f %.3f\n", scene_ground_type_names[published[i].type], mean[0], mean[1], mean[2]);
		for (int band = 0; band < 3; band++) {
			assert_true(mean[band] >= published[i].low[band] - 1e-4 && mean[band] <= published[i].high[band] + 1e-4);
			largest = fmax(largest, mean[band]);
		}
		assert_true(largest <= scene_ground_largest_reflectance(&scene.ground) + 1e-4);
	}
}

/* Payne 1972, table 1, at a transmittance of the air of 0.65 to 0.7: 0.03 with the sun at 70 degrees, 0.06 at 30, 0.13 at 15, and 0.06
 * under overcast. */
static void sea_albedo_follows_the_sun(void **state)
{
	(void)state;
	static const double cases[][4] = {{70, 0, 0.024, 0.042}, {30, 0, 0.048, 0.085}, {15, 0, 0.08, 0.17}, {40, 1, 0.055, 0.066}};
	for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
		struct scene scene = ground_scene(GROUND_SEA);
		double albedo[3];
		scene.sun.elevation_deg = cases[i][0];
		scene.clouds.coverage = cases[i][1];
		sea_albedo(&scene, albedo);
		assert_true(albedo[1] > cases[i][2] && albedo[1] < cases[i][3]);
		assert_true(albedo[2] > albedo[1] && albedo[1] > albedo[0]);
	}
}

/* --- shadows ------------------------------------------------------------------------------------------------------------------------ */

enum { SHADOW_SIDE = 96, SHADOW_REACH = 18 };

/* Values over a grid of `cell` m around the camera's foot, at a height: luminance of the ground where it is seen well, or optical
 * thickness. */
struct seen {
	double value[SHADOW_SIDE * SHADOW_SIDE];
	bool clear[SHADOW_SIDE * SHADOW_SIDE];
};

static void look_down(const struct scene *scene, const struct frame *frame, double height, double cell, bool ground, struct seen *seen)
{
	for (int i = 0; i < SHADOW_SIDE * SHADOW_SIDE; i++) {
		const double east = (i % SHADOW_SIDE - SHADOW_SIDE / 2) * cell, north = (i / SHADOW_SIDE - SHADOW_SIDE / 2) * cell;
		const double direction[3] = {east, north, height - scene->camera.position_m[2]};
		double at[2];
		assert_true(project(scene, direction, at));
		const int x = (int)at[0], y = (int)at[1];
		assert_true(x >= 0 && y >= 0 && x < frame->width && y < frame->height);
		seen->value[i] = ground ? luminance_of(frame, LAYER_GROUND, x, y) : pixel_of(frame, LAYER_OPTICAL_THICKNESS, x, y)[0];
		seen->clear[i] = !ground || pixel_of(frame, LAYER_TRANSMITTANCE, x, y)[1] > 0.9f;
	}
}

/* Correlation of the ground's light with the absence of cloud `dx`, `dy` cells away. */
static double correlation(const struct seen *ground, const struct seen *cloud, int dx, int dy)
{
	double n = 0, a = 0, b = 0, aa = 0, bb = 0, ab = 0;
	for (int y = SHADOW_REACH; y < SHADOW_SIDE - SHADOW_REACH; y++)
		for (int x = SHADOW_REACH; x < SHADOW_SIDE - SHADOW_REACH; x++) {
			const int i = y * SHADOW_SIDE + x;
			if (!ground->clear[i])
				continue;
			const double u = ground->value[i], v = -exp(-cloud->value[i + dy * SHADOW_SIDE + dx]);
			n++, a += u, b += v, aa += u * u, bb += v * v, ab += u * v;
		}
	return -(ab - a * b / n) / sqrt((aa - a * a / n) * (bb - b * b / n));
}

/* Seen from above with the sun at 45 degrees, a cloud's shadow lies as far from its foot as its base is high, away from the sun. */
static void shadows_lie_where_the_parallax_says(void **state)
{
	(void)state;
	static struct seen ground, cloud;
	const double cell = 100;
	for (double azimuth = 20; azimuth < 360; azimuth += 115) {
		struct scene scene = small_scene(320, 320, LAYER(GROUND) | LAYER(OPTICAL_THICKNESS) | LAYER(TRANSMITTANCE));
		scene.clouds.coverage = 0.3;
		scene.clouds.base_m = 1000;
		scene.clouds.thickness_m = 60;
		scene.ground.type = GROUND_LAMBERT;
		for (int k = 0; k < 3; k++)
			scene.ground.albedo[k] = 0.5;
		scene.sun = (struct scene_sun){.elevation_deg = 45, .azimuth_deg = azimuth};
		scene.camera.position_m[2] = 9000;
		scene.camera.elevation_deg = -90;
		scene.camera.azimuth_deg = 0; /* north is up at the pole */
		scene.camera.vertical_fov_deg = 66;
		struct frame frame = render(&scene);
		look_down(&scene, &frame, 0, cell, true, &ground);
		look_down(&scene, &frame, 1030, cell, false, &cloud);
		frame_finish(&frame);
		double best = -2;
		int at[2] = {0, 0};
		for (int dy = -SHADOW_REACH; dy <= SHADOW_REACH; dy++)
			for (int dx = -SHADOW_REACH; dx <= SHADOW_REACH; dx++) {
				const double found = correlation(&ground, &cloud, dx, dy);
				if (found > best)
					best = found, at[0] = dx, at[1] = dy;
			}
		/* From the shadow the cloud is towards the sun. */
		const double east = 1000 * sin(azimuth * DEGREE), north = 1000 * cos(azimuth * DEGREE);
		print_message("sun in the %3.0f: cloud %+.0f, %+.0f m from its shadow, wanted %+.0f, %+.0f (correlation %.2f)\n", azimuth,
			      at[0] * cell, at[1] * cell, east, north, best);
		assert_true(best > 0.6);
		assert_true(hypot(at[0] * cell - east, at[1] * cell - north) < 1.5 * cell);
	}
}

/* --- the horizon --------------------------------------------------------------------------------------------------------------------- */

/* Sine of the elevation that a point of the picture shows, over that of the horizon. */
static double above_horizon(const struct scene *scene, double x, double y)
{
	const struct camera_view view = camera_view_of(scene, 0);
	const double at[2] = {x, y}, h = scene->camera.position_m[2], radius = 6371000;
	double direction[3];
	camera_direction(&view, at, direction);
	return direction[2] + sqrt(h * (2 * radius + h)) / (radius + h);
}

/* Where the horizon of a tilted camera crosses a column of pixels, they show as much ground as lies below it: no stair. */
static void horizon_is_no_stair(void **state)
{
	(void)state;
	static const double heights[] = {2, 20, 100}; /* from higher up the air hides the last of the ground */
	for (int i = 0; i < 3; i++) {
		struct scene scene = small_scene(160, 120, LAYER(GROUND));
		scene.ground.type = GROUND_LAMBERT;
		for (int k = 0; k < 3; k++)
			scene.ground.albedo[k] = 0.8;
		scene.clouds.type = CLOUD_NONE;
		scene.atmosphere.aerosol_optical_depth = 0;
		scene.camera.position_m[2] = heights[i];
		scene.camera.elevation_deg = 0;
		scene.camera.roll_deg = 6;
		struct frame frame = render(&scene);
		double worst = 0;
		for (int x = 0; x < frame.width; x++) {
			double crossing = 0, found = 0;
			int row = 0;
			while (above_horizon(&scene, x + 0.5, crossing) > 0)
				crossing += 0.01;
			/* The light of the pixels down to one that shows ground alone, over that one's. */
			while (row < crossing + 2)
				found += luminance_of(&frame, LAYER_GROUND, x, row++);
			found /= luminance_of(&frame, LAYER_GROUND, x, row - 1);
			worst = fmax(worst, fabs(row - found - crossing));
		}
		frame_finish(&frame);
		print_message("from %.0f m: the edge lies within %.2f of a pixel\n", heights[i], worst);
		assert_true(worst < 0.2);
	}
}

/* No line under the horizon, whichever way the camera looks: none of the last rows of the land is brighter or darker than those above and
 * below it. From 2 m the air of the 5 km to the horizon hides a third of it, so that an edge to the sky remains. */
static void land_ends_without_lines(void **state)
{
	(void)state;
	enum { FIRST = 31, ROWS = 8 };
	double worst = 0;
	for (int i = 0; i < 6; i++) {
		struct scene scene = small_scene(200, 60, LAYER(COLOR));
		scene.clouds.type = CLOUD_NONE;
		scene.camera.azimuth_deg = 60 * i + 10;
		scene.camera.elevation_deg = 0;
		scene.camera.vertical_fov_deg = 4; /* pixels as large as those of the default picture */
		struct frame frame = render(&scene);
		double row[ROWS] = {0};
		for (int k = 0; k < ROWS; k++)
			for (int x = 0; x < frame.width; x++)
				row[k] += luminance_of(&frame, LAYER_COLOR, x, FIRST + k) / frame.width;
		for (int k = 1; k + 1 < ROWS; k++)
			worst = fmax(worst, fabs(row[k] / (0.5 * (row[k - 1] + row[k + 1])) - 1));
		frame_finish(&frame);
	}
	print_message("a row under the horizon differs from its neighbours by %.3f at most\n", worst);
	assert_true(worst < 0.16);
}

/* --- the sea ------------------------------------------------------------------------------------------------------------------------- */

static double mean_ground(const struct scene *scene, int rows)
{
	struct frame frame = render(scene);
	double sum = 0;
	for (int y = frame.height - rows; y < frame.height; y++)
		for (int x = 0; x < frame.width; x++)
			sum += luminance_of(&frame, LAYER_GROUND, x, y) / (rows * frame.width);
	frame_finish(&frame);
	return sum;
}

static struct scene sea_scene(double sun_elevation)
{
	struct scene scene = small_scene(64, 64, LAYER(GROUND));
	scene.ground.type = GROUND_SEA;
	scene.clouds.type = CLOUD_NONE;
	scene.sun = (struct scene_sun){.elevation_deg = sun_elevation, .azimuth_deg = 180};
	scene.camera.azimuth_deg = 180;
	scene.camera.elevation_deg = -10;
	return scene;
}

/* Light on the ground straight below, on a grid of points, as a camera at some height sees it; NAN where the layer is before it. */
static void light_below(struct scene scene, double height, double values[][60])
{
	scene.camera.position_m[2] = height;
	struct frame frame = render(&scene);
	for (int y = 0; y < 60; y++)
		for (int x = 0; x < 60; x++) {
			double direction[3] = {50.0 * (x - 29.5), 50.0 * (y - 29.5), -height}, at[2];
			assert_true(project(&scene, direction, at));
			const int column = (int)at[0], row = (int)at[1];
			assert_true(column >= 0 && row >= 0 && column < frame.width && row < frame.height);
			values[y][x] = luminance_of(&frame, LAYER_GROUND, column, row);
			if (pixel_of(&frame, LAYER_TRANSMITTANCE, column, row)[1] < 0.98f)
				values[y][x] = NAN;
		}
	frame_finish(&frame);
}

/* The shadows are the same ones from just below the layer and from just above it, which come out of different tables. */
static void shadows_are_the_same_from_below_and_above(void **state)
{
	(void)state;
	for (int i = 0; i < 3; i++) {
		struct scene scene = small_scene(360, 360, LAYER(GROUND) | LAYER(TRANSMITTANCE));
		scene.clouds.coverage = 0.4;
		scene.clouds.seed = (uint32_t)(7 + i);
		scene.clouds.base_m = 1000;
		scene.clouds.thickness_m = 60;
		scene.ground.type = GROUND_LAMBERT;
		for (int k = 0; k < 3; k++)
			scene.ground.albedo[k] = 0.5;
		scene.sun = (struct scene_sun){.elevation_deg = 50, .azimuth_deg = 40 + 110 * i};
		scene.camera.elevation_deg = -90;
		scene.camera.azimuth_deg = 0;
		scene.camera.vertical_fov_deg = 125;
		static double below[60][60], above[60][60];
		light_below(scene, 990, below);
		light_below(scene, 1070, above);
		double n = 0, a = 0, b = 0, aa = 0, bb = 0, ab = 0;
		for (int k = 0; k < 3600; k++) {
			const double u = below[k / 60][k % 60], v = above[k / 60][k % 60];
			if (isfinite(u) && isfinite(v))
				n++, a += u, b += v, aa += u * u, bb += v * v, ab += u * v;
		}
		const double correlation = (ab - a * b / n) / sqrt((aa - a * a / n) * (bb - b * b / n));
		print_message("sun from %.0f: light on %.0f places of the ground from below and above: correlation %.3f\n",
			      scene.sun.azimuth_deg, n, correlation);
		assert_true(n > 500 && correlation > 0.9);
	}
}

static void sea_glitters_below_the_sun(void **state)
{
	(void)state;
	struct scene scene = sea_scene(15);
	scene.camera.vertical_fov_deg = 20;
	const double towards = mean_ground(&scene, 64);
	scene.camera.azimuth_deg = 60;
	const double aside = mean_ground(&scene, 64);
	assert_true(towards > 8 * aside);
	/* A deck takes the glitter and leaves a grey sea. */
	scene.camera.azimuth_deg = 180;
	scene.clouds.type = CLOUD_STRATUS;
	scene.clouds.coverage = 1;
	assert_true(mean_ground(&scene, 64) < 0.2 * towards);
}

/* Under an even deck the water straight below sends back Fresnel's 0.021 of the zenith's radiance and what comes from below the surface. */
static void sea_mirrors_the_deck(void **state)
{
	(void)state;
	struct scene scene = sea_scene(40);
	scene.clouds.type = CLOUD_STRATUS;
	scene.clouds.coverage = 1;
	scene.clouds.thickness_m = 600;
	scene.clouds.wind_mps[0] = scene.clouds.wind_mps[1] = 0;
	scene.camera.vertical_fov_deg = 30;
	scene.camera.elevation_deg = -90;
	const double water = mean_ground(&scene, 64);
	scene.camera.elevation_deg = 90;
	scene.output.layers = LAYER(COLOR);
	struct frame frame = render(&scene);
	double deck = 0;
	for (int i = 0; i < 64 * 64; i++)
		deck += luminance_of(&frame, LAYER_COLOR, i % 64, i / 64) / (64 * 64);
	frame_finish(&frame);
	print_message("water %.4f, deck %.4f: ratio %.4f\n", water, deck, water / deck);
	/* Leaving the water: pi times 0.0014 /sr at 550 nm, of an irradiance of about pi times 0.8 of the zenith's radiance. */
	assert_true(isfinite(water / deck));
	assert_float_equal(water / deck, 0.0211 + 0.0014 * 3.14 * 0.8, 0.004);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(mean_albedos_are_published_ones),
		cmocka_unit_test(sea_albedo_follows_the_sun),
		cmocka_unit_test(shadows_lie_where_the_parallax_says),
		cmocka_unit_test(shadows_are_the_same_from_below_and_above),
		cmocka_unit_test(horizon_is_no_stair),
		cmocka_unit_test(land_ends_without_lines),
		cmocka_unit_test(sea_glitters_below_the_sun),
		cmocka_unit_test(sea_mirrors_the_deck),
	};
	return RUN_WITH_RENDERER(tests);
}
