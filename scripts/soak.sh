#!/bin/sh
# Twenty minutes of mixed load with faults injected: soak.sh BUILD_DIR.
exec /usr/bin/python3 tests/soak/soak.py "${1:-build}"
