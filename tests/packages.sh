#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Builds the Debian packages in build/packages, installs them in a fresh Debian 12 and runs debian/tests there: a camera
# node, lf-serve and Python. A browser outside shows the demo. Prints the seconds of each step. Needs root, a Debian
# mirror, npm and the packages of `tools` below.
#   tests/packages.sh [--built]   --built: with the packages that are already in build/packages
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
tools=(chromium debhelper devscripts help2man iproute2 lintian mkdocs mmdebstrap nodejs)

if ((EUID != 0)); then echo "tests/packages.sh: root is required" >&2; exit 1; fi
# shellcheck disable=SC2016  # dpkg-query expands the field
[[ $(dpkg-query -W -f '${db:Status-Status}\n' "${tools[@]}" 2>/dev/null | grep -cx installed) == "${#tools[@]}" ]] ||
  { echo "tests/packages.sh: install ${tools[*]}" >&2; exit 1; }
if [[ ! ${LF_ROOT:-} ]]; then
  LF_ROOT=$(mktemp -d)
  trap 'rm -rf "$LF_ROOT"' EXIT
  # Mounts exist only in the namespace, and end with the inner script.
  LF_ROOT=$LF_ROOT unshare --mount --pid --fork --kill-child "$0" "$@"
  exit
fi

packages=build/packages cache=build/apt-archives  # the next run need not download packages
step() { # NAME COMMAND...
  local begun=$SECONDS name=$1
  shift
  "$@" >"$packages/log" 2>&1 || { tail -n 60 "$packages/log"; echo "not ok - $name"; exit 1; }
  echo "ok - $name ($((SECONDS - begun)) s)"
  sed -n '/^# /p' "$packages/log"
}

# Without debug information and folder names, so that ccache helps in every checkout. debhelper sets another HOME, so
# ccache must be told its folder.
build() {
  git ls-files -z | xargs -0 cp --parents -t "$packages/source" || return
  (cd "$packages/source" && PATH=/usr/lib/ccache:$PATH CCACHE_SLOPPINESS=pch_defines,time_macros,locale \
    CCACHE_DIR=$(ccache --get-config cache_dir 2>/dev/null) \
    DEB_CXXFLAGS_STRIP=-g DEB_CFLAGS_STRIP=-g \
    DEB_BUILD_OPTIONS="noautodbgsym reproducible=-fixfilepath,-fixdebugpath" dpkg-buildpackage -b -uc -us)
}
if [[ ${1:-} != --built ]]; then
  rm -rf "$packages"
  mkdir -p "$packages/source"
  step "dpkg-buildpackage" build
fi
step "lintian" lintian --allow-root --fail-on error,warning "$packages"/*.changes

root=$LF_ROOT
inside() { chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin LC_ALL=C.UTF-8 DEBIAN_FRONTEND=noninteractive "$@"; }
install_packages() { # APT OPTION or PATH in the chroot...
  inside apt-get -q -y install "$@" || return
  local unwanted
  # shellcheck disable=SC2016  # dpkg-query expands the field
  unwanted=$(inside dpkg-query -W -f '${Package}\n' | grep -Ex "$forbidden") || return 0
  echo "installed: $unwanted"
  return 1
}
# Runs a test of debian/tests in a network of its own.
smoke() { # NAME
  install -D -t "$root/srv" "debian/tests/$1"
  # shellcheck disable=SC2016  # expanded by the inner shell
  unshare --net bash -c 'ip link set lo up && chroot "$1" env -i PATH=/usr/bin:/bin HOME=/root "/srv/$2"' - "$root" "$1"
}

# The time from the first command to a picture in a browser, including downloads. In a network of its own, too.
demo() {
  local browser=(tests/web/browser.sh "$PWD/build" tests/web/demo.mjs)
  LF_TESTS=none "${browser[@]}" | tee "$LF_ROOT/driver" || return  # installs the browser's driver
  ! grep -q SKIP "$LF_ROOT/driver" || return
  local since=$EPOCHSECONDS
  inside apt-get -q -y install "$@" || return
  echo "# installed after $((EPOCHSECONDS - since)) s"
  # shellcheck disable=SC2016  # expanded by the inner shell
  LF_SINCE=$since unshare --net bash -c 'ip link set lo up
    chroot "$1" env -i PATH=/usr/bin:/bin HOME=/root lf-serve --demo &
    "${@:2}"
    status=$?
    kill $!
    exit $status' - "$root" "${browser[@]}"
}

step "Debian 12" mmdebstrap --quiet --variant=apt --skip=cleanup/apt/lists bookworm "$root/bare"
cp -a "$root/bare" "$root/full"
for root in "$LF_ROOT/bare" "$LF_ROOT/full"; do
  mkdir -p "$root/packages"
  cp "$packages"/*.deb "$root/packages/"
  mount -t proc proc "$root/proc"
  mount --bind /dev "$root/dev"
done
paths_of() { for name; do ls "$root/packages/${name}_"*; done | sed "s|^$root||"; }  # in the chroot
root=$LF_ROOT/bare
mapfile -t paths < <(paths_of gstreamer1.0-lightfield lightfield-serve)
step "apt install and lf-serve --demo" demo "${paths[@]}"
root=$LF_ROOT/full
mkdir -p "$cache"
mount --bind "$cache" "$root/var/cache/apt/archives"
forbidden='(g\+\+|gcc|cpp|clang|tcc)(-[0-9.]+)?|libopencv.*'
mapfile -t paths < <(paths_of gstreamer1.0-lightfield lightfield-camera-node)
step "apt-get install lightfield-camera-node" install_packages "${paths[@]}"
step "lfnodesink" smoke camera-node
mapfile -t paths < <(paths_of lightfield-serve)
step "apt-get install lightfield-serve" install_packages curl "${paths[@]}"
step "lf-serve" smoke serve
forbidden=${forbidden%|*}  # calibration needs OpenCV
mapfile -t paths < <(paths_of python3-lightfield liblightfield0 liblightfield-calibration0)
step "apt-get install python3-lightfield" install_packages "${paths[@]}"
step "python3" smoke python
step "apt-get install the remaining packages (simulated)" inside sh -c "apt-get -s install /packages/*.deb"
