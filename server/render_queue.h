/* Bounded queue of render jobs, from the HTTP threads to the render thread, or to the thread that prepares for it. Any thread.
 *
 * A full queue refuses: overload is an answer (503), not a wait. Jobs leave in an order that is fair to their clients (fair_order.h). Once
 * closed the queue takes nothing more, and still gives out what it holds.
 */
#ifndef STRATUS_SERVER_RENDER_QUEUE_H
#define STRATUS_SERVER_RENDER_QUEUE_H

#include "renderer/renderer.h"
#include "server/client_address.h"
#include "server/fair_order.h"

enum render_outcome {
	RENDER_OUTCOME_OK,      /* job->frame (or job->light) is set and belongs to the job's owner */
	RENDER_OUTCOME_EXPIRED, /* the deadline passed, in the queue or between passes */
	RENDER_OUTCOME_ABANDONED /* nobody waits for it any more */,
	RENDER_OUTCOME_NO_MEMORY, /* this scene is too large for the device as it is loaded; others may do */
	RENDER_OUTCOME_FAILED,
	RENDER_OUTCOME_STOPPED,    /* of a wait (call.h): a shutdown gave it up */
	RENDER_OUTCOME_UNAVAILABLE /* there is no renderer any more, or another device than before */
};

/* Why a queue did not take a job. */
enum render_refusal { RENDER_TAKEN, RENDER_REFUSED_CLOSED, RENDER_REFUSED_COUNT, RENDER_REFUSED_PIXELS };

/* How far a job came, for those that nobody waits for any more. */
enum render_phase { RENDER_PHASE_QUEUED, RENDER_PHASE_RENDERING, RENDER_PHASE_ENCODING, RENDER_PHASE_COUNT };

/* A picture of the reference lets others pass after so long, about a picture's time: milliseconds. */
#define RENDER_TURN_MS 250.0

/* Parts of a picture that others may share (cost_model.h). */
enum { COST_PARTS = 4 };

/* One picture to render, or the light of a sky to compute. Belongs to its maker, who keeps it until `finished` was called. */
struct render_job {
	const struct scene *scene;
	const struct sky_directions *directions; /* NULL: a picture; else the light of the scene's clear sky there */
	_Atomic double deadline_ms;              /* on the clock of clock.h; moved by others who come to wait for it too */
	double queued_ms;                        /* likewise, set by render_queue_push */
	const char *client;                      /* key of whom it is for; must live as long. NULL: nobody's in particular */
	unsigned long flight;                    /* number of the flight (flight.h) that it is for; 0: others cannot join */
	char line[CLIENT_KEY_SIZE];              /* the queue's own: key of whoever joined and has it served sooner */
	int cost_ranks[COST_PARTS];              /* the cost model's own */
	double predicted_ms;                     /* of the render thread's time; 0: unknown */

	/* Asked at dequeue and between passes: does nobody wait any more? */
	bool (*abandoned)(struct render_job *job);
	/* Called once, by the thread that ends the job, with the outcome set; the job may be gone when it returns. */
	void (*finished)(struct render_job *job);

	/* What was prepared (server/preparation.h), held until the job's owner releases it: else it might be gone when it is needed. */
	const struct droplet_tables *droplets;
	double prepared_ms;
	bool prepared; /* computed or read from disk; else from memory */

	struct render_pending
		*pending; /* of a reference on its way, that goes back to the queue to let others pass; the render thread's own */
	enum render_outcome outcome;
	enum render_refusal refusal; /* set by render_queue_push */
	enum render_phase phase;
	const struct renderer_info *device; /* that the answer speaks of; NULL: any */
	int interruptions;                  /* by a context that was lost while it was rendered */
	double spent_ms;                    /* of the render thread's time */
	double encoded_ms;                  /* of a worker's, behind that */
	double waited_ms;                   /* in queues */
	struct frame frame;
	struct sky_light light; /* likewise */

	struct fair_entry entry; /* of the queue, from being pushed until it is settled */
};

/* Is there no use in going on with a job, since its deadline passed or nobody waits? Its outcome then says so. */
bool render_job_is_over(struct render_job *job);

struct render_queue;

/* What may wait: so many jobs, from 1, and so many pixels, layers counted apart; a job that waits alone may have more. */
struct render_queue_limits {
	size_t jobs;
	double pixels;
};

/* NULL when out of memory. */
struct render_queue *render_queue_create(const struct render_queue_limits *limits);
void render_queue_destroy(struct render_queue *queue);

/* false when full or closed, job->refusal says which; the job then stays with the caller. */
bool render_queue_push(struct render_queue *queue, struct render_job *job);

/* Takes a job whatever the limits and even when closed: it was admitted to another queue before. */
void render_queue_pass(struct render_queue *queue, struct render_job *job);

/* Waits for a job. NULL once the queue is closed and empty. render_queue_settle must follow. */
struct render_job *render_queue_pop(struct render_queue *queue);

/* Likewise; NULL also when none has come within so long, *closed says which. */
struct render_job *render_queue_pop_within(struct render_queue *queue, double milliseconds, bool *closed);

/* The next job that is wanted, or NULL; never waits. `wanted` must not use the queue. render_queue_settle must follow. */
typedef bool render_job_wanted(struct render_job *job, void *context);
struct render_job *render_queue_pop_wanted(struct render_queue *queue, render_job_wanted *wanted, void *context);

/* The job took so long of whoever serves the queue, which its client pays; before it goes to any queue again and before it is finished. */
void render_queue_settle(struct render_queue *queue, struct render_job *job, double took_ms);

/* Takes a wanted job out that is not to be served any more; nobody pays, nothing follows. NULL: there is none. */
struct render_job *render_queue_remove(struct render_queue *queue, render_job_wanted *wanted, void *context);

/* Another client joins a flight: its job, if it waits, goes to that client's line when it is served sooner there, and is that client's to
 * pay from then on. */
void render_queue_share(struct render_queue *queue, unsigned long flight, const char *client);

/* What is to be done before the job of a flight when this client joins, and for the job itself, as predicted. false: it neither waits nor
 * runs. */
bool render_queue_foresee(struct render_queue *queue, unsigned long flight, const char *client, double *ahead_ms, double *own_ms);

/* Is there a job that is wanted? Likewise. */
bool render_queue_has(struct render_queue *queue, render_job_wanted *wanted, void *context);

void render_queue_close(struct render_queue *queue);

/* Jobs waiting now, and the pixels that they ask for, layers counted apart. */
size_t render_queue_depth(struct render_queue *queue);
double render_queue_pixels(struct render_queue *queue);

/* Time that all jobs will take that wait or run now, as predicted; and those of them that come before one of this client and cost. */
double render_queue_backlog_ms(struct render_queue *queue);
double render_queue_ahead_ms(struct render_queue *queue, const char *client, double cost_ms);

#endif
