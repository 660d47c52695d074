/* Queries: the first byte tells which call's, the rest is the text behind the question mark. */
#include "server/query.h"
#include "server/scene_query.h"
#include "server/scene_rules.h"
#include "server/sky_query.h"
#include "server/slab_query.h"
#include "tests/fuzz/scene.h"
#include "tests/fuzz/target.h"

#include <string.h>

static void try_scene(const char *text)
{
	struct problem problem = {0};
	struct query query;
	struct scene_input input = scene_input_default();
	if (query_parse(text, &query, &problem)) {
		scene_query_read(&query, NULL, &input, &problem);
		scene_rules_apply(&input, &problem);
	}
	scene_require_consistent(&input, &problem);
	query_finish(&query);
	problem_finish(&problem);
}

/* What was read of other calls says itself in one line, or is a problem. */
static void require_said(char *canonical, struct problem *problem)
{
	if (problem->kind == PROBLEM_NONE)
		FUZZ_REQUIRE(canonical && *canonical && !strchr(canonical, '\n'));
	else
		scene_require_consistent(NULL, problem);
	free(canonical);
	problem_finish(problem);
}

static void try_sky(const char *text)
{
	struct problem problem = {0};
	struct sky_query query;
	sky_query_read(text, &query, &problem);
	const bool good = problem.kind == PROBLEM_NONE;
	FUZZ_REQUIRE(!good || (query.view_count >= 1 && query.view_count <= SKY_VIEWS_MAX && query.azimuth_count >= 1 &&
			       query.azimuth_count <= SKY_AZIMUTHS_MAX));
	require_said(good ? sky_query_canonical(&query) : NULL, &problem);
}

static void try_slab(const char *text)
{
	struct problem problem = {0};
	struct slab_query query;
	slab_query_read(text, &query, &problem);
	const bool good = problem.kind == PROBLEM_NONE;
	FUZZ_REQUIRE(!good || (query.optical_thickness > 0) != (query.thickness_m > 0));
	require_said(good ? slab_query_canonical(&query) : NULL, &problem);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	static void (*const tries[])(const char *) = {try_scene, try_sky, try_slab};
	/* A request line holds no NUL: libmicrohttpd ends it there. */
	if (size == 0 || memchr(data, 0, size))
		return -1;
	char *text = strndup((const char *)data + 1, size - 1);
	FUZZ_REQUIRE(text);
	tries[data[0] % 3](text);
	free(text);
	return 0;
}
