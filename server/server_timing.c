#include "server/server_timing.h"

#include <stdio.h>

const char *const timing_names[TIMING_COUNT] = {"queue",    "optics",  "sky",    "field", "radiosity", "view",
						"readback", "compare", "encode", "cache", "shared",    "total"};

void timings_set(struct timings *timings, enum timing timing, double milliseconds)
{
	timings->entry[timing].measured = true;
	timings->entry[timing].milliseconds = milliseconds;
}

void timings_set_frame(struct timings *timings, const struct frame *frame)
{
	static const enum timing of_stage[STAGE_COUNT] = {
		[STAGE_OPTICS] = TIMING_OPTICS,       [STAGE_SKY] = TIMING_SKY,   [STAGE_FIELD] = TIMING_FIELD,
		[STAGE_RADIOSITY] = TIMING_RADIOSITY, [STAGE_VIEW] = TIMING_VIEW, [STAGE_READBACK] = TIMING_READBACK,
	};
	for (int stage = 0; stage < STAGE_COUNT; stage++) {
		timings_set(timings, of_stage[stage], frame->timing[stage].milliseconds);
		timings->entry[of_stage[stage]].reused = frame->timing[stage].reused;
	}
	timings->radiosity_passes = frame->radiosity_passes;
	timings->radiosity_residual = frame->radiosity_residual;
}

void timings_set_reused(struct timings *timings)
{
	for (int i = 0; i <= TIMING_ENCODE; i++) {
		if (i == TIMING_COMPARE)
			continue;
		timings_set(timings, (enum timing)i, 0);
		timings->entry[i].reused = i != TIMING_QUEUE;
	}
}

void timings_add_frame(struct timings *timings, const struct timings *frame)
{
	for (int i = 0; i < TIMING_COUNT; i++) {
		if (!frame->entry[i].measured)
			continue;
		timings->entry[i].reused = frame->entry[i].reused && (timings->entry[i].reused || !timings->entry[i].measured);
		timings->entry[i].measured = true;
		timings->entry[i].milliseconds += frame->entry[i].milliseconds;
	}
}

void timings_add_optics(struct timings *timings, double milliseconds, bool computed)
{
	timings->entry[TIMING_OPTICS].milliseconds += milliseconds;
	timings->entry[TIMING_OPTICS].reused &= !computed;
}

void timings_add(struct timings *timings, enum timing timing, double milliseconds)
{
	timings->entry[timing].milliseconds += milliseconds;
	timings->entry[timing].reused &= milliseconds <= 0;
}

void timings_format(const struct timings *timings, char text[static SERVER_TIMING_SIZE])
{
	size_t used = 0;
	text[0] = '\0';
	for (int i = 0; i < TIMING_COUNT; i++) {
		if (!timings->entry[i].measured)
			continue;
		char description[80] = "";
		if (timings->entry[i].reused)
			snprintf(description, sizeof description, ";desc=\"reused\"");
		else if (i == TIMING_CACHE || i == TIMING_SHARED)
			snprintf(description, sizeof description, ";desc=\"hit\"");
		else if (i == TIMING_RADIOSITY && timings->radiosity_passes > 0)
			snprintf(description, sizeof description, ";desc=\"%d passes, residual %.2g\"", timings->radiosity_passes,
				 timings->radiosity_residual);
		int added = snprintf(text + used, SERVER_TIMING_SIZE - used, "%s%s%s;dur=%.3f", used ? ", " : "", timing_names[i],
				     description, timings->entry[i].milliseconds);
		used += added > 0 && (size_t)added < SERVER_TIMING_SIZE - used ? (size_t)added : 0;
	}
}
