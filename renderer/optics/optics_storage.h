/* Memory of an optics, in one piece. Private to renderer/optics. */
#ifndef STRATUS_RENDERER_OPTICS_OPTICS_STORAGE_H
#define STRATUS_RENDERER_OPTICS_OPTICS_STORAGE_H

#include "renderer/optics/kernel_table.h"
#include "renderer/optics/moments.h"

struct optics_storage {
	struct optics optics; /* whose pointers lead into what follows */
	double angle[KERNEL_ANGLE_COUNT], weight[KERNEL_ANGLE_COUNT];
	double phase[BAND_COUNT][KERNEL_ANGLE_COUNT], phase2[BAND_COUNT][KERNEL_ANGLE_COUNT];
	double moment[BAND_COUNT][MOMENT_COUNT], moment_forward[BAND_COUNT][MOMENT_COUNT], moment_modified[BAND_COUNT][MOMENT_COUNT];
};

/* Sets pointers and counts; what they lead to may come from elsewhere. */
void optics_storage_link(struct optics_storage *storage);

/* optics_create in memory of the caller's. */
bool optics_storage_fill(struct optics_storage *storage, const struct kernel *kernel, const struct scene_dsd *dsd, enum optics_model model);

#endif
