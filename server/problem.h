/* What goes wrong towards the client, as RFC 9457 `application/problem+json`.
 *
 * A problem gathers everything that is wrong with a request before it is answered. It is filled by one thread at a time.
 */
#ifndef STRATUS_SERVER_PROBLEM_H
#define STRATUS_SERVER_PROBLEM_H

#include <stdbool.h>
#include <stddef.h>

enum problem_kind {
	PROBLEM_NONE,
	PROBLEM_NOT_JSON,       /* 400, with line and column */
	PROBLEM_BAD_REQUEST,    /* 400, a malformed query or header */
	PROBLEM_NO_KEY,         /* 401 */
	PROBLEM_BAD_KEY,        /* 401 */
	PROBLEM_NOT_FOUND,      /* 404 */
	PROBLEM_METHOD,         /* 405 */
	PROBLEM_NOT_ACCEPTABLE, /* 406 */
	PROBLEM_PRECONDITION,   /* 412 */
	PROBLEM_READ_TIMEOUT,   /* 408, of what was read so far */
	PROBLEM_TOO_LARGE,      /* 413 */
	PROBLEM_TARGET,         /* 414 */
	PROBLEM_MEDIA_TYPE,     /* 415 */
	PROBLEM_INVALID,        /* 422, with `errors` */
	PROBLEM_BAD_ASSET,      /* 422 */
	PROBLEM_ALLOWANCE,      /* 429 */
	PROBLEM_HEADERS,        /* 431 */
	PROBLEM_INTERNAL,       /* 500 */
	PROBLEM_RENDER_FAILED,  /* 500 */
	PROBLEM_QUEUE_FULL,     /* 503 */
	PROBLEM_TRACINGS_FULL,  /* 503 */
	PROBLEM_COMPUTERS_FULL, /* 503 */
	PROBLEM_PREDICTED_LATE, /* 503 */
	PROBLEM_MEMORY_LIMIT,   /* 503 */
	PROBLEM_CONNECTIONS,    /* 503 */
	PROBLEM_NO_MEMORY,      /* 503 */
	PROBLEM_STARTING,       /* 503 */
	PROBLEM_SHUTTING_DOWN,  /* 503 */
	PROBLEM_UPLOADS_FULL,   /* 503 */
	PROBLEM_UNAVAILABLE,    /* 503 */
	PROBLEM_DEADLINE,       /* 504 */
	PROBLEM_VERSION,        /* 505 */
	PROBLEM_STORAGE_FULL,   /* 507 */
	PROBLEM_KIND_COUNT
};

/* As many errors as are listed; a hostile body may hold a hundred thousand. */
enum { PROBLEM_ERRORS_MAX = 64, PROBLEM_DETAIL_SIZE = 256 };

struct problem_error {
	char *pointer; /* JSON pointer (RFC 6901) of the bad member, "" the whole document */
	char *detail;
};

/* Zero is no problem. */
struct problem {
	enum problem_kind kind;
	char detail[PROBLEM_DETAIL_SIZE];
	struct problem_error errors[PROBLEM_ERRORS_MAX];
	double predicted_ms; /* until the answer would have been there; 0: not said */
	bool says_queue;     /* and the renders that wait */
	size_t queue_depth;
	size_t error_count; /* may exceed PROBLEM_ERRORS_MAX: the rest was only counted */
};

void problem_finish(struct problem *problem);

/* States the problem. The first statement wins, so that a cause is not covered by what follows from it. */
__attribute__((format(printf, 3, 4))) void problem_set(struct problem *problem, enum problem_kind kind, const char *format, ...);

/* Adds a bad member and makes the problem PROBLEM_INVALID. A pointer that is listed already keeps its first detail. */
__attribute__((format(printf, 3, 4))) void problem_add(struct problem *problem, const char *pointer, const char *format, ...);

/* Is a member at or below this pointer among the errors? */
bool problem_mentions(const struct problem *problem, const char *pointer);

/* The HTTP status of a kind, 400..507. */
unsigned problem_status(enum problem_kind kind);

/* What `type` ends with: kinds may share one. */
const char *problem_name(enum problem_kind kind);

/* JSON text (free), NULL when out of memory. The request id is part of `instance`; NULL: there is none.
 * retry_after_seconds 0: not said. */
char *problem_to_json(const struct problem *problem, const char *request_id, unsigned retry_after_seconds);

/* One step of a JSON pointer with its escapes, appended to pointer (size bytes, cut on a character's boundary when too long). */
void pointer_append(char *pointer, size_t size, const char *token);

#endif
