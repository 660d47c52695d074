/* Answers: the headers every one carries, problems, documents. HTTP thread. */
#ifndef STRATUS_SERVER_RESPONSE_H
#define STRATUS_SERVER_RESPONSE_H

#include "server/request.h"

/* Cache-Control of what a scene or a query determines: kept, and asked for again by its entity tag after an hour. */
#define CACHE_KEEP "public, max-age=3600"
/* The same of an answer to who showed a key: "public" would let a cache in front give it to those who have none (RFC 9111, 3.5). */
#define CACHE_KEEP_PRIVATE "private, max-age=3600"
/* Of what may change under its address at any time: kept, but asked for again by its entity tag every time. */
#define CACHE_ASK  "no-cache"
#define CACHE_NONE "no-store"

/* What is wrong with a request whose client ended in the middle of it. */
#define REQUEST_CUT "The connection ended before the request did."

/* The answer to a request. Takes over malloc'd data (also on failure). NULL when out of memory. */
struct MHD_Response *response_create(struct request *request, char *data, size_t size);
/* Likewise of an image that others hold too. Takes over one hold of it. */
struct finished_image;
struct MHD_Response *response_create_shared(struct request *request, struct finished_image *image);
/* For a HEAD that is answered without computing, so that the length is unknown. The connection is closed behind it: to keep it
 * libmicrohttpd (0.9.75) would send chunks, whose end it writes although a HEAD has no body, and which the next answer would begin with. */
struct MHD_Response *response_create_unsized(struct request *request);
void response_set(struct MHD_Response *response, const char *name, const char *value);

/* Sends with the headers every answer has; the response is given up in any case. NULL answers nothing. */
enum MHD_Result response_send(struct request *request, unsigned status, struct MHD_Response *response);

/* Sends request->problem, or the one stated here. */
enum MHD_Result response_send_problem(struct request *request);
__attribute__((format(printf, 3, 4))) enum MHD_Result response_send_new_problem(struct request *request, enum problem_kind kind,
										const char *format, ...);

/* Sends a text with an entity tag of its content, or 304 when the client has it. `text` is taken over; NULL: out of memory. */
enum MHD_Result response_send_document(struct request *request, char *text, const char *content_type, const char *cache_control);
/* Likewise JSON; root is taken over. */
enum MHD_Result response_send_json(struct request *request, unsigned status, json_t *root, const char *cache_control);

/* Sends request->problem where libmicrohttpd takes no response: while a body is still coming in, or for what it cannot read. The answer is
 * written to the socket. MHD_NO: the connection closes, and what the client still sends is read for a while (lingering.h). */
enum MHD_Result response_send_problem_past(struct request *request);
/* Nothing that libmicrohttpd writes from here on is sent. */
void response_end_past(struct MHD_Connection *connection);
/* 413 while a body of more than `limit` bytes is still coming in. */
enum MHD_Result response_refuse_body(struct request *request, uint64_t limit);

#endif
