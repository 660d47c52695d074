/* How long a distribution takes to have: new, from disk, from memory. */
#include "tests/validate/validate.h"

#include "renderer/droplet_store.h"

#include <dirent.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum { REPEATS = 7, SOURCES = DROPLET_SOURCE_COUNT, DISTRIBUTIONS = 12 };

/* Milliseconds by distribution and source: the least and the median of the repeats. */
struct times {
	double least[DISTRIBUTIONS][SOURCES], median[DISTRIBUTIONS][SOURCES];
};

static double now_ms(void)
{
	struct timespec now;
	clock_gettime(CLOCK_MONOTONIC, &now);
	return (double)now.tv_sec * 1e3 + (double)now.tv_nsec * 1e-6;
}

static double get_ms(struct droplet_store *store, struct scene_dsd dsd, enum droplet_source expected)
{
	enum droplet_source source;
	const double start = now_ms();
	const struct droplet_tables *tables = droplet_store_get(store, &dsd, OPTICS_MIE, &source);
	const double took = now_ms() - start;
	require(tables && source == expected, "the store does not answer from where it should");
	droplet_store_release(store, tables);
	return took;
}

/* One repeat: nobody asked for this many droplets before. Destroying a store waits for its files. */
static void measure_once(const struct droplet_store_params *params, struct scene_dsd dsd, double took[SOURCES])
{
	struct droplet_store *store = droplet_store_create(params);
	require(store, "no store");
	took[DROPLETS_COMPUTED] = get_ms(store, dsd, DROPLETS_COMPUTED);
	droplet_store_destroy(store);
	store = droplet_store_create(params);
	require(store, "no store");
	took[DROPLETS_FROM_DISK] = get_ms(store, dsd, DROPLETS_FROM_DISK);
	took[DROPLETS_FROM_MEMORY] = get_ms(store, dsd, DROPLETS_FROM_MEMORY);
	droplet_store_destroy(store);
}

static int compare_numbers(const void *a, const void *b)
{
	const double x = *(const double *)a, y = *(const double *)b;
	return (x > y) - (x < y);
}

static void measure_distribution(const struct droplet_store_params *params, struct times *times, int number)
{
	struct scene_dsd dsd = number ? droplets_at(number - 1) : PAPER_DROPLETS;
	double took[SOURCES][REPEATS];
	for (int i = 0; i < REPEATS; i++) {
		double once[SOURCES];
		dsd.n0_per_cm3 *= 0.999;
		measure_once(params, dsd, once);
		for (int source = 0; source < SOURCES; source++)
			took[source][i] = once[source];
	}
	for (int source = 0; source < SOURCES; source++) {
		qsort(took[source], REPEATS, sizeof **took, compare_numbers);
		times->least[number][source] = took[source][0];
		times->median[number][source] = took[source][REPEATS / 2];
	}
}

static void judge(struct validation *validation, const struct times *times, enum droplet_source source, enum tally_id id, int count)
{
	double least[DISTRIBUTIONS], median[DISTRIBUTIONS];
	for (int i = 0; i < count; i++) {
		least[i] = times->least[i][source];
		median[i] = times->median[i][source];
	}
	qsort(median, (size_t)count, sizeof *median, compare_numbers);
	qsort(least, (size_t)count, sizeof *least, compare_numbers);
	for (int i = 0; i < count; i++)
		tally_add(&validation->measured.tally[id], least[i],
			  "the slowest of %d distributions, each by the best of %d; median %.3g ms", count, REPEATS, median[count / 2]);
}

static void remove_folder(const char *folder)
{
	DIR *stream = opendir(folder);
	for (struct dirent *entry; stream && (entry = readdir(stream));) {
		char path[512];
		snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
		if (entry->d_name[0] != '.')
			remove(path);
	}
	if (stream)
		closedir(stream);
	rmdir(folder);
}

/* What they were measured on. */
static void describe(FILE *page)
{
	char line[256], model[200] = "unknown";
	FILE *file = fopen("/proc/cpuinfo", "r");
	while (file && fgets(line, sizeof line, file))
		if (sscanf(line, "model name : %199[^\n]", model) == 1)
			break;
	if (file)
		fclose(file);
	fprintf(page,
		"- Times: processor %s, %ld of them. They fail the run only beyond twice the bound, since a busy machine is no error of "
		"the "
		"code.\n",
		model, sysconf(_SC_NPROCESSORS_ONLN));
}

void validate_times(struct validation *validation)
{
	char folder[] = "/tmp/stratus-validate-XXXXXX";
	require(mkdtemp(folder), "no temporary folder");
	const struct droplet_store_params params = {.kernel = validation->kernel, .directory = folder, .threads = 2};
	const int count = effort_count(validation, DISTRIBUTIONS);
	struct times times;
	for (int i = 0; i < count; i++)
		measure_distribution(&params, &times, i);
	remove_folder(folder);
	describe(validation->page);
	judge(validation, &times, DROPLETS_COMPUTED, TALLY_COLD, count);
	judge(validation, &times, DROPLETS_FROM_DISK, TALLY_DISK, count);
	judge(validation, &times, DROPLETS_FROM_MEMORY, TALLY_MEMORY, count);
}
