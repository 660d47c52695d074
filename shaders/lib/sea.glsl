// The sea: a rough surface that mirrors sky, clouds and sun, light out of the water below, and foam.
//
// Slopes are normally distributed after Cox and Munk 1954 (J. Opt. Soc. Am. 44, 838). Waves that pixels resolve are a sum of many sines that travel as waves on deep water do
// (renderer/stages/sea.c); the others are roughness, so that both together keep the variance at every distance (Bruneton, Neyret and Holzschuch 2010, "Real-time Realistic Ocean
// Lighting using Seamless Transitions from Geometry to BRDF").
#ifndef SHADERS_LIB_SEA
#define SHADERS_LIB_SEA
#include "shaders/lib/ground_lattice.glsl"
#include "shaders/lib/slopes.glsl"

#ifndef __cplusplus
uniform sampler2D sea_sky;
#endif

const float SEA_INDEX = 1.34; // of refraction; sea water in the visible (Quan and Fry 1995: 1.337 to 1.345)
// Radiance out of the water over the irradiance on it, 1/sr, at 650, 550, 450 nm: clear open ocean with 0.3 mg/m3 of chlorophyll. Reflectance 0.33 bb/a below the surface (Morel and
// Prieur 1977) with absorption by water (Pope and Fry 1997), by plankton and its yellow matter (Morel 1991), scattering by water and particles (Morel 1988); 0.13 of it leaves upwards.
const vec3 SEA_LEAVING = vec3(0.00020, 0.00144, 0.0040);
const float SEA_FOAM = 0.22; // reflectance of whitecaps of all ages (Koepke 1984, Appl. Opt. 23, 1816)

// Texels of the mirrored sky a side, and how much of the picture's half-width the horizon's circle takes.
const float SEA_SKY_SIZE = 128.0;
const float SEA_SKY_RADIUS = 0.96;

// Reflectance for unpolarised light (Fresnel) under an angle of this cosine.
float sea_fresnel(float cosine)
{
	float c = clamp(cosine, 0.0, 1.0);
	float g = sqrt(SEA_INDEX * SEA_INDEX - 1.0 + c * c);
	float a = (g - c) / (g + c);
	float b = (c * (g + c) - 1.0) / (c * (g - c) + 1.0);
	return 0.5 * a * a * (1.0 + b * b);
}

// The upper hemisphere as a disc of equal areas (Lambert), the horizon as its edge.
vec2 sea_sky_coordinates(vec3 direction)
{
	float r = sqrt(max(1.0 - direction.z, 0.0)) * inversesqrt(max(1.0 - direction.z * direction.z, 1e-8));
	return vec2(direction.x, direction.y) * (r * 0.5 * SEA_SKY_RADIUS) + 0.5;
}

// Direction of a place in the picture; outside the disc the sky goes on mirrored, for the levels' sake.
vec3 sea_sky_direction(vec2 at)
{
	vec2 p = (at * 2.0 - 1.0) / SEA_SKY_RADIUS;
	float z = clamp(abs(1.0 - dot(p, p)), 0.004, 1.0);
	return vec3(p * (sqrt(1.0 - z * z) * inversesqrt(max(dot(p, p), 1e-12))), z);
}

// Slopes as they are seen: those resolved, and the covariance (xx, xy, yy) of those that are not, and of all. A slope is that of the normal (x, y, 1).
struct sea_slopes {
	vec2 resolved;
	vec3 covariance;
	vec3 total;
};

// Waves shorter than this many pixels are roughness alone; those of twice the length are there by two thirds.
const float SEA_WAVE_PIXELS = 2.3;
// Where pixels are larger than this, m, only the few longest waves would be left, as corduroy: they go, too.
const float SEA_WAVES_END = 2.5;

// Gusts and slicks: how much rougher or smoother than the mean the sea is, over hundreds of metres.
float sea_gusts(vec2 offset, float along)
{
	vec2 foot = vec2(camera_position.x, camera_position.y);
	vec3 small = ground_noise(ground_lattice_at(foot, offset, vec2(310.0)), 91u);
	vec3 large = ground_noise(ground_lattice_at(foot, offset, vec2(1700.0)), 92u);
	float seen_small = 1.0 / (1.0 + along * along * (1.0 / (90.0 * 90.0)));
	float seen_large = 1.0 / (1.0 + along * along * (1.0 / (500.0 * 500.0)));
	return 1.0 + clamp(0.08 * seen_small * (small.z + 0.5 * small.x) + 0.10 * seen_large * large.z, -0.3, 0.3);
}

// offset: from the camera's foot, m; heading: horizontal unit vector to the viewer; across, along: size of the pixel on the water, m.
sea_slopes sea_slopes_at(vec2 offset, vec2 heading, float across, float along)
{
	sea_slopes s;
	s.resolved = vec2(0.0);
	vec3 seen = vec3(0.0);
	float shown = 1.0 / (1.0 + across * across * (1.0 / (SEA_WAVES_END * SEA_WAVES_END)));
	// The pixel as a quadratic form of wave numbers: 1 where a wave is no longer seen.
	float far = SEA_WAVE_PIXELS * SEA_WAVE_PIXELS * along * along;
	float wide = SEA_WAVE_PIXELS * SEA_WAVE_PIXELS * across * across;
	vec3 pixel = vec3(wide) + (far - wide) * vec3(heading.x * heading.x, 2.0 * heading.x * heading.y, heading.y * heading.y);
	pixel.y -= wide;
	for (int first = 0; first < SEA_WAVES; first += 4) {
		vec2 longest = vec2(sea_waves[first].x, sea_waves[first].y);
		if (dot(longest, longest) * wide > 1.1)
			break; // so are all that follow
		for (int i = 0; i < 4; i++) {
			vec4 wave = sea_waves[first + i]; // wave number, 1/m; phase, turns; slope over wave number
			float left = max(1.0 - wave.x * (wave.x * pixel.x + wave.y * pixel.y) - wave.y * wave.y * pixel.z, 0.0);
			vec2 slope = vec2(wave.x, wave.y) * (wave.w * shown * left * left);
			// A cosine for eyes: a cubic of the same variance.
			float turn = wave.x * offset.x + wave.y * offset.y + wave.z;
			float x = abs(turn - floor(turn) - 0.5) - 0.25;
			s.resolved += slope * (x * (6.0877 - 32.468 * x * x));
			seen += vec3(slope.x * slope.x, slope.x * slope.y, slope.y * slope.y);
		}
	}
	s.total = vec3(sea_state) * sea_gusts(offset, along);
	s.covariance = s.total - 0.5 * seen;
	return s;
}

// Variance of the slopes along a horizontal unit vector.
float sea_variance(vec3 covariance, vec2 along)
{
	return max(covariance.x * along.x * along.x + 2.0 * covariance.y * along.x * along.y + covariance.z * along.y * along.y, 1e-5);
}

// What the sea shows of itself to the direction of a unit vector, over its horizontal area, before one part hides another.
float sea_shown_area(vec3 covariance, vec3 to)
{
	vec2 flat_to = vec2(to.x, to.y);
	float sine = sqrt(max(dot(flat_to, flat_to), 1e-8));
	float deviation = sine * sqrt(sea_variance(covariance, flat_to / sine));
	return deviation * normal_ramp(max(to.z, 1e-3) / deviation);
}

// Radiance by a beam of irradiance 1 normal to it: Cox and Munk's probability of the slopes that mirror it to the viewer, over the area that the sea shows, with
// Smith's shadowing towards both (Ross, Dion and Potvin 2005, J. Opt. Soc. Am. A 22, 2442). to_viewer and to_sun are unit vectors, z up. The area is that of all slopes: pixels
// lie on the flat sea, and the mean over them is Cox and Munk's then.
float sea_glint(sea_slopes s, vec3 to_viewer, vec3 to_sun)
{
	vec3 middle = normalize(to_viewer + to_sun + vec3(0.0, 0.0, 1e-4));
	float up = max(middle.z, 1e-3);
	vec2 away = vec2(middle.x, middle.y) / up - s.resolved;
	vec3 c = s.covariance;
	float determinant = max(c.x * c.z - c.y * c.y, 1e-8);
	float exponent = (c.z * away.x * away.x - 2.0 * c.y * away.x * away.y + c.x * away.y * away.y) / determinant;
	float probability = exp(-0.5 * min(exponent, 80.0)) / (2.0 * PI * sqrt(determinant));
	float hidden = to_viewer.z * (sea_shown_area(s.total, to_sun) / max(to_sun.z, 1e-3) - 1.0);
	return sea_fresnel(dot(middle, to_viewer)) * probability / (4.0 * up * up * up * up * max(sea_shown_area(s.total, to_viewer) + hidden, 1e-4));
}

// The sky as the slopes that the viewer sees mirror it. Facets turned to the viewer show more of themselves, and at a slant hide the others: mean and deviation of
// what is left are known in closed form and stand for it as two directions; the picture's levels blur the rest.
vec3 sea_mirrored_sky(sea_slopes s, vec3 to_viewer, vec2 heading, float deviation, float rise)
{
	float ramp = normal_ramp(rise);
	float first = normal_below(rise) / ramp;
	float second = 1.0 + normal_density(rise) / ramp;
	float lean = dot(s.resolved, heading) + deviation * first;
	float spread = deviation * sqrt(max(second - first * first, 0.04));
	float sideways = s.resolved.x * -heading.y + s.resolved.y * heading.x;
	float across = sqrt(sea_variance(s.covariance, vec2(-heading.y, heading.x)));
	vec3 sum = vec3(0.0);
	for (int i = 0; i < 2; i++) {
		float slope = lean + (i == 0 ? -spread : spread);
		vec3 normal = normalize(vec3(heading * slope + vec2(-heading.y, heading.x) * sideways, 1.0));
		float cosine = max(dot(normal, to_viewer), 0.0);
		vec3 up = 2.0 * cosine * normal - to_viewer;
		vec3 mirrored = normalize(vec3(up.x, up.y, max(abs(up.z), 0.01)));
		// A texel of level 0 is about 0.022 rad; the deviation of mirrored directions is twice that of the slopes.
		float level = log2(max(max(2.0 * across * cosine, spread) * (0.35 * SEA_SKY_SIZE), 1.0));
		sum += sea_fresnel(cosine) * vec3(textureLod(sea_sky, sea_sky_coordinates(mirrored), level));
	}
	return 0.5 * sum;
}

// Radiance of the sea. beam: irradiance by the sun normal to it, as it comes through the clouds; received: other irradiance.
vec3 sea_radiance(sea_slopes s, vec3 to_viewer, vec3 to_sun, vec3 beam, vec3 received)
{
	vec2 flat_view = vec2(to_viewer.x, to_viewer.y);
	float sine = sqrt(max(dot(flat_view, flat_view), 1e-6));
	vec2 heading = dot(flat_view, flat_view) > 1e-6 ? flat_view / sine : vec2(0.0, 1.0);
	float deviation = sqrt(sea_variance(s.covariance, heading));
	float rise = min((to_viewer.z / sine + dot(s.resolved, heading)) / deviation, 1e6);
	vec3 irradiance = received + beam * max(to_sun.z, 0.0);
	vec3 below = irradiance * (SEA_LEAVING + vec3(SEA_FOAM * sea_state.w / PI));
	return sea_mirrored_sky(s, to_viewer, heading, deviation, rise) + beam * (to_sun.z > 0.0 ? sea_glint(s, to_viewer, to_sun) : 0.0) + below;
}
#endif
