#!/bin/sh
# Measures, draws and writes docs/validation: validate.sh BUILD_DIR [options of stratus-validate]. Fails when a bound is broken, but only
# after all is written, so that the page shows it.
set -eu
B=$1
shift
data=$B/validation
mkdir -p "$data" docs/validation
status=0
"$B/stratus-validate" "$@" "$data" || status=$?
[ $status -le 1 ] || exit $status
gnuplot -e "data='$data'; out='docs/validation'" tests/validate/figures.gp
cp "$data/README.md" docs/validation/README.md
cp "$data/sky.md" docs/validation/sky.md
exit $status
