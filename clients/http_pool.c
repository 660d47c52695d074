#include "clients/http_pool.h"

#include "clients/clock.h"

#include <curl/curl.h>
#include <signal.h>
#include <stdlib.h>

enum { TICK_MS = 100 };
static const double FIRST_PAUSE_S = 0.25, LONGEST_PAUSE_S = 30;

/* A place for one request: empty (no body), under way (an exchange), or waiting to be asked again. */
struct place {
	struct pool_job job;
	struct http_exchange *exchange;
	int tries;
	double again_s; /* when */
};

struct pool {
	const struct client *client;
	const struct pool_settings *settings;
	const struct pool_work *work;
	CURLM *multi;
	struct place place[POOL_AT_ONCE_MAX];
	bool ended; /* there are no more jobs */
	int retries;
	int status;
};

static volatile sig_atomic_t interrupted;

static void interrupt(int signal)
{
	interrupted = signal;
}

/* --- one place ---------------------------------------------------------------------------------------------------------------------- */

static void empty(struct place *place)
{
	free(place->job.body);
	*place = (struct place){0};
}

static void end_exchange(struct pool *pool, struct place *place)
{
	if (place->exchange)
		curl_multi_remove_handle(pool->multi, http_exchange_handle(place->exchange));
	http_exchange_destroy(place->exchange);
	place->exchange = NULL;
}

static void ask(struct pool *pool, struct place *place)
{
	place->exchange = http_exchange_create(pool->client, &(struct http_request){.path = "/v1/render", .json = place->job.body});
	if (!place->exchange) {
		pool->status = CLIENT_USAGE;
		return;
	}
	curl_easy_setopt(http_exchange_handle(place->exchange), CURLOPT_PRIVATE, place);
	curl_multi_add_handle(pool->multi, http_exchange_handle(place->exchange));
}

/* Places that were refused together come back apart: up to a quarter later, by their number. */
static void put_off(struct pool *pool, struct place *place, double at_least_s)
{
	double pause_s = FIRST_PAUSE_S;
	for (int i = 0; i < place->tries && pause_s < LONGEST_PAUSE_S; i++)
		pause_s *= 2;
	if (pause_s > LONGEST_PAUSE_S)
		pause_s = LONGEST_PAUSE_S;
	if (pause_s < at_least_s)
		pause_s = at_least_s;
	place->again_s = clock_s() + pause_s * (1 + 0.25 * (double)((place - pool->place) % 8) / 8);
	place->tries++;
	pool->retries++;
}

static void take_answer(struct pool *pool, struct place *place)
{
	struct http_response response;
	if (!http_exchange_answer(place->exchange, &response)) {
		client_error("out of memory");
		pool->status = CLIENT_USAGE;
	} else if ((response.status == 429 || response.status == 503) && place->tries < pool->settings->retries) {
		put_off(pool, place, response.retry_after_s);
	} else {
		pool->status = pool->work->take(pool->work->context, &place->job, &response);
		end_exchange(pool, place);
		empty(place);
	}
	http_response_finish(&response);
}

static void take_end(struct pool *pool, struct place *place, CURLcode code)
{
	if (code == CURLE_OK) {
		take_answer(pool, place);
	} else if (place->tries < pool->settings->retries) {
		put_off(pool, place, 0);
	} else {
		client_error("%s: %s", pool->client->server, http_exchange_error(place->exchange, code));
		pool->status = CLIENT_UNREACHABLE;
	}
	end_exchange(pool, place);
}

/* --- all of them -------------------------------------------------------------------------------------------------------------------- */

static bool fill(struct pool *pool, struct place *place)
{
	const enum pool_next next = pool->ended ? POOL_END : pool->work->next(pool->work->context, &place->job);
	pool->ended = next == POOL_END;
	if (next != POOL_JOB)
		return false;
	if (place->job.body)
		ask(pool, place);
	else {
		client_error("out of memory");
		pool->status = CLIENT_USAGE;
	}
	return true;
}

/* Starts what can be started; returns how many places are taken. *waiting: those of them that are put off. */
static int advance(struct pool *pool, int *waiting)
{
	const double now_s = clock_s();
	int taken = 0;
	bool more = true;
	*waiting = 0;
	for (int i = 0; i < pool->settings->at_once && pool->status == CLIENT_OK; i++) {
		struct place *place = &pool->place[i];
		if (place->job.body && !place->exchange && place->again_s <= now_s)
			ask(pool, place);
		else if (!place->job.body && more)
			more = fill(pool, place);
		taken += place->job.body != NULL;
		*waiting += place->job.body && !place->exchange;
	}
	return taken;
}

static void collect(struct pool *pool)
{
	int left;
	for (CURLMsg *message; pool->status == CLIENT_OK && (message = curl_multi_info_read(pool->multi, &left));) {
		struct place *place;
		const CURLcode code = message->data.result;
		if (message->msg == CURLMSG_DONE && curl_easy_getinfo(message->easy_handle, CURLINFO_PRIVATE, &place) == CURLE_OK)
			take_end(pool, place, code);
	}
}

static void drive(struct pool *pool)
{
	double tick_s = 0;
	for (int running, waiting; pool->status == CLIENT_OK;) {
		const int taken = advance(pool, &waiting);
		if (taken == 0 && pool->ended)
			break;
		curl_multi_perform(pool->multi, &running);
		collect(pool);
		if (clock_s() >= tick_s) {
			pool->work->tick(pool->work->context, waiting, pool->retries);
			tick_s = clock_s() + TICK_MS * 1e-3;
		}
		if (running == taken)
			curl_multi_poll(pool->multi, NULL, 0, TICK_MS, NULL);
		else if (waiting > 0)
			curl_multi_poll(pool->multi, NULL, 0, TICK_MS / 4, NULL);
		if (interrupted && pool->status == CLIENT_OK)
			pool->status = CLIENT_INTERRUPTED;
	}
}

int http_pool_run(const struct client *client, const struct pool_settings *settings, const struct pool_work *work)
{
	struct pool pool = {.client = client, .settings = settings, .work = work, .multi = curl_multi_init(), .status = CLIENT_OK};
	struct sigaction on_interrupt = {.sa_handler = interrupt}, before_int, before_term;
	if (!pool.multi) {
		client_error("out of memory");
		return CLIENT_USAGE;
	}
	interrupted = 0;
	sigaction(SIGINT, &on_interrupt, &before_int);
	sigaction(SIGTERM, &on_interrupt, &before_term);
	drive(&pool);
	sigaction(SIGINT, &before_int, NULL);
	sigaction(SIGTERM, &before_term, NULL);
	for (int i = 0; i < settings->at_once; i++) {
		end_exchange(&pool, &pool.place[i]);
		empty(&pool.place[i]);
	}
	curl_multi_cleanup(pool.multi);
	return pool.status;
}
