/* What a load asks for: kinds of requests by weight, each a fixed one or a scene some members of which are drawn anew every time. One
 * thread.
 *
 * A file of JSON objects, one a line; lines that begin with # are remarks:
 *   {"name": "hot", "weight": 3, "scene": {"sun": {"elevation_deg": 30}}}
 *   {"name": "new sky", "scene": {}, "vary": {"sun.elevation_deg": [5.0, 60.0]}}
 *   {"name": "probe", "path": "/healthz"}
 * A member is drawn evenly between its two bounds; between whole numbers it stays whole.
 */
#ifndef STRATUS_CLIENTS_BENCH_MIX_H
#define STRATUS_CLIENTS_BENCH_MIX_H

#include "clients/client.h"

#include <jansson.h>
#include <stddef.h>
#include <stdint.h>

enum { MIX_KINDS_MAX = 32, MIX_NAME_SIZE = 64 };

struct mix;

/* A request as it goes over the wire. */
struct mix_request {
	int kind; /* index, for mix_kind_name */
	char *bytes;
	size_t size;
	bool shared; /* the mix keeps it; else the taker frees bytes */
};

/* Reads a file ("-": standard input). An enum client_exit, after a message when it is not CLIENT_OK; *mix is then NULL. */
int mix_read(const char *path, struct mix **mix);
/* One kind: a scene with members that are drawn, as a line of a file has them (the references stay the caller's), or a path that is
 * fetched. NULL when out of memory, or after a message when the scene cannot have such a member. */
struct mix *mix_of_scene(const json_t *scene, const json_t *vary);
struct mix *mix_of_path(const char *path);
/* Takes NULL. */
void mix_destroy(struct mix *mix);

/* Before the first draw of a load: the Host that requests name, more header lines (each with its CRLF, or ""), and where the draws begin.
 * false when out of memory. */
bool mix_prepare(struct mix *mix, const char *host, const char *headers, uint64_t seed);

int mix_kind_count(const struct mix *mix);
const char *mix_kind_name(const struct mix *mix, int kind);

/* The next request; false when out of memory. */
bool mix_draw(struct mix *mix, struct mix_request *request);
void mix_request_finish(struct mix_request *request);

#endif
