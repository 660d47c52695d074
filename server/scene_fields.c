#include "server/scene_fields.h"

#include <string.h>

#define AT(member)         .offset = offsetof(struct scene_input, member)
#define BETWEEN(low, high) .range = {{low, high}}
#define LATER(choice)      (1u << (choice))

/* clang-format off */
const struct scene_field scene_fields[] = {
	{"sun", "elevation_deg", FIELD_NUMBER, AT(scene.sun.elevation_deg), BETWEEN(-18, 90)},
	{"sun", "azimuth_deg", FIELD_NUMBER, AT(scene.sun.azimuth_deg), BETWEEN(0, 360)},
	{"sun", "time", FIELD_TIME, AT(scene.sun.julian_day)},
	{"sun", "latitude_deg", FIELD_NUMBER, AT(scene.sun.latitude_deg), BETWEEN(-90, 90)},
	{"sun", "longitude_deg", FIELD_NUMBER, AT(scene.sun.longitude_deg), BETWEEN(-180, 180)},

	{"dsd", "n0_per_cm3", FIELD_NUMBER, AT(scene.dsd.n0_per_cm3), BETWEEN(1, 5000)},
	{"dsd", "gamma", FIELD_NUMBER, AT(scene.dsd.gamma), BETWEEN(1, 20)},
	{"dsd", "effective_radius_um", FIELD_NUMBER, AT(scene.dsd.effective_radius_um), BETWEEN(1, 30)},
	/* rn = re / (gamma + 2): the range of re is checked once both are known. */
	{"dsd", "characteristic_radius_um", FIELD_NUMBER, AT(characteristic_radius_um), BETWEEN(0.045, 10), .flags = FIELD_INPUT_ONLY},

	{"clouds", "type", FIELD_CHOICE, AT(scene.clouds.type), .choices = scene_cloud_type_names},
	{"clouds", "seed", FIELD_SEED, AT(scene.clouds.seed), BETWEEN(0, UINT32_MAX)},
	{"clouds", "time_s", FIELD_NUMBER, AT(scene.clouds.time_s), BETWEEN(0, 1e7)},
	{"clouds", "coverage", FIELD_NUMBER, AT(scene.clouds.coverage), BETWEEN(0, 1)},
	{"clouds", "base_m", FIELD_NUMBER, AT(scene.clouds.base_m), BETWEEN(100, 12000)},
	{"clouds", "thickness_m", FIELD_NUMBER, AT(scene.clouds.thickness_m), BETWEEN(0, 2000)},
	{"clouds", "tile_m", FIELD_NUMBER, AT(scene.clouds.tile_m), BETWEEN(2000, 200000)},
	{"clouds", "resolution", FIELD_INTEGER, AT(scene.clouds.resolution), BETWEEN(64, 4096), .flags = FIELD_POWER_OF_TWO},
	{"clouds", "wind_mps", FIELD_NUMBERS, AT(scene.clouds.wind_mps), .range = {{-100, 100}, {-100, 100}}, .count = 2},
	{"clouds", "map", FIELD_ASSET, AT(scene.clouds.map.name)},
	{"clouds", "map_hash", FIELD_HASH, AT(scene.clouds.map.hash)},

	{"ground", "type", FIELD_CHOICE, AT(scene.ground.type), .choices = scene_ground_type_names},
	{"ground", "albedo", FIELD_NUMBERS, AT(scene.ground.albedo), .range = {{0, 1}, {0, 1}, {0, 1}}, .count = 3},
	{"ground", "albedo_scale", FIELD_NUMBER, AT(scene.ground.albedo_scale), BETWEEN(0, 2)},
	{"ground", "map", FIELD_ASSET, AT(scene.ground.map.name)},
	{"ground", "map_hash", FIELD_HASH, AT(scene.ground.map.hash)},

	{"atmosphere", "aerosol_optical_depth", FIELD_NUMBER, AT(scene.atmosphere.aerosol_optical_depth), BETWEEN(0, 2)},
	{"atmosphere", "ozone_du", FIELD_NUMBER, AT(scene.atmosphere.ozone_du), BETWEEN(0, 600)},

	{"camera", "position_m", FIELD_NUMBERS, AT(scene.camera.position_m), .range = {{-1e6, 1e6}, {-1e6, 1e6}, {0.1, 30000}}, .count = 3},
	{"camera", "azimuth_deg", FIELD_NUMBER, AT(scene.camera.azimuth_deg), BETWEEN(0, 360)},
	{"camera", "elevation_deg", FIELD_NUMBER, AT(scene.camera.elevation_deg), BETWEEN(-90, 90)},
	{"camera", "roll_deg", FIELD_NUMBER, AT(scene.camera.roll_deg), BETWEEN(-180, 180)},
	{"camera", "vertical_fov_deg", FIELD_NUMBER, AT(scene.camera.vertical_fov_deg), BETWEEN(0.5, 150)},
	{"camera", "projection", FIELD_CHOICE, AT(scene.camera.projection), .choices = scene_projection_names},
	{"camera", "face", FIELD_CHOICE, AT(scene.camera.face), .choices = scene_face_names},

	{"radiosity", "enabled", FIELD_BOOLEAN, AT(scene.radiosity.enabled)},
	{"radiosity", "tolerance", FIELD_NUMBER, AT(scene.radiosity.tolerance), BETWEEN(1e-6, 1)},
	{"radiosity", "max_passes", FIELD_INTEGER, AT(scene.radiosity.max_passes), BETWEEN(0, 1024)},

	{"model", "name", FIELD_CHOICE, AT(scene.model.name), .choices = scene_model_names,
	 .choices_later = LATER(MODEL_VOLUME) | LATER(MODEL_PLANAR)},
	{"model", "shading", FIELD_CHOICE, AT(scene.model.shading), .choices = scene_shading_names},
	{"model", "optics", FIELD_CHOICE, AT(scene.model.optics), .choices = scene_optics_names},
	{"model", "paths", FIELD_CHOICES, AT(scene.model.paths), .choices = scene_path_names},
	{"model", "samples", FIELD_INTEGER, AT(scene.model.samples), BETWEEN(1, 65536)},
	{"model", "time_budget_ms", FIELD_NUMBER, AT(scene.model.time_budget_ms), BETWEEN(0, 600000)},
	{"model", "seed", FIELD_SEED, AT(scene.model.seed), BETWEEN(0, UINT32_MAX)},
	{"model", "partial", FIELD_BOOLEAN, AT(scene.model.partial)},

	{"output", "width", FIELD_INTEGER, AT(scene.output.width), BETWEEN(16, 8192)},
	{"output", "height", FIELD_INTEGER, AT(scene.output.height), BETWEEN(16, 8192)},
	{"output", "format", FIELD_CHOICE, AT(scene.output.format), .choices = scene_format_names},
	{"output", "exposure_ev", FIELD_NUMBER_OR_AUTO, AT(scene.output.exposure_ev), BETWEEN(-20, 20),
	 .auto_offset = offsetof(struct scene_input, scene.output.exposure_auto)},
	{"output", "tone", FIELD_CHOICE, AT(scene.output.tone), .choices = scene_tone_names},
	{"output", "layers", FIELD_CHOICES, AT(scene.output.layers), .choices = scene_layer_names},
	{"output", "exr_compression", FIELD_CHOICE, AT(scene.output.exr_compression), .choices = scene_exr_compression_names},
	{"output", "exr_type", FIELD_CHOICE, AT(scene.output.exr_type), .choices = scene_exr_type_names},
	{"output", "png_compression", FIELD_CHOICE, AT(scene.output.png_compression), .choices = scene_png_compression_names},
	/* 8 or 16 */
	{"output", "bits", FIELD_INTEGER, AT(scene.output.bits), BETWEEN(8, 16), .flags = FIELD_POWER_OF_TWO},
	{0},
};
/* clang-format on */

_Static_assert(sizeof scene_fields / sizeof *scene_fields <= 64, "scene_input.given has a bit for each field");

struct scene_input scene_input_default(void)
{
	struct scene_input input = {.scene = scene_default()};
	/* What a Lambertian ground is when its albedo is not said; other grounds have their own (scene_rules.c puts it back to zero). */
	for (int i = 0; i < 3; i++)
		input.scene.ground.albedo[i] = 0.5;
	return input;
}

const struct scene_field *scene_field_find(const char *section, const char *name)
{
	for (const struct scene_field *field = scene_fields; field->section; field++)
		if (strcmp(field->section, section) == 0 && strcmp(field->name, name) == 0)
			return field;
	return NULL;
}

bool scene_section_exists(const char *section)
{
	for (const struct scene_field *field = scene_fields; field->section; field++)
		if (strcmp(field->section, section) == 0)
			return true;
	return false;
}

bool scene_field_given(const struct scene_input *input, const struct scene_field *field)
{
	return input->given >> (field - scene_fields) & 1;
}

void scene_field_mark_given(struct scene_input *input, const struct scene_field *field)
{
	input->given |= (uint64_t)1 << (field - scene_fields);
}

int name_index(const char *const *names, const char *name)
{
	for (int i = 0; names[i]; i++)
		if (strcmp(names[i], name) == 0)
			return i;
	return -1;
}
