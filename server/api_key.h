/* The keys that clients show: a prefix that scanners for secrets know, and 256 random bits. Any thread.
 *
 * The file of keys holds their SHA-256 and not the keys. A slow or salted hash, as passwords need it, would gain nothing: those make
 * guessing from a list of likely words dear, and among 2^256 equally likely keys there is nothing to guess. What is not of this form is no
 * key whatever its hash is, so that nobody can make a password one.
 */
#ifndef STRATUS_SERVER_API_KEY_H
#define STRATUS_SERVER_API_KEY_H

#include <nettle/sha2.h>
#include <stdbool.h>

#define API_KEY_PREFIX "stk_"

/* 43 digits of base64url hold 256 bits. */
enum { API_KEY_DIGITS = 43, API_KEY_SIZE = sizeof API_KEY_PREFIX + API_KEY_DIGITS, API_KEY_HASH_BYTES = SHA256_DIGEST_SIZE };

/* A new one. false (and a log line) when the kernel has no randomness. */
bool api_key_make(char key[static API_KEY_SIZE]);

/* false when the text does not have the form of a key. */
bool api_key_hash(const char *text, unsigned char hash[static API_KEY_HASH_BYTES]);

/* Takes the same time wherever two hashes begin to differ. */
bool api_key_hashes_match(const unsigned char a[static API_KEY_HASH_BYTES], const unsigned char b[static API_KEY_HASH_BYTES]);

#endif
