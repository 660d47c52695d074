#include "server/decoder.h"

#include "renderer/log.h"
#include "server/clock.h"
#include "server/decoder_process.h"
#include "server/decoder_wire.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <spawn.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#if defined __SANITIZE_ADDRESS__ || defined __SANITIZE_THREAD__
enum { SLOWNESS = 5, IS_SANITIZED = 1 };
#else
enum { SLOWNESS = 1, IS_SANITIZED = 0 };
#endif

const struct decoder_limits decoder_default_limits = {
	.process = {.memory_bytes = 1 << 30, .cpu_seconds = 60 * SLOWNESS},
	.wall_ms = 120000 * SLOWNESS,
};

/* That the process has for its answer beyond the time of the picture, the loading of its libraries included. */
enum { GRACE_MS = 30000 };
/* How often one that waits for an answer looks whether it is to give up. */
enum { LOOK_MS = 100 };

struct decoder {
	const char *image_module;
	struct decoder_limits limits;
	pthread_mutex_t mutex; /* one picture at a time, and what follows */
	pid_t process;         /* 0: none runs */
	int socket;
	_Atomic bool given_up;
};

/* A picture on its way through the process. */
struct passage {
	struct decoder_request request;
	int picture, memory;
	size_t memory_bytes;
	const struct decoder_findings *findings;
	struct decoder_reply reply;
	double deadline_ms;
	bool until_deadline; /* that comes before the time of a picture is over */
	char *error;
	size_t error_size;
};

__attribute__((format(printf, 2, 3))) static enum decoder_result refuse(const struct passage *passage, const char *format, ...)
{
	va_list args;
	va_start(args, format);
	vsnprintf(passage->error, passage->error_size, format, args);
	va_end(args);
	return DECODER_REFUSED;
}

/* --- the process --------------------------------------------------------------------------------------------------------------------- */

struct decoder *decoder_create(const char *image_module, const struct decoder_limits *limits)
{
	struct decoder *decoder = calloc(1, sizeof *decoder);
	if (!decoder) {
		log_error("decoder_create: out of memory");
		return NULL;
	}
	decoder->image_module = image_module;
	decoder->limits = *limits;
	decoder->socket = -1;
	pthread_mutex_init(&decoder->mutex, NULL);
	return decoder;
}

/* A process that waits sees the socket close and ends by itself; one that hangs does not. */
static void end_process(struct decoder *decoder)
{
	if (!decoder->process)
		return;
	close(decoder->socket);
	kill(decoder->process, SIGKILL);
	while (waitpid(decoder->process, NULL, 0) < 0 && errno == EINTR)
		;
	decoder->process = 0;
	decoder->socket = -1;
}

void decoder_give_up(struct decoder *decoder)
{
	decoder->given_up = true;
}

void decoder_destroy(struct decoder *decoder)
{
	if (!decoder)
		return;
	end_process(decoder);
	pthread_mutex_destroy(&decoder->mutex);
	free(decoder);
}

/* What a loader and sanitizers go by. Nothing else of the daemon's environment is the decoder's business. */
static void choose_environment(char **chosen, size_t room)
{
	static const char *const prefixes[] = {"LD_", "ASAN_", "LSAN_", "UBSAN_", "TSAN_"};
	size_t count = 0;
	for (char **variable = environ; *variable; variable++)
		for (size_t i = 0; i < sizeof prefixes / sizeof *prefixes; i++)
			if (count + 1 < room && strncmp(*variable, prefixes[i], strlen(prefixes[i])) == 0)
				chosen[count++] = *variable;
	chosen[count] = NULL;
}

/* It keeps one end of the socket of all that is open here, and hears of no signal that is meant for the daemon: neither the terminal's nor
 * the supervisor's. What libraries print of a picture is the picture's word, and no line of the log. */
static int spawn(struct decoder *decoder, int socket)
{
	char *arguments[] = {"stratusd", DECODER_PROCESS_FLAG, (char *)(decoder->image_module ? decoder->image_module : ""), NULL};
	char *environment[16];
	posix_spawn_file_actions_t actions;
	posix_spawnattr_t attributes;
	sigset_t none, ignored;
	sigemptyset(&none);
	sigemptyset(&ignored);
	sigaddset(&ignored, SIGPIPE);
	sigaddset(&ignored, SIGXFSZ);
	choose_environment(environment, sizeof environment / sizeof *environment);
	posix_spawn_file_actions_init(&actions);
	posix_spawn_file_actions_adddup2(&actions, socket, DECODER_SOCKET);
	posix_spawn_file_actions_addclosefrom_np(&actions, DECODER_SOCKET + 1);
	for (int fd = STDIN_FILENO; fd <= (IS_SANITIZED ? STDOUT_FILENO : STDERR_FILENO); fd++)
		posix_spawn_file_actions_addopen(&actions, fd, "/dev/null", O_RDWR, 0);
	posix_spawnattr_init(&attributes);
	posix_spawnattr_setsigmask(&attributes, &none);
	posix_spawnattr_setsigdefault(&attributes, &ignored);
	posix_spawnattr_setpgroup(&attributes, 0);
	posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
	const int error = posix_spawn(&decoder->process, "/proc/self/exe", &actions, &attributes, arguments, environment);
	posix_spawnattr_destroy(&attributes);
	posix_spawn_file_actions_destroy(&actions);
	return error;
}

static bool start_process(struct decoder *decoder)
{
	int ends[2];
	if (decoder->process)
		return true;
	if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) != 0) {
		log_error("decoder: socketpair: %s", strerror(errno));
		return false;
	}
	const int error = spawn(decoder, ends[1]);
	close(ends[1]);
	if (error) {
		log_error("decoder: cannot be started: %s", strerror(error));
		close(ends[0]);
		decoder->process = 0;
		return false;
	}
	decoder->socket = ends[0];
	log_debug("decoder: process %d", (int)decoder->process);
	return true;
}

/* --- a picture ----------------------------------------------------------------------------------------------------------------------- */

/* The picture for reading alone, whatever it is open for here; and memory that cannot shrink under its reader. */
static bool open_passage(struct passage *passage, int fd)
{
	char name[64];
	snprintf(name, sizeof name, "/proc/self/fd/%d", fd);
	passage->picture = open(name, O_RDONLY | O_CLOEXEC);
	passage->memory = memfd_create("stratus-picture", MFD_CLOEXEC | MFD_ALLOW_SEALING);
	if (passage->picture < 0 || passage->memory < 0 || ftruncate(passage->memory, (off_t)passage->memory_bytes) != 0 ||
	    fcntl(passage->memory, F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL) != 0) {
		log_error("decoder: a picture cannot be handed over: %s", strerror(errno));
		return false;
	}
	void *findings = mmap(NULL, passage->memory_bytes, PROT_READ, MAP_SHARED, passage->memory, 0);
	if (findings == MAP_FAILED) {
		log_error("decoder: no memory for a picture: %s", strerror(errno));
		return false;
	}
	passage->findings = findings;
	return true;
}

static void close_passage(struct passage *passage)
{
	if (passage->findings)
		munmap((void *)passage->findings, passage->memory_bytes);
	if (passage->picture >= 0)
		close(passage->picture);
	if (passage->memory >= 0)
		close(passage->memory);
}

static bool send_request(const struct decoder *decoder, const struct passage *passage)
{
	char control[CMSG_SPACE(2 * sizeof(int))] __attribute__((aligned(sizeof(size_t)))) = {0};
	struct iovec part = {.iov_base = (void *)&passage->request, .iov_len = sizeof passage->request};
	const struct msghdr message = {.msg_iov = &part, .msg_iovlen = 1, .msg_control = control, .msg_controllen = sizeof control};
	struct cmsghdr *header = CMSG_FIRSTHDR(&message);
	header->cmsg_level = SOL_SOCKET;
	header->cmsg_type = SCM_RIGHTS;
	header->cmsg_len = CMSG_LEN(2 * sizeof(int));
	memcpy(CMSG_DATA(header), (int[]){passage->picture, passage->memory}, 2 * sizeof(int));
	return sendmsg(decoder->socket, &message, MSG_NOSIGNAL) == (ssize_t)sizeof passage->request;
}

static bool receive_reply(const struct decoder *decoder, struct passage *passage)
{
	const double until_ms = clock_now_ms() + passage->request.wall_ms + GRACE_MS * SLOWNESS;
	struct pollfd poll_fd = {.fd = decoder->socket, .events = POLLIN};
	int ready;
	do
		ready = poll(&poll_fd, 1, LOOK_MS);
	while ((ready == 0 || (ready < 0 && errno == EINTR)) && !decoder->given_up && clock_now_ms() < until_ms);
	return ready > 0 && recv(decoder->socket, &passage->reply, sizeof passage->reply, 0) == (ssize_t)sizeof passage->reply;
}

/* The process itself reads no picture, so that whatever ended it was not this one: it is replaced, once. */
static bool exchange(struct decoder *decoder, struct passage *passage)
{
	for (int attempt = 0; attempt < 2 && !decoder->given_up; attempt++) {
		if (!start_process(decoder))
			return false;
		if (send_request(decoder, passage) && receive_reply(decoder, passage))
			return true;
		end_process(decoder);
	}
	if (!decoder->given_up)
		log_error("decoder: its process did not answer");
	return false;
}

static enum decoder_result judge(const struct passage *passage)
{
	const struct decoder_reply *reply = &passage->reply;
	const struct decoder_findings *findings = passage->findings;
	switch (reply->end) {
	case DECODER_KILLED:
		if (passage->until_deadline)
			return DECODER_LATE;
		return refuse(passage, "takes longer than %u s to decode", passage->request.wall_ms / 1000);
	case DECODER_DIED:
		log_warning("decoder: a picture ended it by signal %d", reply->signal);
		if (reply->signal == SIGXCPU)
			return refuse(passage, "takes more than %u s of a processor to decode", passage->request.limits.cpu_seconds);
		return refuse(passage, "makes its decoder fail");
	case DECODER_ENDED:
		break;
	case DECODER_BROKEN:
		log_error("decoder: its process could not shut itself in");
		return DECODER_FAILED;
	}
	if (findings->verdict == DECODER_USABLE)
		return DECODER_OK;
	if (findings->verdict == DECODER_REFUSED_IT && memchr(findings->error, '\0', sizeof findings->error))
		return refuse(passage, "%s", findings->error);
	return refuse(passage, "makes its decoder fail");
}

static enum decoder_result pass(struct decoder *decoder, struct passage *passage, int fd)
{
	bool answered = false;
	pthread_mutex_lock(&decoder->mutex);
	const double left_ms = passage->deadline_ms - clock_now_ms();
	passage->until_deadline = left_ms < decoder->limits.wall_ms;
	passage->request.wall_ms = !passage->until_deadline ? decoder->limits.wall_ms : left_ms > 1 ? (uint32_t)left_ms : 1;
	passage->request.limits = decoder->limits.process;
	if (left_ms > 0)
		answered = open_passage(passage, fd) && exchange(decoder, passage);
	pthread_mutex_unlock(&decoder->mutex);
	return left_ms <= 0 || decoder->given_up ? DECODER_LATE : answered ? judge(passage) : DECODER_FAILED;
}

static bool are_finite(const float *values, size_t count)
{
	float poison = 0;
	for (size_t i = 0; i < count; i++)
		poison += values[i] * 0.0f; /* NaN from the first inf or NaN on */
	return poison == 0;
}

/* --- what is asked ------------------------------------------------------------------------------------------------------------------- */

static bool are_sound(const struct asset_facts *facts)
{
	return facts->format < IMAGE_FORMAT_COUNT && facts->width >= 1 && facts->width <= PICTURE_SIDE_MAX && facts->height >= 1 &&
	       facts->height <= PICTURE_SIDE_MAX && are_finite(facts->lowest, ASSET_USE_COUNT) &&
	       are_finite(facts->highest, ASSET_USE_COUNT) && are_finite(facts->mean_albedo, 3);
}

enum decoder_result decoder_examine(struct decoder *decoder, int fd, uint64_t size, double deadline_ms, struct asset_facts *facts,
				    char *error, size_t error_size)
{
	struct passage passage = {.request = {.picture_bytes = size},
				  .picture = -1,
				  .memory = -1,
				  .memory_bytes = DECODER_VALUES_AT,
				  .deadline_ms = deadline_ms,
				  .error = error,
				  .error_size = error_size};
	enum decoder_result result = pass(decoder, &passage, fd);
	if (result == DECODER_OK) {
		*facts = passage.findings->facts;
		if (!are_sound(facts))
			result = refuse(&passage, "makes its decoder fail");
	}
	close_passage(&passage);
	return result;
}

static struct scene_map *take_map(const struct passage *passage, const unsigned char hash[static SCENE_MAP_HASH_BYTES])
{
	const struct decoder_request *request = &passage->request;
	struct scene_map *map = scene_map_create(request->width, request->height, request->channels, hash);
	if (!map)
		return NULL;
	memcpy(map->values, (const char *)passage->findings + DECODER_VALUES_AT, passage->memory_bytes - DECODER_VALUES_AT);
	return map;
}

enum decoder_result decoder_read_map(struct decoder *decoder, int fd, uint64_t size, double deadline_ms, const struct asset_facts *facts,
				     enum asset_use use, int side, const unsigned char hash[static SCENE_MAP_HASH_BYTES],
				     struct scene_map **map, char *error, size_t error_size)
{
	struct passage passage = {.picture = -1, .memory = -1, .deadline_ms = deadline_ms, .error = error, .error_size = error_size};
	struct decoder_request *request = &passage.request;
	*request = (struct decoder_request){.picture_bytes = size, .wants_map = true, .use = use, .side = side};
	request->width = facts->width < side ? facts->width : side;
	request->height = facts->height < side ? facts->height : side;
	request->channels = use == ASSET_THICKNESS ? 1 : 3;
	const size_t count = (size_t)request->width * (size_t)request->height * (size_t)request->channels;
	passage.memory_bytes = DECODER_VALUES_AT + count * sizeof(float);
	*map = NULL;
	enum decoder_result result = pass(decoder, &passage, fd);
	struct scene_map *taken = result == DECODER_OK ? take_map(&passage, hash) : NULL;
	close_passage(&passage);
	if (result != DECODER_OK)
		return result;
	if (!taken) {
		log_error("decoder: no memory for a map");
		return DECODER_FAILED;
	}
	if (!are_finite(taken->values, count)) {
		scene_map_release(taken);
		return refuse(&passage, "makes its decoder fail");
	}
	scene_map_seal(taken);
	*map = taken;
	return DECODER_OK;
}
