/* Many scenes into a folder: a file for each, whole or not at all, and manifest.jsonl, which says what each is. */
#ifndef STRATUS_CLIENTS_BATCH_RUN_H
#define STRATUS_CLIENTS_BATCH_RUN_H

#include "clients/http_pool.h"
#include "clients/scene_list.h"

struct batch_settings {
	struct pool_settings pool;
	const char *folder;   /* made when it is not there */
	const char *manifest; /* NULL: manifest.jsonl in the folder */
	const char *what;     /* "pictures" */
	bool anew;            /* also what was made before */
};

/* Pictures that the manifest has with the same scene, and whose file has the size that it says, are kept. What is refused is told there,
 * and the others are made. An enum client_exit: CLIENT_REFUSED when one was refused. */
int batch_run(const struct client *client, const struct batch_settings *settings, const struct scene_list *list);

#endif
