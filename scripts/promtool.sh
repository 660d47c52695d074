#!/bin/bash
# Prints the path of a promtool: the one installed, else one unpacked from Debian's prometheus package into FOLDER. That package is not
# installed, since it would start a server. promtool.sh FOLDER; fails, with the reason on standard error, when there is none to be had.
set -euo pipefail
folder=${1:-build/tools}
if command -v promtool; then
	exit 0
fi
if [ ! -x "$folder/promtool" ]; then
	download=$(mktemp -d)
	trap 'rm -rf "$download"' EXIT
	(cd "$download" && apt-get -qq -o APT::Sandbox::User=root download prometheus) >&2
	dpkg-deb --fsys-tarfile "$download"/prometheus_*.deb | tar -x -C "$download" ./usr/bin/promtool
	mkdir -p "$folder"
	mv "$download/usr/bin/promtool" "$folder/promtool"
fi
realpath "$folder/promtool"
