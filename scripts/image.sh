#!/bin/bash
# Builds the container image and renders a picture with it: image.sh [WORK_FOLDER]. With docker or podman where one of them works; else, as
# root, with buildah, which needs no daemon and no namespaces, over a base made by debootstrap, which needs no registry.
set -euo pipefail
work=$(realpath -m "${1:-out/image}")
tag=localhost/stratus
version=$(sed -n 's/.*RENDERER_VERSION "\(.*\)".*/\1/p' renderer/renderer.h)
arguments=(--build-arg "VERSION=$version" --build-arg "REVISION=$(git rev-parse HEAD 2>/dev/null || true)"
	--build-arg "CREATED=$(date -u +%Y-%m-%dT%H:%M:%SZ)" -t "$tag" .)
mkdir -p "$work"
log=$work/stratusd.log

build() {
	local engine
	for engine in docker podman; do
		if "$engine" info >/dev/null 2>&1; then
			"$engine" build "${arguments[@]}"
			run=("$engine" run --rm --network host "$tag")
			return
		fi
	done
	scripts/packages.sh buildah debootstrap
	build_with_buildah
}

# The base has Debian's packages and nothing else, which is what debian:12-slim is but for the documentation in it.
build_with_buildah() {
	export BUILDAH_ISOLATION=chroot
	buildah=(buildah --root "$work/store" --runroot "$work/run")
	local base
	if ! "${buildah[@]}" inspect docker.io/library/debian:12-slim >/dev/null 2>&1; then
		[ -e "$work/base/etc/debian_version" ] || debootstrap --variant=minbase bookworm "$work/base"
		base=$("${buildah[@]}" from scratch)
		"${buildah[@]}" add -q "$base" "$work/base" /
		"${buildah[@]}" commit -q --rm "$base" docker.io/library/debian:12-slim
	fi
	"${buildah[@]}" bud --pull-never --layers --format docker "${arguments[@]}"
	run=("${buildah[@]}" run "$("${buildah[@]}" from --pull-never "$tag")" --)
}

# What the image's command prints, until it says where it listens.
daemon_url() {
	local i
	for ((i = 0; i < 600; i++)); do
		url=$(sed -n 's/^stratusd listening on //p' "$log")
		[ -n "$url" ] && return
		kill -0 "$daemon" 2>/dev/null || break
		sleep 0.1
	done
	cat "$log" >&2
	return 1
}

# What buildah leaves behind keeps its layers for the next time, and no mount that would stand in the way of make clean.
tidy() {
	[ -n "${daemon:-}" ] && stop
	if [ -n "${buildah:-}" ]; then
		"${buildah[@]}" rm -a >/dev/null || true
		umount "$work/store/overlay" 2>/dev/null || true
	fi
}

# docker and podman hand a signal on; buildah does not, so the last of its descendants is asked.
stop() {
	local process=$daemon child
	while child=$(pgrep -n -P "$process"); do
		process=$child
	done
	kill "$process" 2>/dev/null || true
	wait "$daemon" || true
}

trap tidy EXIT
build
"${run[@]}" stratusd --check-config
"${run[@]}" stratusd --listen 127.0.0.1:0 --log-level debug >"$log" 2>&1 &
daemon=$!
daemon_url
"${run[@]}" stratus --server "$url" health --ready
curl -sf -o "$work/sky.png" "$url/v1/render?output.width=320&output.height=240"
[ "$(head -c 4 "$work/sky.png" | tail -c 3)" = PNG ]
echo "image $tag, version $version: $work/sky.png was rendered by it"
