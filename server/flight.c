#include "server/flight.h"

#include "renderer/log.h"
#include "server/clock.h"

#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

/* Asking a seat costs a system call: many of them are asked no more often than this. */
enum { SEATS_ASKED_ALWAYS = 4 };
#define ASK_MS 10.0

/* Flights are no more than the renders that may wait, so a list of them is short. */
struct flights {
	struct image_cache *cache;
	pthread_mutex_t mutex;
	struct flight *first; /* those that others may join */
	size_t open;
	unsigned long opened; /* ever */
};

struct flights *flights_create(struct image_cache *cache)
{
	struct flights *flights = calloc(1, sizeof *flights);
	if (!flights) {
		log_error("flights_create: out of memory");
		return NULL;
	}
	flights->cache = cache;
	pthread_mutex_init(&flights->mutex, NULL);
	return flights;
}

void flights_destroy(struct flights *flights)
{
	if (!flights)
		return;
	pthread_mutex_destroy(&flights->mutex);
	free(flights);
}

size_t flights_open(struct flights *flights)
{
	pthread_mutex_lock(&flights->mutex);
	const size_t open = flights->open;
	pthread_mutex_unlock(&flights->mutex);
	return open;
}

void flights_close(struct flights *flights)
{
	pthread_mutex_lock(&flights->mutex);
	flights->open--;
	pthread_mutex_unlock(&flights->mutex);
}

/* --- within the mutex --------------------------------------------------------------------------------------------------------------- */

static struct flight *find(const struct flights *flights, const char *tag)
{
	struct flight *flight = flights->first;
	while (flight && strcmp(flight->tag, tag) != 0)
		flight = flight->next;
	return flight;
}

static void sit_down(struct flight *flight, struct flight_seat *seat)
{
	seat->flight = flight->number;
	seat->next = flight->seats;
	flight->seats = seat;
	*flight->deadline_ms = fmax(*flight->deadline_ms, seat->deadline_ms);
}

static void open_flight(struct flights *flights, const char *tag, struct flight *flight, _Atomic double *deadline_ms)
{
	flight->flights = flights;
	flight->deadline_ms = deadline_ms;
	flight->is_listed = tag != NULL;
	flight->number = ++flights->opened;
	flights->open++;
	if (!tag)
		return;
	strncpy(flight->tag, tag, sizeof flight->tag - 1);
	flight->next = flights->first;
	flights->first = flight;
}

/* Nobody joins from here on. */
static void delist(struct flight *flight)
{
	struct flight **link = &flight->flights->first;
	while (flight->is_listed && *link != flight)
		link = &(*link)->next;
	if (flight->is_listed)
		*link = flight->next;
	flight->is_listed = false;
}

/* Takes those out whose wait is over, with their outcome set; the rest stay. */
static struct flight_seat *take_over(struct flight *flight, double now_ms)
{
	struct flight_seat *over = NULL, **link = &flight->seats;
	for (struct flight_seat *seat; (seat = *link);) {
		const bool is_late = now_ms >= seat->deadline_ms;
		if (!is_late && !seat->is_gone(seat)) {
			link = &seat->next;
			continue;
		}
		*link = seat->next;
		seat->outcome = is_late ? RENDER_OUTCOME_EXPIRED : RENDER_OUTCOME_ABANDONED;
		seat->next = over;
		over = seat;
	}
	return over;
}

static bool has_many(const struct flight_seat *seats)
{
	int count = 0;
	for (; seats && count <= SEATS_ASKED_ALWAYS; seats = seats->next)
		count++;
	return count > SEATS_ASKED_ALWAYS;
}

/* --- without it: a seat may be gone once it is left ----------------------------------------------------------------------------------- */

static void leave_all(struct flight_seat *seats)
{
	for (struct flight_seat *next; seats; seats = next) {
		next = seats->next;
		seats->leave(seats);
	}
}

/* --- from outside ------------------------------------------------------------------------------------------------------------------- */

enum flight_boarding flight_board(struct flights *flights, const char *tag, struct flight *own, _Atomic double *deadline_ms,
				  struct flight_seat *seat)
{
	enum flight_boarding boarding = FLIGHT_OPENED;
	*deadline_ms = seat->deadline_ms;
	seat->boarded_ms = clock_now_ms();
	pthread_mutex_lock(&flights->mutex);
	struct flight *flight = tag ? find(flights, tag) : NULL;
	if (flight) {
		boarding = FLIGHT_JOINED;
		seat->has_joined = true;
		sit_down(flight, seat);
	} else if (tag && (seat->image = image_cache_find(flights->cache, tag))) {
		boarding = FLIGHT_ARRIVED; /* since who calls looked there */
	} else {
		open_flight(flights, tag, own, deadline_ms);
		sit_down(own, seat);
	}
	pthread_mutex_unlock(&flights->mutex);
	return boarding;
}

unsigned long flights_find(struct flights *flights, const char *tag)
{
	pthread_mutex_lock(&flights->mutex);
	const struct flight *flight = find(flights, tag);
	const unsigned long number = flight ? flight->number : 0;
	pthread_mutex_unlock(&flights->mutex);
	return number;
}

bool flight_is_wanted(struct flight *flight)
{
	struct flight_seat *over = NULL;
	const double now_ms = clock_now_ms();
	pthread_mutex_lock(&flight->flights->mutex);
	if (now_ms >= flight->checked_ms + ASK_MS || now_ms >= *flight->deadline_ms || !has_many(flight->seats)) {
		flight->checked_ms = now_ms;
		over = take_over(flight, now_ms);
	}
	const bool wanted = flight->seats;
	if (!wanted)
		delist(flight);
	pthread_mutex_unlock(&flight->flights->mutex);
	leave_all(over);
	return wanted;
}

void flight_waive_deadlines(struct flight *flight)
{
	pthread_mutex_lock(&flight->flights->mutex);
	for (struct flight_seat *seat = flight->seats; seat; seat = seat->next)
		seat->deadline_ms = INFINITY;
	pthread_mutex_unlock(&flight->flights->mutex);
}

/* Takes all seats out of a flight that has ended. */
static struct flight_seat *end(struct flight *flight)
{
	pthread_mutex_lock(&flight->flights->mutex);
	delist(flight);
	struct flight_seat *seats = flight->seats;
	flight->seats = NULL;
	pthread_mutex_unlock(&flight->flights->mutex);
	for (struct flight_seat *seat = seats; seat; seat = seat->next)
		seat->has_arrived = true;
	return seats;
}

void flight_arrive(struct flight *flight, enum render_outcome outcome, struct finished_image *image)
{
	struct flight_seat *seats = end(flight);
	const double now_ms = clock_now_ms();
	for (struct flight_seat *seat = seats; seat; seat = seat->next) {
		seat->outcome = outcome == RENDER_OUTCOME_OK && now_ms >= seat->deadline_ms ? RENDER_OUTCOME_EXPIRED : outcome;
		seat->image = seat->outcome == RENDER_OUTCOME_OK ? finished_image_hold(image) : NULL;
	}
	leave_all(seats);
}

void flight_refuse(struct flight *flight)
{
	struct flight_seat *seats = end(flight);
	for (struct flight_seat *seat = seats; seat; seat = seat->next)
		seat->refused = true;
	leave_all(seats);
}
