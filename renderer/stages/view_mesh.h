/* Pixels that look up at the layer in an upright perspective, fastest: by a mesh over the picture (shaders/lib/view_mesh.glsl), at whose
 * corners the tables of view_up.h are read. Corners lie where light changes: closer to each other around the sun and above the horizon.
 */
#ifndef STRATUS_RENDERER_STAGES_VIEW_MESH_H
#define STRATUS_RENDERER_STAGES_VIEW_MESH_H

#include "renderer/camera.h"
#include "renderer/gl/pass.h"
#include "renderer/scene_block.h"

enum { VIEW_MESH_LINES_MAX = 512 };

/* Rows and columns [first, end) of a picture. */
struct view_mesh_part {
	int first_row, end_row, first_column, end_column;
};

/* Can the mesh show such a row, whose lowest direction has this sine of elevation? */
bool view_mesh_shows(const struct camera_view *view, double lowest_sine);

/* The part of these rows around the sun where light changes too fast for a mesh; may be empty. */
struct view_mesh_part view_mesh_around_sun(const struct scene_block *block, const struct camera_view *view, int first_row, int end_row);

/* Runs a pass over rows [first_row, end_row), as `run` holds its targets and samplers. */
void view_mesh_run(const struct pass *pass, const struct scene_block *block, const struct camera_view *view, const struct pass_run *run,
		   int first_row, int end_row);

#endif
