#include "server/api_key.h"

#include "renderer/log.h"

#include <errno.h>
#include <nettle/memops.h>
#include <string.h>
#include <sys/random.h>

static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";

bool api_key_make(char key[static API_KEY_SIZE])
{
	unsigned char random[API_KEY_DIGITS];
	if (getrandom(random, sizeof random, 0) != (ssize_t)sizeof random) {
		log_error("api_key_make: getrandom: %s", strerror(errno));
		return false;
	}
	strcpy(key, API_KEY_PREFIX);
	/* Six bits of each byte: two more than 256. */
	for (int i = 0; i < API_KEY_DIGITS; i++)
		key[sizeof API_KEY_PREFIX - 1 + i] = digits[random[i] & 63];
	key[API_KEY_SIZE - 1] = '\0';
	return true;
}

bool api_key_hash(const char *text, unsigned char hash[static API_KEY_HASH_BYTES])
{
	struct sha256_ctx context;
	if (strncmp(text, API_KEY_PREFIX, sizeof API_KEY_PREFIX - 1) != 0 || strlen(text) != API_KEY_SIZE - 1 ||
	    strspn(text + sizeof API_KEY_PREFIX - 1, digits) != API_KEY_DIGITS)
		return false;
	sha256_init(&context);
	sha256_update(&context, API_KEY_SIZE - 1, (const unsigned char *)text);
	sha256_digest(&context, API_KEY_HASH_BYTES, hash);
	return true;
}

bool api_key_hashes_match(const unsigned char a[static API_KEY_HASH_BYTES], const unsigned char b[static API_KEY_HASH_BYTES])
{
	return memeql_sec(a, b, API_KEY_HASH_BYTES);
}
