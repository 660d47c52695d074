/* Numbers as text: the shortest decimal that reads back as the same double, and strict reading. Any thread.
 *
 * The layout is that of ECMAScript (and so of RFC 8785, canonical JSON): plain digits between 1e-6 and 1e21, an exponent elsewhere.
 */
#ifndef STRATUS_SERVER_NUMBER_TEXT_H
#define STRATUS_SERVER_NUMBER_TEXT_H

#include <stdbool.h>

enum { NUMBER_TEXT_SIZE = 48 };

/* value must be finite. Minus zero is written as 0. */
void number_format(double value, char text[static NUMBER_TEXT_SIZE]);

/* Reads a number by the grammar of JSON and nothing else. false when it is none, or is too large for a double. */
bool number_parse(const char *text, double *value);

#endif
