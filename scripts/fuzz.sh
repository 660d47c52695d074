#!/bin/bash
# Runs fuzz targets: fuzz.sh FOLDER_OF_PROGRAMS SECONDS TARGET... Inputs that reach new code are kept in out/fuzz/TARGET and are the start of
# the next run; an input that breaks something is kept in out/fuzz/found and fails the run. Mend the fault, then add the input to
# tests/fuzz/seeds/TARGET, which every `make test` tries.
set -uo pipefail
programs=$1 seconds=$2
shift 2
export ASAN_OPTIONS=detect_leaks=1:allocator_may_return_null=1:handle_abort=1
export UBSAN_OPTIONS=print_stacktrace=1
# What the software renderer and its compiler keep is no leak of ours.
export LSAN_OPTIONS=suppressions=$PWD/scripts/lsan.supp:print_suppressions=0
mkdir -p out/fuzz/found

fuzz() {
	local target=$1 corpus=out/fuzz/$1 seeds=tests/fuzz/seeds/$1 options=(-max_len=65536 -timeout=25 -rss_limit_mb=4096) status
	mkdir -p "$corpus"
	case $target in
	# A service with threads of its own: what it allocates meanwhile belongs to no input, so leaks are looked for by the tests.
	http)
		options+=(-detect_leaks=0 -max_len=8192 -len_control=0)
		local -x ASAN_OPTIONS=$ASAN_OPTIONS:detect_leaks=0
		;;
	esac
	[ -f "tests/fuzz/$target.dict" ] && options+=("-dict=tests/fuzz/$target.dict")
	"$programs/fuzz_$target" "${options[@]}" -max_total_time="$seconds" -print_final_stats=1 -artifact_prefix="out/fuzz/found/$target-" \
		"$corpus" "$seeds" >"out/fuzz/$target.log" 2>&1
	status=$?
	echo "$target: $(sed -n 's/^stat::number_of_executed_units: *//p' "out/fuzz/$target.log") inputs tried, $(find "$corpus" -type f | wc -l) kept," \
		"$([ $status = 0 ] && echo "nothing found" || echo "STOPPED with status $status, see out/fuzz/$target.log")"
	return $status
}

failed=0 running=0
for target; do
	fuzz "$target" &
	running=$((running + 1))
	if [ $running -ge "$(nproc)" ]; then
		wait -n || failed=1
		running=$((running - 1))
	fi
done
while [ $running -gt 0 ]; do
	wait -n || failed=1
	running=$((running - 1))
done
exit $failed
