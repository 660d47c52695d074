/* Names for the variants of a comparison that were given none: each says what it changes. Any thread. */
#ifndef STRATUS_SERVER_VARIANT_NAME_H
#define STRATUS_SERVER_VARIANT_NAME_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>

/* Does a merge patch leave all sections alone but the model? */
bool variant_changes_only_model(const json_t *patch);

/* The members that a patch sets and their values, "radiosity-enabled-false", in letters, digits, '-' and '_'; without the names of sections
 * where it would not fit (size, with the NUL); what does not even so is left out whole, "coverage-0_4-seed-5-and-2-more". "" when the patch
 * changes nothing. */
void variant_name_of_patch(const json_t *patch, char *name, size_t size);

#endif
