/* The page at / and what it is made of, below /web/: files of server/pages, carried by the binary. */
#include "server/routes.h"

#include "renderer/embed.h"
#include "server/entity_tag.h"
#include "server/response.h"

#include <string.h>

#define PAGES "server/pages/"

/* Nothing of the page may come from elsewhere, be written into it, or be framed by others; pictures are shown out of memory. */
static const char policy[] = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; connect-src 'self'; "
			     "base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/* NULL: a kind of file that is not served. */
static const char *type_of(const char *name)
{
	static const struct {
		const char *ending, *type;
	} types[] = {
		{".html", "text/html; charset=utf-8"},
		{".css", "text/css; charset=utf-8"},
		{".js", "text/javascript; charset=utf-8"},
		{".svg", "image/svg+xml"},
	};
	const char *ending = strrchr(name, '.');
	for (size_t i = 0; ending && i < sizeof types / sizeof *types; i++)
		if (strcmp(ending, types[i].ending) == 0)
			return types[i].type;
	return NULL;
}

/* Asked for again by its entity tag every time: the files of one page must be of one version. */
static enum MHD_Result send_file(struct request *request, const struct embedded_file *file)
{
	char tag[ENTITY_TAG_SIZE];
	entity_tag_of(file->data, file->size, tag);
	const bool known = entity_tag_matches(request_header(request, "If-None-Match"), tag);
	struct MHD_Response *response = response_create(request, strndup(file->data, file->size), known ? 0 : file->size);
	if (!known)
		response_set(response, "Content-Type", type_of(file->name));
	response_set(response, "ETag", tag);
	response_set(response, "Cache-Control", CACHE_ASK);
	response_set(response, "Content-Security-Policy", policy);
	response_set(response, "X-Content-Type-Options", "nosniff");
	response_set(response, "Referrer-Policy", "no-referrer");
	return response_send(request, known ? MHD_HTTP_NOT_MODIFIED : MHD_HTTP_OK, response);
}

enum MHD_Result route_index(struct request *request)
{
	return send_file(request, embedded_find(resource_files, PAGES "index.html"));
}

enum MHD_Result route_page(struct request *request)
{
	char name[128];
	const char *path = request->path + strlen(ROUTE_PAGE_PREFIX);
	const int length = snprintf(name, sizeof name, PAGES "%s", path);
	const struct embedded_file *file =
		length > 0 && (size_t)length < sizeof name && type_of(name) ? embedded_find(resource_files, name) : NULL;
	return file ? send_file(request, file) : route_unknown(request);
}
