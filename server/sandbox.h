/* Takes from this process what decoding a picture does not need, for the rest of its life: it keeps the files and the memory that it has,
 * may compute, and may ask for a bounded amount of memory. Linux on x86-64 and ARM also refuses it every other call of the kernel. */
#ifndef STRATUS_SERVER_SANDBOX_H
#define STRATUS_SERVER_SANDBOX_H

#include <stdbool.h>
#include <stdint.h>

struct sandbox_limits {
	uint64_t memory_bytes; /* that it may ask for from here on */
	uint32_t cpu_seconds;  /* from 1; then SIGXCPU */
};

/* false, with the process in some state between, when the kernel refuses a limit: nothing of strangers may be touched then. A kernel that
 * cannot filter calls is no failure. One thread, before others exist. */
bool sandbox_enter(const struct sandbox_limits *limits);

#endif
