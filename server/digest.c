#include "server/digest.h"

#include <nettle/sha2.h>
#include <stdio.h>

void digest_of(const void *bytes, size_t size, char digest[static DIGEST_SIZE])
{
	struct sha256_ctx context;
	unsigned char hash[(DIGEST_SIZE - 1) / 2];
	sha256_init(&context);
	sha256_update(&context, size, bytes);
	sha256_digest(&context, sizeof hash, hash);
	for (size_t i = 0; i < sizeof hash; i++)
		snprintf(digest + 2 * i, 3, "%02x", hash[i]);
}
