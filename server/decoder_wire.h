/* What the daemon and the process that decodes for it say to each other: one message each way over a socket of packets, and a piece of
 * shared memory for what was found. Both are the same program, so that the structs are the same. */
#ifndef STRATUS_SERVER_DECODER_WIRE_H
#define STRATUS_SERVER_DECODER_WIRE_H

#include "server/asset_decode.h"
#include "server/sandbox.h"

/* The descriptor of the socket in the process that decodes. */
enum { DECODER_SOCKET = 3 };

enum { DECODER_ERROR_SIZE = 224 };

/* With it come two descriptors: the picture, to be read alone, and the shared memory, zero. */
struct decoder_request {
	uint64_t picture_bytes;
	bool wants_map;
	enum asset_use use; /* the following when a map is wanted */
	int side;
	int width, height, channels; /* that it will have */
	struct sandbox_limits limits;
	uint32_t wall_ms;
};

enum decoder_end {
	DECODER_ENDED,  /* by itself: the shared memory tells the rest */
	DECODER_DIED,   /* by `signal` */
	DECODER_KILLED, /* wall_ms passed */
	DECODER_BROKEN  /* it could not be started, or not be shut in */
};

struct decoder_reply {
	enum decoder_end end;
	int signal;
};

enum decoder_verdict { DECODER_SILENT, DECODER_USABLE, DECODER_REFUSED_IT };

/* The beginning of the shared memory; the values of a map follow at DECODER_VALUES_AT. */
struct decoder_findings {
	enum decoder_verdict verdict;
	char error[DECODER_ERROR_SIZE];
	struct asset_facts facts;
};
enum { DECODER_VALUES_AT = 4096 };
_Static_assert(sizeof(struct decoder_findings) <= DECODER_VALUES_AT, "findings end before the values");

#endif
