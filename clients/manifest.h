/* What a folder of pictures holds: a JSON object a line, by name. Lines are appended as pictures are made, so that after an interruption it
 * is known what need not be made again; at the end the file is written anew, in order. One thread. */
#ifndef STRATUS_CLIENTS_MANIFEST_H
#define STRATUS_CLIENTS_MANIFEST_H

#include <jansson.h>
#include <stdbool.h>

struct manifest;

/* Reads what there is, where a last line may be broken. NULL after a message. */
struct manifest *manifest_open(const char *path);

/* What was last said of a name; borrowed, NULL when nothing was. */
const json_t *manifest_find(const struct manifest *manifest, const char *name);

/* Appends an entry (its reference is taken, NULL too) with a member `name`. false after a message. */
bool manifest_add(struct manifest *manifest, json_t *entry);

/* Puts the lines in the order in which `name(context, i)` gives them; others stand before. false after a message. */
bool manifest_sort(struct manifest *manifest, const char *(*name)(const void *context, int i), const void *context, int count);

/* Takes NULL. */
void manifest_close(struct manifest *manifest);

#endif
