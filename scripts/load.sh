#!/bin/bash
# Offers a daemon half of what it can do up to four times as much: load.sh BUILD_DIR. LOAD_QUEUE=N for another length of its queue.
set -euo pipefail
B=${1:-build}
. scripts/daemon.sh

work=$(mktemp -d)
queue=${LOAD_QUEUE:-32}
daemon_tidy() { rm -rf "$work"; }
export STRATUS_QUEUE_LENGTH=$queue STRATUS_LOG_LEVEL=warning
daemon_lend "$work/log"
/usr/bin/python3 tests/load/load.py "$B" "$queue"
