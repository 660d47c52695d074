/* The table of everything a scene may say. It drives the JSON body, the dotted members of a query, the canonical form and the query that
 * stands for a scene; openapi.yaml is tested against what it enforces. Read-only, any thread.
 */
#ifndef STRATUS_SERVER_SCENE_FIELDS_H
#define STRATUS_SERVER_SCENE_FIELDS_H

#include "renderer/scene.h"

#include <stddef.h>

enum field_type {
	FIELD_NUMBER,         /* double */
	FIELD_NUMBER_OR_AUTO, /* double, or the word "auto", noted in the bool at auto_offset */
	FIELD_NUMBERS,        /* double[count] */
	FIELD_INTEGER,        /* int */
	FIELD_SEED,           /* uint32_t */
	FIELD_BOOLEAN,        /* bool */
	FIELD_CHOICE,         /* an enumeration, by `choices` */
	FIELD_CHOICES,        /* uint32_t bit set, by `choices` */
	FIELD_TIME,           /* RFC 3339 text, kept as a Julian day in a double */
	FIELD_NAME,           /* char[SCENE_NAME_MAX] */
	FIELD_ASSET,          /* likewise, the name of an asset; "": none */
	FIELD_HASH            /* char[SCENE_HASH_SIZE], what the asset beside it must hold; "": whatever it does */
};

enum field_flag {
	FIELD_POWER_OF_TWO = 1, /* an integer that must be one */
	FIELD_INPUT_ONLY = 2,   /* another form of other members: never in the canonical form */
	FIELD_LATER = 4         /* known, but not in this release */
};

struct field_range {
	double low, high; /* inclusive */
};

struct scene_field {
	const char *section, *name;
	enum field_type type;
	size_t offset; /* in struct scene_input */
	size_t auto_offset;
	struct field_range range[3]; /* of each element; of a single value the first */
	int count;                   /* elements of FIELD_NUMBERS */
	unsigned flags;
	const char *const *choices;
	unsigned choices_later; /* bit set of choices that are not in this release */
};

/* What a request said: the scene (members not given hold their defaults), the members that are other forms of some, and which were
 * given. */
struct scene_input {
	struct scene scene;
	double characteristic_radius_um;
	uint64_t given; /* bit i: scene_fields[i] was given, valid or not */
};

/* Members of a section stand together; ends with a NULL section. */
extern const struct scene_field scene_fields[];

struct scene_input scene_input_default(void);

/* NULL when there is no such member. */
const struct scene_field *scene_field_find(const char *section, const char *name);
bool scene_section_exists(const char *section);

bool scene_field_given(const struct scene_input *input, const struct scene_field *field);
void scene_field_mark_given(struct scene_input *input, const struct scene_field *field);

/* The index of a name in a NULL-ended list, or -1. */
int name_index(const char *const *names, const char *name);

#endif
