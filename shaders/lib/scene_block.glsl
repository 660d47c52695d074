// The scene as uniforms; what each member is: renderer/scene_block.h.
#ifndef SHADERS_LIB_SCENE_BLOCK
#define SHADERS_LIB_SCENE_BLOCK
const int SEA_WAVES = 128;
#ifndef __cplusplus
layout(std140, binding = 0) uniform scene_block {
	vec4 sun_direction;
	vec4 sun_at_camera;
	vec4 solar_irradiance;
	vec4 rayleigh;
	vec4 aerosol;
	vec4 aerosol_shape;
	vec4 ozone;
	vec4 ground_albedo;
	vec4 ground_patch;
	vec4 ground_mean_albedo;
	vec4 camera_position;
	vec4 camera_right;
	vec4 camera_up;
	vec4 camera_forward;
	vec4 image_size;
	vec4 sun_disc_box;
	vec4 cloud_layer;
	vec4 cloud_field;
	vec4 cloud_drift;
	vec4 cloud_puffs;
	vec4 cloud_puffs_drift;
	vec4 cloud_detail;
	vec4 cloud_threshold;
	vec4 extinction;
	vec4 extinction_modified;
	vec4 extinction_scaled;
	vec4 slab_slice_range;
	vec4 slab_light;
	vec4 sky_irradiance_cloud;
	vec4 sky_irradiance_ground;
	vec4 air_below;
	vec4 air_around;
	vec4 band_red;
	vec4 band_green;
	vec4 band_blue;
	vec4 develop;
	vec4 sea_state;
	vec4 sea_waves[SEA_WAVES];
};
uniform vec4 arguments[4];
#define INOUT(type) inout type
#endif

const float PI = 3.14159265358979;
const float EARTH_RADIUS = 6371000.0;
#endif
