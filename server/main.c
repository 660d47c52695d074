/* stratusd: settings, signals, and the life of the service. */
#include "renderer/log.h"
#include "server/config_check.h"
#include "server/decoder_process.h"
#include "server/service.h"
#include "server/supervisor.h"

#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum { EXIT_BAD_CONFIG = 2 };

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

/* Serves until a signal ends it. The supervisor hears of the daemon as long as a restart would not help; then it makes that restart. */
static int wait_for_signal(struct service *service, const sigset_t *signals)
{
	const int interval_ms = supervisor_interval_ms();
	const struct timespec interval = {.tv_sec = interval_ms / 1000, .tv_nsec = interval_ms % 1000 * 1000000L};
	int number;
	while ((number = interval_ms ? sigtimedwait(signals, NULL, &interval) : sigwaitinfo(signals, NULL)) < 0 || number == SIGHUP)
		if (number == SIGHUP)
			reload(service);
		else if (errno == EAGAIN && service_state(service) != SERVICE_FAILED)
			supervisor_tell("WATCHDOG=1");
	return number;
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
		int number = wait_for_signal(service, &signals);
		supervisor_tell("STOPPING=1\nSTATUS=Finishing accepted work.");
		log_info("%s: finishing accepted work", number == SIGINT ? "SIGINT" : "SIGTERM");
	}
	service_destroy(service);
	return ready ? EXIT_SUCCESS : EXIT_FAILURE;
}
