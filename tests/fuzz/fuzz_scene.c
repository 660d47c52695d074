/* The body of /v1/render: any bytes are either a scene that reads back as itself, or a problem that can be told. */
#include "server/json_document.h"
#include "server/scene_json.h"
#include "server/scene_rules.h"
#include "tests/fuzz/scene.h"
#include "tests/fuzz/target.h"

#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct problem problem = {0};
	struct scene_input input = scene_input_default();
	char *text = calloc(1, size + 1);
	FUZZ_REQUIRE(text);
	if (size > 0)
		memcpy(text, data, size);
	json_t *root = json_document_parse(text, size, &problem);
	if (root) {
		scene_json_read(root, &input, &problem);
		scene_rules_apply(&input, &problem);
	}
	FUZZ_REQUIRE(root || problem.kind != PROBLEM_NONE);
	scene_require_consistent(&input, &problem);
	json_decref(root);
	free(text);
	problem_finish(&problem);
	return 0;
}
