#!/bin/bash
# Runs the daemon until Ctrl-C: run.sh BUILD_DIR. On 127.0.0.1:8080, or on any free port when that one is in use.
set -euo pipefail
B=${1:-build}
. scripts/daemon.sh

port=8080
if (exec 4<>/dev/tcp/127.0.0.1/$port) 2>/dev/null; then
	echo "port $port is in use, taking a free one"
	port=0
fi

trap daemon_stop EXIT
trap 'exit 0' INT TERM
daemon_start "127.0.0.1:$port"
if ! daemon_await; then
	wait "$daemon_pid" || status=$?
	exit "${status:-1}"
fi
cat <<END
stratusd listening on $daemon_url

  curl -o sky.png -H 'Content-Type: application/json' -d '{}' $daemon_url/v1/render

Ctrl-C stops it.
END
wait "$daemon_pid"
