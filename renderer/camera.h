/* Projections: which direction a point of the picture shows, and where a direction lies in it. The same mappings as
 * shaders/lib/camera.glsl, in double precision and with their inverse.
 *
 * Perspective: gnomonic. Fisheye: equidistant over 180 degrees, zenith in the middle, north up and so east on the left; nothing outside of
 * its circle. Equirectangular: azimuth/360 across from the left, (90 - elevation)/180 down. Cubemap: faces of 90 degrees, each a
 * perspective.
 *
 * Points are in pixels from the upper left corner of the picture, x to the right and y down; centres of pixels lie at halves. Directions
 * are east, north, up, of any length but 0. Any thread.
 */
#ifndef STRATUS_RENDERER_CAMERA_H
#define STRATUS_RENDERER_CAMERA_H

#include "renderer/scene.h"

/* What is mapped as one: the whole picture, or a face of a stacked cubemap. */
struct camera_view {
	enum projection projection; /* a face of a cubemap counts as a perspective */
	double axes[3][3];          /* unit vectors to the right, up and forward; of a perspective */
	double tangent[2];          /* of half its field of view, across and upwards */
	int width, height;          /* pixels */
	int first_row;              /* in the picture */
};

/* How many views a picture is made of: 6 for a whole cubemap, else 1. */
int camera_view_count(const struct scene *scene);

/* View `index` of a picture, from the top. */
struct camera_view camera_view_of(const struct scene *scene, int index);

/* Largest angle between the centres of neighbouring pixels, rad. */
double camera_pixel_angle(const struct camera_view *view);

/* The direction (of length 1) that a point of the view shows. false outside of the fisheye's circle, where it is the rim's. */
bool camera_direction(const struct camera_view *view, const double at[2], double direction[3]);

/* Where a direction lies. false when the view does not show it; at[] then holds where it would lie beyond the edge of a perspective or
 * the rim of a fisheye, and nothing of use behind a perspective. */
bool camera_project(const struct camera_view *view, const double direction[3], double at[2]);

/* Solid angle of the pixel in a column and a row of the picture, sr. Exact; in the corners of a fisheye that of its mapping carried on. */
double camera_pixel_solid_angle(const struct camera_view *view, int column, int row);

#endif
