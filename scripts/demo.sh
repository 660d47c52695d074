#!/bin/bash
# Four pictures into out/, with the time each stage took: demo.sh BUILD_DIR.
set -euo pipefail
B=${1:-build}
. scripts/daemon.sh

mkdir -p out
log=out/stratusd.log
trap daemon_stop EXIT
trap 'exit 130' INT
trap 'exit 143' TERM
daemon_start 127.0.0.1:0 2>"$log"
if ! daemon_await; then
	echo "the daemon did not start; its log:" >&2
	cat "$log" >&2
	exit 1
fi
export STRATUS_SERVER=$daemon_url

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
