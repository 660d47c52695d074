// Mapping between directions and the tables of the sky seen from the camera's height: columns over the azimuth from the sun (0..180 deg, denser at the
// sun), rows over the elevation from the horizon, upper half above it, lower half below, both denser at the horizon and at the pole.
#ifndef SHADERS_LIB_SKY_TABLE
#define SHADERS_LIB_SKY_TABLE
#include "shaders/lib/sphere.glsl"

const vec2 SKY_TABLE_SIZE = vec2(96.0, 160.0);

// Rows: with s the sine of the elevation counted from the horizon's, 0..1 up to the pole, the share of POLE sqrt(s) in it and sqrt(1 - s): as the root of
// the elevation at the horizon, where the air changes most, and as the angle from the pole there, where a sine alone would leave out what lies within
// 13 degrees of it. Columns: square root of sin(azimuth/2). No inverse trigonometry is needed to look a direction up.
const float SKY_TABLE_POLE = 1.5;

// horizon: sine of its elevation; mu: of the direction's; above: is it over the horizon; cosine: of its azimuth from the sun.
vec2 sky_table_at(float horizon, float mu, bool above, float cosine)
{
	float rows = 0.5 * SKY_TABLE_SIZE.y;
	float rise = mu - horizon;
	float s = clamp(above ? rise / (1.0 - horizon) : -rise / (1.0 + horizon), 0.0, 1.0);
	float from_horizon = SKY_TABLE_POLE * sqrt(s);
	float unit = from_horizon / (from_horizon + sqrt(1.0 - s));
	float row = 0.5 + unit * (rows - 1.0);
	float column = sqrt(sqrt(clamp(0.5 - 0.5 * cosine, 0.0, 1.0)));
	return vec2((0.5 + column * (SKY_TABLE_SIZE.x - 1.0)) / SKY_TABLE_SIZE.x, (above ? row : rows + row) / SKY_TABLE_SIZE.y);
}

vec2 sky_table_coordinates(vec3 direction)
{
	float horizon = sphere_horizon(camera_position.z);
	vec2 flat_direction = vec2(direction.x, direction.y);
	vec2 flat_sun = vec2(sun_direction.x, sun_direction.y);
	float cosine = dot(flat_direction, flat_sun) * inversesqrt(max(dot(flat_direction, flat_direction) * dot(flat_sun, flat_sun), 1e-18));
	return sky_table_at(horizon, direction.z, direction.z > horizon, cosine);
}

// Sine of the elevation of a row above the horizon, unit from 0 (horizon) to 1 (zenith).
float sky_table_sine(float horizon, float unit)
{
	float from_pole = SKY_TABLE_POLE * (1.0 - unit);
	return horizon + unit * unit / (unit * unit + from_pole * from_pole) * (1.0 - horizon);
}

// That unit, of a direction above the horizon at these coordinates.
float sky_table_row(vec2 coordinates)
{
	return (coordinates.y * SKY_TABLE_SIZE.y - 0.5) / (0.5 * SKY_TABLE_SIZE.y - 1.0);
}

// The inverse, for the centre of a texel: x sine of the elevation, y cosine of the azimuth from the sun.
vec2 sky_table_parameters(ivec2 pixel)
{
	float rows = 0.5 * SKY_TABLE_SIZE.y;
	float horizon = sphere_horizon(camera_position.z);
	float column = float(pixel.x) / (SKY_TABLE_SIZE.x - 1.0);
	bool above = float(pixel.y) < rows;
	float unit = (above ? float(pixel.y) : float(pixel.y) - rows) / (rows - 1.0);
	float from_pole = SKY_TABLE_POLE * (1.0 - unit);
	float s = unit * unit / (unit * unit + from_pole * from_pole);
	float mu = above ? horizon + s * (1.0 - horizon) : horizon - s * (1.0 + horizon);
	float half_sine = column * column;
	return vec2(clamp(mu, -1.0, 1.0), 1.0 - 2.0 * half_sine * half_sine);
}
#endif
