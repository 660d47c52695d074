/* SHA-256 of texts, for entity tags and keys. Any thread. */
#ifndef STRATUS_SERVER_DIGEST_H
#define STRATUS_SERVER_DIGEST_H

#include <nettle/sha2.h>
#include <stdbool.h>
#include <stddef.h>

/* 128 bits in hexadecimal and a NUL: enough that two texts never share one. */
enum { DIGEST_SIZE = 33 };

/* Of what comes in pieces: begin, then add, then end. */
struct digest {
	struct sha256_ctx context;
};
void digest_begin(struct digest *digest);
void digest_add(struct digest *digest, const void *bytes, size_t size);
void digest_end(struct digest *digest, char text[static DIGEST_SIZE]);

void digest_of(const void *bytes, size_t size, char digest[static DIGEST_SIZE]);

/* Of a file's content. false when it cannot be read; the digest is then empty. */
bool digest_of_file(const char *path, char digest[static DIGEST_SIZE]);

#endif
