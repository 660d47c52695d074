/* stratusd: settings, signals, and the life of the service. */
#include "renderer/log.h"
#include "server/clock.h"
#include "server/config_check.h"
#include "server/decoder_process.h"
#include "server/service.h"
#include "server/supervisor.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum { EXIT_BAD_CONFIG = 2, EXIT_NO_RENDERER = 3 };

/* So often the main thread looks whether the renderer hangs. */
enum { LOOK_MS = 200 };

/* The signals that end the daemon, and the one that has it read keys and certificate again: blocked in all threads and fetched by the main
 * thread. */
static sigset_t block_signals(void)
{
	sigset_t signals;
	sigemptyset(&signals);
	sigaddset(&signals, SIGTERM);
	sigaddset(&signals, SIGINT);
	sigaddset(&signals, SIGHUP);
	pthread_sigmask(SIG_BLOCK, &signals, NULL);
	signal(SIGPIPE, SIG_IGN);
	signal(SIGXFSZ, SIG_IGN); /* a limit on the size of files is an error of writing them */
	return signals;
}

/* A signal this early finds no accepted work; bringing up OpenGL cannot be interrupted, so the process ends where it is. */
static void leave_on_signal(const sigset_t *signals)
{
	const struct timespec now = {0};
	sigset_t ends = *signals;
	sigdelset(&ends, SIGHUP); /* waits until there is something to reload */
	if (sigtimedwait(&ends, NULL, &now) > 0) {
		log_info("stopped while starting");
		_exit(EXIT_SUCCESS);
	}
}

static bool wait_until_ready(struct service *service, const sigset_t *signals)
{
	enum service_state state;
	while ((state = service_wait(service, 50)) == SERVICE_STARTING)
		leave_on_signal(signals);
	return state == SERVICE_READY;
}

static void reload(struct service *service)
{
	struct timespec now;
	char text[64];
	clock_gettime(CLOCK_MONOTONIC, &now);
	snprintf(text, sizeof text, "RELOADING=1\nMONOTONIC_USEC=%lld", now.tv_sec * 1000000LL + now.tv_nsec / 1000);
	supervisor_tell(text);
	log_info("SIGHUP: reading keys and certificate again");
	service_reload(service);
	supervisor_tell("READY=1");
}

/* The supervisor hears whether renders are taken, and of the daemon's life as long as a restart would not help. */
static void tell(enum service_state state, double *told_ms)
{
	static enum service_state before = SERVICE_READY;
	const int interval_ms = supervisor_interval_ms();
	if (interval_ms && clock_now_ms() >= *told_ms + interval_ms) {
		supervisor_tell("WATCHDOG=1");
		*told_ms = clock_now_ms();
	}
	if (state != before)
		supervisor_tell(state == SERVICE_RECOVERING ? "STATUS=The renderer is made anew, or no picture can be written."
							    : "STATUS=Renders are taken.");
	before = state;
}

/* Serves until a signal ends it, whose number it returns, or the renderer is gone: 0. */
static int wait_for_end(struct service *service, const sigset_t *signals)
{
	double told_ms = clock_now_ms();
	const int interval_ms = supervisor_interval_ms();
	const struct timespec interval = {.tv_nsec = (interval_ms && interval_ms < LOOK_MS ? interval_ms : LOOK_MS) * 1000000L};
	enum service_state state;
	while ((state = service_state(service)) != SERVICE_FAILED) {
		tell(state, &told_ms);
		const int number = sigtimedwait(signals, NULL, &interval);
		if (number == SIGHUP)
			reload(service);
		else if (number > 0)
			return number;
	}
	return 0;
}

/* A signal that comes twice within this time is one: terminals and wrappers both pass it on. */
#define SECOND_SIGNAL_MS 1000.0

static double first_signal_ms;

static void leave_at_once(int number)
{
	static const char text[] = "stopped at once by a second signal, accepted work is left\n";
	(void)number;
	if (clock_now_ms() < first_signal_ms + SECOND_SIGNAL_MS)
		return;
	(void)!write(STDERR_FILENO, text, sizeof text - 1);
	_exit(EXIT_FAILURE);
}

/* Whoever asks again means it. */
static void allow_second_signal(const sigset_t *signals)
{
	sigset_t ends = *signals;
	sigdelset(&ends, SIGHUP);
	first_signal_ms = clock_now_ms();
	signal(SIGTERM, leave_at_once);
	signal(SIGINT, leave_at_once);
	pthread_sigmask(SIG_UNBLOCK, &ends, NULL);
}

/* Nothing can be waited for that hangs in a driver: the process ends where it is, and a supervisor starts another one. */
static void abandon(struct service *service)
{
	log_error("the renderer hangs or is gone: ending, to be started anew");
	supervisor_tell("STOPPING=1\nSTATUS=The renderer hangs or is gone.");
	service_abandon(service);
	_exit(EXIT_NO_RENDERER);
}

static void set_log(const struct config *config)
{
	log_set_level((enum log_level)config->log_level);
	log_set_format((enum log_format)config->log_format);
}

int main(int argc, char **argv)
{
	struct config config;
	if (argc == 3 && strcmp(argv[1], DECODER_PROCESS_FLAG) == 0)
		return decoder_process_main(argv[2]);
	switch (config_parse(argc, argv, &config)) {
	case CONFIG_DONE:
		return EXIT_SUCCESS;
	case CONFIG_BAD:
		return EXIT_BAD_CONFIG;
	case CONFIG_CHECK:
		set_log(&config);
		return config_check(&config) ? EXIT_SUCCESS : EXIT_BAD_CONFIG;
	case CONFIG_RUN:
		break;
	}
	set_log(&config);
	if (!config_is_consistent(&config))
		return EXIT_BAD_CONFIG;
	sigset_t signals = block_signals();
	struct service *service = service_create(&config);
	bool ready = service && wait_until_ready(service, &signals);
	if (ready) {
		printf("stratusd listening on %s://%s:%u\n", config.tls_cert ? "https" : "http", service->host, service->port);
		fflush(stdout);
		supervisor_tell("READY=1\nSTATUS=Renders are taken.");
		const int number = wait_for_end(service, &signals);
		if (!number)
			abandon(service);
		allow_second_signal(&signals);
		supervisor_tell("STOPPING=1\nSTATUS=Finishing accepted work.");
		log_info("%s: finishing accepted work", number == SIGINT ? "SIGINT" : "SIGTERM");
	}
	service_destroy(service);
	return ready ? EXIT_SUCCESS : EXIT_FAILURE;
}
