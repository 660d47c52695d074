/* One render for all who ask for the same at the same time.
 *
 * Who asks takes a seat. The first opens a flight, whose work then runs; others who ask for the same entity tag until that has ended take
 * seats in it. Each seat keeps its own deadline and its own client: it is left when its deadline has passed or its client has gone, and the
 * work goes on while any seat is taken. Any thread; nothing is computed while others wait.
 */
#ifndef STRATUS_SERVER_FLIGHT_H
#define STRATUS_SERVER_FLIGHT_H

#include "server/image_cache.h"
#include "server/render_queue.h"

/* A place of one who waits. Belongs to its maker, who sets the first part, and must stay until `leave` is called. */
struct flight_seat {
	double deadline_ms; /* on the clock of clock.h */
	/* Does nobody wait at this seat any more? Quick; must not use the flights. */
	bool (*is_gone)(struct flight_seat *seat);
	/* Called once, by the thread that ends the wait, with the rest set; the seat may be gone when it returns. Quick. */
	void (*leave)(struct flight_seat *seat);

	bool has_joined;              /* the flight of another */
	unsigned long flight;         /* its number */
	bool has_arrived;             /* the work has ended; else this seat was left before */
	bool refused;                 /* the work was not accepted */
	enum render_outcome outcome;  /* of the wait */
	struct finished_image *image; /* of RENDER_OUTCOME_OK; the owner of the seat releases it */
	double boarded_ms;
	struct flight_seat *next;
};

/* What is rendered for the seats. Part of the work that does it. */
struct flight {
	struct flights *flights;
	char tag[ENTITY_TAG_SIZE];
	unsigned long number;        /* from 1, never that of another */
	bool is_listed;              /* others may join */
	_Atomic double *deadline_ms; /* of the work: the latest of all seats that were ever taken */
	struct flight_seat *seats;
	double checked_ms; /* when all seats were asked last */
	struct flight *next;
};

struct flights;

/* cache: where finished images are kept; must outlive this. NULL (and a log line) on failure. */
struct flights *flights_create(struct image_cache *cache);
/* Takes NULL. No flight may be open. */
void flights_destroy(struct flights *flights);

/* Flights that were opened and not closed. */
size_t flights_open(struct flights *flights);

enum flight_boarding {
	FLIGHT_OPENED,  /* the seat is in `own`, whose work the caller starts, refuses or ends */
	FLIGHT_JOINED,  /* the seat is in another one; it may have been left already */
	FLIGHT_ARRIVED, /* no seat is needed: seat->image has just been finished */
};

/* Takes a seat in the flight of a tag. tag NULL: for nobody else. own: zeroed; deadline_ms: of its work, set to the seat's and later than
 * that as others join. Both stay where they are until flight_close. */
enum flight_boarding flight_board(struct flights *flights, const char *tag, struct flight *own, _Atomic double *deadline_ms,
				  struct flight_seat *seat);

/* Number of the flight that a seat would be taken in now; 0: there is none. */
unsigned long flights_find(struct flights *flights, const char *tag);

/* Is any seat taken still? Those whose deadline has passed or whose client has gone are left. Once false nobody joins any more: the work is
 * to be dropped. By one thread at a time, that of the work. */
bool flight_is_wanted(struct flight *flight);

/* Whoever sits now stays whatever the deadline. */
void flight_waive_deadlines(struct flight *flight);

/* The work has ended: all seats are left. image: of RENDER_OUTCOME_OK, else NULL; stays the caller's, and if it is to be found in the cache
 * it is there already. Seats that are late by now get RENDER_OUTCOME_EXPIRED. */
void flight_arrive(struct flight *flight, enum render_outcome outcome, struct finished_image *image);
/* The work was not accepted: likewise. */
void flight_refuse(struct flight *flight);

/* Once for each flight that was opened, after all else: counts it as closed. The flight itself may be gone already. */
void flights_close(struct flights *flights);

#endif
