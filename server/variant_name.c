#include "server/variant_name.h"

#include <ctype.h>
#include <stdio.h>
#include <string.h>

/* What the name was cut from may be longer. */
struct draft {
	char text[128];
	size_t length; /* that it would have */
};

static void add_word(struct draft *draft, char separator, const char *word)
{
	if (draft->length > 0 && draft->length < sizeof draft->text - 1)
		draft->text[draft->length] = separator;
	draft->length += draft->length > 0;
	for (; *word; word++, draft->length++)
		if (draft->length < sizeof draft->text - 1)
			draft->text[draft->length] = isalnum((unsigned char)*word) || *word == '-' ? *word : '_';
}

static void add_value(struct draft *draft, const json_t *value)
{
	char number[32];
	size_t index;
	json_t *element;
	json_array_foreach((json_t *)value, index, element) add_value(draft, element);
	if (json_is_number(value)) {
		snprintf(number, sizeof number, "%.6g", json_number_value(value));
		add_word(draft, '-', number);
	} else if (json_is_string(value)) {
		add_word(draft, '-', json_string_value(value));
	} else if (json_is_boolean(value)) {
		add_word(draft, '-', json_is_true(value) ? "true" : "false");
	} else if (json_is_null(value)) {
		add_word(draft, '-', "default");
	}
}

static void add_section(struct draft *draft, const char *section, const json_t *members, bool with_sections)
{
	const char *name;
	json_t *value;
	if (!json_is_object(members)) {
		add_word(draft, '-', section);
		add_value(draft, members);
	}
	json_object_foreach((json_t *)members, name, value)
	{
		if (with_sections)
			add_word(draft, '-', section);
		add_word(draft, '-', name);
		add_value(draft, value);
	}
}

static void write_draft(struct draft *draft, const json_t *patch, bool with_sections)
{
	const char *section;
	json_t *members;
	*draft = (struct draft){0};
	json_object_foreach((json_t *)patch, section, members) if (strcmp(section, "name") != 0)
		add_section(draft, section, members, with_sections);
}

bool variant_changes_only_model(const json_t *patch)
{
	const char *section;
	json_t *members;
	json_object_foreach((json_t *)patch, section,
			    members) if (strcmp(section, "name") != 0 && strcmp(section, "model") != 0) return false;
	return true;
}

void variant_name_of_patch(const json_t *patch, char *name, size_t size)
{
	struct draft draft;
	write_draft(&draft, patch, true);
	if (draft.length >= size)
		write_draft(&draft, patch, false);
	snprintf(name, size, "%s", draft.text);
}
