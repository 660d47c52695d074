/* Whether finished pictures can be written: when several could not, one after the other, a small picture is written now and then, and until
 * that succeeds the service is not ready. Zero: all is well.
 */
#ifndef STRATUS_SERVER_ENCODER_CARE_H
#define STRATUS_SERVER_ENCODER_CARE_H

#include "renderer/image/image.h"

#include <stdbool.h>

struct encoder_care {
	_Atomic int failures; /* on end */
	_Atomic bool is_broken;
	double tried_ms; /* of the thread that looks */
};

/* A picture could be written, or could not though somebody waited for it. Any thread. */
void encoder_care_note(struct encoder_care *care, bool could);

/* Tries a small picture where that is called for, which takes about a millisecond; now and then, by one thread. */
void encoder_care_look(struct encoder_care *care, const struct image_api *images);

/* Any thread. */
bool encoder_care_is_broken(const struct encoder_care *care);

#endif
