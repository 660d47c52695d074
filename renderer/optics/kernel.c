/* The kernel table on disk: a header that names everything the payload depends on, then struct kernel_payload as it stands in memory.
 * The file is made by the machine that uses it, so foreign byte orders are refused rather than converted. */
#include "renderer/optics/kernel_table.h"

#include "renderer/file_replace.h"
#include "renderer/log.h"

#include <errno.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const double band_wavelength_nm[BAND_COUNT] = {650, 550, 450};
const double band_refractive_index[BAND_COUNT] = {1.331, 1.333, 1.337};

struct kernel_header {
	char magic[8];
	uint32_t byte_order;
	uint32_t version; /* raised whenever the meaning of the payload changes */
	uint32_t counts[4];
	double x_min, x_max;
	double refractive_index[BAND_COUNT];
	uint64_t payload_size;
	uint64_t payload_hash;
};

static const char magic[8] = "STRATMIE";
enum { BYTE_ORDER_MARK = 0x01020304, KERNEL_VERSION = 1 };

/* FNV-1a, 64 bits. */
static uint64_t hash_bytes(const void *data, size_t size)
{
	const unsigned char *byte = data;
	uint64_t hash = 0xcbf29ce484222325;
	for (size_t i = 0; i < size; i++)
		hash = (hash ^ byte[i]) * 0x100000001b3;
	return hash;
}

static struct kernel_header header_of(const struct kernel_payload *payload)
{
	struct kernel_header header = {
		.byte_order = BYTE_ORDER_MARK,
		.version = KERNEL_VERSION,
		.counts = {BAND_COUNT, KERNEL_NODE_COUNT, KERNEL_PEAK_COUNT, KERNEL_BODY_COUNT},
		.x_min = KERNEL_X_MIN,
		.x_max = KERNEL_X_MAX,
		.payload_size = sizeof *payload,
		.payload_hash = hash_bytes(payload, sizeof *payload),
	};
	memcpy(header.magic, magic, sizeof magic);
	memcpy(header.refractive_index, band_refractive_index, sizeof band_refractive_index);
	return header;
}

/* What is wrong with a header as read, the hash apart; NULL when nothing is. */
static const char *header_fault(const struct kernel_header *found, const struct kernel_header *expected)
{
	if (memcmp(found->magic, expected->magic, sizeof found->magic) != 0)
		return "not a kernel table";
	if (found->byte_order != expected->byte_order)
		return "made on a machine of another byte order";
	if (found->version != expected->version)
		return "of another version";
	if (memcmp(found->counts, expected->counts,
		   offsetof(struct kernel_header, payload_hash) - offsetof(struct kernel_header, counts)) != 0)
		return "made for other sizes or bands";
	return NULL;
}

/* Reads header and payload; the fault as text, NULL when the table is sound. */
static const char *read_table(FILE *file, struct kernel *kernel)
{
	struct kernel_header found;
	if (fread(&found, sizeof found, 1, file) != 1)
		return ferror(file) ? strerror(errno) : "too short";
	/* The payload is read before the header is judged, because the expected header carries its hash; a foreign header must not
	 * pass for a short file, so its fault comes first. */
	size_t got = fread(&kernel->payload, 1, sizeof kernel->payload, file);
	struct kernel_header expected = header_of(&kernel->payload);
	const char *fault = header_fault(&found, &expected);
	if (fault)
		return fault;
	if (got != sizeof kernel->payload)
		return "too short";
	if (fgetc(file) != EOF)
		return "too long";
	if (found.payload_hash != expected.payload_hash)
		return "damaged (checksum)";
	kernel->hash = found.payload_hash;
	return NULL;
}

struct kernel *kernel_load(const char *path)
{
	FILE *file = fopen(path, "rbe");
	if (!file) {
		log_error("kernel table %s: %s", path, strerror(errno));
		return NULL;
	}
	struct kernel *kernel = calloc(1, sizeof *kernel);
	const char *fault = kernel ? read_table(file, kernel) : "out of memory";
	fclose(file);
	if (!fault)
		return kernel;
	log_error("kernel table %s: %s; make it anew with stratus-kernel", path, fault);
	free(kernel);
	return NULL;
}

void kernel_destroy(struct kernel *kernel)
{
	free(kernel);
}

unsigned long long kernel_hash(const struct kernel *kernel)
{
	return kernel->hash;
}

bool kernel_save(const struct kernel_payload *payload, const char *path)
{
	struct kernel_header header = header_of(payload);
	const struct iovec parts[] = {{&header, sizeof header}, {(void *)payload, sizeof *payload}};
	if (file_replace(path, parts, 2))
		return true;
	log_error("kernel table %s: %s", path, strerror(errno));
	return false;
}
