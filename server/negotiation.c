#include "server/negotiation.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

const char *const image_content_types[IMAGE_FORMAT_COUNT] = {[IMAGE_PNG] = "image/png", [IMAGE_EXR] = "image/x-exr"};

/* How an Accept header values one type: by the most specific range that matches. */
struct preference {
	double quality; /* 0..1; 0 also when nothing matches */
	int precision;  /* 0: not matched, 1: any type, 2: image/any and the like, 3: named */
};

static const char *skip_space(const char *c)
{
	while (*c == ' ' || *c == '\t')
		c++;
	return c;
}

/* The value of ";q=" among the parameters of a range that ends at `end`; 1 when there is none. */
static double parse_quality(const char *c, const char *end)
{
	while (c < end && (c = memchr(c, ';', (size_t)(end - c)))) {
		c = skip_space(c + 1);
		if ((*c == 'q' || *c == 'Q') && c[1] == '=') {
			double quality = strtod(c + 2, NULL);
			return quality >= 0 ? fmin(quality, 1) : 0;
		}
	}
	return 1;
}

static int match_precision(const char *range, size_t length, const char *type)
{
	if (length == strlen(type) && strncasecmp(range, type, length) == 0)
		return 3;
	if (length >= 3 && strncmp(range + length - 2, "/*", 2) == 0 && strncasecmp(range, type, length - 1) == 0)
		return 2;
	return length == 3 && strncmp(range, "*/*", 3) == 0 ? 1 : 0;
}

static struct preference preference_for(const char *accept, const char *type)
{
	struct preference best = {0, 0};
	while (*accept) {
		const char *range = skip_space(accept);
		const char *end = range + strcspn(range, ",");
		size_t length = strcspn(range, ",; \t");
		int precision = match_precision(range, length, type);
		if (precision > best.precision)
			best = (struct preference){parse_quality(range + length, end), precision};
		accept = *end ? end + 1 : end;
	}
	return best;
}

bool negotiation_choose(const char *accept, enum image_format wanted, enum image_format *chosen)
{
	*chosen = wanted;
	if (!accept || !*skip_space(accept))
		return true;
	enum image_format other = wanted == IMAGE_PNG ? IMAGE_EXR : IMAGE_PNG;
	struct preference ours = preference_for(accept, image_content_types[wanted]);
	struct preference theirs = preference_for(accept, image_content_types[other]);
	bool overrides = theirs.precision == 3 && theirs.quality > 0 &&
			 (theirs.quality > ours.quality || (ours.precision < 3 && theirs.quality == ours.quality));
	if (overrides)
		*chosen = other;
	return overrides || ours.quality > 0;
}

int negotiation_choose_type(const char *accept, const char *const *types)
{
	struct preference best = {0, 0};
	int chosen = -1;
	if (!accept || !*skip_space(accept))
		return 0;
	for (int i = 0; types[i]; i++) {
		const struct preference own = preference_for(accept, types[i]);
		const bool better = own.quality > best.quality ||
				    (own.quality > 0 && own.quality == best.quality && own.precision == 3 && best.precision < 3);
		if (better) {
			best = own;
			chosen = i;
		}
	}
	return chosen;
}

bool negotiation_is_json(const char *content_type)
{
	if (!content_type)
		return true;
	content_type = skip_space(content_type);
	size_t length = strcspn(content_type, "; \t");
	return length == strlen("application/json") && strncasecmp(content_type, "application/json", length) == 0;
}
