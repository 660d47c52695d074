// The reference model: samples of a pixel, light paths from the camera until all light is found. Adds to the sums of the picture: 0 color, linear Rec.709; 1 the part of it that is left to
// chance, without the sun's disc, and 2 that one's square; then, where REFERENCE_LAYERS, five layers (enum layer) in the bands. arguments[0]: first sample, samples, seed (lower and upper 16
// bits); [1] and [2].x: layers; [2].y: kinds of light that are shown, as a bit set.
#include "shaders/lib/camera.glsl"
#include "shaders/lib/colour.glsl"
#include "shaders/lib/ground.glsl"
#include "shaders/lib/ground_near.glsl"
#if VIEW_GROUND == 2
#include "shaders/lib/sea.glsl"
#endif
#include "shaders/lib/light_path_sun.glsl"
#include "shaders/lib/sun_disc.glsl"

#ifndef __cplusplus
uniform sampler2D sky_total;
uniform sampler2D sky_near;
uniform sampler2D air_to_layer;
uniform sampler2D air_to_end;
#endif

// Kinds of light, in the order of enum layer.
const int KIND_SUN_DIRECT = 1;
const int KIND_ORDER0 = 2;
const int KIND_CLOUD_SKY = 6;
const int KIND_CLOUD_GROUND = 7;
const int KIND_SKY = 8;
const int KIND_GROUND = 9;
const int KIND_AIR = 10;
const int KIND_TRANSMITTANCE = 11;
const int KIND_OPTICAL_THICKNESS = 12;
const int KIND_DISTANCE = 13;

// Processors that run pixels in step with each other do everything for all of them or none, so that what happens seldom is done seldom: so many scatterings before the ends of
// flights are looked at and a search for the sun is begun, so many steps before a scattering.
const int REFERENCE_SCATTERINGS = 8;
const int REFERENCE_STEPS = 2;
// Searches for the sun are left to chance where they are expected to bring less than its inverse, of which a path brings some.
const float REFERENCE_PATIENCE = 4.0;

struct reference_sums {
	vec3 light; // of this sample, in the bands
	vec3 certain; // part of it that is the same for all samples
	vec3 chance;
	vec3 color;
	vec3 squares;
#if REFERENCE_LAYERS
	vec3 layer_0;
	vec3 layer_1;
	vec3 layer_2;
	vec3 layer_3;
	vec3 layer_4;
#endif
};

void reference_keep(INOUT(reference_sums) sums, int kind, vec3 value)
{
#if REFERENCE_LAYERS
	float number = float(kind);
	sums.layer_0 += arguments[1].x == number ? value : vec3(0.0);
	sums.layer_1 += arguments[1].y == number ? value : vec3(0.0);
	sums.layer_2 += arguments[1].z == number ? value : vec3(0.0);
	sums.layer_3 += arguments[1].w == number ? value : vec3(0.0);
	sums.layer_4 += arguments[2].x == number ? value : vec3(0.0);
#endif
}

void reference_add(INOUT(reference_sums) sums, int kind, vec3 light)
{
	bool shown = (int(arguments[2].y) >> (kind - 1) & 1) != 0;
	sums.light += shown ? light : vec3(0.0);
	reference_keep(sums, kind, light);
}

// What a path shows that looks for light by way of sky or sun.
int reference_kind(light_path path, int otherwise)
{
	return path.grounded == 2 ? KIND_GROUND : path.grounded == 1 ? KIND_CLOUD_GROUND : otherwise;
}

// The first thing that a path meets: cloud (0), ground (1) or nothing (2); the air before it is that of the slab's view (shaders/lib/view.glsl).
void reference_first(INOUT(light_path) path, INOUT(reference_sums) sums, int what, vec3 disc)
{
	if (!path.first)
		return;
	path.first = false;
	vec2 air = sky_table_coordinates(path.direction);
	vec3 total = vec3(textureLod(sky_total, air, 0.0));
	vec3 near = vec3(textureLod(sky_near, air, 0.0));
	vec3 to_layer = vec3(textureLod(air_to_layer, air, 0.0));
	vec3 to_end = vec3(textureLod(air_to_end, air, 0.0));
	vec3 passes = path_weight(path, vec3(1.0));
#if REFERENCE_ABOVE
	// From inside the layer cloud overhead is met at once.
	if (what == 0 && path.direction.z > 0.0 && camera_position.z < cloud_layer.x + cloud_layer.y) {
		near = vec3(0.0);
		to_layer = vec3(1.0);
	}
	vec3 behind = max(total - near, vec3(0.0)) * vec3(air_below) + max(to_layer - to_end, vec3(0.0)) * vec3(air_around);
	if (what == 2) {
		reference_add(sums, KIND_SKY, total * passes);
		reference_add(sums, KIND_SUN_DIRECT, disc * passes);
	} else {
		reference_add(sums, KIND_AIR, what == 0 ? near : near + behind * passes);
	}
#else
	if (what == 1) {
		reference_add(sums, KIND_AIR, total * vec3(air_below) + (vec3(1.0) - to_end) * vec3(air_around));
	} else {
		reference_add(sums, KIND_AIR, near * vec3(air_below) + (vec3(1.0) - to_layer) * vec3(air_around));
		if (what == 2)
			reference_add(sums, KIND_SKY, max(total - near, vec3(0.0)) * passes);
	}
	if (what != 1) {
#if VIEW_LARGE_SUN
		reference_add(sums, KIND_SUN_DIRECT, what == 2 ? disc * passes : vec3(0.0));
#else
		vec3 before = sums.light;
		reference_add(sums, KIND_SUN_DIRECT, disc);
		sums.certain = sums.light - before;
#endif
	}
#endif
	path.share = what == 1 ? to_end : to_layer;
	vec3 way = path.place - vec3(0.0, 0.0, camera_position.z);
	reference_keep(sums, KIND_TRANSMITTANCE, what == 0 ? vec3(0.0) : passes);
	reference_keep(sums, KIND_DISTANCE, what == 2 ? vec3(0.0) : vec3(length(way), 1.0, 0.0));
}

// --- the ends of flights ---

void reference_start(INOUT(light_path) path, INOUT(reference_sums) sums, ivec2 pixel, uint number)
{
	uint key = noise_hash(uint(pixel.x) + noise_hash(uint(pixel.y) + noise_hash(uint(arguments[0].z) + 65536u * uint(arguments[0].w))));
	path.random = noise_hash(key + number * 0x85ebca77u);
	vec2 at = vec2(pixel) + vec2(path_even(key, number, 0u, 0xe60e2b72u), path_even(key, number, 1u, 0xcebd76d9u));
	float hero = path_even(key, number, 2u, 0xb9c9aa3au);
	path.hero = hero < PATH_HERO_SHARE.x ? 0 : hero < PATH_HERO_SHARE.x + PATH_HERO_SHARE.y ? 1 : 2;
	path.place = vec3(0.0, 0.0, camera_position.z);
	path.direction = camera_ray(at);
	path.ratio = vec3(1.0);
	path.share = vec3(1.0);
	path.turns = 0;
	path.first = true;
	path.straight = true;
	path.bends = 0.0;
	path.lifted = false;
	path.grounded = 0;
	path.arc = 0.0;
	path.reach = 1.0;
	path.behind = 1.0;
	path.cloudy = ivec2(0);
	path.looked = vec2(1.0);
	path.mean = 0.0;
	path.whole = 0.0;
	path.pick_sum = 0.0;
	sums.light = vec3(0.0);
	sums.certain = vec3(0.0);
	float h = camera_position.z;
	float mu = path.direction.z;
#if REFERENCE_ABOVE
	float top = cloud_layer.x + cloud_layer.y;
	float t = h > top ? sphere_distance_down(h, mu, top) : 0.0;
#else
	float t = mu > sphere_horizon(h) ? sphere_distance_up(h, mu, cloud_layer.x) : -1.0;
#endif
	path.mode = t < 0.0 ? PATH_LEAVES : PATH_LAYER;
	path.place += path.direction * max(t, 0.0);
#if REFERENCE_LAYERS && !REFERENCE_ABOVE
	reference_keep(sums, KIND_OPTICAL_THICKNESS, t < 0.0 ? vec3(0.0) : vec3(extinction.y * path_top(path.place)));
#endif
	if (!camera_shows(at))
		path.mode = PATH_DONE;
}

// Goes on where the search for the sun began.
void reference_resume(INOUT(light_path) path)
{
	path.place = path.kept_place;
	path.direction = path.kept_direction;
	path.mode = path.kept_mode;
}

// A scattering in cloud. Of those since the last search for the sun one is drawn for the next (Talbot, Cline and Egbert 2005, "Importance Resampling for Global Illumination"): by
// the phase function, bounded since the peak is blurred on the way, and by the way straight up to the top here.
void reference_scatter(INOUT(light_path) path)
{
	path.ratio *= vec3(extinction) / path_of_hero(vec3(extinction), path.hero);
	vec3 sun = vec3(sun_direction);
	float mu_sun = clamp(dot(path_up(path.place), sun), -1.0, 1.0);
	float over = max(path.top + cloud_layer.x - path_height(path.place), 0.0);
	float passes = exp(-min(extinction_modified.y * over / max(mu_sun, 0.1), 2.5));
	float worth = passes * (min(phase_full(scattering_half_angle(path.direction, sun)).y, 15.0) + 0.2);
	path.pick_sum += worth;
	if (path_random(path) * path.pick_sum < worth) {
		path.pick_place = path.place;
		path.pick_direction = path.direction;
		path.pick_ratio = path.ratio;
		path.pick_worth = worth;
		path.pick_passes = passes;
		path.pick_kind = KIND_ORDER0 + min(path.turns + 1, 3);
		path.pick_straight = path.straight;
		path.pick_bends = path.bends;
	}
	float share = path_random(path);
	float around = path_random(path);
	path_scatter(path, share, around);
	path.lifted = false;
	path.mode = PATH_LAYER;
}

// The scattering that was drawn looks for the sun.
void reference_look(INOUT(light_path) path)
{
	float height = path_height(path.pick_place);
	float mu_sun = clamp(dot(path_up(path.pick_place), vec3(sun_direction)), -1.0, 1.0);
	path.kept_place = path.place;
	path.kept_direction = path.direction;
	path.kept_mode = path.mode;
	vec3 weight = path_sun_begin(path, path.pick_place, height, mu_sun, path.pick_ratio, REFERENCE_PATIENCE * path.pick_sum / path.pick_passes);
	vec2 half_angle = scattering_half_angle(path.pick_direction, path.direction);
	bool forward = half_angle.x < FORWARD_PEAK_SINE;
	bool counts = !forward || path.pick_straight;
	float bend = path_bend(half_angle.x);
	path.weighed = forward ? vec2(bend, path.pick_bends + bend) : vec2(1.0);
	path.sun = weight * phase_full(half_angle) * (0.25 / PI * path.pick_sum / path.pick_worth) * sun_irradiance(height, mu_sun);
	path.kind = reference_kind(path, forward ? KIND_ORDER0 : path.pick_kind);
	path.pick_sum = 0.0;
	path.place = path.pick_place;
	path.mode = PATH_SUN;
	if (!counts || !(path.sun.x + path.sun.y + path.sun.z > 0.0))
		reference_resume(path);
}

// The first one.
void reference_meet_cloud(INOUT(light_path) path, INOUT(reference_sums) sums, vec3 disc)
{
#if REFERENCE_ABOVE
	reference_keep(sums, KIND_OPTICAL_THICKNESS, vec3(extinction.y * path.top));
#endif
	reference_first(path, sums, 0, disc);
}

#if VIEW_GROUND == 2
// The sea that the camera sees: a path is mirrored by one of its slopes, or goes on as light from below the surface; later ones meet it as ground of the sea's albedo. Slopes, what of
// them the viewer sees, foam and light from below are those of shaders/lib/sea.glsl.
struct reference_sea {
	sea_slopes slopes;
	vec3 to_viewer; // in the frame of the place
	float area;     // of slopes that the viewer sees, over the horizontal one
	vec3 leaving;   // radiance out of the water and by foam, over the irradiance
};

reference_sea reference_sea_at(ground_point point)
{
	reference_sea sea;
	vec2 heading = -point.offset * inversesqrt(max(dot(point.offset, point.offset), 1e-8));
	float sine = sqrt(max(1.0 - point.mu_v * point.mu_v, 1e-6));
	sea.slopes = sea_slopes_at(point.offset, heading, point.across, point.across / point.mu_v);
	sea.to_viewer = vec3(heading * sine, point.mu_v);
	float deviation = sqrt(sea_variance(sea.slopes.covariance, heading));
	float rise = min((point.mu_v / sine + dot(sea.slopes.resolved, heading)) / deviation, 1e6);
	sea.area = max(sine * deviation * normal_ramp(rise), 1e-4);
	sea.leaving = ground_patch.y * (SEA_LEAVING + vec3(SEA_FOAM * sea_state.w / PI));
	return sea;
}

// Of a beam of irradiance 1 normal to it.
vec3 reference_sea_beam(reference_sea sea, vec3 up, vec3 to_light)
{
	float mu = dot(up, to_light);
	vec3 here = normalize(vec3(to_light.x, to_light.y, 0.0) + vec3(0.0, 0.0, mu));
	return mu > 1e-3 ? vec3(ground_patch.y * sea_glint(sea.slopes, sea.to_viewer, here)) + sea.leaving * mu : vec3(0.0);
}

// A direction to go on in; the path's share changes by what comes from there.
vec3 reference_sea_onward(reference_sea sea, vec3 up, INOUT(light_path) path)
{
	float radius = sqrt(-2.0 * log(path_random(path)));
	float around = 2.0 * PI * path_random(path);
	vec2 normal_pair = radius * vec2(cos(around), sin(around));
	vec3 c = sea.slopes.covariance;
	float a = sqrt(max(c.x, 1e-8));
	float b = c.y / a;
	vec2 slope = sea.slopes.resolved + vec2(a * normal_pair.x, b * normal_pair.x + sqrt(max(c.z - b * b, 0.0)) * normal_pair.y);
	vec3 facet = vec3(slope, 1.0);
	float seen = max(dot(facet, sea.to_viewer), 0.0);
	vec3 normal = normalize(facet);
	float cosine = max(dot(normal, sea.to_viewer), 0.0);
	float mirrored = ground_patch.y * sea_fresnel(cosine) * seen / sea.area;
	vec3 direction = 2.0 * cosine * normal - sea.to_viewer;
	direction = normalize(vec3(direction.x, direction.y, max(abs(direction.z), 0.01)));
	float share = path_random(path);
	float even = path_random(path);
	float which = path_random(path);
	float chance = clamp(mirrored / (mirrored + 3.0 * sea.leaving.y), 0.1, 0.95);
	path.share *= which < chance ? vec3(mirrored / chance) : sea.leaving * (PI / (1.0 - chance));
	vec3 lifted = vec3(direction.x, direction.y, 0.0) + up * direction.z;
	return which < chance ? normalize(lifted) : path_turned(up, sqrt(share), sqrt(1.0 - share), 2.0 * PI * even);
}
#endif

// On the ground, t m ahead.
void reference_ground(INOUT(light_path) path, INOUT(reference_sums) sums, float t)
{
	path.place += path.direction * t;
	vec3 up = path_up(path.place);
	float mu_v = clamp(-dot(up, path.direction), 0.002, 1.0);
	float footprint = path.first ? camera_position.w * t * pow(mu_v, -0.75) : 20.0;
	bool again = !path.first;
	path.grounded = path.first ? 2 : max(path.grounded, 1);
	vec3 detail = vec3(1.0, 1.0, 0.0);
	vec2 there = vec2(path.place) + vec2(camera_position);
	ground_point point;
	point.offset = vec2(path.place);
	point.across = camera_position.w * t;
	point.mu_v = mu_v;
	point.mu_sun = clamp(dot(up, vec3(sun_direction)), -1.0, 1.0);
#if VIEW_GROUND == 2
	vec3 reflectance = ground_reflectance_seen(there, footprint);
#else
	// What the camera itself sees has all that the slab's view shows of it.
	if (path.first)
		detail = ground_detail(point);
#if VIEW_GROUND == 3
	vec3 reflectance = ground_ice(ground_reflectance_seen(there + (path.first ? ground_ragged(point) : vec2(0.0)), footprint), footprint);
#else
	vec3 reflectance = ground_reflectance_seen(there, footprint);
#endif
#endif
#if VIEW_GROUND == 1
	reflectance = ground_drier(reflectance, detail.z);
#endif
	reference_first(path, sums, 1, vec3(0.0));
#if VIEW_GROUND == 2
	vec3 before = path.share;
#endif
	path.share *= reflectance * detail.y;
	path.straight = false;
	path.lifted = true;
	path.kind = reference_kind(path, KIND_GROUND);
	float base = cloud_layer.x;
	float mu_sun = clamp(dot(up, vec3(sun_direction)), -1.0, 1.0);
	vec3 entry = path.place + vec3(sun_direction) * sphere_distance_up(0.0, max(mu_sun, 0.0), base);
	path.weighed = vec2(1.0);
	path.sun = path_sun_begin(path, entry, base, max(mu_sun, 0.01), path.ratio, 4.0) * sun_irradiance(0.0, mu_sun);
	float mu_out = dot(up, path.direction);
	vec3 seen_in = vec3(detail.x * max(mu_out, 0.0) / PI);
#if VIEW_GROUND == 2
	reference_sea sea = reference_sea_at(point);
	if (!again)
		seen_in = reference_sea_beam(sea, up, path.direction) / max(reflectance, vec3(1e-9));
#endif
	path.sun *= seen_in;
	// Half of all light starts above 45 degrees: Lambert's law.
	float share = path_random(path);
	float around = path_random(path);
	vec3 onward = path_turned(up, sqrt(share), sqrt(1.0 - share), 2.0 * PI * around);
#if VIEW_GROUND == 2
	if (!again) {
		path.share = before;
		onward = reference_sea_onward(sea, up, path);
	}
#endif
	path.kept_place = path.place + onward * sphere_distance_up(0.0, max(dot(up, onward), 1e-4), base);
	path.kept_direction = onward;
	// Light from the ground to clouds is a small part of what a path shows; on the ground that the camera sees it is most.
	float most = again ? clamp(max(path.share.x, max(path.share.y, path.share.z)), 0.02, 1.0) : 1.0;
	path.share *= path_random(path) < most ? 1.0 / most : 0.0;
	path.kept_mode = path.share.x + path.share.y + path.share.z > 0.0 ? PATH_LAYER : PATH_DONE;
	if (mu_out > 1e-3 && path.sun.x + path.sun.y + path.sun.z > 0.0) {
		path.mode = PATH_SUN;
		path.place += path.direction * sphere_distance_up(0.0, mu_out, base);
	} else {
		reference_resume(path);
	}
}

// Above the layer there is the sky, below it the ground, or the layer again.
void reference_leave(INOUT(light_path) path, INOUT(reference_sums) sums, vec3 disc)
{
	float height = path_height(path.place);
	float mu = clamp(dot(path_up(path.place), path.direction), -1.0, 1.0);
	float t = sphere_distance_down(height, mu, 0.0);
	if (height > cloud_layer.x + 0.5 * cloud_layer.y) {
		path.mode = PATH_DONE;
		if (path.first) {
			reference_first(path, sums, 2, disc);
		} else {
			vec3 from_layer = path_sky(sky_at_layer, cloud_layer.x + cloud_layer.y, path.place, path.direction);
			vec3 from_ground = path_sky(sky_at_ground, 0.0, path.place, path.direction);
			reference_add(sums, reference_kind(path, KIND_CLOUD_SKY), path_weight(path, vec3(1.0)) * (path.lifted ? from_ground : from_layer));
		}
	} else if (t >= 0.0) {
		reference_ground(path, sums, t);
	} else {
		path.place += path.direction * max(sphere_distance_up(height, mu, cloud_layer.x), 0.0);
		path.mode = PATH_LAYER;
	}
}

// --- flights ---

// A step through the layer: to the next place where something may happen.
void reference_step(INOUT(light_path) path)
{
	bool searches = path.mode == PATH_SUN;
	float largest = path_largest_extinction();
	float mu = dot(path_up(path.place), path.direction);
	float over = path_height(path.place) - cloud_layer.x - path_bound(path.place);
	// Nothing stands so high around here: on to where it might, or to where the search expects cloud.
	int part = path_part_at(path.arc / path.reach);
	bool empty = over > 1.0 && !(searches && path_part_cloudy(path.cloudy.x, part));
	float reach = field_warp_reach(vec2(path.place) / cloud_layer.z) * cloud_layer.z / PATH_BOUNDS_SIZE / max(length(vec2(path.direction)), 1e-3);
	float t = -log(path_random(path)) / largest;
	if (empty) {
		t = mu < 0.0 ? min(reach, over / -mu) : reach;
		if (searches && part < PATH_PARTS - 1)
			t = min(t, path_part_start(part + 1) * path.reach - path.arc + 0.1);
	}
	bool collided = true;
	if (searches && path.arc + t >= path.next) {
		t = max(path.next - path.arc, 0.0);
		collided = false;
	}
	path.place += path.direction * t;
	path.arc += t;
	float height = path_height(path.place) - cloud_layer.x;
	// Not beyond the layer's end.
	float beyond = height < 0.0 ? height : max(height - cloud_layer.y, 0.0);
	path.arc -= clamp(beyond / (abs(mu) < 1e-4 ? 1e-4 : mu), 0.0, t);
	path.top = path_top(path.place);
	bool inside = height >= 0.0 && height < path.top;
	if (height < 0.0 || height > cloud_layer.y) {
		path.mode = searches ? PATH_ARRIVES : PATH_LEAVES;
	} else if (searches) {
		if (!collided && inside)
			path.mode = PATH_TURNS;
		else if (!collided || (!empty && !path_sun_collides(path, inside, largest)))
			reference_resume(path);
	} else if (!empty && inside) {
		float hero = path_of_hero(vec3(extinction), path.hero);
		if (path_random(path) * largest < hero)
			path.mode = PATH_SCATTERS;
		else
			path.ratio *= (vec3(largest) - vec3(extinction)) / max(largest - hero, 1e-12);
	}
}

void pass(ivec2 pixel)
{
	reference_sums sums;
	sums.color = vec3(0.0);
	sums.chance = vec3(0.0);
	sums.squares = vec3(0.0);
#if REFERENCE_LAYERS
	sums.layer_0 = vec3(0.0);
	sums.layer_1 = vec3(0.0);
	sums.layer_2 = vec3(0.0);
	sums.layer_3 = vec3(0.0);
	sums.layer_4 = vec3(0.0);
#endif
	vec3 disc = vec3(sun_at_camera) * sun_disc_share(pixel);
	uint number = uint(arguments[0].x);
	uint end = number + uint(arguments[0].y);
	light_path path;
	path.mode = PATH_START;
	while (number < end) {
		if (path.mode == PATH_START)
			reference_start(path, sums, pixel, number);
		for (int i = 0; i < REFERENCE_SCATTERINGS; i++) {
			for (int k = 0; k < REFERENCE_STEPS; k++)
				if (path.mode == PATH_LAYER || path.mode == PATH_SUN)
					reference_step(path);
			if (path.mode == PATH_TURNS)
				path_sun_turns(path);
			// The first is left to the end of this, for all that comes with it.
			if (path.mode == PATH_SCATTERS && !path.first)
				reference_scatter(path);
		}
		if (path.mode == PATH_ARRIVES) {
			reference_add(sums, path.kind, path_sun_arrives(path));
			reference_resume(path);
		} else if (path.pick_sum > 0.0 && path.mode != PATH_SUN && path.mode != PATH_TURNS) {
			reference_look(path);
		}
		if (path.mode == PATH_SCATTERS && path.first)
			reference_meet_cloud(path, sums, disc);
		if (path.mode == PATH_LEAVES && path.pick_sum == 0.0)
			reference_leave(path, sums, disc);
		if (path.mode == PATH_DONE) {
			// Weights of ways to a sun at the horizon can leave the range of numbers.
			if (!(abs(sums.light.x) + abs(sums.light.y) + abs(sums.light.z) < 1e12))
				sums.light = sums.certain;
			vec3 rgb = colour_of_bands(sums.light);
			sums.color += rgb;
			rgb = colour_of_bands(sums.light - sums.certain);
			sums.chance += rgb;
			sums.squares += rgb * rgb;
			path.mode = PATH_START;
			number += 1u;
		}
	}
	STORE(0, vec4(sums.color, arguments[0].y));
	STORE(1, vec4(sums.chance, 0.0));
	STORE(2, vec4(sums.squares, 0.0));
#if REFERENCE_LAYERS
	STORE(3, vec4(sums.layer_0, 0.0));
	STORE(4, vec4(sums.layer_1, 0.0));
	STORE(5, vec4(sums.layer_2, 0.0));
	STORE(6, vec4(sums.layer_3, 0.0));
	STORE(7, vec4(sums.layer_4, 0.0));
#endif
}
