#include "clients/watch.h"

#include <time.h>

static const struct timespec pause_time = {.tv_nsec = 100000000};

static bool is_same(const struct stat *a, const struct stat *b)
{
	return a->st_ino == b->st_ino && a->st_dev == b->st_dev && a->st_size == b->st_size && a->st_mtim.tv_sec == b->st_mtim.tv_sec &&
	       a->st_mtim.tv_nsec == b->st_mtim.tv_nsec;
}

void watch_begin(struct watch *watch, const char *path)
{
	watch->path = path;
	watch->exists = stat(path, &watch->seen) == 0;
}

/* Looks again after a while; true when it is as it was. */
static bool look(struct watch *watch)
{
	const struct watch before = *watch;
	nanosleep(&pause_time, NULL);
	watch_begin(watch, watch->path);
	return watch->exists == before.exists && (!watch->exists || is_same(&watch->seen, &before.seen));
}

void watch_await(struct watch *watch)
{
	const struct watch before = *watch;
	do
		while (!look(watch))
			;
	while (!watch->exists || (before.exists && is_same(&watch->seen, &before.seen)));
}
