#include "renderer/optics/droplet_storage.h"

#include "renderer/log.h"

#include <math.h>
#include <pthread.h>
#include <stddef.h>
#include <stdlib.h>
#include <sys/mman.h>

/* Of a page that spares the processor most of the faults of fresh memory: they take longer than reading the file does. */
enum { HUGE_PAGE = 2 << 20 };

/* Logarithms of phase functions stay finite, far below all that droplets scatter. */
#define PHASE_MIN 1e-12

double droplet_phase_angle(int column, int columns)
{
	double unit = (double)column / (columns - 1);
	return unit < 0.5 ? 2 * asin(unit * M_SQRT2) : 2 * acos(fmin(1, (1 - unit) * M_SQRT2));
}

struct droplet_storage *droplet_storage_create(void)
{
	void *memory;
	if (posix_memalign(&memory, HUGE_PAGE, sizeof(struct droplet_storage)) != 0)
		return NULL;
	madvise(memory, sizeof(struct droplet_storage), MADV_HUGEPAGE);
	struct droplet_storage *storage = memory;
	storage->tables = (struct droplet_tables){.optics = &storage->optics.optics,
						  .slab = &storage->slab,
						  .forward = &storage->forward,
						  .phase = storage->phase,
						  .bytes = sizeof *storage};
	optics_storage_link(&storage->optics);
	return storage;
}

/* The numbers of struct optics stand in front of its pointers, its arrays behind them, and all the rest follows without a gap. */
void droplet_storage_parts(struct droplet_storage *storage, struct iovec parts[DROPLET_STORAGE_PARTS])
{
	char *arrays = (char *)storage->optics.angle, *end = (char *)storage + sizeof *storage;
	parts[0] = (struct iovec){&storage->optics, offsetof(struct optics, angle_count)};
	parts[1] = (struct iovec){arrays, (size_t)(end - arrays)};
}

_Static_assert(sizeof(struct optics_storage) == sizeof(struct optics) + sizeof(double) * (8 * KERNEL_ANGLE_COUNT + 9 * MOMENT_COUNT) &&
		       offsetof(struct droplet_storage, phase) ==
			       offsetof(struct droplet_storage, slab) + sizeof(struct slab_solution) + sizeof(struct forward_tables) &&
		       sizeof(struct droplet_storage) ==
			       offsetof(struct droplet_storage, phase) + sizeof(float[2][DROPLET_PHASE_COLUMNS][BAND_COUNT]),
	       "no padding whose bytes would differ from file to file");

static void fill_phase(struct droplet_storage *storage)
{
	const struct optics *optics = &storage->optics.optics;
	for (int i = 0; i < DROPLET_PHASE_COLUMNS; i++) {
		double angle = droplet_phase_angle(i, DROPLET_PHASE_COLUMNS);
		for (int band = 0; band < BAND_COUNT; band++) {
			storage->phase[0][i][band] = (float)log2(fmax(PHASE_MIN, optics_phase(optics, band, angle)));
			storage->phase[1][i][band] = (float)log2(fmax(PHASE_MIN, optics_phase2(optics, band, angle)));
		}
	}
}

/* All that needs no solved slab. */
static void *fill_aside(void *argument)
{
	struct droplet_storage *storage = argument;
	forward_tables_compute(&storage->optics.optics, &storage->forward);
	fill_phase(storage);
	return NULL;
}

static bool all_finite(const float *values, size_t count)
{
	float sum = 0; /* 0 times anything finite */
	for (size_t i = 0; i < count; i++)
		sum += 0 * values[i];
	return sum == 0;
}

static bool is_finite(const struct droplet_storage *storage)
{
	const struct forward_tables *forward = &storage->forward;
	return all_finite(&storage->phase[0][0][0], sizeof storage->phase / sizeof(float)) &&
	       all_finite(&forward->peak[0][0][0], sizeof forward->peak / sizeof(float)) &&
	       all_finite(&forward->blur[0][0][0], sizeof forward->blur / sizeof(float));
}

/* Solves the slab, and fills the rest on a thread of its own beside it, where there may be more than one. */
static bool fill_tables(struct droplet_storage *storage, int threads)
{
	pthread_t aside;
	bool started = threads > 1 && pthread_create(&aside, NULL, fill_aside, storage) == 0;
	bool ok = slab_solve_into(&storage->optics.optics, threads, &storage->slab);
	if (started)
		pthread_join(aside, NULL);
	else
		fill_aside(storage);
	if (ok && !is_finite(storage)) {
		log_error("droplets: tables of forward peak or phase functions are not finite");
		ok = false;
	}
	return ok;
}

struct droplet_tables *droplet_tables_create(const struct kernel *kernel, const struct scene_dsd *dsd, enum optics_model model, int threads)
{
	struct droplet_storage *storage = droplet_storage_create();
	if (!storage) {
		log_error("droplets: out of memory");
		return NULL;
	}
	if (optics_storage_fill(&storage->optics, kernel, dsd, model) && fill_tables(storage, threads))
		return &storage->tables;
	droplet_tables_destroy(&storage->tables);
	return NULL;
}

_Static_assert(offsetof(struct droplet_storage, tables) == 0, "droplet_tables_destroy frees all");

void droplet_tables_destroy(struct droplet_tables *tables)
{
	free(tables);
}
