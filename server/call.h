/* What calls have in common whose answer other threads compute: when it is known already, when nobody wants it any more, and what is said
 * when there is none.
 *
 * Such a call reads its query on the HTTP thread, answers there what needs no computing (call_answer_at_once), and is suspended else
 * (request_suspend) until its answer, or the reason for none, is there.
 */
#ifndef STRATUS_SERVER_CALL_H
#define STRATUS_SERVER_CALL_H

#include "server/entity_tag.h"
#include "server/render_queue.h"
#include "server/request.h"

enum call_outcome {
	CALL_OK,
	CALL_EXPIRED,   /* the deadline passed */
	CALL_ABANDONED, /* nobody waits for it any more */
	CALL_STOPPED,   /* by a shutdown */
	CALL_FAILED
};

/* The entity tag of an answer that follows from the text of a question, which is taken over, and the program and device that answer it.
 * call: distinguishes calls. false when out of memory, as which a NULL question counts. Any thread. */
bool call_tag(const struct service *service, const char *call, char *question, char tag[static ENTITY_TAG_SIZE]);

/* Sends an answer, or its headers, with what belongs to it. */
typedef enum MHD_Result call_sender(struct request *request, unsigned status, struct MHD_Response *response);

/* Answers 304 to who has the answer already, and HEAD without computing. false: neither, nothing was sent. HTTP thread. */
bool call_answer_at_once(struct request *request, const char *tag, call_sender *send, enum MHD_Result *result);

/* Sends an answer in JSON, or its headers, as call_sender does. tag: its entity tag; cache_control: as in response.h. HTTP thread. */
enum MHD_Result call_send_json(struct request *request, unsigned status, struct MHD_Response *response, const char *tag,
			       const char *cache_control);

/* --- while others work for it, any thread ----------------------------------------------------------------------------------------- */

/* CALL_OK: the answer is still wanted. */
enum call_outcome call_reason_to_stop(const struct request *request, double deadline_ms);

/* Is nobody to wait for it any more: its client has gone, or a shutdown gives it up? */
bool call_is_abandoned(const struct request *request);

/* Counts the wait of one of several requests for one job, and resumes it; the job itself is counted once, by call_count_render. */
void call_end_wait(struct request *request, enum render_outcome outcome);
void call_count_render(struct service *service, const struct render_job *job);

/* Counts a job of the render thread that brought nothing, and resumes its request. Counted here and not when the answer is sent, which
 * libmicrohttpd does not come to for a connection that it finds closed. */
void call_end_render(struct request *request, const struct render_job *job);

/* --- without an answer, HTTP thread ----------------------------------------------------------------------------------------------- */

/* The calls that computers work for are too many. */
enum MHD_Result call_refuse_computing(struct request *request);
/* The renders are too many, or a shutdown closed their queue. */
enum MHD_Result call_refuse_render(struct request *request, const struct render_job *job);

/* Why there is none. what: that would be the answer, such as "The image". */
enum MHD_Result call_send_failure(struct request *request, enum call_outcome outcome, const char *what);
/* The same of a render job. size: what the device may have no memory for, such as "an image of this size". */
enum MHD_Result call_send_render_failure(struct request *request, enum render_outcome outcome, const char *what, const char *size);

#endif
