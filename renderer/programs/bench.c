/* render-bench: renders scenes without HTTP, JSON or OpenImageIO and prints what each stage costs; writes what it rendered as a PPM or PFM.
 *
 * Every number of a scene that matters for looks can be set as NAME=VALUE, which makes it a tool for working on shaders too. */
#include "renderer/gl/timer.h"
#include "renderer/golden.h"
#include "renderer/optics/kernel.h"
#include "renderer/renderer.h"

#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

struct setting {
	const char *name;
	size_t offset;
	const char *const *words; /* enumerations are stored as int; NULL for a number */
	bool whole;               /* an int, else a double */
};

#define NUMBER(name, member)                                                                                                               \
	{                                                                                                                                  \
		name, offsetof(struct scene, member), NULL, false                                                                          \
	}
#define WHOLE(name, member)                                                                                                                \
	{                                                                                                                                  \
		name, offsetof(struct scene, member), NULL, true                                                                           \
	}
#define WORD(name, member, words)                                                                                                          \
	{                                                                                                                                  \
		name, offsetof(struct scene, member), words, false                                                                         \
	}

static const struct setting settings[] = {
	NUMBER("sun.elevation_deg", sun.elevation_deg),
	NUMBER("sun.azimuth_deg", sun.azimuth_deg),
	NUMBER("dsd.n0_per_cm3", dsd.n0_per_cm3),
	NUMBER("dsd.gamma", dsd.gamma),
	NUMBER("dsd.effective_radius_um", dsd.effective_radius_um),
	WORD("clouds.type", clouds.type, scene_cloud_type_names),
	NUMBER("clouds.time_s", clouds.time_s),
	NUMBER("clouds.coverage", clouds.coverage),
	NUMBER("clouds.base_m", clouds.base_m),
	NUMBER("clouds.thickness_m", clouds.thickness_m),
	NUMBER("clouds.tile_m", clouds.tile_m),
	NUMBER("clouds.wind_mps.0", clouds.wind_mps[0]),
	NUMBER("clouds.wind_mps.1", clouds.wind_mps[1]),
	WORD("ground.type", ground.type, scene_ground_type_names),
	NUMBER("ground.albedo.0", ground.albedo[0]),
	NUMBER("ground.albedo.1", ground.albedo[1]),
	NUMBER("ground.albedo.2", ground.albedo[2]),
	NUMBER("atmosphere.aerosol_optical_depth", atmosphere.aerosol_optical_depth),
	NUMBER("atmosphere.ozone_du", atmosphere.ozone_du),
	NUMBER("camera.x_m", camera.position_m[0]),
	NUMBER("camera.y_m", camera.position_m[1]),
	NUMBER("camera.z_m", camera.position_m[2]),
	NUMBER("camera.azimuth_deg", camera.azimuth_deg),
	NUMBER("camera.elevation_deg", camera.elevation_deg),
	NUMBER("camera.roll_deg", camera.roll_deg),
	NUMBER("camera.vertical_fov_deg", camera.vertical_fov_deg),
	WORD("camera.projection", camera.projection, scene_projection_names),
	WORD("camera.face", camera.face, scene_face_names),
	NUMBER("radiosity.tolerance", radiosity.tolerance),
	WORD("model.name", model.name, scene_model_names),
	WHOLE("model.samples", model.samples),
	WHOLE("model.seed", model.seed),
	NUMBER("model.time_budget_ms", model.time_budget_ms),
	WORD("model.shading", model.shading, scene_shading_names),
	WORD("model.optics", model.optics, scene_optics_names),
};

static void usage(FILE *to)
{
	fprintf(to, "usage: render-bench [-k KERNEL] [-s SHADER_DIR] [-p auto|fragment|compute] [-d DEVICE] [-n FRAMES] [-w WIDTH] [-h "
		    "HEIGHT]\n"
		    "                    [-S SEED] [-r RESOLUTION] [-R] [-o FILE.ppm|FILE.pfm] [-l LAYER] [-g FILE] [NAME=VALUE ...]\n"
		    "Renders the default scene with these changes and prints milliseconds per stage of the first frame, of a repeated one "
		    "with the\n"
		    "camera turned, and of one with another time. -l says which layer a PFM gets. -R switches the radiosity off. -g writes "
		    "the golden render's "
		    "values and no more. NAME is a "
		    "member as in JSON (camera.z_m "
		    "for heights).\n");
}

static bool apply(struct scene *scene, const char *text)
{
	const char *equals = strchr(text, '=');
	for (size_t i = 0; equals && i < sizeof settings / sizeof *settings; i++) {
		const struct setting *s = &settings[i];
		if (strlen(s->name) != (size_t)(equals - text) || strncmp(s->name, text, (size_t)(equals - text)) != 0)
			continue;
		char *at = (char *)scene + s->offset;
		if (!s->words) {
			char *end;
			const double number = strtod(equals + 1, &end);
			const int whole = (int)number;
			if (s->whole)
				memcpy(at, &whole, sizeof whole);
			else
				memcpy(at, &number, sizeof number);
			return *end == 0 && end != equals + 1;
		}
		for (int k = 0; s->words[k]; k++)
			if (strcmp(s->words[k], equals + 1) == 0) {
				memcpy(at, &k, sizeof k);
				return true;
			}
	}
	return false;
}

/* Of a PFM. */
static enum layer written = LAYER_COLOR;

static bool write_picture(const struct frame *frame, const char *path)
{
	int plane = 0;
	while (frame->type == PIXEL_F32 && plane < frame->layer_count - 1 && frame->layer[plane] != written)
		plane++;
	FILE *file = fopen(path, "wb");
	if (!file)
		return false;
	const size_t row = (size_t)frame->width * 3 * (frame->type == PIXEL_F32 ? 4 : 1);
	const char *pixels = (const char *)frame->pixels + (size_t)plane * row * (size_t)frame->height;
	if (frame->type == PIXEL_F32) {
		fprintf(file, "PF\n%d %d\n-1\n", frame->width, frame->height);
		for (int y = frame->height - 1; y >= 0; y--)
			fwrite(pixels + (size_t)y * row, 1, row, file);
	} else {
		fprintf(file, "P6\n%d %d\n255\n", frame->width, frame->height);
		fwrite(pixels, 1, row * (size_t)frame->height, file);
	}
	return fclose(file) == 0;
}

/* Processor time of all threads: steadier than the wall clock on a busy machine. */
static double processor_milliseconds(void)
{
	struct timespec now;
	clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
	return (double)now.tv_sec * 1e3 + (double)now.tv_nsec * 1e-6;
}

static void print_timing(const char *name, const struct frame *frame, double wall, double processor)
{
	printf("%-16s", name);
	for (int i = 0; i < STAGE_COUNT; i++)
		printf(" %s %.2f%s", stage_names[i], frame->timing[i].milliseconds, frame->timing[i].reused ? "*" : "");
	printf(" wall %.2f ms, processor %.2f ms (EV %.2f", wall, processor, frame->exposure_ev);
	if (frame->type == PIXEL_F32)
		printf(", %.0f + %.0f lux", frame->direct_illuminance_lux, frame->diffuse_illuminance_lux);
	printf("; residual after each of %d passes:", frame->radiosity_passes);
	for (int i = 0; i < frame->radiosity_passes && i < RADIOSITY_PASSES_LISTED; i++)
		printf(" %.1e", frame->radiosity_residuals[i]);
	puts(")");
}

static int compare_floats(const void *a, const void *b)
{
	const float x = *(const float *)a, y = *(const float *)b;
	return (x > y) - (x < y);
}

/* Median over the pixels of the standard error of their luminance (as if its channels erred together) over it; layers as main asks for
 * them. */
static double median_error(const struct frame *frame)
{
	static const double weight[] = {0.2126, 0.7152, 0.0722};
	const size_t count = (size_t)frame->width * (size_t)frame->height;
	const float *color = frame->pixels, *error = color + 3 * count * (size_t)(frame->layer_count - 1);
	float *values = calloc(count, sizeof *values);
	for (size_t i = 0; values && i < count; i++) {
		double light = 1e-9, wrong = 0;
		for (size_t c = 0; c < 3; c++) {
			light += weight[c] * color[3 * i + c];
			wrong += weight[c] * error[3 * i + c];
		}
		values[i] = (float)(wrong / light);
	}
	if (values)
		qsort(values, count, sizeof *values, compare_floats);
	const double median = values ? values[count / 2] : 0;
	free(values);
	return median;
}

static bool render(struct renderer *renderer, const struct scene *scene, const char *name, const char *path)
{
	struct frame frame;
	const double begin = clock_milliseconds(), processor = processor_milliseconds();
	if (renderer_render(renderer, scene, NULL, NULL, &frame) != RENDER_OK)
		return false;
	print_timing(name, &frame, clock_milliseconds() - begin, processor_milliseconds() - processor);
	if (frame.samples > 0 && frame.type == PIXEL_F32)
		printf("%-16s %d samples, median standard error %.2f %%\n", "", frame.samples, 100 * median_error(&frame));
	const bool ok = !path || write_picture(&frame, path);
	frame_finish(&frame);
	return ok;
}

static bool write_golden(struct renderer *renderer, const char *path)
{
	struct golden_picture picture;
	if (golden_render(renderer, false, NULL, NULL, &picture) != GOLDEN_PASSED)
		return false;
	golden_compare(&picture, &golden_expected);
	FILE *file = fopen(path, "w");
	if (!file)
		return false;
	golden_print(&picture, file);
	return fclose(file) == 0;
}

int main(int argc, char **argv)
{
	const char *kernel_path = "build/mie.kernel", *output = NULL, *golden = NULL;
	struct renderer_params params = {.device_index = -1};
	struct scene scene = scene_default();
	int frames = 3, width = 0, height = 0, option, status = 1;
	while ((option = getopt(argc, argv, "k:s:p:d:n:w:h:S:r:Ro:l:g:")) != -1) {
		switch (option) {
		case 'k':
			kernel_path = optarg;
			break;
		case 's':
			params.shader_dir = optarg;
			break;
		case 'p':
			params.pass_kind = *optarg == 'f' ? PASS_FRAGMENT : *optarg == 'c' ? PASS_COMPUTE : PASS_AUTO;
			break;
		case 'd':
			params.device_index = atoi(optarg);
			break;
		case 'n':
			frames = atoi(optarg);
			break;
		case 'w':
			width = atoi(optarg);
			break;
		case 'h':
			height = atoi(optarg);
			break;
		case 'S':
			scene.clouds.seed = (uint32_t)strtoul(optarg, NULL, 10);
			break;
		case 'r':
			scene.clouds.resolution = atoi(optarg);
			break;
		case 'R':
			scene.radiosity.enabled = false;
			break;
		case 'o':
			output = optarg;
			break;
		case 'g':
			golden = optarg;
			break;
		case 'l':
			for (int i = 0; scene_layer_names[i]; i++)
				if (strcmp(scene_layer_names[i], optarg) == 0)
					written = (enum layer)i;
			break;
		default:
			usage(stderr);
			return 2;
		}
	}
	if (output && strstr(output, ".pfm"))
		scene.output.format = IMAGE_EXR;
	for (; optind < argc; optind++) {
		if (!apply(&scene, argv[optind])) {
			fprintf(stderr, "render-bench: cannot set %s\n", argv[optind]);
			usage(stderr);
			return 2;
		}
	}

	if (scene.model.name == MODEL_REFERENCE)
		scene.output.layers |= 1u << LAYER_STANDARD_ERROR;
	scene.output.layers |= 1u << written;

	const struct scene_shape shape = scene_camera_shape(&scene.camera);
	scene.output.width = width ? width : shape.ratio[0] && height ? height * shape.ratio[0] / shape.ratio[1] : shape.width;
	scene.output.height = height ? height : shape.ratio[0] ? scene.output.width * shape.ratio[1] / shape.ratio[0] : shape.height;

	const double begin = clock_milliseconds();
	struct kernel *kernel = kernel_load(kernel_path);
	params.droplets = kernel ? droplet_store_create(&(struct droplet_store_params){.kernel = kernel}) : NULL;
	struct renderer *renderer = params.droplets ? renderer_create(&params) : NULL;
	if (!renderer)
		goto end;
	if (golden) {
		status = write_golden(renderer, golden) ? 0 : 1;
		goto end;
	}
	printf("start %.0f ms on %s\n", clock_milliseconds() - begin, renderer_info(renderer)->renderer);
	if (!render(renderer, &scene, "first", output))
		goto end;
	for (int i = 0; i < frames; i++) {
		scene.camera.azimuth_deg += 5;
		if (!render(renderer, &scene, "camera turned", NULL))
			goto end;
	}
	scene.clouds.time_s += 1;
	status = render(renderer, &scene, "one second on", NULL) ? 0 : 1;

end:
	renderer_destroy(renderer);
	droplet_store_destroy(params.droplets);
	kernel_destroy(kernel);
	return status;
}
