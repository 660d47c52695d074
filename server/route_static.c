/* What the binary carries for programs: the contract, the presets; and the answers for paths where nothing is. */
#include "server/routes.h"

#include "renderer/embed.h"
#include "renderer/log.h"
#include "server/response.h"
#include "server/scene_query.h"

#include <string.h>

static enum MHD_Result send_resource(struct request *request, const char *name, const char *content_type)
{
	const struct embedded_file *file = embedded_find(resource_files, name);
	return response_send_document(request, file ? strndup(file->data, file->size) : NULL, content_type, CACHE_KEEP);
}

enum MHD_Result route_openapi(struct request *request)
{
	return send_resource(request, "openapi.yaml", "application/yaml");
}

/* {"name", "title", "description", "scene"} of server/presets/NAME.json, which has the last three; NULL when it is no preset. */
static json_t *preset_to_json(const struct embedded_file *file)
{
	static const char prefix[] = "server/presets/", suffix[] = ".json";
	size_t length = strlen(file->name);
	if (strncmp(file->name, prefix, sizeof prefix - 1) != 0 || length < sizeof prefix + sizeof suffix)
		return NULL;
	json_t *preset = json_object(), *content = json_loadb(file->data, file->size, JSON_REJECT_DUPLICATES, NULL);
	json_object_set_new(preset, "name", json_stringn(file->name + sizeof prefix - 1, length - sizeof prefix - sizeof suffix + 2));
	if (json_object_update(preset, content) != 0)
		log_error("%s is not a preset", file->name);
	json_decref(content);
	return preset;
}

enum MHD_Result route_presets(struct request *request)
{
	if (!scene_query_refuse(request->query, &request->problem))
		return response_send_problem(request);
	json_t *presets = json_array();
	for (const struct embedded_file *file = resource_files; file->name; file++) {
		json_t *preset = preset_to_json(file);
		if (preset)
			json_array_append_new(presets, preset);
	}
	return response_send_json(request, MHD_HTTP_OK, json_pack("{s:o}", "presets", presets), CACHE_KEEP);
}

enum MHD_Result route_unknown(struct request *request)
{
	return response_send_new_problem(request, PROBLEM_NOT_FOUND, "There is no such address; /openapi.yaml lists those that exist.");
}
