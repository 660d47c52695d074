#include "clients/preset_list.h"

#include "clients/http.h"
#include "clients/problem.h"

int preset_list_fetch(const struct client *client, json_t **presets)
{
	struct http_response response;
	int status = http_send(client, &(struct http_request){.path = "/v1/presets"}, &response);
	*presets = NULL;
	if (status == CLIENT_OK && response.status != 200) {
		problem_print(&response);
		status = CLIENT_REFUSED;
	} else if (status == CLIENT_OK) {
		*presets = json_loadb(response.body, response.size, 0, NULL);
		if (!json_is_object(*presets)) {
			client_error("%s is no stratus daemon: its presets are no JSON object", client->server);
			json_decref(*presets);
			status = CLIENT_REFUSED;
		}
	}
	http_response_finish(&response);
	return status;
}
