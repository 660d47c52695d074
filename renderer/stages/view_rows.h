/* What the pixels of a row, or of a piece of some rows, have in common, so that programs made for it can run over them. */
#ifndef STRATUS_RENDERER_STAGES_VIEW_ROWS_H
#define STRATUS_RENDERER_STAGES_VIEW_ROWS_H

#include "renderer/camera.h"
#include "renderer/stages/view_up.h"

/* Rays of either kind, all to the ground, none to the ground. The numbers stand in shaders/lib/view.glsl. */
enum view_region { VIEW_MIXED, VIEW_GROUND, VIEW_SKY, VIEW_REGIONS };

/* Sine of the (negative) elevation of the horizon of a sphere `height` above the ground, seen from the camera; 1 from inside it. */
double view_rows_horizon(const struct scene_block *block, double height);

/* Of a row, with a margin of a pixel or two. above: is the camera above a layer? Then rays to the sky do not meet that either. */
enum view_region view_rows_region(const struct scene_block *block, const struct camera_view *view, bool above, int row);

/* Of a row that looks up at the layer. */
enum view_up_reach view_rows_reach(const struct scene_block *block, const struct camera_view *view, int row);

/* large_sun: sun_disc.large. */
enum view_up_disc view_rows_disc(const struct scene_block *block, bool large_sun, int row);

/* Of a rectangle in rows of VIEW_UP_SOME_LOW: that, VIEW_UP_LOW or VIEW_UP_FAR. */
enum view_up_reach view_rows_low(const struct scene_block *block, const struct camera_view *view, int first_row, int end_row,
				 int first_column, int end_column);

#endif
