#include "server/supervisor.h"

#include "renderer/log.h"

#include <errno.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

void supervisor_tell(const char *state)
{
	const char *path = getenv("NOTIFY_SOCKET");
	struct sockaddr_un address = {.sun_family = AF_UNIX};
	if (!path || !*path)
		return;
	const size_t length = strlen(path);
	if (length >= sizeof address.sun_path) {
		log_warning("NOTIFY_SOCKET: the name is too long");
		return;
	}
	memcpy(address.sun_path, path, length);
	if (*path == '@')
		address.sun_path[0] = '\0'; /* an abstract address */
	const socklen_t size = (socklen_t)(offsetof(struct sockaddr_un, sun_path) + length);
	const int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
	if (fd < 0 || sendto(fd, state, strlen(state), MSG_NOSIGNAL, (const struct sockaddr *)&address, size) < 0)
		log_warning("NOTIFY_SOCKET %s: %s", path, strerror(errno));
	if (fd >= 0)
		close(fd);
}

int supervisor_interval_ms(void)
{
	const char *microseconds = getenv("WATCHDOG_USEC"), *process = getenv("WATCHDOG_PID");
	if (!microseconds || (process && strtol(process, NULL, 10) != (long)getpid()))
		return 0;
	const long long milliseconds = strtoll(microseconds, NULL, 10) / 1000 / 2; /* half, as sd_watchdog_enabled(3) advises */
	return milliseconds < 1 ? 0 : milliseconds > 3600000 ? 3600000 : (int)milliseconds;
}
