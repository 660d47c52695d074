#!/bin/bash
# Writes a manual page on standard output: manual.sh PROGRAM TEMPLATE. What stands in the template for options (@OPTIONS@, of stratusd) or
# commands (@COMMANDS@, of stratus) is taken from the program's own --help, so that the page cannot say anything else.
set -euo pipefail
program=$1 template=$2
version=$("$program" --version)

# Text as roff: no backslash and no line that begins with a dot or a quote is taken for a request; a sentence begins a line.
escape() { sed -E -e 's/\\/\\e/g' -e 's/([a-z)])\. ([A-Z])/\1.\n\2/g' | sed -e "s/^\([.']\)/\\\\\&\1/"; }

# Lines "  -o, --output FILE  text" become items of a list; other lines stay.
items() {
	sed -E -e 's/^  (-(.), )?--([a-z-]+) ([^ ]+) +(.*)$/.It @\2@Fl -\3 Ar \4\n\\\&\5/;t' \
		-e 's/^  (-(.), )?--([a-z-]+) +(.*)$/.It @\2@Fl -\3\n\\\&\4/' | sed -E -e 's/@(.)@/Fl \1 , /' -e 's/@@//'
}

# Of stratusd: below the text of a flag are its variable and its default.
options() {
	# The default of the state directory is that of whoever runs it.
	# shellcheck disable=SC2016
	env -i HOME='$HOME' "$program" --help | sed '1,/^usage/d' | escape | items |
		sed -E 's/^ +(STRATUS_[A-Z_]+) \[(.*)\]$/.Pq Ev \1 , default \2/; s/, default $/, no default/; /^$/d' |
		sed -E 's/^(\.Pq .*, default )(.+)$/\1Ql \2/'
}

# Of stratus: a section for each command, with its summary, its remarks and its options.
command_section() {
	local help
	help=$("$program" "$1" --help | escape)
	echo ".Ss $(sed -n '1s/^usage: //p' <<<"$help")"
	sed '1,2d' <<<"$help" | items | sed -E 's/^ {8,}//' | awk '
		/^\.It / && !list { print ".Bl -tag -width Ds"; list = 1 }
		/^$/ { gap = 1; next }
		gap && !/^\.It / && shown { print ".Pp" }
		{ gap = 0; shown = 1; print }
		END { if (list) print ".El" }'
}

commands() {
	local name
	for name in $("$program" --help | sed -nE 's/^  ([a-z]+)  +.*/\1/p'); do
		command_section "$name"
	done
}

while IFS= read -r line; do
	case $line in
	.Os) echo ".Os $version" ;;
	@OPTIONS@) options ;;
	@COMMANDS@) commands ;;
	*) printf '%s\n' "$line" ;;
	esac
done <"$template"
