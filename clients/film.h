/* A film that ffmpeg encodes from PNG frames, at its place when it is whole. */
#ifndef STRATUS_CLIENTS_FILM_H
#define STRATUS_CLIENTS_FILM_H

#include <stdbool.h>
#include <stddef.h>

struct film;

/* Does the name end as a film's does: .mp4 (H.264) or .webm (VP9)? */
bool film_is_named(const char *path);

/* Starts ffmpeg, which is found by PATH. comment: text for the file's metadata. NULL after a message. */
struct film *film_begin(const char *path, double frames_per_s, const char *comment);

/* The next frame, a PNG file. false after a message. */
bool film_add(struct film *film, const void *png, size_t size);

/* Ends the film; `whole` false throws it away. An enum client_exit, after a message when it is not CLIENT_OK. Takes NULL. */
int film_end(struct film *film, bool whole);

#endif
