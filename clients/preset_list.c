#include "clients/preset_list.h"

#include "clients/http.h"
#include "clients/problem.h"

#include <string.h>

int preset_list_fetch(const struct client *client, json_t **presets)
{
	struct http_response response;
	int status = http_send(client, &(struct http_request){.path = "/v1/presets"}, &response);
	*presets = NULL;
	if (status == CLIENT_OK && response.status != 200) {
		problem_print(&response);
		status = CLIENT_REFUSED;
	} else if (status == CLIENT_OK) {
		json_t *answer = json_loadb(response.body, response.size, 0, NULL);
		*presets = json_incref(json_object_get(answer, "presets"));
		json_decref(answer);
		if (!*presets) {
			client_error("%s lists no presets", client->server);
			status = CLIENT_REFUSED;
		}
	}
	http_response_finish(&response);
	return status;
}

json_t *preset_list_find(const json_t *presets, const char *name)
{
	size_t i;
	json_t *preset;
	json_array_foreach(presets, i, preset)
	{
		const char *found = json_string_value(json_object_get(preset, "name"));
		if (found && strcmp(found, name) == 0)
			return json_object_get(preset, "scene");
	}
	client_error("there is no preset \"%s\"; stratus presets lists them", name);
	return NULL;
}
