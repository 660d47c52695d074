#!/bin/bash
# Measures the slab against its reference into docs/judge and redraws figure 9: judge.sh BUILD_DIR. JUDGE_SAMPLES=N for others than 64 samples.
set -euo pipefail
B=${1:-build}
. scripts/daemon.sh

folder=docs/judge
# What finished scenes gave is kept for a run that was stopped, by the same program of the same scenes.
JUDGE_KEPT=out/judge/${JUDGE_SAMPLES:-64}-$(cat "$B/stratusd" "$B/stratus" tests/judge/*.json tests/judge/scenes/*.json tests/judge/judge.py | sha256sum | cut -c1-12)
export JUDGE_KEPT
work=$(mktemp -d)
daemon_tidy() { rm -rf "$work"; }
daemon_lend "$work/log"

draw() { # draw NAME: solved, paper and reference side by side, without the maps below them
	[ -f "$JUDGE_KEPT/$1.png" ] && return
	echo "figure 9, $1"
	"$B/stratus" compare "tests/judge/figure9-$1.json" --with model.shading=paper --with model.name=reference --and model.samples="${JUDGE_SAMPLES:-64}" \
		--region all --timeout 3600 -q -o "$work/$1.png"
	convert "$work/$1.png" -crop 100%x33.334%+0+0 +repage "$JUDGE_KEPT/$1.png"
}

mkdir -p $folder "$JUDGE_KEPT"
/usr/bin/python3 tests/judge/judge.py $folder/README.md "$B"
draw below
draw above
convert "$JUDGE_KEPT/below.png" "$JUDGE_KEPT/above.png" -append -quality 88 -strip $folder/figure9.jpg
echo "$folder/README.md"
