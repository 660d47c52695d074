/* stratus completion: a script for bash, made of the tables that the commands read, and the members of a scene for it. */
#include "clients/commands.h"
#include "clients/http.h"
#include "clients/problem.h"

#include <stdio.h>
#include <string.h>

/* --- the members of a scene
 * --------------------------------------------------------------------------------------------------------------- */

/* The name of a line "NAME:" with so many spaces before it; false when it is none. */
static bool read_name(const char *line, int indent, char name[static 64])
{
	int end = 0;
	return (int)strspn(line, " ") == indent && sscanf(line + indent, "%63[a-z0-9_]:%n", name, &end) == 1 && end > 0;
}

/* Prints section.member for the properties of the schema Scene in the daemon's own description; false when there were none. */
static bool print_members(char *text)
{
	char section[64] = "", name[64];
	bool in_scene = false, printed = false;
	for (char *line = strtok(text, "\n"); line; line = strtok(NULL, "\n")) {
		if (strncmp(line, "    ", 4) == 0 && line[4] != ' ')
			in_scene = strcmp(line, "    Scene:") == 0;
		else if (in_scene && read_name(line, 8, name))
			memcpy(section, name, sizeof section);
		else if (in_scene && *section && read_name(line, 12, name))
			printed = printf("%s.%s\n", section, name) > 0;
	}
	return printed;
}

static int fetch_members(const struct client *client)
{
	struct http_response response;
	int status = http_send(client, &(struct http_request){.path = "/openapi.yaml"}, &response);
	if (status == CLIENT_OK && response.status != 200) {
		problem_print(&response);
		status = CLIENT_REFUSED;
	} else if (status == CLIENT_OK && !print_members(response.body)) {
		client_error("%s does not say what is in a scene", client->server);
		status = CLIENT_REFUSED;
	}
	http_response_finish(&response);
	return status;
}

/* --- the script
 * --------------------------------------------------------------------------------------------------------------------------- */

static void print_names(const struct option_row *rows)
{
	for (const struct option_row *row = rows; row && row->name; row++) {
		printf(" --%s", row->name);
		if (row->letter)
			printf(" -%c", row->letter);
	}
}

/* What stands behind an option, as a case of its names. */
static void print_values(const struct option_row *rows)
{
	static const char *const how[] = {[WORDS_ANY] = "_stratus_nothing",
					  [WORDS_FILE] = "_stratus_files",
					  [WORDS_FOLDER] = "_stratus_folders",
					  [WORDS_PRESET] = "_stratus_presets",
					  [WORDS_MEMBER] = "_stratus_members"};
	for (const struct option_row *row = rows; row && row->name; row++) {
		if (!row->argument)
			continue;
		printf("\t\t--%s", row->name);
		if (row->letter)
			printf(" | -%c", row->letter);
		if (row->choices)
			printf(") _stratus_words '%s'; return ;;\n", row->choices);
		else
			printf(") %s; return ;;\n", how[row->words]);
	}
}

static void print_command(const struct command *command)
{
	printf("\t%s)\n\t\toptions='", command->name);
	print_names(command->options);
	printf("'\n\t\tcase $previous in\n");
	print_values(command->options);
	printf("\t\tesac\n");
	if (command->choices)
		printf("\t\twords='%s'\n", command->choices);
	if (command->words == WORDS_FILE)
		puts("\t\tfiles=1");
	if (command->words == WORDS_PRESET)
		puts("\t\tpresets=1");
	puts("\t\t;;");
}

static const char head[] =
	"# bash completion for stratus, made by: stratus completion bash\n"
	"_stratus_nothing() { COMPREPLY=(); }\n"
	"_stratus_files() { mapfile -t COMPREPLY < <(compgen -f -- \"$current\"); compopt -o filenames 2>/dev/null; }\n"
	"_stratus_folders() { mapfile -t COMPREPLY < <(compgen -d -- \"$current\"); compopt -o filenames 2>/dev/null; }\n"
	"_stratus_words() { mapfile -t COMPREPLY < <(compgen -W \"$1\" -- \"$current\"); }\n"
	"_stratus_presets() { _stratus_words \"$(stratus presets -q 2>/dev/null)\"; }\n"
	"_stratus_members() {\n"
	"\t_stratus_words \"$(stratus completion members 2>/dev/null | sed 's/$/=/')\"\n"
	"\tcompopt -o nospace 2>/dev/null\n"
	"}\n"
	"_stratus() {\n"
	"\tlocal current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]} command='' options='' words='' files='' "
	"presets='' i\n"
	"\tfor ((i = 1; i < COMP_CWORD; i++)); do\n"
	"\t\tcase ${COMP_WORDS[i]} in\n";

static const char middle[] = "\t\t-*) ;;\n"
			     "\t\t*) command=${COMP_WORDS[i]}; break ;;\n"
			     "\t\tesac\n"
			     "\tdone\n"
			     "\tcase $previous in\n";

static const char tail[] = "\tesac\n"
			   "\tif [ -z \"$command\" ]; then\n"
			   "\t\t_stratus_words \"$commands $common --version -V\"\n"
			   "\telif [[ $current == -* ]]; then\n"
			   "\t\t_stratus_words \"$options $common\"\n"
			   "\telif [ -n \"$presets\" ]; then\n"
			   "\t\t_stratus_presets\n"
			   "\telif [ -n \"$words\" ] && [ $((COMP_CWORD - i)) = 1 ]; then\n"
			   "\t\t_stratus_words \"$words\"\n"
			   "\telif [ -n \"$files\" ]; then\n"
			   "\t\t_stratus_files\n"
			   "\tfi\n"
			   "}\n"
			   "complete -F _stratus stratus\n";

static void print_bash(void)
{
	fputs(head, stdout);
	fputs("\t\t", stdout);
	for (const struct option_row *row = client_options, *first = row; row->name; row++)
		if (row->argument)
			printf("%s--%s", row == first ? "" : " | ", row->name);
	puts(") ((i++)) ;;");
	fputs(middle, stdout);
	print_values(client_options);
	fputs("\tesac\n\tlocal common='", stdout);
	print_names(client_options);
	fputs("' commands='", stdout);
	for (int i = 0; commands[i]; i++)
		printf("%s%s", i ? " " : "", commands[i]->name);
	puts("'\n\tcase $command in");
	for (int i = 0; commands[i]; i++)
		print_command(commands[i]);
	fputs(tail, stdout);
}

static int run_completion(struct client *client, void *options, char **words)
{
	(void)options;
	if (strcmp(words[0], "members") == 0)
		return fetch_members(client);
	if (strcmp(words[0], "bash") != 0) {
		client_error("completion is for bash, not for %s", words[0]);
		return CLIENT_USAGE;
	}
	print_bash();
	return client_end_output();
}

const struct command command_completion = {
	.name = "completion",
	.arguments = "bash | members",
	.summary = "print a script that completes this client's words in a shell",
	.remarks = "For this shell: source <(stratus completion bash). An installed client has it at its place already.\n"
		   "members prints what --set may change, as the daemon says.\n",
	.words_min = 1,
	.words_max = 1,
	.choices = "bash members",
	.run = run_completion,
};
