#include "renderer/scene.h"

#include <math.h>
#include <string.h>

const char *const scene_cloud_type_names[] = {"stratus", "stratocumulus", "altocumulus", "cirrocumulus", "none", NULL};
const char *const scene_ground_type_names[] = {"grass", "country", "soil", "sand", "sea", "sea_ice", "snow", "black", "lambert", NULL};
const char *const scene_projection_names[] = {"perspective", "fisheye", "equirectangular", "cubemap", NULL};
const char *const scene_face_names[] = {"+X", "-X", "+Y", "-Y", "+Z", "-Z", NULL};
const char *const scene_model_names[] = {"slab", "reference", "volume", "planar", NULL};
const char *const scene_shading_names[] = {"solved", "paper", NULL};
const char *const scene_optics_names[] = {"mie", "paper", NULL};
const char *const scene_format_names[] = {"png", "exr", NULL};
const char *const scene_tone_names[] = {"filmic", "linear", NULL};
const char *const scene_png_compression_names[] = {"fast", "small", NULL};
const char *const scene_exr_compression_names[] = {"none", "rle", "zip", "piz", "dwaa", NULL};
const char *const scene_exr_type_names[] = {"auto", "half", "float", NULL};
const char *const scene_layer_names[] = {
	"color",          "sun_direct", "order0", "order1", "order2",        "multiple",          "cloud_sky",
	"cloud_ground",   "sky",        "ground", "air",    "transmittance", "optical_thickness", "distance",
	"standard_error", NULL};

const char *const scene_path_names[] = {"sun_direct",   "order0", "order1", "order2", "multiple", "cloud_sky",
					"cloud_ground", "sky",    "ground", "air",    NULL};

struct scene scene_default(void)
{
	struct scene scene;
	memset(&scene, 0, sizeof scene);
	scene.sun = (struct scene_sun){.elevation_deg = 35, .azimuth_deg = 140};
	scene.dsd = (struct scene_dsd){.n0_per_cm3 = 300, .gamma = 2, .effective_radius_um = 7};
	scene.clouds.type = CLOUD_STRATOCUMULUS;
	scene.clouds.seed = 1;
	scene.clouds.coverage = 0.7;
	scene.clouds.base_m = 1200;
	scene.clouds.thickness_m = 400;
	scene.clouds.tile_m = 20000;
	scene.clouds.resolution = 512;
	scene.clouds.wind_mps[0] = 8;
	scene.clouds.wind_mps[1] = 3;
	scene.ground.type = GROUND_COUNTRY;
	scene.ground.albedo_scale = 1;
	scene.atmosphere = (struct scene_atmosphere){.aerosol_optical_depth = 0.1, .ozone_du = 300};
	scene.camera.position_m[2] = 2;
	scene.camera.azimuth_deg = 140;
	scene.camera.elevation_deg = 20;
	scene.camera.vertical_fov_deg = 60;
	scene.camera.projection = PROJECTION_PERSPECTIVE;
	scene.camera.face = FACE_ALL;
	scene.radiosity.enabled = true;
	scene.radiosity.tolerance = 0.001;
	scene.radiosity.max_passes = 64;
	scene.model.name = MODEL_SLAB;
	scene.model.shading = SHADING_SOLVED;
	scene.model.optics = OPTICS_MIE;
	scene.model.paths = SCENE_PATHS_ALL;
	scene.model.samples = 64;
	scene.model.seed = 1;
	scene.output.width = scene_camera_shape(&scene.camera).width;
	scene.output.height = scene_camera_shape(&scene.camera).height;
	scene.output.format = IMAGE_PNG;
	scene.output.exposure_auto = true;
	scene.output.tone = TONE_FILMIC;
	scene.output.layers = 1u << LAYER_COLOR;
	scene.output.exr_compression = EXR_ZIP;
	scene.output.exr_type = EXR_AUTO;
	scene.output.png_compression = PNG_FAST;
	scene.output.bits = 8;
	return scene;
}

bool scene_has_clouds(const struct scene *scene)
{
	return scene->clouds.type != CLOUD_NONE && scene->clouds.thickness_m > 0;
}

double scene_dsd_liquid_water(const struct scene_dsd *dsd)
{
	const double rn_m = dsd->effective_radius_um / (dsd->gamma + 2) * 1e-6;
	const double mean_r3 = rn_m * rn_m * rn_m * dsd->gamma * (dsd->gamma + 1) * (dsd->gamma + 2);
	return 4.0 / 3.0 * M_PI * 1e6 * dsd->n0_per_cm3 * 1e6 * mean_r3;
}

double scene_ground_largest_reflectance(const struct scene_ground *ground)
{
	/* Of what shaders/lib/ground_paint.glsl paints. */
	static const double painted[GROUND_TYPE_COUNT] = {
		[GROUND_GRASS] = 0.13, [GROUND_COUNTRY] = 0.23, [GROUND_SOIL] = 0.22, [GROUND_SAND] = 0.42,
		[GROUND_SEA] = 0.5,    [GROUND_SEA_ICE] = 0.88, [GROUND_SNOW] = 0.96};
	double largest = painted[ground->type];
	if (ground->type == GROUND_LAMBERT)
		largest = fmax(ground->albedo[0], fmax(ground->albedo[1], ground->albedo[2]));
	return largest * ground->albedo_scale;
}

struct scene_shape scene_camera_shape(const struct scene_camera *camera)
{
	switch (camera->projection) {
	case PROJECTION_FISHEYE:
		return (struct scene_shape){{1, 1}, 1024, 1024};
	case PROJECTION_EQUIRECTANGULAR:
		return (struct scene_shape){{2, 1}, 2048, 1024};
	case PROJECTION_CUBEMAP:
		return camera->face == FACE_ALL ? (struct scene_shape){{1, 6}, 512, 3072} : (struct scene_shape){{1, 1}, 512, 512};
	case PROJECTION_PERSPECTIVE:
	case PROJECTION_COUNT:
		break;
	}
	return (struct scene_shape){{0, 0}, 1024, 768};
}

/* ImfEnvmap.h of OpenEXR 3.1 draws the faces as they lie in the file, seen from inside; its X, Y, Z are east, up, south. */
static const double face_axes[FACE_ALL][3][3] = {
	[FACE_POS_X] = {{0, -1, 0}, {0, 0, 1}, {1, 0, 0}},  [FACE_NEG_X] = {{0, 1, 0}, {0, 0, 1}, {-1, 0, 0}},
	[FACE_POS_Y] = {{1, 0, 0}, {0, -1, 0}, {0, 0, 1}},  [FACE_NEG_Y] = {{1, 0, 0}, {0, 1, 0}, {0, 0, -1}},
	[FACE_POS_Z] = {{-1, 0, 0}, {0, 0, 1}, {0, -1, 0}}, [FACE_NEG_Z] = {{1, 0, 0}, {0, 0, 1}, {0, 1, 0}},
};

void scene_camera_axes(const struct scene_camera *camera, double axes[3][3])
{
	if (camera->projection == PROJECTION_CUBEMAP) {
		memcpy(axes, face_axes[camera->face == FACE_ALL ? FACE_POS_X : camera->face], sizeof face_axes[0]);
		return;
	}
	const double degree = M_PI / 180, e = camera->elevation_deg * degree, roll = camera->roll_deg * degree;
	/* Facing south and tilted up to the zenith, or north and down to the nadir, leaves north at the top. */
	const double azimuth = camera->elevation_deg >= 90 ? M_PI : camera->elevation_deg <= -90 ? 0 : camera->azimuth_deg * degree;
	const double right[3] = {cos(azimuth), -sin(azimuth), 0};
	const double up[3] = {-sin(e) * sin(azimuth), -sin(e) * cos(azimuth), cos(e)};
	const double forward[3] = {cos(e) * sin(azimuth), cos(e) * cos(azimuth), sin(e)};
	for (int i = 0; i < 3; i++) {
		axes[0][i] = cos(roll) * right[i] + sin(roll) * up[i];
		axes[1][i] = cos(roll) * up[i] - sin(roll) * right[i];
		axes[2][i] = forward[i];
	}
}
