#include "server/slab_query.h"

#include "server/number_text.h"
#include "server/query_list.h"
#include "server/scene_canonical.h"
#include "server/scene_rules.h"
#include "server/text.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const char *const slab_method_names[] = {"solved", "paper", "montecarlo", NULL};
const char *const slab_phase_names[] = {"full", "modified", NULL};

#define PHOTONS_MAX 1e7

/* Photons of a query that states none, when so many may be traced. */
#define PHOTONS_DEFAULT 1e5

/* Most steps of a tracing, of some 0.05 us each: ten minutes of one processor, whatever the deadline. */
#define TRACING_STEPS_MAX 1e10

/* The default is what is traced in some ten seconds of one processor, within the usual deadline. */
#define DEFAULT_SHARE (1.0 / 60)

enum { POINTER_SIZE = 512 };

enum parameter {
	OPTICAL_THICKNESS,
	THICKNESS_M,
	SUN_ZENITH_DEG,
	VIEW_ZENITH_DEG,
	RELATIVE_AZIMUTH_DEG,
	ORDERS,
	SHADING,
	PHOTONS,
	SEED,
	PARAMETER_COUNT
};

enum parameter_type { TYPE_NUMBER, TYPE_POSITIVE, TYPE_WHOLE, TYPE_LIST, TYPE_CHOICE };

struct description {
	const char *name;
	enum parameter_type type;
	size_t offset, count_offset; /* in struct slab_query */
	double low, high;            /* inclusive, but for the 0 of TYPE_POSITIVE */
	int count_max;
	const char *const *choices;
};

#define AT(member) offsetof(struct slab_query, member)

static const struct description descriptions[PARAMETER_COUNT] = {
	[OPTICAL_THICKNESS] = {"optical_thickness", TYPE_POSITIVE, AT(optical_thickness), .high = 20000},
	[THICKNESS_M] = {"thickness_m", TYPE_POSITIVE, AT(thickness_m), .high = 10000},
	[SUN_ZENITH_DEG] = {"sun_zenith_deg", TYPE_NUMBER, AT(sun_zenith_deg), .low = 0, .high = 90},
	[VIEW_ZENITH_DEG] = {"view_zenith_deg", TYPE_LIST, AT(view_zenith_deg), AT(view_count), 0, 90, SLAB_VIEWS_MAX, NULL},
	[RELATIVE_AZIMUTH_DEG] = {"relative_azimuth_deg", TYPE_LIST, AT(relative_azimuth_deg), AT(azimuth_count), -360, 360,
				  SLAB_AZIMUTHS_MAX, NULL},
	[ORDERS] = {"orders", TYPE_CHOICE, AT(phase), .choices = slab_phase_names},
	[SHADING] = {"shading", TYPE_CHOICE, AT(method), .choices = slab_method_names},
	[PHOTONS] = {"photons", TYPE_WHOLE, AT(photons), .low = 1, .high = PHOTONS_MAX},
	[SEED] = {"seed", TYPE_WHOLE, AT(seed), .low = 0, .high = 4294967295},
};

static struct slab_query query_default(void)
{
	struct slab_query query = {
		.input = scene_input_default(),
		.view_count = 6,
		.view_zenith_deg = {0, 15, 30, 45, 60, 75},
		.azimuth_count = 5,
		.relative_azimuth_deg = {0, 45, 90, 135, 180},
		.method = SLAB_BY_SOLVER,
		.photons = PHOTONS_DEFAULT,
		.seed = 1,
	};
	query.sun_zenith_deg = 90 - query.input.scene.sun.elevation_deg;
	return query;
}

/* --- values ---------------------------------------------------------------------------------------------------------------------- */

static void read_number(const struct description *description, const char *value, const char *pointer, double *target,
			struct problem *problem)
{
	char high[NUMBER_TEXT_SIZE];
	double number;
	number_format(description->high, high);
	if (number_parse(value, &number) && description->type == TYPE_WHOLE && number != floor(number))
		problem_add(problem, pointer, "must be a whole number");
	else if (number_parse(value, &number) && description->type == TYPE_POSITIVE && !(number > 0 && number <= description->high))
		problem_add(problem, pointer, "must be above 0 and at most %s", high);
	else
		query_number_read(value, description->low, description->high, pointer, target, problem);
}

static void read_list(const struct description *description, const char *value, struct slab_query *query, struct problem *problem)
{
	const struct query_list list = {description->name, description->low, description->high, description->count_max};
	query_list_read(&list, value, (double *)((char *)query + description->offset), (int *)((char *)query + description->count_offset),
			problem);
}

static void read_choice(const struct description *description, const char *value, const char *pointer, int *target, struct problem *problem)
{
	int index = name_index(description->choices, value);
	char list[PROBLEM_DETAIL_SIZE] = "";
	for (int i = 0; description->choices[i]; i++) {
		size_t used = strlen(list);
		snprintf(list + used, sizeof list - used, "%s%s", i ? ", " : "", description->choices[i]);
	}
	if (index < 0)
		problem_add(problem, pointer, "must be one of %s", list);
	else
		*target = index;
}

static void read_parameter(enum parameter parameter, const char *value, struct slab_query *query, struct problem *problem)
{
	const struct description *description = &descriptions[parameter];
	void *target = (char *)query + description->offset;
	char pointer[POINTER_SIZE] = "";
	pointer_append(pointer, sizeof pointer, description->name);
	if (query->given >> parameter & 1)
		problem_add(problem, pointer, "is given twice");
	else if (description->type == TYPE_LIST)
		read_list(description, value, query, problem);
	else if (description->type == TYPE_CHOICE)
		read_choice(description, value, pointer, target, problem);
	else
		read_number(description, value, pointer, target, problem);
	query->given |= 1u << parameter;
}

/* Takes this call's own parameters, which are no members of a scene, out of the pairs. */
static void take_parameters(struct query *pairs, struct slab_query *query, struct problem *problem)
{
	size_t kept = 0;
	for (size_t i = 0; i < pairs->count; i++) {
		int parameter = 0;
		while (parameter < PARAMETER_COUNT && strcmp(pairs->pairs[i].name, descriptions[parameter].name) != 0)
			parameter++;
		if (parameter < PARAMETER_COUNT)
			read_parameter((enum parameter)parameter, pairs->pairs[i].value, query, problem);
		else
			pairs->pairs[kept++] = pairs->pairs[i];
	}
	pairs->count = kept;
}

static bool is_droplets(const struct scene_field *field)
{
	return strcmp(field->section, "dsd") == 0 || (strcmp(field->section, "model") == 0 && strcmp(field->name, "optics") == 0);
}

/* --- rules across parameters --------------------------------------------------------------------------------------------------------- */

static bool is_given(const struct slab_query *query, enum parameter parameter)
{
	return query->given >> parameter & 1;
}

static void check_thickness(const struct slab_query *query, struct problem *problem)
{
	if (!is_given(query, OPTICAL_THICKNESS) && !is_given(query, THICKNESS_M))
		problem_add(problem, "/optical_thickness", "is needed, or thickness_m instead");
	if (is_given(query, OPTICAL_THICKNESS) && is_given(query, THICKNESS_M))
		problem_add(problem, "/thickness_m", "does not go with optical_thickness: give one of them");
}

static void check_orders(struct slab_query *query, struct problem *problem)
{
	if (!is_given(query, ORDERS))
		query->phase = query->method == SLAB_BY_PAPER ? SLAB_PHASE_MODIFIED : SLAB_PHASE_FULL;
	else if (query->method == SLAB_BY_PAPER && query->phase == SLAB_PHASE_FULL)
		problem_add(problem, "/orders",
			    "must be modified with shading=paper, whose orders are those of the modified phase function");
}

/* Vertical optical thickness, for what it costs to trace: droplets scatter about twice their area. */
static double expected_thickness(const struct slab_query *query)
{
	if (!is_given(query, THICKNESS_M))
		return query->optical_thickness;
	const struct scene_dsd *dsd = &query->input.scene.dsd;
	double rn = dsd->effective_radius_um * 1e-6 / (dsd->gamma + 2);
	return query->thickness_m * 2 * M_PI * dsd->n0_per_cm3 * 1e6 * rn * rn * dsd->gamma * (dsd->gamma + 1);
}

/* Photons that can be traced in bounded time. A photon is scattered 6/7 (1 + 2 mu_l) tau times on average; every view traces a ray for it,
 * and every direction looks at it a few times, near the surface, however thick the layer is. */
static double photons_max(const struct slab_query *query)
{
	double scatterings = 5 + 2.6 * expected_thickness(query), views = query->view_count, directions = views * query->azimuth_count;
	double steps = (query->phase == SLAB_PHASE_MODIFIED ? 2 : 1) * scatterings + 8 * views + directions;
	return fmin(PHOTONS_MAX, fmax(floor(TRACING_STEPS_MAX / (BAND_COUNT * steps)), 1));
}

static void check_photons(struct slab_query *query, struct problem *problem)
{
	static const char alone[] = "goes with shading=montecarlo alone";
	double most = photons_max(query);
	if (query->method != SLAB_BY_PHOTONS && is_given(query, PHOTONS))
		problem_add(problem, "/photons", alone);
	if (query->method != SLAB_BY_PHOTONS && is_given(query, SEED))
		problem_add(problem, "/seed", alone);
	if (!is_given(query, PHOTONS))
		query->photons = fmin(query->photons, fmax(floor(DEFAULT_SHARE * most), 1));
	if (query->method == SLAB_BY_PHOTONS && problem->kind == PROBLEM_NONE && query->photons > most)
		problem_add(problem, "/photons", "must be at most %.0f for a layer this thick and %d directions", most,
			    query->view_count * query->azimuth_count);
}

/* What goes with the method, which is known. */
static void check_method(struct slab_query *query, struct problem *problem)
{
	check_orders(query, problem);
	check_photons(query, problem);
}

void slab_query_read(const char *text, struct slab_query *query, struct problem *problem)
{
	struct query pairs;
	*query = query_default();
	if (query_parse(text, &pairs, problem)) {
		take_parameters(&pairs, query, problem);
		scene_query_read(&pairs, is_droplets, &query->input, problem);
		scene_rules_apply(&query->input, problem);
		check_thickness(query, problem);
		if (!problem_mentions(problem, "/shading"))
			check_method(query, problem);
	}
	query_finish(&pairs);
}

/* --- canonical form -------------------------------------------------------------------------------------------------------------- */

static void add_number(struct text *text, const char *name, double number)
{
	char value[NUMBER_TEXT_SIZE];
	number_format(number, value);
	text_printf(text, "&%s=%s", name, value);
}

static void add_list(struct text *text, const char *name, const double *numbers, int count)
{
	for (int i = 0; i < count; i++)
		add_number(text, name, numbers[i]);
}

char *slab_query_canonical(const struct slab_query *query)
{
	struct text text = {0};
	char *scene = scene_canonical(&query->input.scene);
	text_printf(&text, "%s&%s&%s", scene ? scene : "", slab_method_names[query->method], slab_phase_names[query->phase]);
	add_number(&text, "optical_thickness", query->optical_thickness);
	add_number(&text, "thickness_m", query->thickness_m);
	add_number(&text, "sun_zenith_deg", query->sun_zenith_deg);
	add_list(&text, "view_zenith_deg", query->view_zenith_deg, query->view_count);
	add_list(&text, "relative_azimuth_deg", query->relative_azimuth_deg, query->azimuth_count);
	if (query->method == SLAB_BY_PHOTONS) {
		add_number(&text, "photons", query->photons);
		add_number(&text, "seed", query->seed);
	}
	if (!scene)
		text.failed = true;
	free(scene);
	return text_take(&text);
}
