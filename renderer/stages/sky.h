/* The sky stage: clear air lit by the sun.
 *
 * Depends on the sun's elevation, the atmosphere, the mean albedo of the ground, and, for what is seen, the camera's height and the height
 * of the cloud layer. Azimuths are taken from the sun, so that turning it or the camera costs nothing.
 */
#ifndef STRATUS_RENDERER_STAGES_SKY_H
#define STRATUS_RENDERER_STAGES_SKY_H

#include "renderer/renderer.h"
#include "renderer/stages/stage.h"

enum { SKY_PASS_COUNT = 7 };

struct sky_stage {
	struct pass *passes[SKY_PASS_COUNT];
};

struct sky_tables {
	const struct texture *transmittance;                    /* of the air to its top */
	const struct texture *total, *near, *to_layer, *to_end; /* seen from the camera, shaders/passes/sky_view.glsl */
	double diffuse_cloud[3], diffuse_ground[3];             /* irradiance by the clear sky, W/m2/nm per band, as in the block */
	double sun_cloud[3], sun_ground[3];                     /* by the sun on a plane normal to its beam */
};

/* Absorption cross sections of ozone in m2 per band: those that stand for the spectrum in pictures, and those at the bands' wavelengths. */
extern const double sky_ozone_of_pictures[3], sky_ozone_at_wavelength[3];

bool sky_stage_init(struct sky_stage *stage, const struct pass_compiler *compiler);
void sky_stage_finish(struct sky_stage *stage);

/* Fills in the block's atmosphere, irradiances and mean albedo, which is given per band. The tables stay valid for this frame. false (and a
 * log line) when out of memory. */
bool sky_stage_run(const struct sky_stage *stage, struct stage_context *context, const struct scene *scene, const double mean_albedo[3],
		   struct sky_tables *tables);

/* The light of a scene without clouds in some directions, seen from the ground. The caller frees light->radiance in any case; false (and a
 * log line) when out of memory. */
bool sky_stage_run_directions(const struct sky_stage *stage, struct stage_context *context, const struct scene *scene,
			      const double mean_albedo[3], const struct sky_directions *directions, struct sky_light *light);

#endif
