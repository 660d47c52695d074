/* stratusd: settings, signals, and the life of the service. */
#include "renderer/log.h"
#include "server/service.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

/* The signals that end the daemon, blocked in all threads and fetched by the main thread. */
static sigset_t block_signals(void)
{
	sigset_t signals;
	sigemptyset(&signals);
	sigaddset(&signals, SIGTERM);
	sigaddset(&signals, SIGINT);
	pthread_sigmask(SIG_BLOCK, &signals, NULL);
	signal(SIGPIPE, SIG_IGN);
	signal(SIGXFSZ, SIG_IGN); /* a limit on the size of files is an error of writing them */
	return signals;
}

/* A signal this early finds no accepted work; bringing up OpenGL cannot be interrupted, so the process ends where it is. */
static void leave_on_signal(const sigset_t *signals)
{
	const struct timespec now = {0};
	if (sigtimedwait(signals, NULL, &now) > 0) {
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

int main(int argc, char **argv)
{
	struct config config;
	switch (config_parse(argc, argv, &config)) {
	case CONFIG_DONE:
		return EXIT_SUCCESS;
	case CONFIG_BAD:
		return 2;
	case CONFIG_RUN:
		break;
	}
	log_set_level((enum log_level)config.log_level);
	log_set_format((enum log_format)config.log_format);
	sigset_t signals = block_signals();
	struct service *service = service_create(&config);
	bool ready = service && wait_until_ready(service, &signals);
	if (ready) {
		printf("stratusd listening on http://%s:%u\n", service->host, service->port);
		fflush(stdout);
		int number = sigwaitinfo(&signals, NULL);
		log_info("%s: finishing accepted work", number == SIGINT ? "SIGINT" : "SIGTERM");
	}
	service_destroy(service);
	return ready ? EXIT_SUCCESS : EXIT_FAILURE;
}
