#include "server/intake.h"

#include "renderer/log.h"

#include <math.h>
#include <pthread.h>
#include <stdlib.h>

/* Of the time that is promised: the rest is for the way to the daemon and back, and for threads that wait for a processor. */
#define PROMISED 0.9
/* So many answers may take longer than foreseen: fewer than one in a hundred, since the margin itself goes up and down. */
#define LATE_SHARE (1.0 / 400)
/* Of the places, from where on time counts. Below, a long picture that runs refuses nobody. */
#define FREE_SHARE 0.25
/* Before anything is measured, in places. */
#define MARGIN_START 0.25
#define MARGIN_MOST  0.5
/* Service times: a few pictures between renderer and answer, and one that takes thrice as long as others. */
#define MARGIN_USUAL 8.0
/* Weight of each measurement in the service time, for all but the first. */
#define SERVICE_GAIN (1.0 / 32)
/* From so many measurements on the service time is good for refusing anybody. */
enum { SERVICE_SETTLED = 16 };
/* With so many taken nobody who works on pictures waits for others: one is rendered, one travels to memory, others are encoded. */
enum { ENOUGH = 4 };

struct intake {
	pthread_mutex_t mutex;
	size_t places, taken;
	double answered_ms; /* when the last answer was there; 0: there was not enough to do since */
	double service_ms;
	unsigned long measured; /* service times */
	double margin;          /* service times */
};

struct intake *intake_create(size_t places)
{
	struct intake *intake = calloc(1, sizeof *intake);
	if (!intake) {
		log_error("intake_create: out of memory");
		return NULL;
	}
	pthread_mutex_init(&intake->mutex, NULL);
	intake->places = places;
	intake->margin = MARGIN_START * (double)places;
	return intake;
}

void intake_destroy(struct intake *intake)
{
	if (!intake)
		return;
	pthread_mutex_destroy(&intake->mutex);
	free(intake);
}

static bool does_time_count(const struct intake *intake)
{
	return (double)intake->taken >= FREE_SHARE * (double)intake->places && intake->measured >= SERVICE_SETTLED;
}

static double late_ms(const struct intake *intake, double ahead_ms)
{
	return ahead_ms + (intake->margin - PROMISED * (double)intake->places) * intake->service_ms;
}

enum intake_answer intake_enter(struct intake *intake, struct intake_place *place, double ahead_ms, double now_ms, double *late)
{
	enum intake_answer answer = INTAKE_TAKEN;
	pthread_mutex_lock(&intake->mutex);
	const bool counts = does_time_count(intake);
	*late = counts ? fmax(late_ms(intake, ahead_ms), 0) : 0;
	if (intake->taken >= intake->places)
		answer = INTAKE_FULL;
	else if (*late > 0)
		answer = INTAKE_LONG;
	else
		intake->taken++;
	pthread_mutex_unlock(&intake->mutex);
	if (answer == INTAKE_TAKEN)
		*place = (struct intake_place){.since_ms = now_ms, .ahead_ms = ahead_ms, .is_taken = true, .is_measured = counts};
	return answer;
}

/* From one answer to the next, as long as there is enough to do. */
static void measure_service(struct intake *intake, double now_ms)
{
	if (intake->answered_ms > 0) {
		const double gain = fmax(1.0 / (double)++intake->measured, SERVICE_GAIN);
		intake->service_ms += gain * (now_ms - intake->answered_ms - intake->service_ms);
	}
	intake->answered_ms = now_ms;
}

/* Up by a service time as rarely as is wanted, else a little down: the margin comes to rest where these cancel out. A large one falls
 * faster and is bounded, so that a time in which nothing was answered, when a renderer is made anew, is forgotten after a few thousand
 * answers. */
static void learn_margin(struct intake *intake, const struct intake_place *place, double now_ms)
{
	const bool late = now_ms - place->since_ms > place->ahead_ms + intake->margin * intake->service_ms;
	intake->margin += late ? 1 : -LATE_SHARE * fmax(1, intake->margin / MARGIN_USUAL);
	intake->margin = fmin(fmax(intake->margin, 0), MARGIN_MOST * (double)intake->places);
}

void intake_leave(struct intake *intake, struct intake_place *place, bool answered, double now_ms)
{
	if (!place->is_taken)
		return;
	pthread_mutex_lock(&intake->mutex);
	if (answered && place->is_measured)
		learn_margin(intake, place, now_ms);
	if (answered)
		measure_service(intake, now_ms);
	intake->taken--;
	if (intake->taken < ENOUGH)
		intake->answered_ms = 0;
	pthread_mutex_unlock(&intake->mutex);
	place->is_taken = false;
}

struct intake_now intake_look(struct intake *intake)
{
	pthread_mutex_lock(&intake->mutex);
	const struct intake_now now = {
		.places = intake->places,
		.taken = intake->taken,
		.service_ms = intake->measured >= SERVICE_SETTLED ? intake->service_ms : 0,
		.margin = intake->margin,
	};
	pthread_mutex_unlock(&intake->mutex);
	return now;
}
