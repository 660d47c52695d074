#include "clients/http.h"

#include <curl/curl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { CONNECT_SECONDS = 10, GRACE_MS = 2000 }; /* grace: the daemon's own 504 says more than a broken connection */

struct body {
	char *data;
	size_t size, room;
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
	response->content_type = join_header(curl, "Content-Type");
	response->server_timing = join_header(curl, "Server-Timing");
	response->request_id = join_header(curl, "X-Request-Id");
	response->body = body->data ? body->data : strdup("");
	response->size = body->size;
	body->data = NULL;
	return response->content_type && response->server_timing && response->request_id && response->body;
}

int http_send(const struct client *client, const struct http_request *request, struct http_response *response)
{
	struct body body = {0};
	char message[CURL_ERROR_SIZE] = "";
	CURL *curl = curl_easy_init();
	char *url = join_url(client, request->path);
	struct curl_slist *headers = request_headers(client, request);
	bool done = false;

	*response = (struct http_response){0};
	if (!curl || !url || !headers) {
		client_error("out of memory");
		goto cleanup;
	}
	set_options(curl, client, request);
	curl_easy_setopt(curl, CURLOPT_URL, url);
	curl_easy_setopt(curl, CURLOPT_HTTPHEADER, headers);
	curl_easy_setopt(curl, CURLOPT_WRITEDATA, &body);
	curl_easy_setopt(curl, CURLOPT_ERRORBUFFER, message);

	const CURLcode code = curl_easy_perform(curl);
	if (code != CURLE_OK) {
		client_error("%s: %s", url, *message ? message : curl_easy_strerror(code));
		goto cleanup;
	}
	done = take_answer(curl, &body, response);
	if (!done)
		client_error("out of memory");

cleanup:
	free(body.data);
	curl_slist_free_all(headers);
	free(url);
	curl_easy_cleanup(curl);
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
