# shellcheck shell=bash
# Sourced by the scripts that need a daemon, which set B, the build folder: starts one and knows when it is ready.

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

# daemon_lend LOG: a daemon on a free port for as long as the script runs, at whose end daemon_tidy is called; clients find it by
# STRATUS_SERVER. Exits with what the daemon logged when it does not start.
daemon_lend() {
	trap 'daemon_stop; daemon_tidy' EXIT
	trap 'exit 130' INT
	trap 'exit 143' TERM
	daemon_start 127.0.0.1:0 2>"$1"
	if ! daemon_await; then
		echo "the daemon did not start; its log:" >&2
		cat "$1" >&2
		exit 1
	fi
	export STRATUS_SERVER=$daemon_url
}

# What a script leaves to be removed; redefined by those that do.
daemon_tidy() { :; }
