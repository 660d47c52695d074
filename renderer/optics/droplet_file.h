/* Droplet tables and the paper's fit as files, made by the machine that uses them.
 *
 * A header says everything that the content depends on: droplets, kernel table, sources and compiler of the optics, C library, the
 * processor's vectors. What says anything else, or has another length or checksum than it should, is not believed. Any thread.
 */
#ifndef STRATUS_RENDERER_OPTICS_DROPLET_FILE_H
#define STRATUS_RENDERER_OPTICS_DROPLET_FILE_H

#include "renderer/optics/droplet_tables.h"
#include "renderer/optics/paper_fit.h"

#include <stdint.h>

enum droplet_kind { DROPLET_TABLES, DROPLET_FIT };

/* What is kept, and of which droplets. Plain numbers, no padding in between that could differ. */
struct droplet_key {
	uint32_t kind, model; /* enum droplet_kind, enum optics_model */
	double n0_per_cm3, gamma, effective_radius_um;
};
struct droplet_key droplet_key_make(enum droplet_kind kind, const struct scene_dsd *dsd, enum optics_model model);
bool droplet_key_equal(const struct droplet_key *a, const struct droplet_key *b);

/* Name of the file in its directory, and what all such names match (fnmatch). */
enum { DROPLET_NAME_SIZE = 40 };
void droplet_key_name(const struct droplet_key *key, char name[static DROPLET_NAME_SIZE]);
#define DROPLET_NAME_PATTERN "*-????????????????????????????????"

size_t droplet_file_bytes(enum droplet_kind kind);

/* Where, what, and from which kernel table. */
struct droplet_file {
	const char *path;
	struct droplet_key key;
	uint64_t kernel_hash;
};

/* BAD: there is a file, and it is not believed; a warning says which and why. */
enum droplet_file_state { DROPLET_FILE_GOOD, DROPLET_FILE_ABSENT, DROPLET_FILE_BAD };

/* Set *tables or *fit when GOOD. Marks the file as used now. 3 ms for tables when the system has the file in memory; a processor whose
 * system refuses huge pages takes 10. ABSENT also when there is no memory to read into. */
enum droplet_file_state droplet_file_read_tables(const struct droplet_file *file, struct droplet_tables **tables);
enum droplet_file_state droplet_file_read_fit(const struct droplet_file *file, struct paper_fit_table *fit);

/* file_replace; false with errno set. */
bool droplet_file_write_tables(const struct droplet_file *file, const struct droplet_tables *tables);
bool droplet_file_write_fit(const struct droplet_file *file, const struct paper_fit_table *fit);

#endif
