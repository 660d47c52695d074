// The color of pixels that look up at the layer, by a mesh over the picture (shaders/lib/view_mesh.glsl). FIELD_NEAR: as in shaders/passes/view_up.glsl.
#include "shaders/lib/colour.glsl"
#include "shaders/lib/view_mesh.glsl"

MESH_VARYING vec4 mesh_many_at[MESH_MANY];
MESH_VARYING vec3 mesh_first_at[MESH_FIRST];
MESH_VARYING float mesh_first_end;
MESH_VARYING vec4 mesh_sky;       // and the ray's x
MESH_VARYING vec4 mesh_near;      // and the ray's y
MESH_VARYING vec4 mesh_reflected; // and the ray's z
MESH_VARYING vec4 mesh_along;     // and the filtering

#ifdef PASS_VERTEX
// arguments[0].x: angle of a cell, rad
void corner(vec2 at)
{
	// Not of length 1: linear over a perspective.
	vec2 p = vec2(2.0 * at.x * image_size.z - 1.0, 1.0 - 2.0 * (at.y - camera_forward.w) * image_size.w);
	vec3 ray = vec3(camera_forward) + p.x * camera_right.w * vec3(camera_right) + p.y * camera_up.w * vec3(camera_up);
	float size = length(ray);
	mesh_corner c = mesh_corner_of(ray / size, size, arguments[0].x);
	mesh_many_at = c.many;
	mesh_first_at = c.first;
	mesh_first_end = c.first_end;
	mesh_sky = vec4(c.sky, c.ray.x);
	mesh_near = vec4(c.near, c.ray.y);
	mesh_reflected = vec4(c.reflected, c.ray.z);
	mesh_along = vec4(c.along, c.filtering);
}
#else
void pass(ivec2 pixel)
{
	mesh_corner c;
	c.many = mesh_many_at;
	c.first = mesh_first_at;
	c.first_end = mesh_first_end;
	c.sky = vec3(mesh_sky);
	c.near = vec3(mesh_near);
	c.reflected = vec3(mesh_reflected);
	c.ray = vec3(mesh_sky.w, mesh_near.w, mesh_reflected.w);
	c.along = mesh_along.xy;
	c.filtering = mesh_along.zw;
	STORE(0, vec4(colour_of_bands(mesh_radiance(c)), 1.0));
}
#endif
