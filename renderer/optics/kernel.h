/* The kernel table: extinction and scattered intensity of a sphere of water over size parameter and angle, for the three bands.
 *
 * Summing Mie series for each droplet size distribution would cost seconds to minutes. The scattering functions depend on size parameter
 * x = 2 pi r / lambda and refractive index alone, so they are computed once, on a fine grid of x (step max(0.02, x/4000), finer for small
 * x), averaged into bins with hat functions in ln x, and kept on disk. A distribution is then a weighted sum over bins.
 */
#ifndef STRATUS_RENDERER_OPTICS_KERNEL_H
#define STRATUS_RENDERER_OPTICS_KERNEL_H

#include <stdbool.h>

struct kernel;

/* Reads and checks a table (magic, version, sizes, checksum). NULL when the file is missing, damaged or of another version; the log
 * says which. Any thread; the result is read-only and may be shared. */
struct kernel *kernel_load(const char *path);
void kernel_destroy(struct kernel *kernel);

/* Called with 0..1, in increasing order, from the calling thread of kernel_generate. */
typedef void kernel_progress(void *context, double done);

/* Computes the table on `threads` threads (0: all processors) and writes it to path atomically (temporary file, fsync, rename).
 * Some 5 s on two cores. The content does not depend on the number of threads. progress may be NULL. false (and a log line) when the file
 * cannot be written. */
bool kernel_generate(const char *path, int threads, kernel_progress *progress, void *context);

/* Hash of the table's content, for keys of what is derived from it. */
unsigned long long kernel_hash(const struct kernel *kernel);

#endif
