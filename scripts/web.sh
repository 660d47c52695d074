#!/bin/bash
# Tests of the web page in Chromium: web.sh BUILD_DIR. The last line is "N passed, N failed, N skipped": all are skipped, and that is said, where there is no
# Chromium, no Node.js, or no npm registry to have the packages of tests/web/package-lock.json from.
set -uo pipefail
B=${1:-build}
modules=$PWD/build/web-test
tests=(tests/web/*.test.mjs)
results=$(mktemp -d)
trap 'rm -rf "$results"' EXIT

skip() {
	echo "the web page is not tested: $1"
	echo "0 passed, 0 failed, ${#tests[@]} skipped"
	exit 0
}

for program in chromium node npm; do
	command -v $program >/dev/null || skip "there is no $program (make web-packages)"
done
if ! cmp -s tests/web/package-lock.json "$modules/node_modules/.from"; then
	mkdir -p "$modules"
	cp tests/web/package.json tests/web/package-lock.json "$modules"
	npm ci --prefix "$modules" --ignore-scripts --no-audit --no-fund --fetch-retries=1 >"$results/npm" 2>&1 || {
		cat "$results/npm"
		skip "npm has no packages"
	}
	cp tests/web/package-lock.json "$modules/node_modules/.from"
fi

passed=0 failed=0
for test in "${tests[@]}"; do
	echo "== $test"
	STRATUS_BUILD=$B STRATUS_WEB_MODULES=$modules timeout 1500 node --test --test-reporter=tap "$test" >"$results/tap"
	status=$?
	ok=$(sed -n 's/^# pass \([0-9]*\)$/\1/p' "$results/tap")
	bad=$(sed -n 's/^# fail \([0-9]*\)$/\1/p' "$results/tap")
	grep -E '^ *(not )?ok ' "$results/tap"
	[ $status = 0 ] || cat "$results/tap"
	[ $status != 0 ] && [ "${bad:-0}" = 0 ] && bad=1
	passed=$((passed + ${ok:-0})) failed=$((failed + ${bad:-0}))
done
echo "$passed passed, $failed failed, 0 skipped"
[ $failed = 0 ] && [ $passed -gt 0 ]
