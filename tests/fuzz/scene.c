#include "tests/fuzz/scene.h"

#include "server/json_document.h"
#include "server/query.h"
#include "server/scene_canonical.h"
#include "server/scene_json.h"
#include "server/scene_query.h"
#include "server/scene_rules.h"
#include "tests/fuzz/target.h"

#include <string.h>

/* A problem as a client gets it must be JSON itself. */
static void require_told(const struct problem *problem)
{
	char *text = problem_to_json(problem, "fuzz", 1);
	FUZZ_REQUIRE(text);
	json_t *root = json_loads(text, JSON_REJECT_DUPLICATES, NULL);
	FUZZ_REQUIRE(json_is_object(root));
	FUZZ_REQUIRE(json_string_value(json_object_get(root, "type")));
	json_decref(root);
	free(text);
	const unsigned status = problem_status(problem->kind);
	FUZZ_REQUIRE(status >= 400 && status < 500);
}

static void require_same(const char *canonical, struct scene_input *again, struct problem *problem)
{
	scene_rules_apply(again, problem);
	FUZZ_REQUIRE(problem->kind == PROBLEM_NONE);
	char *text = scene_canonical(&again->scene);
	FUZZ_REQUIRE(text && strcmp(text, canonical) == 0);
	free(text);
}

static void require_body_reads_back(const char *canonical)
{
	struct problem problem = {0};
	struct scene_input again = scene_input_default();
	char *text = strdup(canonical);
	json_t *root = json_document_parse(text, strlen(text), &problem);
	FUZZ_REQUIRE(root);
	scene_json_read(root, &again, &problem);
	require_same(canonical, &again, &problem);
	json_decref(root);
	free(text);
	problem_finish(&problem);
}

static void require_query_reads_back(const struct scene *scene, const char *canonical)
{
	struct problem problem = {0};
	struct query query;
	struct scene_input again = scene_input_default();
	char *text = scene_canonical_query(scene);
	FUZZ_REQUIRE(text && query_parse(text, &query, &problem));
	scene_query_read(&query, NULL, &again, &problem);
	require_same(canonical, &again, &problem);
	query_finish(&query);
	free(text);
	problem_finish(&problem);
}

void scene_require_consistent(const struct scene_input *input, const struct problem *problem)
{
	if (problem->kind != PROBLEM_NONE) {
		require_told(problem);
		return;
	}
	char *canonical = scene_canonical(&input->scene);
	FUZZ_REQUIRE(canonical);
	require_body_reads_back(canonical);
	require_query_reads_back(&input->scene, canonical);
	free(canonical);
}
