/* The keys in force, what their holders may ask for, and what they did. Any thread. */
#ifndef STRATUS_SERVER_API_KEYS_H
#define STRATUS_SERVER_API_KEYS_H

#include "server/key_file.h"

#include <stdint.h>

enum api_key_limit { KEY_LIMIT_REQUESTS, KEY_LIMIT_MEGAPIXELS, KEY_LIMIT_COUNT };

/* Since the start, or since the key came. */
struct api_key_counts {
	unsigned long requests, refused[KEY_LIMIT_COUNT];
	double pixels; /* of pictures that were sent, layers counted apart */
};

struct api_keys;

/* path: the file of keys; NULL: none are asked for. NULL (and lines of the log) when it cannot be used. */
struct api_keys *api_keys_create(const char *path);
void api_keys_destroy(struct api_keys *keys);

/* Are requests without a key refused? */
bool api_keys_are_asked_for(const struct api_keys *keys);

/* Reads the file again: keys that are in it no more are no keys from now on, those that are keep their counts and what they have used up.
 * false (and lines of the log) when it cannot be used: then nothing changes. */
bool api_keys_reload(struct api_keys *keys);

/* The name of a key that is shown; false when it is none. As long as it takes whatever keys there are. */
bool api_keys_find(struct api_keys *keys, const char *shown, char name[static KEY_NAME_SIZE]);

/* Takes from what a key may have; 0, or the milliseconds after which there is enough. A name that is no key any more may take what it
 * likes: it was one when its request came. */
double api_keys_take(struct api_keys *keys, const char *name, enum api_key_limit limit, double amount);
void api_keys_give_back(struct api_keys *keys, const char *name, enum api_key_limit limit, double amount);

/* Counts an answer. name: empty for a request without a key. */
void api_keys_count(struct api_keys *keys, const char *name, double pixels);

/* Visits the counts of all keys, and first those of requests without one as of the key "anonymous". */
void api_keys_visit(struct api_keys *keys, void (*visit)(void *context, const char *name, const struct api_key_counts *counts),
		    void *context);

#endif
