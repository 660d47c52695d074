#include "renderer/image/regions.h"

#include "renderer/camera.h"

#include <math.h>

/* Angular radius of the sun, degrees: 959.63" at the mean distance, IAU. */
#define SUN_RADIUS_DEG 0.26656

/* Of the sphere that the sky is traced over (shaders/lib/sphere.glsl). */
#define EARTH_RADIUS_M 6371000.0

const float *frame_layer(const struct frame *frame, enum layer layer)
{
	const size_t plane = (size_t)frame->width * (size_t)frame->height * (size_t)frame->channels;
	for (int i = 0; i < frame->layer_count; i++)
		if (frame->type == PIXEL_F32 && frame->layer[i] == layer)
			return (const float *)frame->pixels + (size_t)i * plane;
	return NULL;
}

/* What a picture's pixels have in common. */
struct looks {
	double sun[3], sun_cosine; /* nearer to the sun than this, a pixel shows some of its disc */
	double horizon;            /* the upward part of rays that just touch the ground */
};

static struct looks looks_of(const struct scene *scene, const struct camera_view *view)
{
	const double degree = M_PI / 180, e = scene->sun.elevation_deg * degree, a = scene->sun.azimuth_deg * degree;
	const double h = scene->camera.position_m[2], r = EARTH_RADIUS_M;
	return (struct looks){
		.sun = {cos(e) * sin(a), cos(e) * cos(a), sin(e)},
		/* Half the diagonal of a pixel reaches as far; a little more, since rows are closer than columns at the edges. */
		.sun_cosine = cos(SUN_RADIUS_DEG * degree + 0.75 * camera_pixel_angle(view)),
		.horizon = -sqrt(h * (2 * r + h)) / (r + h),
	};
}

/* transmittance: three bands, or NULL. */
static uint8_t region_of(const struct looks *looks, const double direction[3], const float *transmittance, const float *distance)
{
	const double sun = direction[0] * looks->sun[0] + direction[1] * looks->sun[1] + direction[2] * looks->sun[2];
	if (sun > looks->sun_cosine)
		return 0;
	if (!transmittance)
		return REGION_ALL;
	if (fminf(transmittance[0], fminf(transmittance[1], transmittance[2])) < 0.99f)
		return REGION_CLOUD;
	return *distance > 0 && direction[2] < looks->horizon ? REGION_GROUND : REGION_SKY;
}

void regions_find(const struct scene *scene, const struct frame *frame, uint8_t *mask)
{
	const float *transmittance = frame ? frame_layer(frame, LAYER_TRANSMITTANCE) : NULL;
	const float *distance = frame ? frame_layer(frame, LAYER_DISTANCE) : NULL;
	for (int i = 0; i < camera_view_count(scene); i++) {
		const struct camera_view view = camera_view_of(scene, i);
		const struct looks looks = looks_of(scene, &view);
		const size_t first = (size_t)view.first_row * (size_t)view.width;
		for (size_t k = 0; k < (size_t)view.width * (size_t)view.height; k++) {
			const size_t pixel = first + k, row = pixel / (size_t)view.width;
			const double at[2] = {(double)(pixel % (size_t)view.width) + 0.5, (double)row + 0.5};
			double direction[3];
			const bool shown = camera_direction(&view, at, direction);
			mask[pixel] = !shown   ? 0
				      : !frame ? region_of(&looks, direction, NULL, NULL)
					       : region_of(&looks, direction, transmittance + 3 * pixel, distance + 3 * pixel);
		}
	}
}
