#include "renderer/optics/droplet_file.h"

#include "renderer/file_replace.h"
#include "renderer/log.h"
#include "renderer/optics/droplet_storage.h"
#include "renderer/optics/slab_layer.h"

#include "optics_digest.h"

#include <errno.h>
#include <fcntl.h>
#include <gnu/libc-version.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <xxhash.h>

struct file_header {
	char magic[8];
	uint32_t byte_order;
	uint32_t format; /* raised whenever this header changes; what the payload is follows from `program` */
	uint64_t program;
	uint64_t kernel_hash;
	struct droplet_key key;
	uint64_t vector_bytes;
	uint64_t payload_size;
	uint64_t payload_hash; /* XXH3 of its parts, each seeded with that of the one before */
};

static const char magic[8] = "STRATDRP";
enum { BYTE_ORDER_MARK = 0x01020304, FORMAT = 1, PARTS_MAX = 1 + DROPLET_STORAGE_PARTS };

_Static_assert(sizeof(struct droplet_key) == 8 + 3 * sizeof(double) && sizeof(struct file_header) == 56 + sizeof(struct droplet_key),
	       "headers have no padding");

size_t droplet_file_bytes(enum droplet_kind kind)
{
	size_t pointers = sizeof(struct optics) - offsetof(struct optics, angle_count);
	size_t tables = sizeof(struct droplet_storage) - offsetof(struct droplet_storage, optics) - pointers;
	return sizeof(struct file_header) + (kind == DROPLET_TABLES ? tables : sizeof(struct paper_fit_table));
}

struct droplet_key droplet_key_make(enum droplet_kind kind, const struct scene_dsd *dsd, enum optics_model model)
{
	return (struct droplet_key){kind, model, dsd->n0_per_cm3, dsd->gamma, dsd->effective_radius_um};
}

bool droplet_key_equal(const struct droplet_key *a, const struct droplet_key *b)
{
	return memcmp(a, b, sizeof *a) == 0;
}

void droplet_key_name(const struct droplet_key *key, char name[static DROPLET_NAME_SIZE])
{
	XXH128_hash_t hash = XXH3_128bits(key, sizeof *key);
	snprintf(name, DROPLET_NAME_SIZE, "%s-%016llx%016llx", key->kind == DROPLET_FIT ? "fit" : "tables", (unsigned long long)hash.high64,
		 (unsigned long long)hash.low64);
}

/* Two programs that round differently must not believe each other's files, since entity tags promise the same bytes for a scene. */
static uint64_t program_hash(void)
{
	char text[256];
	int length = snprintf(text, sizeof text, "%s %s", OPTICS_DIGEST, gnu_get_libc_version());
	return XXH3_64bits(text, (size_t)length);
}

static uint64_t hash_parts(const struct iovec *parts, int count)
{
	uint64_t hash = 0;
	for (int i = 0; i < count; i++)
		hash = XXH3_64bits_withSeed(parts[i].iov_base, parts[i].iov_len, hash);
	return hash;
}

/* All but the payload's hash. */
static struct file_header header_of(const struct droplet_file *file, const struct iovec *parts, int count)
{
	struct file_header header = {
		.byte_order = BYTE_ORDER_MARK,
		.format = FORMAT,
		.program = program_hash(),
		.kernel_hash = file->kernel_hash,
		.key = file->key,
		.vector_bytes = (uint64_t)layer_vector_bytes(),
	};
	memcpy(header.magic, magic, sizeof magic);
	for (int i = 0; i < count; i++)
		header.payload_size += parts[i].iov_len;
	return header;
}

/* What is wrong with a header as read, its hash apart; NULL when nothing is. */
static const char *header_fault(const struct file_header *found, const struct file_header *expected)
{
	if (memcmp(found->magic, expected->magic, sizeof found->magic) != 0)
		return "not a file of droplet tables";
	if (found->byte_order != expected->byte_order)
		return "made on a machine of another byte order";
	if (found->format != expected->format || found->program != expected->program)
		return "made by another version";
	if (found->kernel_hash != expected->kernel_hash)
		return "made from another kernel table";
	if (found->vector_bytes != expected->vector_bytes)
		return "made on a processor with other vectors";
	if (!droplet_key_equal(&found->key, &expected->key))
		return "of other droplets";
	return found->payload_size == expected->payload_size ? NULL : "made for other sizes";
}

/* The fault as text. */
static const char *read_bytes(int fd, void *memory, size_t size)
{
	char *byte = memory;
	while (size > 0) {
		ssize_t got = read(fd, byte, size);
		if (got < 0 && errno == EINTR)
			continue;
		if (got <= 0)
			return got < 0 ? strerror(errno) : "too short";
		byte += got;
		size -= (size_t)got;
	}
	return NULL;
}

/* The payload is not touched before kind and length of the file and its header are what they should be. */
static const char *read_sound(int fd, const struct file_header *expected, const struct iovec *parts, int count)
{
	struct stat status;
	struct file_header found;
	if (fstat(fd, &status) != 0)
		return strerror(errno);
	if (!S_ISREG(status.st_mode))
		return "not a file";
	const char *fault = read_bytes(fd, &found, sizeof found);
	if (!fault)
		fault = header_fault(&found, expected);
	if (!fault && (uint64_t)status.st_size != sizeof found + expected->payload_size)
		fault = (uint64_t)status.st_size < sizeof found + expected->payload_size ? "too short" : "too long";
	for (int i = 0; i < count && !fault; i++)
		fault = read_bytes(fd, parts[i].iov_base, parts[i].iov_len);
	if (!fault && hash_parts(parts, count) != found.payload_hash)
		fault = "damaged (checksum)";
	return fault;
}

static enum droplet_file_state read_parts(const struct droplet_file *file, const struct iovec *parts, int count)
{
	/* Without following links or waiting for the other end of a pipe: the directory may be anyone's. */
	int fd = open(file->path, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
	if (fd < 0 && (errno == ENOENT || errno == ENOTDIR))
		return DROPLET_FILE_ABSENT;
	struct file_header expected = header_of(file, parts, count);
	const char *fault = fd < 0 ? (errno == ELOOP ? "a symbolic link" : strerror(errno)) : read_sound(fd, &expected, parts, count);
	if (!fault)
		futimens(fd, NULL);
	if (fd >= 0)
		close(fd);
	if (!fault)
		return DROPLET_FILE_GOOD;
	log_warning("droplets: %s is not used, it is computed anew: %s", file->path, fault);
	return DROPLET_FILE_BAD;
}

enum droplet_file_state droplet_file_read_tables(const struct droplet_file *file, struct droplet_tables **tables)
{
	struct iovec parts[DROPLET_STORAGE_PARTS];
	struct droplet_storage *storage = droplet_storage_create();
	if (!storage)
		return DROPLET_FILE_ABSENT;
	droplet_storage_parts(storage, parts);
	enum droplet_file_state state = read_parts(file, parts, DROPLET_STORAGE_PARTS);
	if (state == DROPLET_FILE_GOOD)
		*tables = &storage->tables;
	else
		droplet_tables_destroy(&storage->tables);
	return state;
}

enum droplet_file_state droplet_file_read_fit(const struct droplet_file *file, struct paper_fit_table *fit)
{
	const struct iovec part = {fit, sizeof *fit};
	return read_parts(file, &part, 1);
}

static bool write_parts(const struct droplet_file *file, const struct iovec *payload, int count)
{
	struct file_header header = header_of(file, payload, count);
	struct iovec parts[PARTS_MAX] = {{&header, sizeof header}};
	memcpy(&parts[1], payload, (size_t)count * sizeof *payload);
	header.payload_hash = hash_parts(payload, count);
	return file_replace(file->path, parts, 1 + count);
}

bool droplet_file_write_tables(const struct droplet_file *file, const struct droplet_tables *tables)
{
	struct iovec parts[DROPLET_STORAGE_PARTS];
	droplet_storage_parts((struct droplet_storage *)tables, parts);
	return write_parts(file, parts, DROPLET_STORAGE_PARTS);
}

bool droplet_file_write_fit(const struct droplet_file *file, const struct paper_fit_table *fit)
{
	const struct iovec part = {(void *)fit, sizeof *fit};
	return write_parts(file, &part, 1);
}
