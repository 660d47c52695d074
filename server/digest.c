#include "server/digest.h"

#include <nettle/sha2.h>
#include <stdio.h>

static void finish(struct sha256_ctx *context, char digest[static DIGEST_SIZE])
{
	unsigned char hash[(DIGEST_SIZE - 1) / 2];
	sha256_digest(context, sizeof hash, hash);
	for (size_t i = 0; i < sizeof hash; i++)
		snprintf(digest + 2 * i, 3, "%02x", hash[i]);
}

void digest_of(const void *bytes, size_t size, char digest[static DIGEST_SIZE])
{
	struct sha256_ctx context;
	sha256_init(&context);
	sha256_update(&context, size, bytes);
	finish(&context, digest);
}

bool digest_of_file(const char *path, char digest[static DIGEST_SIZE])
{
	unsigned char block[65536];
	struct sha256_ctx context;
	FILE *file = fopen(path, "rb");
	digest[0] = '\0';
	if (!file)
		return false;
	sha256_init(&context);
	for (size_t got; (got = fread(block, 1, sizeof block, file)) > 0;)
		sha256_update(&context, got, block);
	const bool ok = !ferror(file);
	fclose(file);
	if (ok)
		finish(&context, digest);
	return ok;
}
