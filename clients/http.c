#include "clients/http.h"

#include "clients/clock.h"

#include <curl/curl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { CONNECT_SECONDS = 10, GRACE_MS = 2000 }; /* grace: the daemon's own 504 says more than a broken connection */

struct body {
	char *data;
	size_t size, room;
};

struct http_exchange {
	CURL *curl;
	char *url;
	struct curl_slist *headers;
	struct body body;
	char message[CURL_ERROR_SIZE];
	double begin_s, timeout_s; /* for show_time */
	bool shown;
};

static size_t append_body(char *data, size_t one, size_t count, void *context)
{
	(void)one; /* always 1 */
	struct body *body = context;
	if (body->size + count + 1 > body->room) {
		const size_t room = 2 * (body->size + count) + 4096;
		char *grown = realloc(body->data, room);
		if (!grown)
			return 0; /* libcurl gives up */
		body->data = grown;
		body->room = room;
	}
	memcpy(body->data + body->size, data, count);
	body->size += count;
	body->data[body->size] = '\0';
	return count;
}

/* All values of a header, joined by commas. NULL: out of memory. */
static char *join_header(CURL *curl, const char *name)
{
	char *joined = strdup("");
	struct curl_header *header;
	for (size_t i = 0; joined && curl_easy_header(curl, name, i, CURLH_HEADER, -1, &header) == CURLHE_OK; i++) {
		char *longer;
		if (asprintf(&longer, "%s%s%s", joined, i ? ", " : "", header->value) < 0)
			longer = NULL;
		free(joined);
		joined = longer;
	}
	return joined;
}

static char *join_url(const struct client *client, const char *path)
{
	size_t length = strlen(client->server);
	char *url;
	while (length && client->server[length - 1] == '/')
		length--;
	return asprintf(&url, "%.*s%s", (int)length, client->server, path) < 0 ? NULL : url;
}

static struct curl_slist *append_key(struct curl_slist *headers, const char *key)
{
	char *line;
	if (asprintf(&line, "Authorization: Bearer %s", key) < 0)
		return headers; /* the daemon asks for it */
	headers = curl_slist_append(headers, line);
	free(line);
	return headers;
}

static struct curl_slist *request_headers(const struct client *client, const struct http_request *request)
{
	char line[64];
	struct curl_slist *headers = curl_slist_append(NULL, request->accept ? request->accept : "Accept: */*");
	if (request->json) {
		headers = curl_slist_append(headers, "Content-Type: application/json");
		headers = curl_slist_append(headers, "Expect:"); /* no round trip before the body */
	}
	if (request->header)
		headers = curl_slist_append(headers, request->header);
	if (client->key)
		headers = append_key(headers, client->key);
	if (client->timeout_s > 0) {
		snprintf(line, sizeof line, "X-Timeout-Ms: %.0f", client->timeout_s * 1000);
		headers = curl_slist_append(headers, line);
	}
	return headers;
}

static void set_options(CURL *curl, const struct client *client, const struct http_request *request)
{
	curl_easy_setopt(curl, CURLOPT_NOSIGNAL, 1L);
	curl_easy_setopt(curl, CURLOPT_DEFAULT_PROTOCOL, "http");
	curl_easy_setopt(curl, CURLOPT_PROTOCOLS_STR, "http,https");
	curl_easy_setopt(curl, CURLOPT_USERAGENT, "stratus/" CLIENT_VERSION);
	curl_easy_setopt(curl, CURLOPT_CONNECTTIMEOUT, (long)CONNECT_SECONDS);
	curl_easy_setopt(curl, CURLOPT_WRITEFUNCTION, append_body);
	if (client->timeout_s > 0)
		curl_easy_setopt(curl, CURLOPT_TIMEOUT_MS, (long)(client->timeout_s * 1000) + GRACE_MS);
	if (client->ca_cert)
		curl_easy_setopt(curl, CURLOPT_CAINFO, client->ca_cert);
	if (request->json) {
		curl_easy_setopt(curl, CURLOPT_POSTFIELDSIZE_LARGE, (curl_off_t)strlen(request->json));
		curl_easy_setopt(curl, CURLOPT_POSTFIELDS, request->json);
	}
	if (request->upload) {
		curl_easy_setopt(curl, CURLOPT_UPLOAD, 1L);
		curl_easy_setopt(curl, CURLOPT_READDATA, request->upload);
		curl_easy_setopt(curl, CURLOPT_INFILESIZE_LARGE, (curl_off_t)(request->size < 0 ? -1 : request->size));
	}
	if (request->remove)
		curl_easy_setopt(curl, CURLOPT_CUSTOMREQUEST, "DELETE");
}

static bool take_answer(CURL *curl, struct body *body, struct http_response *response)
{
	curl_easy_getinfo(curl, CURLINFO_RESPONSE_CODE, &response->status);
	curl_easy_getinfo(curl, CURLINFO_TOTAL_TIME, &response->seconds);
	curl_off_t retry_after_s = 0;
	curl_easy_getinfo(curl, CURLINFO_RETRY_AFTER, &retry_after_s);
	response->retry_after_s = (double)retry_after_s;
	response->content_type = join_header(curl, "Content-Type");
	response->server_timing = join_header(curl, "Server-Timing");
	response->request_id = join_header(curl, "X-Request-Id");
	response->body = body->data ? body->data : strdup("");
	response->size = body->size;
	body->data = NULL;
	return response->content_type && response->server_timing && response->request_id && response->body;
}

struct http_exchange *http_exchange_create(const struct client *client, const struct http_request *request)
{
	struct http_exchange *exchange = calloc(1, sizeof *exchange);
	if (exchange) {
		exchange->curl = curl_easy_init();
		exchange->url = join_url(client, request->path);
		exchange->headers = request_headers(client, request);
	}
	if (!exchange || !exchange->curl || !exchange->url || !exchange->headers) {
		client_error("out of memory");
		http_exchange_destroy(exchange);
		return NULL;
	}
	set_options(exchange->curl, client, request);
	curl_easy_setopt(exchange->curl, CURLOPT_URL, exchange->url);
	curl_easy_setopt(exchange->curl, CURLOPT_HTTPHEADER, exchange->headers);
	curl_easy_setopt(exchange->curl, CURLOPT_WRITEDATA, &exchange->body);
	curl_easy_setopt(exchange->curl, CURLOPT_ERRORBUFFER, exchange->message);
	return exchange;
}

void *http_exchange_handle(struct http_exchange *exchange)
{
	return exchange->curl;
}

bool http_exchange_answer(struct http_exchange *exchange, struct http_response *response)
{
	*response = (struct http_response){0};
	return take_answer(exchange->curl, &exchange->body, response);
}

const char *http_exchange_error(const struct http_exchange *exchange, int code)
{
	return *exchange->message ? exchange->message : curl_easy_strerror((CURLcode)code);
}

void http_exchange_destroy(struct http_exchange *exchange)
{
	if (!exchange)
		return;
	free(exchange->body.data);
	curl_slist_free_all(exchange->headers);
	free(exchange->url);
	curl_easy_cleanup(exchange->curl);
	free(exchange);
}

enum { SHOWN_AFTER_S = 1 };

/* Called by libcurl some times a second. */
static int show_time(void *context, curl_off_t total, curl_off_t now, curl_off_t upload_total, curl_off_t upload_now)
{
	struct http_exchange *exchange = context;
	const double seconds = clock_s() - exchange->begin_s;
	(void)total;
	(void)upload_total;
	(void)upload_now;
	if (seconds < SHOWN_AFTER_S)
		return 0;
	exchange->shown = true;
	fprintf(stderr, "\r\033[K%s, %.0f s", now > 0 ? "receiving" : "rendering", floor(seconds));
	if (exchange->timeout_s > 0)
		fprintf(stderr, " of at most %.0f s", exchange->timeout_s);
	fflush(stderr);
	return 0;
}

static void begin_show(struct http_exchange *exchange, const struct client *client)
{
	if (client->quiet || !isatty(STDERR_FILENO))
		return;
	exchange->begin_s = clock_s();
	exchange->timeout_s = client->timeout_s;
	curl_easy_setopt(exchange->curl, CURLOPT_XFERINFOFUNCTION, show_time);
	curl_easy_setopt(exchange->curl, CURLOPT_XFERINFODATA, exchange);
	curl_easy_setopt(exchange->curl, CURLOPT_NOPROGRESS, 0L);
}

int http_send(const struct client *client, const struct http_request *request, struct http_response *response)
{
	struct http_exchange *exchange = http_exchange_create(client, request);
	bool done = false;
	*response = (struct http_response){0};
	if (!exchange)
		return CLIENT_UNREACHABLE;
	if (request->shows_time)
		begin_show(exchange, client);
	const CURLcode code = curl_easy_perform(exchange->curl);
	if (exchange->shown)
		fputs("\r\033[K", stderr);
	if (code != CURLE_OK) {
		client_error("%s: %s", exchange->url, http_exchange_error(exchange, code));
	} else {
		done = http_exchange_answer(exchange, response);
		if (!done)
			client_error("out of memory");
	}
	http_exchange_destroy(exchange);
	return done ? CLIENT_OK : CLIENT_UNREACHABLE;
}

void http_response_finish(struct http_response *response)
{
	free(response->content_type);
	free(response->server_timing);
	free(response->request_id);
	free(response->body);
	*response = (struct http_response){0};
}
