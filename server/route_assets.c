/* /v1/assets: uploaded pictures.
 *
 * The body of a PUT goes to a file as it comes, and is refused as soon as it is known to be no use. When it is whole the request waits,
 * suspended, for the thread that has it decoded: that looks through the picture and puts it under its name.
 */
#include "server/routes.h"

#include "renderer/log.h"
#include "server/asset_store.h"
#include "server/clock.h"
#include "server/entity_tag.h"
#include "server/negotiation.h"
#include "server/query.h"
#include "server/response.h"
#include "server/scene_query.h"
#include "server/service.h"

#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* Uploads are few at a time: one that never ends must not keep its place. */
#define UPLOAD_MS_MAX 900000.0

#define NO_PICTURE "An asset is a PNG or an EXR."

struct asset_work {
	struct work examine; /* for the decoder */
	struct request *request;
	char name[SCENE_NAME_MAX];
	struct asset_condition condition;
	struct asset_upload *upload;
	enum asset_result received; /* what became of the body */
	unsigned char magic[PICTURE_MAGIC_SIZE];
	size_t magic_size;
	double deadline_ms;

	enum asset_result result;
	enum decoder_result examined; /* DECODER_OK: it can be used */
	struct asset_facts facts;
	char error[PROBLEM_DETAIL_SIZE - 32];
	bool created;
	char hash[DIGEST_SIZE];
};

static void work_destroy(void *context)
{
	struct asset_work *work = context;
	asset_upload_destroy(work->upload);
	free(work);
}

/* The name in the path, decoded. false when that names no asset. */
static bool read_name(const struct request *request, char name[static SCENE_NAME_MAX])
{
	char *text = strdup(request->path + strlen(ROUTE_ASSET_PREFIX));
	const bool valid = text && query_decode(text) && asset_name_is_valid(text);
	if (valid)
		strcpy(name, text);
	free(text);
	return valid;
}

static struct asset_condition condition_of(const struct request *request)
{
	return (struct asset_condition){request_header(request, "If-Match"), request_header(request, "If-None-Match")};
}

static void state_result(struct request *request, enum asset_result result)
{
	const struct asset_limits *limits = asset_store_limits(request->service->assets);
	struct problem *problem = &request->problem;
	switch (result) {
	case ASSET_MISSING:
		problem_set(problem, PROBLEM_NOT_FOUND, "There is no asset of this name; /v1/assets lists them.");
		return;
	case ASSET_TOO_LARGE:
		problem_set(problem, PROBLEM_TOO_LARGE, "An asset has at most %llu bytes.", (unsigned long long)limits->file_bytes);
		return;
	case ASSET_FULL:
		problem_set(problem, PROBLEM_STORAGE_FULL,
			    "All assets together are at most %zu and %llu bytes, and the disk's room: delete some first.", limits->count,
			    (unsigned long long)limits->total_bytes);
		return;
	case ASSET_BUSY:
		problem_set(problem, PROBLEM_UPLOADS_FULL,
			    "Uploads are coming in: at most %d may, and of one client as many as places are left.", ASSET_UPLOADS_MAX);
		return;
	case ASSET_UNWANTED:
		problem_set(problem, PROBLEM_PRECONDITION, "If-Match or If-None-Match asks for another state of this asset than it has.");
		return;
	case ASSET_OK:
	case ASSET_FAILED:
		break;
	}
	problem_set(problem, PROBLEM_INTERNAL, "The asset could not be kept. The log has the reason under %s.", request->id);
}

static enum MHD_Result send_result(struct request *request, enum asset_result result)
{
	problem_finish(&request->problem);
	state_result(request, result);
	return response_send_problem(request);
}

static void tag_of(const char *hash, char tag[static ENTITY_TAG_SIZE])
{
	snprintf(tag, ENTITY_TAG_SIZE, "\"%s\"", hash);
}

/* --- the list -------------------------------------------------------------------------------------------------------------------- */

static json_t *asset_to_json(const char *name, const struct asset_file *file)
{
	const struct asset_facts *facts = &file->facts;
	char modified[32];
	struct tm utc;
	strftime(modified, sizeof modified, "%Y-%m-%dT%H:%M:%SZ", gmtime_r(&file->modified, &utc));
	const float *low = facts->lowest, *high = facts->highest, *mean = facts->mean_albedo;
	return json_pack("{s:s, s:s, s:I, s:s, s:i, s:i, s:[f,f], s:[f,f], s:[f,f,f], s:s}", "name", name, "content_type",
			 image_content_types[facts->format], "bytes", (json_int_t)file->bytes, "hash", file->hash, "width", facts->width,
			 "height", facts->height, "thickness", (double)low[ASSET_THICKNESS], (double)high[ASSET_THICKNESS], "albedo",
			 (double)low[ASSET_ALBEDO], (double)high[ASSET_ALBEDO], "mean_albedo", (double)mean[0], (double)mean[1],
			 (double)mean[2], "modified", modified);
}

static void add_to_list(void *context, const char *name, const struct asset_file *file)
{
	json_array_append_new(context, asset_to_json(name, file));
}

enum MHD_Result route_assets(struct request *request)
{
	if (!scene_query_refuse(request->query, &request->problem))
		return response_send_problem(request);
	const struct asset_limits *limits = asset_store_limits(request->service->assets);
	json_t *list = json_array();
	if (!asset_store_list(request->service->assets, add_to_list, list)) {
		json_decref(list);
		return send_result(request, ASSET_FAILED);
	}
	json_t *root =
		json_pack("{s:o, s:{s:I, s:I, s:I, s:i}}", "assets", list, "limits", "count", (json_int_t)limits->count, "total_bytes",
			  (json_int_t)limits->total_bytes, "bytes", (json_int_t)limits->file_bytes, "side", PICTURE_SIDE_MAX);
	return response_send_json(request, MHD_HTTP_OK, root, CACHE_ASK);
}

/* --- one ------------------------------------------------------------------------------------------------------------------------- */

static struct MHD_Response *response_of_file(struct asset_file *file, bool with_body)
{
	if (!with_body)
		return MHD_create_response_from_buffer(0, NULL, MHD_RESPMEM_PERSISTENT);
	struct MHD_Response *response = MHD_create_response_from_fd_at_offset64(file->bytes, file->fd, 0);
	if (response)
		file->fd = -1; /* closed with the response */
	return response;
}

static enum MHD_Result send_file(struct request *request, const char *name)
{
	struct asset_file file;
	const struct asset_condition condition = condition_of(request);
	char tag[ENTITY_TAG_SIZE];
	const enum asset_result result = asset_store_open(request->service->assets, name, &file);
	if (result != ASSET_OK)
		return send_result(request, result);
	tag_of(file.hash, tag);
	if (condition.if_match && !entity_tag_is_expected(condition.if_match, tag)) {
		asset_file_close(&file);
		return send_result(request, ASSET_UNWANTED);
	}
	const bool known = entity_tag_matches(condition.if_none_match, tag);
	struct MHD_Response *response = response_of_file(&file, !known);
	request->bytes = known ? 0 : file.bytes;
	asset_file_close(&file);
	response_set(response, "ETag", tag);
	response_set(response, "Cache-Control", CACHE_ASK);
	if (!known) {
		response_set(response, "Content-Type", image_content_types[file.facts.format]);
		response_set(response, "X-Content-Type-Options", "nosniff"); /* a stranger's file must not become a page of ours */
	}
	return response_send(request, known ? MHD_HTTP_NOT_MODIFIED : MHD_HTTP_OK, response);
}

static enum MHD_Result delete (struct request *request, const char *name) {
	const struct asset_condition condition = condition_of(request);
	const enum asset_result result = asset_store_delete(request->service->assets, name, &condition);
	if (result != ASSET_OK) return send_result(request, result);
	log_info("asset %s deleted by request %s", name, request->id);
	return response_send(request, MHD_HTTP_NO_CONTENT, MHD_create_response_from_buffer(0, NULL, MHD_RESPMEM_PERSISTENT));
}

/* --- PUT ------------------------------------------------------------------------------------------------------------------------- */

static uint64_t announced_bytes(const struct request *request)
{
	const char *length = request_header(request, "Content-Length");
	return length ? strtoull(length, NULL, 10) : 0;
}

enum MHD_Result route_asset_begin(struct request *request)
{
	struct service *service = request->service;
	struct asset_work *work = calloc(1, sizeof *work);
	if (!work)
		return response_send_new_problem(request, PROBLEM_INTERNAL, "Out of memory.");
	work->request = request;
	request->work = work;
	request->work_destroy = work_destroy;
	if (!read_name(request, work->name))
		return response_send_new_problem(request, PROBLEM_BAD_REQUEST,
						 "The name of an asset has 1 to %d letters, digits, '-', '_' and '.', and no dot first.",
						 SCENE_NAME_MAX - 1);
	if (request_header(request, "Content-Range")) /* RFC 9110, 14.5 */
		return response_send_new_problem(request, PROBLEM_BAD_REQUEST, "An asset is sent whole, without a Content-Range.");
	scene_query_refuse(request->query, &request->problem);
	work->deadline_ms = request_read_deadline(request);
	if (request->problem.kind != PROBLEM_NONE || service_refuses(request))
		return response_send_problem(request);
	work->condition = condition_of(request);
	enum asset_result result = asset_store_check(service->assets, work->name, &work->condition);
	if (result == ASSET_OK)
		result = asset_upload_begin(service->assets, work->name, announced_bytes(request), request->client, &work->upload);
	return result == ASSET_OK ? MHD_YES : send_result(request, result);
}

/* Before the answer goes out: who has it may begin the next upload. */
static void end_upload(struct asset_work *work)
{
	asset_upload_destroy(work->upload);
	work->upload = NULL;
}

static bool is_picture(const struct asset_work *work)
{
	enum image_format format;
	return work->magic_size == sizeof work->magic && picture_file_recognise(work->magic, &format);
}

static bool is_whole(const struct request *request)
{
	const struct asset_work *work = request->work;
	uint64_t size;
	asset_upload_fd(work->upload, &size);
	return size == announced_bytes(request);
}

/* Nothing of what is still to come would change the answer. */
static enum MHD_Result refuse_rest(struct request *request, enum asset_result result)
{
	if (result == ASSET_OK)
		problem_set(&request->problem, PROBLEM_MEDIA_TYPE, NO_PICTURE);
	else
		state_result(request, result);
	end_upload(request->work);
	return response_send_problem_past(request);
}

enum MHD_Result route_asset_take(struct request *request, const char *data, size_t size)
{
	struct asset_work *work = request->work;
	if (clock_now_ms() > request->started_ms + UPLOAD_MS_MAX)
		return MHD_NO;
	for (size_t i = 0; i < size && work->magic_size < sizeof work->magic; i++)
		work->magic[work->magic_size++] = (unsigned char)data[i];
	work->received = asset_upload_append(work->upload, data, size);
	const bool is_bad = work->received != ASSET_OK || (work->magic_size == sizeof work->magic && !is_picture(work));
	/* A body that is whole is answered as all others are, and its connection goes on. */
	return is_bad && !is_whole(request) ? refuse_rest(request, work->received) : MHD_YES;
}

static enum MHD_Result send_put(struct request *request)
{
	const struct asset_work *work = request->work;
	char tag[ENTITY_TAG_SIZE];
	if (work->examined == DECODER_LATE)
		return response_send_new_problem(request, PROBLEM_DEADLINE, "The asset was not looked through within its deadline.");
	if (work->examined == DECODER_REFUSED)
		return response_send_new_problem(request, PROBLEM_BAD_ASSET, "The picture %s.", work->error);
	if (work->examined == DECODER_FAILED)
		return send_result(request, ASSET_FAILED);
	if (work->result != ASSET_OK)
		return send_result(request, work->result);
	log_info("asset %s is %s by request %s", work->name, work->hash, request->id);
	struct MHD_Response *response = MHD_create_response_from_buffer(0, NULL, MHD_RESPMEM_PERSISTENT);
	tag_of(work->hash, tag);
	response_set(response, "ETag", tag);
	return response_send(request, work->created ? MHD_HTTP_CREATED : MHD_HTTP_NO_CONTENT, response);
}

static void examine(struct work *base)
{
	struct asset_work *work = (struct asset_work *)((char *)base - offsetof(struct asset_work, examine));
	struct request *request = work->request;
	struct service *service = request->service;
	uint64_t size;
	const int fd = asset_upload_fd(work->upload, &size);
	work->examined = service->giving_up ? DECODER_LATE
					    : decoder_examine(service->decoder, fd, size, work->deadline_ms, &work->facts, work->error,
							      sizeof work->error);
	if (work->examined == DECODER_OK)
		work->result = asset_upload_commit(work->upload, &work->facts, &work->condition, &work->created, work->hash);
	end_upload(work);
	request_resume(request);
}

static enum MHD_Result finish_put(struct request *request)
{
	struct asset_work *work = request->work;
	struct service *service = request->service;
	if (work->received != ASSET_OK) {
		end_upload(work);
		return send_result(request, work->received);
	}
	if (!is_picture(work)) {
		end_upload(work);
		return response_send_new_problem(request, PROBLEM_MEDIA_TYPE, NO_PICTURE);
	}
	/* However long the body took to come: unless the client says otherwise, looking through it has as long as any other answer. */
	if (!request_header(request, "X-Timeout-Ms"))
		work->deadline_ms = clock_now_ms() + service->config->timeout_ms;
	work->examine.run = examine;
	work->examine.client = request->client;
	request_suspend(request, send_put);
	if (!worker_pool_try(service->decoders, &work->examine)) {
		work->result = ASSET_BUSY;
		work->examined = DECODER_OK;
		request_resume(request);
	}
	return MHD_YES;
}

enum MHD_Result route_asset(struct request *request)
{
	char name[SCENE_NAME_MAX];
	if (request->is_put)
		return finish_put(request);
	if (!read_name(request, name))
		return send_result(request, ASSET_MISSING);
	if (!scene_query_refuse(request->query, &request->problem))
		return response_send_problem(request);
	return strcmp(request->method, MHD_HTTP_METHOD_DELETE) == 0 ? delete (request, name) : send_file(request, name);
}
