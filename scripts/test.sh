#!/bin/bash
# Runs every test against the programs in BUILD_DIR: test.sh BUILD_DIR. The last line is "N passed, N failed".
# After the plain build the tests of programs are repeated with sanitizers, and those of what threads share with that for threads;
# STRATUS_QUICK=1 leaves that out.
# What fails beside others is run once more at the end, alone, and counts by that; it is named as "unsteady: NAME" before the last line.
set -uo pipefail
B=${1:-build}
SAN=${SAN:-} sanitized=
python=/usr/bin/python3 # Debian's, which sees the packages installed for the tests
results=$(mktemp -d)
trap 'rm -rf "$results"' EXIT
passed=0 failed=0
touch "$results"/{units,tests,unsteady}.again

count() { # count PASSED FAILED
	passed=$((passed + $1))
	failed=$((failed + $2))
}

# One unit test program, with its arguments. cmocka's own count where it ended in order, else one failure; 77 means that it cannot run here.
# The first time a failure is put off, unless a sanitizer reports it.
run_unit() {
	local program=$1 output status ok bad
	echo "== ${program#"$B"/}"
	output=$(timeout 1500 "${calm[@]}" "$@" 2>&1)
	status=$?
	if [ $status = 77 ]; then
		echo "skipped"
		return
	fi
	[ $status = 0 ] || echo "$output (exit status $status)"
	if [ $status != 0 ] && [ -z "${is_alone:-}" ] && ! grep -qE 'Sanitizer|runtime error:' <<<"$output"; then
		echo "$*" >>"$results/units.again"
		return
	fi
	ok=$(sed -n 's/^\[  PASSED  \] \([0-9]*\) test.*/\1/p' <<<"$output" | tail -1)
	bad=$(sed -n 's/^\[  FAILED  \] \([0-9]*\) test.*/\1/p' <<<"$output" | tail -1)
	if [ $status != 0 ] && [ "${bad:-0}" = 0 ]; then
		bad=1
	elif [ $status = 0 ] && [ -z "$ok" ]; then
		ok=1 # a program without cmocka
	fi
	echo "${ok:-0} passed, ${bad:-0} failed in ${program##*/}"
	count "${ok:-0}" "${bad:-0}"
}

# What measures light for minutes runs code that others run as well: left out with sanitizers, under which it takes longer still, to build too.
measures=" deck reference_layer reference_twin renderer_coverage renderer_fields renderer_model renderer_motion renderer_panoramas renderer_repeat
	renderer_sides shaders_picture sky_light slab slab_photons "

# ThreadSanitizer of gcc 12 knows where memory is as long as the kernel does not scatter it too far (vm.mmap_rnd_bits).
calm=()

run_units() {
	local program name
	for program in "$B"/tests/test_*; do
		name=${program##*/test_}
		[ -n "$SAN" ] && [[ $measures =~ [[:space:]]$name[[:space:]] ]] && continue
		[ -x "$program" ] && [ -f "$program" ] && run_unit "$program"
	done
}

# What fuzzing starts from, and what it found once.
run_replays() {
	local seeds
	for seeds in tests/fuzz/seeds/*; do
		STRATUS_IMAGE_MODULE=$B/stratus-image.so run_unit "$B/fuzz/replay_${seeds##*/}" "$seeds"
	done
}

# One folder of pytest, since a conftest.py is a module by its bare name; the counts come from its report. Five: no tests there.
run_pytest() {
	local report=$results/$RANDOM.xml status counts
	echo "== pytest $*"
	STRATUS_BUILD=$B $python -m pytest -q -p no:cacheprovider --junitxml="$report" "$@"
	status=$?
	[ $status = 5 ] && return
	counts=$($python scripts/test_report.py "$report" "$results/tests.again") || counts="0 1"
	[ $status -gt 1 ] && [ "${counts#* }" = 0 ] && counts="${counts% *} 1"
	# shellcheck disable=SC2086
	count $counts
}

# Beside the others time was taken from them; now there is nothing else.
run_again() {
	local is_alone=1 before
	while read -r -u 3 program seeds; do
		before=$failed
		echo "== again, alone"
		# shellcheck disable=SC2086
		STRATUS_IMAGE_MODULE=$B/stratus-image.so run_unit "$program" $seeds
		[ "$failed" != "$before" ] || echo "unsteady: $program" >>"$results/unsteady.again"
	done 3<"$results/units.again"
	while read -r -u 3 name; do
		echo "== again, alone: $name"
		if STRATUS_BUILD=$B $python -m pytest -q -p no:cacheprovider "$name" 3<&-; then
			count 1 0
			echo "unsteady: $name" >>"$results/unsteady.again"
		else
			count 0 1
		fi
	done 3<"$results/tests.again"
}

run_format() {
	echo "== clang-format"
	if find renderer server clients tests shaders \( -name '*.[ch]' -o -name '*.cpp' \) -print0 |
		xargs -0 clang-format --dry-run -Werror; then
		count 1 0
	else
		count 0 1
	fi
}

build_sanitized() {
	make --no-print-directory -j"$(nproc)" SAN=address,undefined WITHOUT="$measures" programs unit replays
}

# The page in a browser, beside nothing else; its last line counts, and says when there is no browser or no npm registry.
run_web() {
	local log=$results/web counts
	echo "== the page in a browser"
	if ! scripts/web.sh "$B" 2>&1 | tee "$log"; then
		echo "== again"
		scripts/web.sh "$B" 2>&1 | tee "$log" && echo "unsteady: scripts/web.sh" >>"$results/unsteady.again"
	fi
	counts=$(sed -n '$s/^\([0-9]*\) passed, \([0-9]*\) failed, [0-9]* skipped$/\1 \2/p' "$log")
	# shellcheck disable=SC2086
	count ${counts:-0 1}
}

# The same programs built with sanitizers, in a process of its own whose last line is its count.
run_sanitized() {
	local log=$results/sanitized counts
	echo "== again with SAN=address,undefined"
	if build_sanitized >"$log" 2>&1; then
		SAN=address,undefined scripts/test.sh build/san-address-undefined 2>&1 | tee "$log" | sed '$d'
	else
		cat "$log"
	fi
	grep '^unsteady: ' "$log" | sed 's/$/ (with sanitizers)/' >>"$results/unsteady.again"
	counts=$(sed -n '$s/^\([0-9]*\) passed, \([0-9]*\) failed$/\1 \2/p' "$log")
	# shellcheck disable=SC2086
	count ${counts:-0 1}
}

# What threads share, with the sanitizer that sees a lock missing.
run_threads() {
	local log=$results/threads name is_alone=1 programs=()
	for name in render_queue fair_order flight image_cache intake worker_pool cache api_keys asset_store cost_model decoder lingering log shares; do
		programs+=("build/san-thread/tests/test_$name")
	done
	echo "== again with SAN=thread"
	if ! make --no-print-directory -j"$(nproc)" SAN=thread build/san-thread/stratus-image.so "${programs[@]}" >"$log" 2>&1; then
		cat "$log"
		count 0 1
		return
	fi
	setarch -R true 2>/dev/null && calm=(setarch -R)
	for name in "${programs[@]}"; do
		run_unit "$name"
	done
	calm=()
}

# Leaks of drivers are told from ours by the module that allocated, so that no module may be unloaded before the report.
keep_modules() {
	echo 'int dlclose(void *handle) { (void)handle; return 0; }' | gcc -shared -fPIC -x c - -o "$results/keep.so" || return
	export LD_PRELOAD=$results/keep.so
	export ASAN_OPTIONS=${ASAN_OPTIONS:-detect_leaks=1:verify_asan_link_order=0}
	export LSAN_OPTIONS=${LSAN_OPTIONS:-suppressions=$PWD/scripts/lsan.supp:print_suppressions=0}
	export UBSAN_OPTIONS=${UBSAN_OPTIONS:-print_stacktrace=1}
}

if [ -n "$SAN" ]; then
	keep_modules
fi
run_programs() {
	run_units
	run_replays
}

[ -n "$SAN" ] || [ "${STRATUS_QUICK:-0}" = 1 ] || sanitized=1

# Most of what goes over HTTP waits; the programs meanwhile compute, then the compiler. Their counts come from a process of their own.
(
	passed=0 failed=0
	run_programs
	echo "$passed $failed" >"$results/programs"
	[ -z "$sanitized" ] || build_sanitized >/dev/null
) >"$results/programs.log" 2>&1 &
programs=$!
if [ -n "$SAN" ]; then
	run_pytest tests/http
else
	run_pytest tests/http
	run_pytest tests/client
	run_pytest tests/ops
	run_format
fi
wait $programs
cat "$results/programs.log"
# shellcheck disable=SC2046
count $(cat "$results/programs" || echo 0 1)
run_again
[ -n "$SAN" ] || run_web
if [ -n "$sanitized" ]; then
	run_sanitized
	run_threads
fi

cat "$results/unsteady.again"
echo "$passed passed, $failed failed"
[ $failed = 0 ] && [ $passed -gt 0 ]
