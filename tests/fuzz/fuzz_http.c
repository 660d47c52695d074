/* Bytes into the daemon's own port: the whole service runs in this process, renderer included. The first byte tells how the rest is sent:
 * into how many pieces it is cut, and whether the client waits for an answer or goes at once. What comes back must be answers of HTTP, none
 * of them 500: nothing that a stranger sends is the daemon's fault. Now and then the daemon must still answer a plain question. */
#include "renderer/log.h"
#include "server/config.h"
#include "server/service.h"
#include "tests/fuzz/target.h"

#include <arpa/inet.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

static struct config config;
static struct service *service;
static char state_dir[] = "/tmp/stratus-fuzz-XXXXXX";

static void stop(void)
{
	service_destroy(service);
	char command[128];
	snprintf(command, sizeof command, "rm -rf '%s'", state_dir);
	if (system(command) != 0)
		perror(command);
}

/* A short deadline, so that no input costs more than that. */
int LLVMFuzzerInitialize(int *argc, char ***argv)
{
	(void)argc;
	(void)argv;
	char *kernel = getenv("STRATUS_KERNEL"), *module = getenv("STRATUS_IMAGE_MODULE");
	FUZZ_REQUIRE(mkdtemp(state_dir));
	char *flags[] = {"stratusd",          "--listen=127.0.0.1:0",
			 "--timeout-ms=250",  "--reference-mpaths=1",
			 "--header-max-kb=1", /* so that the limits are within reach of an input */
			 "--body-max-kb=2",   "--log-level=error",
			 "--state-dir",       state_dir,
			 "--kernel",          kernel ? kernel : "build/mie.kernel",
			 "--image-module",    module ? module : "build/stratus-image.so"};
	FUZZ_REQUIRE(config_parse(sizeof flags / sizeof *flags, flags, &config) == CONFIG_RUN);
	log_set_level((enum log_level)config.log_level);
	service = service_create(&config);
	FUZZ_REQUIRE(service);
	enum service_state state;
	while ((state = service_wait(service, 1000)) == SERVICE_STARTING)
		;
	FUZZ_REQUIRE(state == SERVICE_READY);
	atexit(stop);
	return 0;
}

/* Each from an address of its own, so that ports that wait for stray packets do not run out. */
static int connect_to_service(void)
{
	static uint32_t count;
	const int client = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
	const struct sockaddr_in from = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(0x7f000002 + count++ % 0xfffff)};
	const struct sockaddr_in to = {
		.sin_family = AF_INET, .sin_port = htons((uint16_t)service->port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
	FUZZ_REQUIRE(client >= 0 && bind(client, (const struct sockaddr *)&from, sizeof from) == 0);
	FUZZ_REQUIRE(connect(client, (const struct sockaddr *)&to, sizeof to) == 0);
	return client;
}

/* A server may close before it has read everything. */
static void send_pieces(int client, const uint8_t *data, size_t size, size_t pieces)
{
	for (size_t i = 0; i < pieces; i++) {
		const size_t from = size * i / pieces, to = size * (i + 1) / pieces;
		if (to > from && send(client, data + from, to - from, MSG_NOSIGNAL) < 0)
			break;
	}
}

/* What comes until the end of the connection, or until nothing has come for so long; the first bytes are kept. */
static size_t receive(int client, int patience_ms, char *head, size_t head_size)
{
	static char rest[1 << 16];
	size_t length = 0;
	struct pollfd readable = {.fd = client, .events = POLLIN};
	while (poll(&readable, 1, patience_ms) > 0) {
		const bool full = length + 1 >= head_size;
		const ssize_t got = full ? recv(client, rest, sizeof rest, 0) : recv(client, head + length, head_size - 1 - length, 0);
		if (got <= 0)
			break;
		length += full ? 0 : (size_t)got;
	}
	head[length] = 0;
	return length;
}

static size_t ask(const uint8_t *data, size_t size, size_t pieces, int patience_ms, char *head, size_t head_size)
{
	const int client = connect_to_service();
	send_pieces(client, data, size, pieces);
	const size_t length = receive(client, patience_ms, head, head_size);
	close(client);
	return length;
}

static void require_alive(void)
{
	static const char question[] = "GET /healthz HTTP/1.1\r\nHost: a\r\nConnection: close\r\n\r\n";
	char head[1024];
	ask((const uint8_t *)question, sizeof question - 1, 1, 20000, head, sizeof head);
	FUZZ_REQUIRE(strncmp(head, "HTTP/1.1 200", 12) == 0);
	FUZZ_REQUIRE(service_state(service) == SERVICE_READY);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	static unsigned count;
	if (size < 2)
		return -1;
	char head[1024];
	const int patience_ms = data[0] & 4 ? 100 : data[0] & 8 ? 0 : 4;
	const size_t length = ask(data + 1, size - 1, 1 + data[0] % 4, patience_ms, head, sizeof head);
	if (length >= 12) {
		FUZZ_REQUIRE(strncmp(head, "HTTP/1.", 7) == 0);
		FUZZ_REQUIRE(strncmp(head + 8, " 500", 4) != 0);
	}
	if (++count % 64 == 1)
		require_alive();
	return 0;
}
