/* The vectors of the scene block (renderer/scene_block.h), for shaders that are compiled for the processor. */
#ifndef STRATUS_TESTS_UNIT_GLSL_BLOCK_H
#define STRATUS_TESTS_UNIT_GLSL_BLOCK_H

#define GLSL_BLOCK(X)                                                                                                                      \
	X(sun_direction)                                                                                                                   \
	X(sun_at_camera)                                                                                                                   \
	X(solar_irradiance)                                                                                                                \
	X(rayleigh)                                                                                                                        \
	X(aerosol)                                                                                                                         \
	X(aerosol_shape)                                                                                                                   \
	X(ozone)                                                                                                                           \
	X(ground_albedo)                                                                                                                   \
	X(ground_patch)                                                                                                                    \
	X(ground_mean_albedo)                                                                                                              \
	X(ground_region)                                                                                                                   \
	X(camera_position)                                                                                                                 \
	X(camera_right)                                                                                                                    \
	X(camera_up)                                                                                                                       \
	X(camera_forward)                                                                                                                  \
	X(image_size)                                                                                                                      \
	X(sun_disc_box)                                                                                                                    \
	X(cloud_layer)                                                                                                                     \
	X(cloud_field)                                                                                                                     \
	X(cloud_drift)                                                                                                                     \
	X(cloud_warp)                                                                                                                      \
	X(cloud_puffs)                                                                                                                     \
	X(cloud_puffs_drift)                                                                                                               \
	X(cloud_detail)                                                                                                                    \
	X(cloud_threshold)                                                                                                                 \
	X(extinction)                                                                                                                      \
	X(extinction_modified)                                                                                                             \
	X(extinction_scaled)                                                                                                               \
	X(slab_slice_range)                                                                                                                \
	X(slab_light)                                                                                                                      \
	X(sky_irradiance_cloud)                                                                                                            \
	X(sky_irradiance_ground)                                                                                                           \
	X(air_below)                                                                                                                       \
	X(air_around)                                                                                                                      \
	X(band_red)                                                                                                                        \
	X(band_green)                                                                                                                      \
	X(band_blue)                                                                                                                       \
	X(develop)                                                                                                                         \
	X(sea_state)

#endif
