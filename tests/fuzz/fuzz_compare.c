/* The body of /v1/compare: variants laid over a scene, regions, and names that end up in channels of a file. */
#include "server/compare_query.h"
#include "server/json_document.h"
#include "tests/fuzz/scene.h"
#include "tests/fuzz/target.h"

#include <string.h>

static void require_sound(const struct compare_query *query)
{
	FUZZ_REQUIRE(query->variant_count >= COMPARE_VARIANTS_MIN && query->variant_count <= COMPARE_VARIANTS_MAX);
	FUZZ_REQUIRE(query->truth >= 0 && query->truth < query->variant_count);
	FUZZ_REQUIRE(query->region_count > 0 && query->region_count <= COMPARE_REGIONS_MAX);
	const struct problem none = {0};
	for (int i = 0; i < query->variant_count; i++)
		scene_require_consistent(&query->variant[i].input, &none);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct problem problem = {0};
	struct compare_query *query = calloc(1, sizeof *query);
	char *text = calloc(1, size + 1);
	FUZZ_REQUIRE(text && query);
	if (size > 0)
		memcpy(text, data, size);
	json_t *root = json_document_parse(text, size, &problem);
	if (root)
		compare_query_read(root, query, &problem);
	if (problem.kind == PROBLEM_NONE)
		require_sound(query);
	else
		scene_require_consistent(&(struct scene_input){0}, &problem);
	json_decref(root);
	free(text);
	free(query);
	problem_finish(&problem);
	return 0;
}
