/* The body of /v1/compare: a scene, what its variants change in it, and where they are compared. Any thread.
 *
 * {"scene": {...}, "variants": [{"name": "paper", "model": {"shading": "paper"}}, ...], "reference": "paper", "regions": ["cloud", ...]}
 *
 * A variant is the scene with the variant's own members laid over it as a JSON merge patch (RFC 7396: null takes a member away).
 */
#ifndef STRATUS_SERVER_COMPARE_QUERY_H
#define STRATUS_SERVER_COMPARE_QUERY_H

#include "server/problem.h"
#include "server/scene_fields.h"

#include <jansson.h>

enum {
	COMPARE_VARIANTS_MIN = 2,
	COMPARE_VARIANTS_MAX = 4,
	COMPARE_REGIONS_MAX = 16,
	COMPARE_NAME_SIZE = 33,
	COMPARE_PIXELS_MAX = 16 << 20 /* over all variants: their light is held in memory until they are compared */
};

struct compare_region {
	char name[COMPARE_NAME_SIZE];
	uint8_t bits;      /* of enum region_bit (renderer/image/regions.h); REGION_ALL of a rectangle */
	bool is_rectangle; /* then in pixels, from the upper left corner */
	int x, y, width, height;
};

struct compare_variant {
	char name[COMPARE_NAME_SIZE];
	struct scene_input input; /* its output is an EXR of the layers that are compared */
};

struct compare_query {
	struct compare_variant variant[COMPARE_VARIANTS_MAX];
	int variant_count;
	int truth; /* the one that the others are held against */
	struct compare_region region[COMPARE_REGIONS_MAX];
	int region_count;
	bool has_masks; /* a region needs to know what is cloud, sky and ground */
};

/* Reads a body and applies the rules of scenes to every variant, but for what their assets hold. All that is wrong is added to the problem,
 * by its place in the body. */
void compare_query_read(const json_t *root, struct compare_query *query, struct problem *problem);

/* Where a member of a variant's scene stands in the body: in the variant when that changes it, else in the scene. */
void compare_query_pointer(const json_t *root, int variant, const char *member, char *pointer, size_t size);

/* Adds what is wrong with a variant's scene to the problem of the body. */
void compare_query_add(const json_t *root, int variant, const struct problem *of_scene, struct problem *problem);

/* The scene whose layers tell cloud, sky and ground: the truth's as a slab. A render of its own, since a picture that is rendered beside
 * other layers differs in its last digits from the one that people see. */
struct scene compare_query_mask(const struct compare_query *query);

#endif
