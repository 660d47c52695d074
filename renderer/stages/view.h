/* The view stage: the picture seen by the camera, as scene-linear layers; and the develop stage, exposure and tone for a screen.
 *
 * Depends on everything but the output's encoding.
 */
#ifndef STRATUS_RENDERER_STAGES_VIEW_H
#define STRATUS_RENDERER_STAGES_VIEW_H

#include "renderer/stages/disc.h"
#include "renderer/stages/height_view.h"
#include "renderer/stages/view_rows.h"
#include "renderer/stages/view_samples.h"
#include "renderer/stages/view_up.h"

/* Layers that one run of the view pass makes. */
enum { VIEW_OUTPUTS = 4 };

/* Where the camera is. */
enum view_side { VIEW_CLEAR, VIEW_BELOW, VIEW_ABOVE, VIEW_SIDES };

/* What the ground is close by. The numbers stand in shaders/lib/ground.glsl. */
enum view_ground { VIEW_BARE, VIEW_GROWN, VIEW_SEA, VIEW_ICE, VIEW_GROUNDS };

enum { VIEW_DEVELOPS = 4 };

/* How much of the ground is seen: what lies close by, the regions that the far ground is made of (shaders/lib/ground.glsl), or both. */
enum view_reach { VIEW_NEAR, VIEW_NEAR_AND_FAR, VIEW_FAR, VIEW_REACHES };

/* The view pass exists in many forms, since software renderers execute both sides of every branch. */
struct view_variant {
	enum view_side side;
	enum view_region region;
	enum shading shading;
	bool twilight;              /* the base of the layer is lit by the sun somewhere */
	bool layers;                /* several, else the color alone */
	enum projection projection; /* of a camera_view */
	bool large_sun;             /* sun_disc.large */
	enum view_ground ground;
	enum view_reach reach;
	bool packed; /* the field, from below */
};

struct view_stage {
	struct pass_compiler compiler; /* shader_dir must outlive the stage */
	/* By shading, side, twilight, layers, region, projection, large sun, packed, ground, reach. Those that most pictures need are made
	 * at the start, the others with the first picture that wants them. */
	struct pass *passes[SHADING_COUNT][VIEW_SIDES][2][2][VIEW_REGIONS][PROJECTION_COUNT][2][2][VIEW_GROUNDS][VIEW_REACHES];
	struct view_up_stage up;
	struct height_view_stage height;
	struct view_samples_stage samples;
	struct pass *develop[VIEW_DEVELOPS]; /* into codes of 16 and of 8 bits, of a picture with corners and of a round one */
	struct texture spare;                /* of a picture that was dropped, to be used again; may be none */
	struct disc_buffer disc;             /* of the last picture made */
	renderer_cancelled *cancelled;       /* of the picture being made; may be NULL */
	void *cancel_context;
};

struct view_inputs {
	const struct ground_maps *ground;
	const struct droplets *droplets;
	const struct texture *slab_rows, *slab_slices; /* the second NULL in the paper's shading */
	const struct sky_tables *sky;
	const struct field_maps *field;
	const struct radiosity_light *light; /* NULL without clouds */
	struct height_view *seen;            /* of the view stage's own making: what the pixels see of the layer from above */
	const struct texture *sea_sky;       /* what a sea mirrors; NULL for other grounds */
	const struct sun_cover *sun_cover;   /* what the layer leaves of the beam; NULL: all of it */
};

bool view_stage_init(struct view_stage *stage, const struct pass_compiler *compiler);
void view_stage_finish(struct view_stage *stage);

enum view_ground view_ground_of(const struct scene *scene);

/* Fills in the block's camera, of the picture's first view. Call before any pass runs, since the sky is tabulated from the camera's height.
 */
void view_fill_block(struct scene_block *block, const struct scene *scene);

/* Those of a view alone. */
void view_fill_camera(struct scene_block *block, const struct scene *scene, const struct camera_view *view);

/* Renders layers[0..count) into textures of the output's size (RGBA32F), owned by the cache and valid for this frame. cancelled may be
 * NULL; it is asked between passes. false when cancelled, out of memory, or when a program does not compile. */
bool view_stage_run(struct view_stage *stage, struct stage_context *context, const struct scene *scene, const struct view_inputs *inputs,
		    const enum layer *layers, int count, renderer_cancelled *cancelled, void *cancel_context,
		    const struct texture **pictures);

/* For other passes that follow viewing rays (shaders/lib/view.glsl): the program of a file in the form for `variant`, with samplers as
 * view_bind_inputs binds them; NULL after log lines. And the form that a frame needs. */
struct pass *view_create_pass(const struct pass_compiler *compiler, const char *file, int outputs, const struct view_variant *variant);
struct view_variant view_variant_of(const struct stage_context *context, const struct scene *scene, const struct view_inputs *inputs,
				    bool layers);
void view_bind_inputs(struct pass_run *run, enum view_side side, const struct view_inputs *inputs);

/* Exposure, tone and sRGB of a picture into `target` (RGBA8 or RGBA16). Of a round one, a fisheye, the edge of the circle is softened over
 * a pixel, which the picture itself is not, since its pixels are radiances. Reads the block's develop member. */
void view_develop(const struct view_stage *stage, const struct texture *picture, bool round_picture, struct texture *target);

#endif
