// Low views from below, to which clouds stand: their sides are seen before their bases. What such a view meets is followed from the base of the layer to its top, and so is the sun's beam
// to what is seen there. Light is that of shaders/lib/side_light.glsl, but of a side it is its own, not that of the columns around it.
#ifndef SHADERS_LIB_SIDE_LOW
#define SHADERS_LIB_SIDE_LOW
#include "shaders/lib/camera.glsl"
#include "shaders/lib/side_light.glsl"

// Cosines of the view to the vertical up to which all, and from which on nothing, is seen so; renderer/stages/view_rows.c has them too.
const float SIDE_LOW_ALL = 0.3;
const float SIDE_LOW_NONE = 0.34;

// Decided when the shader is built: are all views low (1), some (2) or none (0)?
#ifndef SIDE_LOW
#define SIDE_LOW 0
#endif

// Steps along the view from the base to the top are this share of the layer's height across, and so often twice as long that there are about so many.
const float SIDE_LOW_ACROSS = 0.4;
const float SIDE_LOW_STEPS = 24.0;
const int SIDE_LOW_SUN_STEPS = 2;
// Octaves by which texels of the tops are smaller than a step along the view.
const float SIDE_LOW_SHARP = 1.0;
// Detail, which is of the thickness, is so much more of a side.
const float SIDE_LOW_ROUGHER = 2.0;
// Height, of that of the layer, from which on what is met is side.
const float SIDE_LOW_UPRIGHT = 0.2;
// Up a side the view becomes square to it, and light its own, over such heights, of that of the layer: light that is scattered often knows no edge between base and side.
const float SIDE_LOW_SQUARE_OVER = 0.25;
const float SIDE_LOW_OWN_OVER = 0.7;
// What is seen belongs to a cloud so thick at least, of what the view meets.
const float SIDE_LOW_WHOLE = 0.5;
// Share of its own light that what lies at the base has; the rest is spread sideways, and fades out upwards.
const float SIDE_LOW_OWN = 0.2;
// A lit side sends back what the cloud behind it does, not what lies right below it alone: so much of how thick that is so far behind, in shares of the layer's height.
const float SIDE_LOW_BEHIND = 0.7;
const float SIDE_LOW_BEHIND_FAR = 0.5;
const float SIDE_LOW_BEHIND_WIDE = 0.3; // over which that is a mean
// What falls on a surface as it faces the sun, of what falls on a horizontal one.
const vec2 SIDE_LOW_FACING = vec2(0.8, 1.6);
// What is seen of a side lies inside by so much, on the sun's beam and along the vertical, m: single pixels at crests, where no cloud is before them, would glitter.
const float SIDE_LOW_INSIDE = 6.0;
// Of the base of one cloud and the side of another behind it, that is left out of which less than this share is seen.
const float SIDE_LOW_OTHER = 0.04;
// Within a pixel, heights that differ by more than up to twice as much are those of different clouds, m.
const float SIDE_LOW_APART = 20.0;
// Row (shaders/lib/sky_table.glsl) of views under which slabs look as sides do, which are seen more squarely than any base.
const float SIDE_LOW_SQUARE = 0.6;

// Share of what is seen so.
float side_low_share(float mu_v)
{
	return 1.0 - smoothstep(SIDE_LOW_ALL, SIDE_LOW_NONE, mu_v);
}

// What a low view meets, but for detail. A pixel covers a long strip of the layer, in which edges are passed: it is two views, of its lower and its upper half.
struct side_low {
	vec2 thickness; // m along the vertical that hide as much, of either
	float sharpness; // extinction along the view per m of it
	float height;    // m over the base, where the cloud begins of which most is seen: the mean of several may lie in none
	vec2 place;      // m, of that
	float other;     // share in what is seen, 0 to 0.5, of a side where most is a base, and of a base where most is a side
	float other_height;
	vec2 other_place;
};

// place: where the view meets the base, m; heading: of the view, any length; mu_v: its cosine to the vertical; footprint: of the pixel, m.
side_low side_low_at(vec2 place, vec2 heading, float mu_v, float footprint)
{
	vec2 flat_view = heading * inversesqrt(max(dot(heading, heading), 1e-12));
	float strip = camera_strip(footprint, mu_v);
	// Steeper views are none of these, but are followed before that is known.
	float slope = max(sqrt(max(1.0 - mu_v * mu_v, 0.0)) / mu_v, 1.0);
	// Steps end at distances that are the same for neighbouring pixels: a crest that one of them looks at all look at, and none sees it pass between two steps.
	float stride = max(SIDE_LOW_ACROSS * cloud_layer.y, 1.0) * exp2(max(floor(log2(slope / (SIDE_LOW_ACROSS * SIDE_LOW_STEPS)) + 0.5), 0.0));
	vec2 base = vec2(dot(place - vec2(camera_position), flat_view)) + vec2(-0.25, 0.25) * strip;
	vec2 next = (floor(base / stride) + 1.0) * stride - base;
	float level = max(log2(max(stride, footprint) * SIDE_SIZE / cloud_layer.z) - SIDE_LOW_SHARP, 0.0);
	float sharpness = extinction_scaled.y / mu_v;
	vec4 chosen = packed_chosen(int(SIDE_SIZE), floor(level + 0.5));
	float texels = chosen.x / cloud_layer.z;
	vec2 ahead = flat_view * texels;
	vec2 p = field_place(place) * texels - ahead * (0.25 * strip);
	vec2 q = p + ahead * (0.5 * strip);
	vec2 from = vec2(packed_linear_of(thickness_packed, p, chosen), packed_linear_of(thickness_packed, q, chosen));
	vec2 none = SIDE_NONE * max(vec2(1.0) - 10.0 * slope / stride * from, vec2(0.0));
	vec2 thickness = vec2(0.0);
	vec2 clear = vec2(1.0);
	vec2 begins = vec2(0.0);
	vec2 part = vec2(0.0); // seen of the cloud that begins there
	vec2 base_part = vec2(0.0); // seen of a cloud whose base is met
	vec2 most = vec2(0.0);      // seen of any one cloud whose side is met
	vec2 height = vec2(0.0);    // where that begins
	vec2 z = vec2(0.0);
	vec2 dz = next / slope;
	for (float left = cloud_layer.y * slope / stride + 1.0; left > 0.0; left -= 1.0) {
		p += ahead * next.x;
		q += ahead * next.y;
		z += dz;
		vec2 to = vec2(packed_linear_of(thickness_packed, p, chosen), packed_linear_of(thickness_packed, q, chosen)) - z;
		// Where cloud begins above a base that is clear, the side leans out as far as it may.
		from -= mix(vec2(0.0), none, greaterThan(to, vec2(0.0)));
		none = vec2(0.0);
		vec2 filled = dz * (max(from, vec2(0.0)) + max(to, vec2(0.0))) / (abs(from) + abs(to) + 1e-3);
		vec2 passed = clear * exp(-filled * sharpness);
		begins = mix(z - filled, begins, greaterThan(from, vec2(0.0)));
		part = clear - passed + mix(vec2(0.0), part, greaterThan(from, vec2(0.0)));
		vec2 sides = part * step(vec2(1e-3), begins);
		base_part = max(base_part, part - sides);
		height = mix(height, begins, greaterThan(sides, most));
		most = max(most, sides);
		clear = passed;
		thickness += filled;
		from = to;
		next = vec2(stride);
		dz = vec2(stride / slope);
	}
	side_low view;
	view.thickness = thickness;
	view.sharpness = sharpness;
	// Of both, but of one where these are places of two clouds.
	float upper = most.y / (most.x + most.y + 1e-6);
	upper = mix(upper, step(0.5, upper), clamp(abs(height.x - height.y) / SIDE_LOW_APART - 1.0, 0.0, 1.0));
	float side_height = mix(height.x, height.y, upper);
	vec2 side_place = place + flat_view * (slope * side_height + (upper - 0.5) * 0.5 * strip);
	vec2 base_place = place + flat_view * ((base_part.y / (base_part.x + base_part.y + 1e-6) - 0.5) * 0.5 * strip);
	float side = (most.x + most.y) / (most.x + most.y + base_part.x + base_part.y + 1e-6);
	bool mostly = side > 0.5;
	view.height = mostly ? side_height : 0.0;
	view.place = mostly ? side_place : base_place;
	view.other = min(side, 1.0 - side);
	view.other_height = mostly ? 0.0 : side_height;
	view.other_place = mostly ? base_place : side_place;
	return view;
}

// Of a place and a height over the base. x, y: cloud on the sun's beam before and behind it, m along the vertical; z: what falls on the top there, of what falls on a horizontal one.
vec3 side_low_beam(vec2 uv, float height)
{
	vec2 slope = height_sun_heading() / (height_sun_rise() * cloud_layer.z);
	float up = (cloud_layer.y - height) / float(SIDE_LOW_SUN_STEPS);
	float down = height / float(SIDE_LOW_SUN_STEPS);
	vec2 passed = vec2(0.0);
	float rises = 0.0;
	for (int i = 0; i < SIDE_LOW_SUN_STEPS; i++) {
		float above = up * (float(i) + 0.5);
		float below = -down * (float(i) + 0.5);
		float ahead = packed_linear(thickness_packed, uv + slope * above, int(SIDE_SIZE), 0.0);
		float behind = packed_linear(thickness_packed, uv + slope * below, int(SIDE_SIZE), 0.0);
		passed.x += clamp(ahead - height - above + 0.5 * up, 0.0, up);
		passed.y += clamp(behind - height - below + 0.5 * down, 0.0, down);
		rises += i == 0 ? ahead - behind : 0.0;
	}
	return vec3(passed, 1.0 - rises * 2.0 / max(up + down, 1e-3));
}

// thickness: at view.place, with all detail, m.
side_lit side_low_lit(side_low view, float footprint, float thickness)
{
	vec2 uv = field_place(view.place) / cloud_layer.z;
	float level = max(log2(footprint * SIDE_SIZE / cloud_layer.z), 0.0);
	vec4 light = textureLod(side_light, uv, level);
	vec3 beam = side_low_beam(uv, view.height);
	// A layer may be of no height.
	float height = view.height / max(cloud_layer.y, 1e-3);
	float upright = min(height / SIDE_LOW_UPRIGHT, 1.0);
	float base = packed_linear(thickness_packed, uv, int(SIDE_SIZE), floor(level + 0.5));
	float detail = (thickness - base) * mix(1.0, SIDE_LOW_ROUGHER, upright);
	side_lit lit;
	lit.upright = 1.0 - exp(-height / SIDE_LOW_SQUARE_OVER);
	vec2 met = clamp(view.thickness + detail * view.thickness / (view.thickness + abs(detail) + 1e-3), vec2(0.0), vec2(cloud_layer.y));
	// What lets through as much as both do at the mean, and what there is where cloud is.
	lit.thickness = min(met.x, met.y) - log(0.5 + 0.5 * exp(-abs(met.x - met.y) * view.sharpness)) / view.sharpness;
	vec2 hidden = vec2(1.0) - exp(-met * view.sharpness);
	lit.inside = dot(met, hidden) / max(hidden.x + hidden.y, 1e-3);
	lit.sun = mix(side_beam(max(base + detail, 0.0), base, light.w), max(beam.x + detail, SIDE_LOW_INSIDE), upright);
	float spread = slab_light.w * lit.inside;
	float column = mix(lit.inside, light.x, spread / (1.0 + spread));
	lit.smooth_m = max(max(beam.x + beam.y, column), SIDE_LOW_WHOLE * min(max(view.thickness.x, view.thickness.y), cloud_layer.y));
	vec2 behind = uv - height_sun_heading() * (SIDE_LOW_BEHIND_FAR * cloud_layer.y / cloud_layer.z);
	float wide = log2(max(SIDE_LOW_BEHIND_WIDE * cloud_layer.y * SIDE_SIZE / cloud_layer.z, 1.0));
	float mass = packed_linear(thickness_packed, behind, int(SIDE_SIZE), floor(wide + 0.5));
	lit.smooth_m = max(lit.smooth_m, mix(lit.smooth_m, mass, SIDE_LOW_BEHIND * upright));
	float through = side_transmitted(lit.smooth_m);
	float back = (1.0 - through) * clamp(beam.z, SIDE_LOW_FACING.x, SIDE_LOW_FACING.y);
	// Where parts of several clouds are seen and the place at their mean has less cloud around it than that: as much of either end for what is not known.
	vec2 ends = vec2(beam) / max(lit.smooth_m, 1.0);
	float own = mix(back, through, ends.x + 0.5 * max(1.0 - ends.x - ends.y, 0.0));
	lit.light = mix(own, light.y, (1.0 - SIDE_LOW_OWN) * exp(-height / SIDE_LOW_OWN_OVER)) / through;
	return lit;
}

// The other thing in what is seen, to be lit as the first.
side_low side_low_other(side_low view)
{
	view.height = view.other_height;
	view.place = view.other_place;
	return view;
}

// share: of b. x: in what hides; y: in what is seen.
side_lit side_both(side_lit a, side_lit b, vec2 share)
{
	a.inside = mix(a.inside, b.inside, share.x);
	a.thickness = mix(a.thickness, b.thickness, share.x);
	a.sun = mix(a.sun, b.sun, share.y);
	a.smooth_m = mix(a.smooth_m, b.smooth_m, share.y);
	a.light = mix(a.light, b.light, share.y);
	a.upright = mix(a.upright, b.upright, share.y);
	return a;
}

// Of a view that is low in part: `share` of b, by how much cloud either sees. Where one sees none, light is the other's.
side_lit side_mixed(side_lit a, side_lit b, float share)
{
	float of_b = share * b.thickness;
	// Not divided by the mean that mix() gives, which differs from it by rounding where b has hardly any cloud.
	return side_both(a, b, vec2(share, of_b / ((1.0 - share) * a.thickness + of_b + 1e-6)));
}

// Row of the slab's light that such a place shows, of the row of the view; both from 0 (horizon) to 1 (zenith).
float side_low_row(float row, float upright)
{
	return mix(row, max(row, SIDE_LOW_SQUARE), upright);
}

// Share of the sky's diffuse light in what it shows, the rest being from below: a side has half of either before it.
float side_low_sky(float share, float upright)
{
	return mix(share, 0.5, upright);
}
#endif
