// The scene as uniforms; what each member is: renderer/scene_block.h.
#ifndef SHADERS_LIB_SCENE_BLOCK
#define SHADERS_LIB_SCENE_BLOCK
const int SEA_WAVES = 128;
#ifndef __cplusplus
#define SCENE_MEMBERS(M) \
	M(sun_direction) M(sun_at_camera) M(solar_irradiance) M(rayleigh) M(aerosol) M(aerosol_shape) M(ozone) M(ground_albedo) M(ground_patch) \
	M(ground_mean_albedo) M(ground_region) M(camera_position) M(camera_right) M(camera_up) M(camera_forward) M(image_size) M(sun_disc_box) M(cloud_layer) \
	M(cloud_field) M(cloud_drift) M(cloud_warp) M(cloud_puffs) M(cloud_puffs_drift) M(cloud_detail) M(cloud_threshold) M(extinction) M(extinction_modified) M(extinction_scaled) \
	M(slab_slice_range) M(slab_light) M(sky_irradiance_cloud) M(sky_irradiance_ground) M(air_below) M(air_around) M(band_red) M(band_green) \
	M(band_blue) M(develop) M(sea_state)
#define SCENE_BLOCK_MEMBER(name) vec4 name;
#ifdef PASS_SOFTWARE
// The vertices hand the block on as what is the same all over a triangle, which software renderers hold ready, while they would gather it out of the block lane by lane:
// thirty instructions for each number at each pixel.
layout(std140, binding = 0) uniform scene_block {
	SCENE_MEMBERS(SCENE_BLOCK_MEMBER)
	vec4 sea_waves[SEA_WAVES];
} scene;
#define sea_waves scene.sea_waves
#ifdef PASS_VERTEX
#define SCENE_HANDED_ON(name) flat out vec4 name;
#define SCENE_HAND_ON(name) name = scene.name;
#else
#define SCENE_HANDED_ON(name) flat in vec4 name;
#endif
SCENE_MEMBERS(SCENE_HANDED_ON)
#else
#define SCENE_HAND_ON(name)
layout(std140, binding = 0) uniform scene_block {
	SCENE_MEMBERS(SCENE_BLOCK_MEMBER)
	vec4 sea_waves[SEA_WAVES];
};
#endif
#ifdef PASS_VERTEX
void scene_hand_on()
{
	SCENE_MEMBERS(SCENE_HAND_ON)
}
#endif
uniform vec4 arguments[4];
#define INOUT(type) inout type
#endif

const float PI = 3.14159265358979;
const float EARTH_RADIUS = 6371000.0;
#endif
