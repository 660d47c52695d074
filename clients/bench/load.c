#include "clients/bench/load.h"

#include "clients/bench/connection.h"
#include "clients/bench/draws.h"
#include "clients/bench/server_address.h"
#include "clients/timing.h"

#include <errno.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#define SECOND_NS 1000000000.0

/* How often requests without an answer are looked for. */
enum { SCAN_NS = 20000000, EVENTS_MAX = 256 };

const char *const load_error_names[LOAD_ERROR_COUNT] = {
	[LOAD_NO_CONNECTION] = "no connection", [LOAD_BROKEN] = "broken", [LOAD_NO_HTTP] = "no HTTP", [LOAD_TIMED_OUT] = "timed out"};

/* Times of requests that are due and not sent, first in first out. */
struct due_list {
	int64_t *time_ns;
	size_t first, count, room;
};

struct load {
	const struct load_settings *settings;
	struct mix *mix;
	struct load_result *result;
	struct server_address address;
	struct draws gaps;
	int epoll;
	struct connection *connection; /* settings->connections of them */
	int *idle, idle_count;         /* indices of open ones without a request, the one used last on top */
	int *closed, closed_count;     /* of those not open */
	int busy;
	struct due_list due;
	int64_t begin_ns, measure_ns, end_ns, next_ns, scan_ns;
	uint64_t planned; /* of an open load, warm-up included */
	bool failed;
};

static volatile sig_atomic_t interrupted;

static void interrupt(int number)
{
	(void)number;
	interrupted = 1;
}

void load_catch_interrupts(void)
{
	const struct sigaction on_interrupt = {.sa_handler = interrupt, .sa_flags = SA_RESETHAND};
	sigaction(SIGINT, &on_interrupt, NULL);
	sigaction(SIGTERM, &on_interrupt, NULL);
}

static int64_t now_ns(void)
{
	struct timespec now;
	clock_gettime(CLOCK_MONOTONIC, &now);
	return now.tv_sec * (int64_t)SECOND_NS + now.tv_nsec;
}

static bool due_push(struct due_list *due, int64_t time_ns)
{
	if (due->count == due->room) {
		const size_t room = due->room ? 2 * due->room : 1024;
		int64_t *times = malloc(room * sizeof *times);
		if (!times)
			return false;
		for (size_t i = 0; i < due->count; i++)
			times[i] = due->time_ns[(due->first + i) % due->room];
		free(due->time_ns);
		*due = (struct due_list){times, 0, due->count, room};
	}
	due->time_ns[(due->first + due->count++) % due->room] = time_ns;
	return true;
}

static int64_t due_pop(struct due_list *due)
{
	const int64_t time_ns = due->time_ns[due->first];
	due->first = (due->first + 1) % due->room;
	due->count--;
	return time_ns;
}

/* --- what is measured ---------------------------------------------------------------------------------------------------------------- */

static struct histogram *histogram_for(struct load_result *result, int status)
{
	const bool good = (status >= 200 && status < 300) || status == 304;
	return good ? result->good : status == 429 || status == 503 ? result->refused : result->other;
}

static struct histogram *stage_histogram(struct load_result *result, const char *name)
{
	for (int i = 0; i < result->stages; i++)
		if (strcmp(result->stage[i].name, name) == 0)
			return result->stage[i].latency;
	if (result->stages == LOAD_STAGES_MAX)
		return NULL;
	struct load_stage *stage = &result->stage[result->stages];
	stage->latency = histogram_create();
	if (!stage->latency)
		return NULL;
	snprintf(stage->name, sizeof stage->name, "%s", name);
	result->stages++;
	return stage->latency;
}

static void record_stages(struct load_result *result, const char *server_timing)
{
	struct timing_table table;
	timing_parse(server_timing, &table);
	for (int i = 0; i < table.count; i++) {
		struct histogram *histogram = stage_histogram(result, table.row[i].name);
		if (histogram)
			histogram_record(histogram, (int64_t)(table.row[i].milliseconds * 1e6));
	}
}

static void record_answer(struct load *load, const struct connection *connection, int64_t now)
{
	struct load_result *result = load->result;
	const int64_t latency = now - connection->planned_ns;
	struct histogram *histogram = histogram_for(result, connection->status);
	result->status[connection->status]++;
	result->bytes += connection->bytes;
	histogram_record(histogram, latency);
	if (histogram != result->good)
		return;
	histogram_record(result->kind[connection->request.kind], latency);
	record_stages(result, connection->server_timing);
	result->good_seconds_end = (double)(now - load->measure_ns) / SECOND_NS;
}

static void record_error(struct load *load, bool measured, enum load_error error)
{
	if (measured)
		load->result->error[error]++;
}

/* --- connections -----------------------------------------------------------------------------------------------------------------------
 */

static void release(struct load *load, int index)
{
	struct connection *connection = &load->connection[index];
	connection_finish_request(connection);
	load->busy--;
	if (connection->state == CONNECTION_IDLE)
		load->idle[load->idle_count++] = index;
	else
		load->closed[load->closed_count++] = index;
}

static enum connection_event begin(struct load *load, int index, struct mix_request *request)
{
	struct connection *connection = &load->connection[index];
	const bool fresh = connection->state == CONNECTION_CLOSED;
	const enum connection_event event = connection_start(connection, load->address.found, request);
	if (event == CONNECTION_GOES_ON && fresh) {
		struct epoll_event interest = {.events = EPOLLIN | EPOLLOUT | EPOLLRDHUP | EPOLLET, .data.u32 = (uint32_t)index};
		if (epoll_ctl(load->epoll, EPOLL_CTL_ADD, connection->fd, &interest) != 0) {
			connection_close(connection);
			return CONNECTION_REFUSED;
		}
	}
	return event == CONNECTION_GOES_ON ? connection_ask(connection) : event;
}

/* Goes on with a connection after something happened to it. */
static void settle(struct load *load, int index, enum connection_event event)
{
	static const enum load_error errors[] = {
		[CONNECTION_REFUSED] = LOAD_NO_CONNECTION, [CONNECTION_BROKEN] = LOAD_BROKEN, [CONNECTION_CONFUSED] = LOAD_NO_HTTP};
	struct connection *connection = &load->connection[index];
	if (event == CONNECTION_STALE) {
		struct mix_request again = connection->request;
		event = begin(load, index, &again);
	}
	if (event == CONNECTION_GOES_ON)
		return;
	if (event != CONNECTION_ANSWERED)
		record_error(load, connection->measured, errors[event]);
	else if (connection->measured)
		record_answer(load, connection, now_ns());
	release(load, index);
}

static void start_request(struct load *load, int64_t planned_ns)
{
	struct mix_request request;
	const int index = load->idle_count ? load->idle[--load->idle_count] : load->closed[--load->closed_count];
	struct connection *connection = &load->connection[index];
	load->busy++;
	const int open = load->busy + load->idle_count;
	if (open > load->result->connections)
		load->result->connections = open;
	connection->planned_ns = planned_ns;
	connection->measured = planned_ns >= load->measure_ns;
	load->result->planned += connection->measured;
	if (!mix_draw(load->mix, &request)) {
		load->failed = true;
		release(load, index);
		return;
	}
	settle(load, index, begin(load, index, &request));
}

static void drop_idle(struct load *load, int index)
{
	for (int i = 0; i < load->idle_count; i++)
		if (load->idle[i] == index) {
			load->idle[i] = load->idle[--load->idle_count];
			load->closed[load->closed_count++] = index;
			break;
		}
	connection_close(&load->connection[index]);
}

/* The end of a connection may come with the last answer on it. */
static void take_event(struct load *load, const struct epoll_event *event)
{
	const int index = (int)event->data.u32;
	struct connection *connection = &load->connection[index];
	const bool busy = connection->state != CONNECTION_IDLE && connection->state != CONNECTION_CLOSED;
	if (busy)
		settle(load, index, connection_advance(connection));
	const bool ends = event->events & (EPOLLRDHUP | EPOLLHUP | EPOLLERR);
	if (connection->state == CONNECTION_IDLE && (!busy || ends) && connection_is_dead(connection))
		drop_idle(load, index);
}

/* Gives up what has waited too long. */
static void scan(struct load *load, int64_t now)
{
	const int64_t limit = now - (int64_t)(load->settings->timeout_s * SECOND_NS);
	for (int i = 0; i < load->settings->connections; i++) {
		struct connection *connection = &load->connection[i];
		const bool busy = connection->state != CONNECTION_CLOSED && connection->state != CONNECTION_IDLE;
		if (busy && connection->planned_ns < limit) {
			record_error(load, connection->measured, LOAD_TIMED_OUT);
			connection_close(connection);
			release(load, i);
		}
	}
	while (load->due.count > 0 && load->due.time_ns[load->due.first] < limit) {
		const bool measured = due_pop(&load->due) >= load->measure_ns;
		load->result->planned += measured;
		record_error(load, measured, LOAD_TIMED_OUT);
	}
	load->scan_ns = now + SCAN_NS;
}

/* --- the plan ----------------------------------------------------------------------------------------------------------------------------
 */

/* Even times are counted from the beginning, so that rounding does not add up. */
static void plan_next(struct load *load)
{
	const double gap = SECOND_NS / load->settings->rate;
	load->planned++;
	if (load->settings->random_arrivals)
		load->next_ns += (int64_t)(-gap * log(1 - draws_next(&load->gaps)));
	else
		load->next_ns = load->begin_ns + (int64_t)((double)load->planned * gap);
}

static bool plan_is_open(const struct load *load, int64_t now)
{
	return load->settings->rate > 0 ? load->next_ns < load->end_ns : now < load->end_ns;
}

/* What is due by now is asked, as far as there are connections for it. */
static void follow_plan(struct load *load, int64_t now)
{
	const int room = load->idle_count + load->closed_count;
	if (load->settings->rate <= 0) {
		for (int i = 0; i < room && now < load->end_ns; i++)
			start_request(load, now);
		return;
	}
	for (; load->next_ns <= now && plan_is_open(load, now); plan_next(load)) {
		load->result->late += load->due.count >= (size_t)room && load->next_ns >= load->measure_ns;
		load->failed |= !due_push(&load->due, load->next_ns);
	}
	while (load->due.count > 0 && load->idle_count + load->closed_count > 0 && !load->failed)
		start_request(load, due_pop(&load->due));
}

static void await(struct load *load)
{
	struct epoll_event events[EVENTS_MAX];
	const int64_t now = now_ns();
	int64_t until = load->scan_ns;
	if (load->settings->rate > 0 && plan_is_open(load, now) && load->next_ns < until)
		until = load->next_ns;
	const int64_t wait = until > now ? until - now : 0;
	const struct timespec patience = {wait / (int64_t)SECOND_NS, wait % (int64_t)SECOND_NS};
	const int count = epoll_pwait2(load->epoll, events, EVENTS_MAX, &patience, NULL);
	for (int i = 0; i < count; i++)
		take_event(load, &events[i]);
}

/* The measured time ends here. Who waits for an answer is no error, and is told apart. */
static void break_off(struct load *load)
{
	struct load_result *result = load->result;
	const double measured_s = (double)(now_ns() - load->measure_ns) / SECOND_NS;
	uint64_t asked = 0;
	for (int i = 0; i < load->settings->connections; i++) {
		const struct connection *connection = &load->connection[i];
		asked += connection->state != CONNECTION_CLOSED && connection->state != CONNECTION_IDLE && connection->measured;
	}
	result->planned -= asked;
	result->unanswered = asked;
	while (load->due.count > 0)
		result->unanswered += due_pop(&load->due) >= load->measure_ns;
	if (measured_s < result->seconds)
		result->seconds = measured_s > 0 ? measured_s : 0;
}

static void drive(struct load *load)
{
	load->begin_ns = load->next_ns = now_ns();
	load->scan_ns = load->begin_ns + SCAN_NS;
	load->measure_ns = load->begin_ns + (int64_t)(load->settings->warm_up_s * SECOND_NS);
	load->end_ns = load->measure_ns + (int64_t)(load->settings->duration_s * SECOND_NS);
	for (int64_t now = load->begin_ns;
	     !load->failed && !interrupted && (plan_is_open(load, now) || load->busy > 0 || load->due.count > 0); now = now_ns()) {
		follow_plan(load, now);
		await(load);
		if (now >= load->scan_ns)
			scan(load, now);
	}
}

/* --- a run -----------------------------------------------------------------------------------------------------------------------------
 */

static bool create_result(struct load_result *result, int kinds)
{
	result->good = histogram_create();
	result->refused = histogram_create();
	result->other = histogram_create();
	bool good = result->good && result->refused && result->other;
	for (int i = 0; i < kinds; i++)
		good &= (result->kind[i] = histogram_create()) != NULL;
	return good;
}

void load_result_finish(struct load_result *result)
{
	histogram_destroy(result->good);
	histogram_destroy(result->refused);
	histogram_destroy(result->other);
	for (int i = 0; i < MIX_KINDS_MAX; i++)
		histogram_destroy(result->kind[i]);
	for (int i = 0; i < result->stages; i++)
		histogram_destroy(result->stage[i].latency);
	*result = (struct load_result){0};
}

static bool create_load(struct load *load, const struct client *client)
{
	char headers[64] = "";
	const size_t count = (size_t)load->settings->connections;
	if (client->timeout_s > 0)
		snprintf(headers, sizeof headers, "X-Timeout-Ms: %.0f\r\n", ceil(client->timeout_s * 1000));
	load->epoll = epoll_create1(EPOLL_CLOEXEC);
	load->connection = calloc(count, sizeof *load->connection);
	load->idle = calloc(count, sizeof *load->idle);
	load->closed = calloc(count, sizeof *load->closed);
	if (load->epoll < 0 || !load->connection || !load->idle || !load->closed)
		return false;
	for (int i = load->settings->connections; i > 0; i--)
		load->closed[load->closed_count++] = i - 1;
	load->gaps = draws_begin((uint64_t)load->settings->seed + 1);
	return mix_prepare(load->mix, load->address.host, headers, (uint64_t)load->settings->seed) &&
	       create_result(load->result, mix_kind_count(load->mix));
}

static void destroy_load(struct load *load)
{
	for (int i = 0; load->connection && i < load->settings->connections; i++) {
		connection_finish_request(&load->connection[i]);
		connection_close(&load->connection[i]);
	}
	if (load->epoll >= 0)
		close(load->epoll);
	free(load->connection);
	free(load->idle);
	free(load->closed);
	free(load->due.time_ns);
	server_address_finish(&load->address);
}

static double processor_s(void)
{
	struct rusage usage;
	getrusage(RUSAGE_SELF, &usage);
	return (double)(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) + 1e-6 * (double)(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
}

/* Each connection is a descriptor, and some more. */
static void allow_descriptors(int connections)
{
	struct rlimit limit;
	const rlim_t wanted = (rlim_t)connections + 64;
	if (getrlimit(RLIMIT_NOFILE, &limit) == 0 && limit.rlim_cur < wanted && limit.rlim_cur < limit.rlim_max) {
		limit.rlim_cur = wanted < limit.rlim_max ? wanted : limit.rlim_max;
		setrlimit(RLIMIT_NOFILE, &limit);
	}
}

int load_run(const struct client *client, struct mix *mix, const struct load_settings *settings, struct load_result *result)
{
	struct load load = {.settings = settings, .mix = mix, .result = result, .epoll = -1};
	*result = (struct load_result){.seconds = settings->duration_s};
	int status = server_address_find(client->server, &load.address);
	allow_descriptors(settings->connections);
	prctl(PR_SET_TIMERSLACK, 1000UL, 0, 0, 0); /* waits end within a microsecond of their time, where the kernel can */
	if (status == CLIENT_OK) {
		const double before_s = processor_s();
		load.failed = !create_load(&load, client);
		if (!load.failed)
			drive(&load);
		if (interrupted && !load.failed) {
			break_off(&load);
			status = CLIENT_INTERRUPTED;
		}
		result->processor_s = processor_s() - before_s;
		if (load.failed) {
			client_error("out of memory");
			status = CLIENT_USAGE;
		}
	}
	destroy_load(&load);
	return status;
}
