# shellcheck shell=bash
# Sourced by run.sh and demo.sh, which set B, the build folder: starts one daemon and knows when it is ready.

# daemon_start ADDRESS: starts $B/stratusd. Sets daemon_pid; the daemon's standard output is descriptor 3.
daemon_start() {
	mkdir -p build/state
	exec 3< <(exec "$B/stratusd" --listen "$1" --state-dir build/state --kernel build/mie.kernel)
	daemon_pid=$!
}

# daemon_await: reads until the daemon says where it listens; sets daemon_url. Fails when it ends without having said so.
# shellcheck disable=SC2034 # daemon_url is for the caller
daemon_await() {
	local line
	while IFS= read -r line <&3; do
		case $line in
		'stratusd listening on '*)
			daemon_url=${line#stratusd listening on }
			return 0
			;;
		esac
	done
	return 1
}

# daemon_stop: asks the daemon to end, waits for it. Nothing when none was started or it is gone.
daemon_stop() {
	[ -n "${daemon_pid:-}" ] || return 0
	kill "$daemon_pid" 2>/dev/null || true
	wait "$daemon_pid" 2>/dev/null || true
	daemon_pid=
}
