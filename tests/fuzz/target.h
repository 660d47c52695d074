/* What every fuzz target has in common. A target is one file with LLVMFuzzerTestOneInput: libFuzzer calls it with bytes of its making
 * (make fuzz), and replay.c with files that were kept (make test).
 *
 * A target takes any bytes. It aborts when the program does what it must not: a broken promise is found as a crash is.
 */
#ifndef STRATUS_FUZZ_TARGET_H
#define STRATUS_FUZZ_TARGET_H

#include <stddef.h>
#include <stdint.h>

/* Once, before the first input; may be missing in a target. */
int LLVMFuzzerInitialize(int *argc, char ***argv);

/* One input. 0: taken; -1: no use in keeping it. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* Aborts with a line on standard error: what was promised, and does not hold. */
#define FUZZ_REQUIRE(truth)                                                                                                                \
	do {                                                                                                                               \
		if (!(truth))                                                                                                              \
			fuzz_fail(__FILE__, __LINE__, #truth);                                                                             \
	} while (0)

#include <stdio.h>
#include <stdlib.h>

static inline _Noreturn void fuzz_fail(const char *file, int line, const char *promise)
{
	fprintf(stderr, "%s:%d: does not hold: %s\n", file, line, promise);
	abort();
}

#endif
