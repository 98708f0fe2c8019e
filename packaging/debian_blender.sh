#!/usr/bin/env bash
# Makes a folder with Debian trixie and its Blender 4.3 (about 1.5 GB), to test the extension in a whole Blender program:
#
#   packaging/debian_blender.sh .cache/debian-trixie          (as root; needs debootstrap and Debian's package servers)
#   GLINT_BLENDER="chroot $PWD/.cache/debian-trixie blender" GLINT_BLENDER_ROOT=$PWD/.cache/debian-trixie make test ARGS=tests/packaging
#
# Exit code 77 means that it cannot be set up here; the last line says why.
set -euo pipefail

folder=${1:?usage: debian_blender.sh FOLDER}
seconds=${GLINT_DEBIAN_SECONDS:-480}
packages="blender python3-numpy python3-openimageio xvfb libgl1-mesa-dri libegl1"

cannot() {
  echo "debian_blender: not set up: $1"
  exit 77
}

if [ -e "$folder/glint-ready" ]; then
  echo "debian_blender: $folder is ready"
  exit 0
fi
[ "$(id -u)" = 0 ] || cannot "it needs root (debootstrap and chroot)"
if ! command -v debootstrap >/dev/null; then
  apt-get update -qq && apt-get install -y -qq --no-install-recommends debootstrap >/dev/null || cannot "debootstrap cannot be installed"
fi

deadline=$(($(date +%s) + seconds))
within() { timeout $((deadline - $(date +%s) > 0 ? deadline - $(date +%s) : 1)) "$@"; }

rm -rf "$folder"
mkdir -p "$folder"
log=$folder.log
within debootstrap --variant=minbase trixie "$folder" http://deb.debian.org/debian >"$log" 2>&1 \
  || cannot "debootstrap failed or took longer than $seconds s (see $log)"
within chroot "$folder" env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends $packages >>"$log" 2>&1 \
  || cannot "installing Blender failed or took longer than $seconds s (see $log)"
chroot "$folder" apt-get clean
touch "$folder/glint-ready"
echo "debian_blender: $folder is ready: $(chroot "$folder" blender --version | head -n 1)"
