#!/bin/bash
# Renders docs/gallery/list.txt into small files beside the scenes, and the page that shows them: gallery.sh BUILD_DIR [PICTURE ...].
set -euo pipefail
B=${1:-build}
shift || true
. scripts/daemon.sh

folder=docs/gallery
work=$(mktemp -d)
daemon_tidy() { rm -rf "$work"; }
daemon_lend "$work/log"

trim() { sed 's/^ *//; s/ *$//' <<<"$1"; }

wanted() { # wanted PICTURE NAMES...: no names are all
	local picture=$1
	shift
	[ $# = 0 ] && return
	[[ " $* " == *" $picture "* ]]
}

draw() { # draw PICTURE SCENE SETS
	local options=()
	[ -z "$3" ] || options=(--set "$3")
	echo "$folder/$1.jpg"
	"$B/stratus" render "$folder/$2.json" "${options[@]}" -q -o "$work/$1.png"
	convert "$work/$1.png" -quality 87 -sampling-factor 4:2:0 -strip "$folder/$1.jpg"
}

page=$work/README.md
{
	echo "# Gallery"
	echo
	echo "Drawn by \`make gallery\` out of the scenes beside the pictures. Any of them alone: \`stratus render docs/gallery/NAME.json -o NAME.png\`,"
	echo "with \`--set\` and what stands under the picture. The letters are those of figure 2 of the paper."
} >"$page"

while IFS='|' read -r picture scene sets caption; do
	case $picture in
	'# '* | '') continue ;;
	'## '*)
		printf '\n%s\n\n| | |\n| --- | --- |\n' "$picture" >>"$page"
		continue
		;;
	esac
	picture=$(trim "$picture") scene=$(trim "$scene") sets=$(trim "$sets") caption=$(trim "$caption")
	wanted "$picture" "$@" && draw "$picture" "$scene" "$sets"
	printf '| ![%s](%s.jpg) | %s<br>[%s.json](%s.json)%s |\n' "$caption" "$picture" "$caption" "$scene" "$scene" \
		"${sets:+<br>\`--set '$sets'\`}" >>"$page"
done <$folder/list.txt
mv "$page" $folder/README.md
