#include "server/scene_rules.h"

#include "server/sun_position.h"

#include <math.h>
#include <stdio.h>

static bool given(const struct scene_input *input, const char *section, const char *name)
{
	return scene_field_given(input, scene_field_find(section, name));
}

/* Adds the same detail to each of the members of a section that were given. */
static void refuse_given(const struct scene_input *input, const char *section, const char *const *names, const char *detail,
			 struct problem *problem)
{
	for (; *names; names++) {
		char pointer[64];
		snprintf(pointer, sizeof pointer, "/%s/%s", section, *names);
		if (given(input, section, *names))
			problem_add(problem, pointer, "%s", detail);
	}
}

static void resolve_sun(struct scene_input *input, struct problem *problem)
{
	static const char *const angles[] = {"elevation_deg", "azimuth_deg", NULL};
	static const char *const place[] = {"time", "latitude_deg", "longitude_deg", NULL};
	int count = 0;
	for (int i = 0; place[i]; i++)
		count += given(input, "sun", place[i]);
	if (count == 0)
		return;
	refuse_given(input, "sun", angles, "is given by time, latitude_deg and longitude_deg already: give one form", problem);
	for (int i = 0; place[i]; i++) {
		char pointer[64];
		snprintf(pointer, sizeof pointer, "/sun/%s", place[i]);
		if (!given(input, "sun", place[i]))
			problem_add(problem, pointer, "is needed: time, latitude_deg and longitude_deg go together");
	}
	if (problem_mentions(problem, "/sun"))
		return;
	struct scene_sun *given_sun = &input->scene.sun;
	struct scene_sun sun = sun_position_at(given_sun->julian_day, given_sun->latitude_deg, given_sun->longitude_deg);
	if (sun.elevation_deg < scene_field_find("sun", "elevation_deg")->range[0].low)
		problem_add(problem, "/sun/time", "the sun is %.1f degrees below the horizon then and there: at most 18",
			    -sun.elevation_deg);
	else
		*given_sun = sun;
}

static void resolve_dsd(struct scene_input *input, struct problem *problem)
{
	static const char *const radius[] = {"effective_radius_um", NULL};
	struct scene_dsd *dsd = &input->scene.dsd;
	bool characteristic = given(input, "dsd", "characteristic_radius_um");
	if (characteristic)
		refuse_given(input, "dsd", radius, "is given by characteristic_radius_um already: give one form", problem);
	if (problem_mentions(problem, "/dsd"))
		return;
	if (characteristic) {
		const struct field_range *range = scene_field_find("dsd", "effective_radius_um")->range;
		dsd->effective_radius_um = input->characteristic_radius_um * (dsd->gamma + 2);
		if (!(dsd->effective_radius_um >= range->low && dsd->effective_radius_um <= range->high)) {
			problem_add(problem, "/dsd/characteristic_radius_um",
				    "gives an effective radius of %.4g um, which must be from 1 to 30", dsd->effective_radius_um);
			return;
		}
	}
	double water = scene_dsd_liquid_water(dsd);
	if (!(water <= 5))
		problem_add(problem, "/dsd", "holds %.3g g/m3 of liquid water: at most 5", water);
}

static void check_clouds(const struct scene_input *input, struct problem *problem)
{
	static const char *const procedural[] = {"type", "seed", "coverage", NULL}, *const hash[] = {"map_hash", NULL};
	if (given(input, "clouds", "map"))
		refuse_given(input, "clouds", procedural, "does not go with a map", problem);
	else
		refuse_given(input, "clouds", hash, "goes with a map only", problem);
}

static void check_ground(struct scene_input *input, struct problem *problem)
{
	static const char *const albedo[] = {"albedo", NULL};
	static const char *const procedural[] = {"type", "albedo", NULL}, *const hash[] = {"map_hash", NULL};
	struct scene_ground *ground = &input->scene.ground;
	if (given(input, "ground", "map"))
		refuse_given(input, "ground", procedural, "does not go with a map", problem);
	else
		refuse_given(input, "ground", hash, "goes with a map only", problem);
	if (problem_mentions(problem, "/ground"))
		return;
	if (*ground->map.name) { /* a Lambertian ground whose reflectance the map says; what it reaches is checked with the map */
		ground->type = GROUND_LAMBERT;
		ground->albedo[0] = ground->albedo[1] = ground->albedo[2] = 0;
		return;
	}
	if (ground->type != GROUND_LAMBERT) {
		refuse_given(input, "ground", albedo, "goes with the type lambert only", problem);
		/* One scene, one content: an unused albedo must not make two scenes of one. */
		ground->albedo[0] = ground->albedo[1] = ground->albedo[2] = 0;
	}
	if (scene_ground_largest_reflectance(ground) > 1)
		problem_add(problem, "/ground/albedo_scale", "times the albedo exceeds 1: at most %g for this ground",
			    floor(1000 * ground->albedo_scale / scene_ground_largest_reflectance(ground)) / 1000); /* never up */
}

static void check_camera(const struct scene_input *input, struct problem *problem)
{
	static const char *const directions[] = {"azimuth_deg", "elevation_deg", "roll_deg", "vertical_fov_deg", NULL};
	static const char *const face[] = {"face", NULL};
	const struct scene *scene = &input->scene;
	const struct scene_clouds *clouds = &scene->clouds;
	if (scene->camera.projection != PROJECTION_PERSPECTIVE)
		refuse_given(input, "camera", directions, "does not go with a panorama", problem);
	if (scene->camera.projection != PROJECTION_CUBEMAP && !problem_mentions(problem, "/camera/projection"))
		refuse_given(input, "camera", face, "goes with the projection cubemap only", problem);
	if (problem_mentions(problem, "/camera/position_m") || problem_mentions(problem, "/clouds"))
		return;
	double z = scene->camera.position_m[2];
	bool has_clouds = clouds->type != CLOUD_NONE && clouds->thickness_m > 0;
	if (has_clouds && scene->model.name == MODEL_SLAB && z >= clouds->base_m && z <= clouds->base_m + clouds->thickness_m)
		problem_add(problem, "/camera/position_m/2", "lies inside the cloud layer (%g to %g m), where the slab model has no view",
			    clouds->base_m, clouds->base_m + clouds->thickness_m);
}

/* Any scene may be rendered as its own reference, which has no use for what the slab is told of shading and radiosity: it is put back to
 * what it usually is, since it must not make two scenes of one. */
static void check_model(struct scene_input *input, struct problem *problem)
{
	static const char *const sampling[] = {"samples", "time_budget_ms", "seed", "partial", NULL};
	struct scene *scene = &input->scene;
	const bool known = !problem_mentions(problem, "/model/name");
	if (scene->model.name == MODEL_REFERENCE) {
		scene->model.shading = scene_default().model.shading;
		scene->radiosity = scene_default().radiosity;
	} else if (known) {
		refuse_given(input, "model", sampling, "goes with the model reference only", problem);
	}
}

/* One side of a picture that follows from the other. Both have the same range; `ratio` is that side's to the other's. */
static void follow(const char *name, int value, const int ratio[2], int *other, struct problem *problem)
{
	const struct field_range *range = scene_field_find("output", name)->range;
	const int low = (int)range->low, high = (int)range->high, step = ratio[0];
	/* Within the range of both sides, and a multiple of what makes the other side whole. */
	const int least = (low * (ratio[0] > ratio[1] ? ratio[0] : ratio[1]) + ratio[1] - 1) / ratio[1];
	const int most = high * (ratio[0] < ratio[1] ? ratio[0] : ratio[1]) / ratio[1];
	char pointer[64];
	snprintf(pointer, sizeof pointer, "/output/%s", name);
	if (value % step != 0)
		problem_add(problem, pointer, "must be a multiple of %d: this projection is %d to %d", step, ratio[0], ratio[1]);
	else if (value < least || value > most)
		problem_add(problem, pointer, "must be from %d to %d: this projection is %d to %d", least, most - most % step, ratio[0],
			    ratio[1]);
	else
		*other = value / ratio[0] * ratio[1];
}

/* Panoramas have one shape: the side that was not given follows from the one that was. */
static void resolve_size(struct scene_input *input, struct problem *problem)
{
	const struct scene_shape shape = scene_camera_shape(&input->scene.camera);
	struct scene_output *output = &input->scene.output;
	const bool width = given(input, "output", "width"), height = given(input, "output", "height");
	const int upright[2] = {shape.ratio[1], shape.ratio[0]};
	if (shape.ratio[0] == 0 || problem_mentions(problem, "/output/width") || problem_mentions(problem, "/output/height") ||
	    problem_mentions(problem, "/camera/face"))
		return;
	int follows = 0;
	if (width)
		follow("width", output->width, shape.ratio, &follows, problem);
	else if (height)
		follow("height", output->height, upright, &follows, problem);
	if (!width && !height)
		output->width = shape.width, output->height = shape.height;
	else if (!width)
		output->width = follows ? follows : shape.width;
	else if (!height)
		output->height = follows ? follows : shape.height;
	else if (follows && follows != output->height)
		problem_add(problem, "/output/height", "must be %d for this width: this projection is %d to %d wide to high", follows,
			    shape.ratio[0], shape.ratio[1]);
}

static void check_output(const struct scene_input *input, struct problem *problem)
{
	const struct scene_output *output = &input->scene.output;
	if (problem_mentions(problem, "/output"))
		return;
	if (output->format == IMAGE_PNG && output->layers != 1u << LAYER_COLOR)
		problem_add(problem, "/output/layers", "other layers than color need the format exr");
	if ((output->layers >> LAYER_STANDARD_ERROR & 1) && input->scene.model.name != MODEL_REFERENCE)
		problem_add(problem, "/output/layers", "standard_error is of the model reference only");
	int64_t pixels = (int64_t)output->width * output->height * __builtin_popcount(output->layers);
	if (pixels > SCENE_PIXELS_MAX)
		problem_add(problem, "/output", "width x height x layers is %lld pixels: at most %d", (long long)pixels, SCENE_PIXELS_MAX);
}

void scene_rules_apply(struct scene_input *input, struct problem *problem)
{
	resolve_sun(input, problem);
	resolve_dsd(input, problem);
	check_clouds(input, problem);
	check_ground(input, problem);
	check_camera(input, problem);
	check_model(input, problem);
	resolve_size(input, problem);
	check_output(input, problem);
}
