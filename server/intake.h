/* How much is taken on. A picture that is accepted has a place until its answer is there, whatever it waits for meanwhile: its maps, its
 * droplets, the renderer, an encoder. There are so many places, and whoever has one is answered within as many service times.
 *
 * A service time is what passes between two answers while there is enough to do. The number of places alone would not bound the wait, since
 * some pictures take more than others. So when a quarter of them is taken the others are given by time: to whoever would be answered soon
 * enough, as far as can be foreseen from what is done before the last of its client (fair_order.h) and from a margin, by which fewer than
 * one in a hundred of the answers of late took longer than that: for themselves, for those that came later and went first, for encoding,
 * and for errors of prediction. What a picture itself takes plays no part, since otherwise cheap ones would keep dear ones out for ever.
 * Until enough was measured the number alone counts. Any thread.
 */
#ifndef STRATUS_SERVER_INTAKE_H
#define STRATUS_SERVER_INTAKE_H

#include <stdbool.h>
#include <stddef.h>

struct intake;

/* Belongs to who has it. Zero: none. */
struct intake_place {
	double since_ms, ahead_ms;
	bool is_taken, is_measured;
};

enum intake_answer {
	INTAKE_TAKEN,
	INTAKE_FULL, /* no place is left */
	INTAKE_LONG  /* one is, and the answer would come too late */
};

struct intake_now {
	size_t places, taken;
	double service_ms; /* 0: not measured yet */
	double margin;     /* service times */
};

/* places: from 1. NULL (and a log line) when out of memory. */
struct intake *intake_create(size_t places);
/* All places must have been given back. Takes NULL. */
void intake_destroy(struct intake *intake);

/* ahead_ms: what will be done before, as predicted. now_ms: on the clock of clock.h, here and below. *late_ms: with INTAKE_LONG, by how
 * much too late. */
enum intake_answer intake_enter(struct intake *intake, struct intake_place *place, double ahead_ms, double now_ms, double *late_ms);

/* Gives a place back, if there is one. answered: with what was asked for. */
void intake_leave(struct intake *intake, struct intake_place *place, bool answered, double now_ms);

struct intake_now intake_look(struct intake *intake);

#endif
