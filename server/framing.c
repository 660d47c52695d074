#include "server/framing.h"

#include <stdbool.h>
#include <string.h>
#include <strings.h>

struct framing {
	int lengths, codings, hosts;
	bool other_coding, bad_length, bad_name, bad_value;
};

/* A name is a token (RFC 9110, 5.6.2): a blank in it, before the colon say, makes it another header for another reader. */
static bool is_token(const char *name, size_t size)
{
	for (size_t i = 0; i < size; i++)
		if (name[i] <= ' ' || name[i] == 0x7f || strchr("\"(),/:;<=>?@[\\]{}", name[i]))
			return false;
	return size > 0;
}

/* A bare end of a line is one to some readers and none to others (RFC 9112, 2.2). */
static bool is_clean(const char *value, size_t size)
{
	for (size_t i = 0; i < size; i++)
		if (value[i] == '\r' || value[i] == '\n')
			return false;
	return true;
}

static bool is_digits(const char *value, size_t size)
{
	for (size_t i = 0; i < size; i++)
		if (value[i] < '0' || value[i] > '9')
			return false;
	return size > 0;
}

static enum MHD_Result look(void *context, enum MHD_ValueKind kind, const char *name, size_t name_size, const char *value, size_t size)
{
	struct framing *framing = context;
	(void)kind;
	framing->bad_name |= !is_token(name, name_size);
	framing->bad_value |= !is_clean(value, size);
	if (strcasecmp(name, "Content-Length") == 0) {
		framing->lengths++;
		framing->bad_length |= !is_digits(value, size);
	} else if (strcasecmp(name, "Transfer-Encoding") == 0) {
		framing->codings++;
		framing->other_coding |= !value || strcasecmp(value, "chunked") != 0;
	} else if (strcasecmp(name, "Host") == 0) {
		framing->hosts++;
	}
	return MHD_YES;
}

const char *framing_fault(struct MHD_Connection *connection, const char *version)
{
	struct framing framing = {0};
	const bool is_old = strcmp(version, "HTTP/1.0") == 0;
	MHD_get_connection_values_n(connection, MHD_HEADER_KIND, look, &framing);
	if (framing.bad_name)
		return "The name of a header must be a token, with no blank before the colon.";
	if (framing.bad_value)
		return "The value of a header holds no end of a line.";
	if (framing.hosts > 1 || (framing.hosts == 0 && !is_old)) /* RFC 9112, 3.2 */
		return "A request of HTTP/1.1 has one Host.";
	if (framing.codings && is_old) /* RFC 9112, 6.1 */
		return "HTTP/1.0 knows no Transfer-Encoding.";
	if (framing.lengths > 1 || framing.codings > 1 || (framing.lengths && framing.codings))
		return "A request has one Content-Length or one Transfer-Encoding, not more and not both.";
	if (framing.bad_length)
		return "Content-Length must be a whole number.";
	return framing.other_coding ? "Transfer-Encoding may be chunked alone." : NULL;
}
