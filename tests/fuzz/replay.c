/* Runs a fuzz target over files and folders of files, without a fuzzer: what was found once is tried by every `make test`.
 * replay FILE|FOLDER... */
#include "tests/fuzz/target.h"

#include <dirent.h>
#include <stdbool.h>
#include <string.h>
#include <sys/stat.h>

__attribute__((weak)) int LLVMFuzzerInitialize(int *argc, char ***argv)
{
	(void)argc;
	(void)argv;
	return 0;
}

static bool replay_file(const char *path)
{
	enum { INPUT_MAX = 1 << 22 };
	static uint8_t data[INPUT_MAX];
	FILE *file = fopen(path, "rb");
	if (!file)
		return false;
	const size_t size = fread(data, 1, sizeof data, file);
	fclose(file);
	/* Where reading past the end is found. */
	uint8_t *input = malloc(size ? size : 1);
	if (!input)
		return false;
	memcpy(input, data, size);
	LLVMFuzzerTestOneInput(input, size);
	free(input);
	return true;
}

static int replay(const char *path)
{
	struct stat status;
	if (stat(path, &status) != 0 || !S_ISDIR(status.st_mode))
		return replay_file(path) ? 1 : -1;
	DIR *folder = opendir(path);
	if (!folder)
		return -1;
	int count = 0;
	for (struct dirent *entry; (entry = readdir(folder));) {
		char name[4096];
		snprintf(name, sizeof name, "%s/%s", path, entry->d_name);
		if (entry->d_name[0] != '.' && replay_file(name))
			count++;
	}
	closedir(folder);
	return count;
}

int main(int argc, char **argv)
{
	int count = 0;
	LLVMFuzzerInitialize(&argc, &argv);
	for (int i = 1; i < argc; i++) {
		const int more = replay(argv[i]);
		if (more < 0) {
			fprintf(stderr, "cannot read %s\n", argv[i]);
			return 1;
		}
		count += more;
	}
	printf("%s: %d inputs\n", argv[0], count);
	return count > 0 ? 0 : 1;
}
