#include "server/process_memory.h"

#include <stdbool.h>
#include <stdio.h>
#include <unistd.h>

double process_resident_bytes(void)
{
	unsigned long total, resident;
	FILE *file = fopen("/proc/self/statm", "re");
	if (!file)
		return 0;
	const bool read = fscanf(file, "%lu %lu", &total, &resident) == 2;
	fclose(file);
	return read ? (double)resident * (double)sysconf(_SC_PAGESIZE) : 0;
}
