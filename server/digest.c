#include "server/digest.h"

#include <stdio.h>

void digest_begin(struct digest *digest)
{
	sha256_init(&digest->context);
}

void digest_add(struct digest *digest, const void *bytes, size_t size)
{
	sha256_update(&digest->context, size, bytes);
}

void digest_end(struct digest *digest, char text[static DIGEST_SIZE])
{
	unsigned char hash[(DIGEST_SIZE - 1) / 2];
	sha256_digest(&digest->context, sizeof hash, hash);
	for (size_t i = 0; i < sizeof hash; i++)
		snprintf(text + 2 * i, 3, "%02x", hash[i]);
}

void digest_of(const void *bytes, size_t size, char digest[static DIGEST_SIZE])
{
	struct digest all;
	digest_begin(&all);
	digest_add(&all, bytes, size);
	digest_end(&all, digest);
}

bool digest_of_file(const char *path, char digest[static DIGEST_SIZE])
{
	unsigned char block[65536];
	struct digest all;
	FILE *file = fopen(path, "rb");
	digest[0] = '\0';
	if (!file)
		return false;
	digest_begin(&all);
	for (size_t got; (got = fread(block, 1, sizeof block, file)) > 0;)
		digest_add(&all, block, got);
	const bool ok = !ferror(file);
	fclose(file);
	if (ok)
		digest_end(&all, digest);
	return ok;
}
