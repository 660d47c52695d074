#!/bin/bash
# Four pictures into out/, with the time each stage took: demo.sh BUILD_DIR.
set -euo pipefail
B=${1:-build}
. scripts/daemon.sh

mkdir -p out
daemon_lend out/stratusd.log

mapfile -t presets < <("$B/stratus" presets -q)
[ "${#presets[@]}" -ge 4 ] || { echo "the daemon lists ${#presets[@]} presets, four are wanted" >&2; exit 1; }
for i in 0 1 2 3; do
	extension=png
	[ $i = 3 ] && extension=exr
	file=out/${presets[$i]}.$extension
	echo "$file"
	"$B/stratus" render --preset "${presets[$i]}" -o "$file" 2>&1
	echo
done
