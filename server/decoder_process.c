#include "server/decoder_process.h"

#include "server/clock.h"
#include "server/decoder_wire.h"

#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

enum { EXIT_SHUT_OUT = 90, LOOK_MS = 100 };

struct job {
	struct decoder_request request;
	int picture, memory; /* descriptors; negative: did not come */
};

static size_t map_values(const struct decoder_request *request)
{
	return request->wants_map ? (size_t)request->width * (size_t)request->height * (size_t)request->channels : 0;
}

/* --- the copy that dies with its picture --------------------------------------------------------------------------------------------- */

static bool make_map(const struct image_api *images, const struct job *job, struct decoder_findings *findings)
{
	static const unsigned char no_hash[SCENE_MAP_HASH_BYTES];
	const struct decoder_request *request = &job->request;
	struct scene_map *map = asset_decode(images, job->picture, request->picture_bytes, request->use, request->side, no_hash,
					     findings->error, sizeof findings->error);
	const bool fits = map && map->width == request->width && map->height == request->height && map->channels == request->channels;
	if (map && !fits)
		snprintf(findings->error, sizeof findings->error, "has another size than before");
	if (fits)
		memcpy((char *)findings + DECODER_VALUES_AT, map->values, map_values(request) * sizeof(float));
	return fits; /* the map goes with the process */
}

static _Noreturn void decode(const struct image_api *images, const struct job *job)
{
	const size_t size = DECODER_VALUES_AT + map_values(&job->request) * sizeof(float);
	struct decoder_findings *findings = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED, job->memory, 0);
	close(DECODER_SOCKET);
	prctl(PR_SET_PDEATHSIG, SIGKILL);
	if (findings == MAP_FAILED || !sandbox_enter(&job->request.limits))
		_exit(EXIT_SHUT_OUT);
	const bool usable = job->request.wants_map ? make_map(images, job, findings)
						   : asset_examine(images, job->picture, job->request.picture_bytes, &findings->facts,
								   findings->error, sizeof findings->error);
	findings->verdict = usable ? DECODER_USABLE : DECODER_REFUSED_IT;
	_exit(EXIT_SUCCESS);
}

/* --- the process that stays ---------------------------------------------------------------------------------------------------------- */

static bool daemon_is_gone(void)
{
	struct pollfd poll_fd = {.fd = DECODER_SOCKET, .events = POLLRDHUP};
	return poll(&poll_fd, 1, 0) > 0 && (poll_fd.revents & (POLLRDHUP | POLLHUP | POLLERR));
}

/* Waits for the end of the copy, and makes it when it comes too late or nobody waits any more. */
static struct decoder_reply await(pid_t child, double until_ms, const sigset_t *child_ends)
{
	const struct timespec look = {.tv_nsec = LOOK_MS * 1000000L};
	struct decoder_reply reply = {.end = DECODER_ENDED};
	int status = 0;
	pid_t ended;
	while ((ended = waitpid(child, &status, WNOHANG)) == 0) {
		if (clock_now_ms() >= until_ms || daemon_is_gone()) {
			kill(child, SIGKILL);
			waitpid(child, &status, 0);
			return (struct decoder_reply){.end = DECODER_KILLED};
		}
		sigtimedwait(child_ends, NULL, &look);
	}
	if (ended < 0 || (WIFEXITED(status) && WEXITSTATUS(status) == EXIT_SHUT_OUT))
		reply.end = DECODER_BROKEN;
	else if (WIFSIGNALED(status))
		reply = (struct decoder_reply){.end = DECODER_DIED, .signal = WTERMSIG(status)};
	return reply;
}

static bool receive(struct job *job)
{
	char control[CMSG_SPACE(2 * sizeof(int))] __attribute__((aligned(sizeof(size_t))));
	struct iovec part = {.iov_base = &job->request, .iov_len = sizeof job->request};
	struct msghdr message = {.msg_iov = &part, .msg_iovlen = 1, .msg_control = control, .msg_controllen = sizeof control};
	ssize_t got;
	job->picture = job->memory = -1;
	while ((got = recvmsg(DECODER_SOCKET, &message, MSG_CMSG_CLOEXEC)) < 0 && errno == EINTR)
		;
	if (got != (ssize_t)sizeof job->request)
		return false;
	const struct cmsghdr *header = CMSG_FIRSTHDR(&message);
	if (header && header->cmsg_type == SCM_RIGHTS && header->cmsg_len == CMSG_LEN(2 * sizeof(int))) {
		int descriptors[2];
		memcpy(descriptors, CMSG_DATA(header), sizeof descriptors);
		job->picture = descriptors[0];
		job->memory = descriptors[1];
	}
	return job->picture >= 0;
}

void decoder_process_serve(const struct image_api *images)
{
	sigset_t child_ends;
	sigemptyset(&child_ends);
	sigaddset(&child_ends, SIGCHLD);
	sigprocmask(SIG_BLOCK, &child_ends, NULL);
	for (struct job job; receive(&job);) {
		const double until_ms = clock_now_ms() + job.request.wall_ms;
		const pid_t child = fork();
		if (child == 0)
			decode(images, &job);
		const struct decoder_reply reply =
			child < 0 ? (struct decoder_reply){.end = DECODER_BROKEN} : await(child, until_ms, &child_ends);
		close(job.picture);
		close(job.memory);
		if (send(DECODER_SOCKET, &reply, sizeof reply, MSG_NOSIGNAL) != (ssize_t)sizeof reply)
			break;
	}
}

/* A picture of our own, 1 x 1: what libraries prepare when they are first used, each copy then has. */
static void warm_up(const struct image_api *images)
{
	static const unsigned char png[] = {0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48,
					    0x44, 0x52, 0x00, 0x00, 0x00, 0x01, 0x00, 0x00, 0x00, 0x01, 0x08, 0x00, 0x00, 0x00,
					    0x00, 0x3a, 0x7e, 0x9b, 0x55, 0x00, 0x00, 0x00, 0x0a, 0x49, 0x44, 0x41, 0x54, 0x78,
					    0x9c, 0x63, 0x68, 0x00, 0x00, 0x00, 0x82, 0x00, 0x81, 0x77, 0xcd, 0x72, 0xb6, 0x00,
					    0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82};
	struct asset_facts facts;
	char error[DECODER_ERROR_SIZE];
	const int fd = memfd_create("stratus-warm-up", MFD_CLOEXEC);
	if (fd < 0)
		return;
	if (write(fd, png, sizeof png) == (ssize_t)sizeof png)
		asset_examine(images, fd, sizeof png, &facts, error, sizeof error);
	close(fd);
}

int decoder_process_main(const char *image_module)
{
	prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
	const struct image_api *images = image_module_load(*image_module ? image_module : NULL);
	if (!images)
		return EXIT_FAILURE;
	warm_up(images);
	decoder_process_serve(images);
	return EXIT_SUCCESS;
}
