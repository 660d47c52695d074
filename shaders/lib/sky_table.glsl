// Mapping between directions and the tables of the sky seen from the camera's height: columns over the azimuth from the sun (0..180 deg, denser at the
// sun), rows over the elevation from the horizon, upper half above it, lower half below, both denser at the horizon.
#include "shaders/lib/sphere.glsl"

const vec2 SKY_TABLE_SIZE = vec2(96.0, 160.0);

// Elevation of the horizon in radians, not positive.
float sky_table_horizon()
{
	return asin(sphere_horizon(camera_position.z));
}

vec2 sky_table_coordinates(vec3 direction)
{
	float rows = 0.5 * SKY_TABLE_SIZE.y;
	float horizon = sky_table_horizon();
	float e = asin(clamp(direction.z, -1.0, 1.0)) - horizon;
	float unit = sqrt(clamp(e > 0.0 ? e / (0.5 * PI - horizon) : -e / (0.5 * PI + horizon), 0.0, 1.0));
	float row = 0.5 + unit * (rows - 1.0);
	vec2 flat_direction = vec2(direction.x, direction.y);
	float cosine = dot(flat_direction, vec2(sun_direction.x, sun_direction.y)) /
	               max(length(flat_direction) * length(vec2(sun_direction.x, sun_direction.y)), 1e-9);
	float column = sqrt(acos(clamp(cosine, -1.0, 1.0)) / PI);
	return vec2((0.5 + column * (SKY_TABLE_SIZE.x - 1.0)) / SKY_TABLE_SIZE.x, (e > 0.0 ? row : rows + row) / SKY_TABLE_SIZE.y);
}

// The inverse, for the centre of a texel: x elevation, y azimuth from the sun, radians.
vec2 sky_table_angles(ivec2 pixel)
{
	float rows = 0.5 * SKY_TABLE_SIZE.y;
	float horizon = sky_table_horizon();
	float column = float(pixel.x) / (SKY_TABLE_SIZE.x - 1.0);
	bool above = float(pixel.y) < rows;
	float unit = (above ? float(pixel.y) : float(pixel.y) - rows) / (rows - 1.0);
	float e = above ? horizon + unit * unit * (0.5 * PI - horizon) : horizon - unit * unit * (0.5 * PI + horizon);
	return vec2(e, PI * column * column);
}
