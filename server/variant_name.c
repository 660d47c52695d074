#include "server/variant_name.h"

#include <ctype.h>
#include <stdio.h>
#include <string.h>

/* Members are left out whole where there is no room for them. */
struct draft {
	char text[128];
	size_t length; /* that it would have */
	size_t room;   /* for members, in characters */
	int left_out;  /* so many of them */
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

/* The first is there in any case, be it cut. */
static void add_member(struct draft *draft, const char *section, const char *name, const json_t *value)
{
	const size_t before = draft->length;
	if (section)
		add_word(draft, '-', section);
	add_word(draft, '-', name);
	add_value(draft, value);
	if (before > 0 && draft->length > draft->room) {
		draft->length = before;
		draft->left_out++;
	}
}

static void add_section(struct draft *draft, const char *section, const json_t *members, bool with_sections)
{
	const char *name;
	json_t *value;
	if (!json_is_object(members))
		add_member(draft, NULL, section, members);
	json_object_foreach((json_t *)members, name, value) add_member(draft, with_sections ? section : NULL, name, value);
}

static void write_draft(struct draft *draft, const json_t *patch, bool with_sections, size_t room)
{
	const char *section;
	json_t *members;
	*draft = (struct draft){.room = room};
	json_object_foreach((json_t *)patch, section, members) if (strcmp(section, "name") != 0)
		add_section(draft, section, members, with_sections);
	draft->text[draft->length < sizeof draft->text ? draft->length : sizeof draft->text - 1] = '\0';
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
	static const char tail[] = "-and-99-more";
	struct draft draft;
	write_draft(&draft, patch, true, size - 1);
	if (draft.left_out || draft.length >= size)
		write_draft(&draft, patch, false, size - 1);
	if (draft.left_out)
		write_draft(&draft, patch, false, size - sizeof tail);
	if (draft.left_out)
		snprintf(name, size, "%.*s-and-%d-more", (int)(size - sizeof tail), draft.text, draft.left_out);
	else
		snprintf(name, size, "%s", draft.text);
}
