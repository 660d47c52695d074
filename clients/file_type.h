/* What a file's name says that it is. */
#ifndef STRATUS_CLIENTS_FILE_TYPE_H
#define STRATUS_CLIENTS_FILE_TYPE_H

#include <stdbool.h>

/* Does the name end as that of a picture or of a film does, whichever? Under it nobody expects another type, or a folder. */
bool file_type_is_picture(const char *path);

#endif
