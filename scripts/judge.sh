#!/bin/bash
# Measures the slab against its reference into docs/judge and redraws figure 9: judge.sh BUILD_DIR. JUDGE_SAMPLES=N for others than 64 samples.
set -euo pipefail
B=${1:-build}
. scripts/daemon.sh

folder=docs/judge
work=$(mktemp -d)
trap 'daemon_stop; rm -rf "$work"' EXIT
trap 'exit 130' INT
trap 'exit 143' TERM
daemon_start 127.0.0.1:0 2>"$work/log"
if ! daemon_await; then
	echo "the daemon did not start; its log:" >&2
	cat "$work/log" >&2
	exit 1
fi
export STRATUS_SERVER=$daemon_url

draw() { # draw NAME: solved, paper and reference side by side, without the maps below them
	[ -f "out/judge/$1.png" ] && return
	echo "figure 9, $1"
	"$B/stratus" compare "tests/judge/figure9-$1.json" --with model.shading=paper --with model.name=reference --and model.samples="${JUDGE_SAMPLES:-64}" \
		--region all --timeout 3600 -q -o "$work/$1.png"
	convert "$work/$1.png" -crop 100%x33.334%+0+0 +repage "out/judge/$1.png"
}

mkdir -p $folder out/judge
/usr/bin/python3 tests/judge/judge.py $folder/README.md "$B"
draw below
draw above
convert out/judge/below.png out/judge/above.png -append -quality 88 -strip $folder/figure9.jpg
echo "$folder/README.md"
