/* Uploaded pictures on disk, in the folder `assets` of the state directory. Any thread.
 *
 * The folder is the truth: a file `files/NAME` is the picture as it was sent, then a record of what is known of it. Files are written
 * whole beside it (`incoming`) and renamed, so that a process that dies at any moment leaves the old file or the new one, and several
 * daemons may share the folder. An open file stays what it was when its name is given to another or is deleted.
 */
#ifndef STRATUS_SERVER_ASSET_STORE_H
#define STRATUS_SERVER_ASSET_STORE_H

#include "server/asset_decode.h"
#include "server/digest.h"

#include <stdint.h>
#include <time.h>

struct asset_limits {
	uint64_t file_bytes;  /* of one picture */
	uint64_t total_bytes; /* of all, those that are coming in included */
	size_t count;
};

/* Uploads that may come in at a time. */
enum { ASSET_UPLOADS_MAX = 16 };

enum asset_result {
	ASSET_OK,
	ASSET_MISSING,   /* there is none of that name */
	ASSET_TOO_LARGE, /* larger than one may be */
	ASSET_FULL,      /* more than there may be, or no space on the disk */
	ASSET_BUSY,      /* too many are coming in, or of this client (shares.h) */
	ASSET_UNWANTED,  /* the condition does not hold */
	ASSET_FAILED     /* the log has the reason */
};

/* A stored picture, open for reading. */
struct asset_file {
	int fd; /* negative: none; its first `bytes` are the picture */
	uint64_t bytes;
	char hash[DIGEST_SIZE]; /* of the content */
	struct asset_facts facts;
	time_t modified;
};

/* Headers of a request that ask for a state (RFC 9110, 13.1); NULL: not sent. */
struct asset_condition {
	const char *if_match, *if_none_match;
};

struct asset_store;
struct asset_upload;

/* Removes what uploads of dead processes have left. NULL (and a log line) when out of memory. */
struct asset_store *asset_store_create(const char *state_dir, const struct asset_limits *limits);
void asset_store_destroy(struct asset_store *store);
const struct asset_limits *asset_store_limits(const struct asset_store *store);

/* 1 to 63 letters, digits, '-', '_' and '.', the first no dot: such a name cannot leave a folder. */
bool asset_name_is_valid(const char *name);

/* ASSET_OK (asset_file_close then), ASSET_MISSING, ASSET_FAILED. */
enum asset_result asset_store_open(struct asset_store *store, const char *name, struct asset_file *file);
void asset_file_close(struct asset_file *file);

/* Calls `visit` for each picture, by name in alphabetical order. false (and a log line) when the folder cannot be read. */
bool asset_store_list(struct asset_store *store, void (*visit)(void *context, const char *name, const struct asset_file *file),
		      void *context);

/* How many there are and what they take. */
void asset_store_usage(struct asset_store *store, size_t *count, uint64_t *bytes);

/* May this condition's request change the name? ASSET_OK, ASSET_UNWANTED, ASSET_FAILED. */
enum asset_result asset_store_check(struct asset_store *store, const char *name, const struct asset_condition *condition);

/* ASSET_OK, ASSET_MISSING, ASSET_UNWANTED, ASSET_FAILED. */
enum asset_result asset_store_delete(struct asset_store *store, const char *name, const struct asset_condition *condition);

/* --- uploads: one thread at a time each -------------------------------------------------------------------------------------------- */

/* Begins to take a picture in for a name, of `announced` bytes (0: unknown) and from a client (its key). ASSET_OK: *upload is the caller's.
 */
enum asset_result asset_upload_begin(struct asset_store *store, const char *name, uint64_t announced, const char *client,
				     struct asset_upload **upload);
/* Takes NULL. */
void asset_upload_destroy(struct asset_upload *upload);

enum asset_result asset_upload_append(struct asset_upload *upload, const void *bytes, size_t size);

/* What came so far: an open file, and its size. */
int asset_upload_fd(const struct asset_upload *upload, uint64_t *size);

/* All is there and was examined: puts it under its name. *created: the name is new. hash is set. ASSET_OK, ASSET_FULL, ASSET_UNWANTED,
 * ASSET_FAILED. */
enum asset_result asset_upload_commit(struct asset_upload *upload, const struct asset_facts *facts, const struct asset_condition *condition,
				      bool *created, char hash[static DIGEST_SIZE]);

#endif
