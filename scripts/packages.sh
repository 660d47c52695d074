#!/bin/sh
# Installs the Debian packages named that are not installed yet, with sudo when not root.
set -eu
for package; do # keeps those that are missing
	shift
	dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q 'ok installed' || set -- "$@" "$package"
done
[ $# -gt 0 ] || exit 0
echo "installing: $*"
sudo=
if [ "$(id -u)" != 0 ]; then
	command -v sudo >/dev/null || { echo "need root or sudo to install: $*" >&2; exit 1; }
	sudo=sudo
fi
$sudo apt-get update -qq
$sudo env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@" >/dev/null
