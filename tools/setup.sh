#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Installs the Debian 12 packages that gst-lightfield needs, then configures and builds the project in build/. The
# script asks nothing, and prints nothing if everything is up to date.
#
# --quickstart  Only the packages and programs that pipelines/quickstart.sh needs for the built-in scene.
# --tests       Also the packages that the tests need: a browser, tshark, Janus, coturn, nginx, calibration images,
#               faketime, locales and MkDocs.
# TARGET        A target of ninja; only the given targets are built.
set -euo pipefail

what=
if [[ "${1:-}" =~ ^--(quickstart|tests)$ ]]; then
  what=${BASH_REMATCH[1]}
  shift
fi
if [[ "${1:-}" == -* ]]; then
  echo "usage: tools/setup.sh [--quickstart | --tests] [TARGET...]"
  [[ "$1" == --help || "$1" == -h ]]
  exit
fi
cd "$(dirname "${BASH_SOURCE[0]}")/.."

packages=(
  g++ meson ninja-build pkg-config
  libgstreamer1.0-dev libgstreamer-plugins-base1.0-dev gstreamer1.0-tools
  gstreamer1.0-plugins-base gstreamer1.0-plugins-good  # videoconvert, PNG, JPEG, Matroska
  libcli11-dev libglm-dev libhwy-dev libjpeg62-turbo-dev libopencv-core-dev libopencv-imgproc-dev libpng-dev
  libtiff-dev libwebp-dev nlohmann-json3-dev zlib1g-dev
  libegl-dev libgles-dev
  python3
)
if [[ $what != quickstart ]]; then
  packages+=(
    iproute2 libgstreamer-plugins-bad1.0-dev libsoup-3.0-dev libssl-dev libyaml-cpp-dev
    gstreamer1.0-plugins-bad                           # parsers, WebRTC
    gstreamer1.0-nice gstreamer1.0-plugins-ugly        # WebRTC's network, H.264
    gstreamer1.0-x                                     # windows
    libceres-dev libopencv-dev
    libegl1 libgl1-mesa-dri                            # OpenGL ES and a software driver
    libbenchmark-dev libgmock-dev libgtest-dev
    libgstrtspserver-1.0-dev                           # network cameras of the tests
    python3-gi gir1.2-gst-plugins-base-1.0 python3-opencv  # the examples in Python
    pybind11-dev python3-dev python3-numpy                # the Python modules
  )
fi
if [[ $what == tests ]]; then
  packages+=(gstreamer1.0-gl tshark janus coturn opencv-doc iptables python3-gst-1.0 faketime locales mkdocs
    haproxy prometheus curl systemd abigail-tools appstream desktop-file-utils gstreamer1.0-rtsp
    gir1.2-gst-rtsp-server-1.0 avahi-daemon)
  # These programs are often installed from other sources.
  command -v chromium chromium-browser google-chrome >/dev/null || packages+=(chromium)
  command -v node >/dev/null || packages+=(nodejs)
  command -v npm >/dev/null || packages+=(npm)
  command -v nginx /usr/sbin/nginx >/dev/null || packages+=(nginx-light)
fi

missing_packages() {
  comm -23 <(printf '%s\n' "${packages[@]}" | sort) \
    <(dpkg-query -W -f '${db:Status-Status} ${Package}\n' "${packages[@]}" 2>/dev/null | sed -n 's/^installed //p' | sort)
}

# Reads lines "percent N ..." and prints the progress of a job every ten seconds.
say_progress() { # what
  local begun=$SECONDS last=$SECONDS line percent
  while IFS= read -r line; do
    [[ $line =~ ^percent\ ([0-9]+) ]] || continue
    percent=${BASH_REMATCH[1]}
    ((percent > 0 && SECONDS - last >= 10)) || continue
    last=$SECONDS
    echo "$1: $percent %, about $(((SECONDS - begun) * (100 - percent) / percent)) s left"
  done
}

install_packages() {
  local missing as_root=()
  mapfile -t missing < <(missing_packages)
  ((${#missing[@]})) || return 0
  if ((EUID != 0)); then
    if ! command -v sudo >/dev/null || ! sudo -n true 2>/dev/null && [[ ! -t 0 ]]; then
      echo "tools/setup.sh: root or sudo is required to install: ${missing[*]}" >&2
      exit 1
    fi
    as_root=(sudo)
  fi
  echo "installing ${missing[*]}"
  local log
  log=$(mktemp)
  # apt-get prints "dlstatus:N:PERCENT:..." during downloads, then "pmstatus:PACKAGE:PERCENT:..." during installation.
  if ! { "${as_root[@]}" apt-get -qq update &&
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qq -y --no-install-recommends -o APT::Status-Fd=1 \
      install "${missing[@]}"; } 2>&1 </dev/null | tee "$log" |
    sed -un 's/^dlstatus:[^:]*:\([0-9]*\).*/\1 0/p; s/^pmstatus:[^:]*:\([0-9]*\).*/100 \1/p' |
    while read -r loaded set_up; do echo "percent $(((loaded + 3 * set_up) / 4))"; done | say_progress installing; then
    cat "$log" >&2
    rm "$log"
    echo "tools/setup.sh: packages could not be installed" >&2
    exit 1
  fi
  rm "$log"
  # Debian starts these servers after installation, but the tests start their own instances.
  local package
  for package in "${missing[@]}"; do
    [[ $package =~ ^(janus|coturn|nginx|haproxy|prometheus|avahi-daemon)(-light)?$ && -d /run/systemd/system ]] || continue
    "${as_root[@]}" systemctl --quiet disable --now "${BASH_REMATCH[1]}"
  done
}

# Enables all features, or for the quickstart those with installed packages. Keeps all other options of build/.
configure() {
  local options=(-Dauto_features=enabled)
  if [[ $what == quickstart ]]; then
    [[ ! -f build/build.ninja ]] || return 0
    options=()
  elif [[ -f build/build.ninja ]]; then
    ! grep -qx 'auto_features = enabled' build/meson-private/cmd_line.txt || return 0
    meson configure --clearcache build >/dev/null  # forget that packages were missing
    options+=(--reconfigure)
  fi
  echo "configuring build/"
  local log
  log=$(mktemp)
  meson setup "${options[@]}" build >"$log" 2>&1 || { cat "$log" >&2; rm "$log"; exit 1; }
  rm "$log"
}

build() {
  # A dry run finds out if there is work. It first regenerates build files that have changed.
  if ninja -C build -n "$@" | grep -q 'no work to do'; then return; fi
  if [[ -t 1 ]]; then
    ninja -C build "$@"
    return
  fi
  echo "building"
  local log
  log=$(mktemp)
  if ! NINJA_STATUS='percent %p ' ninja -C build "$@" | tee "$log" | sed -un 's/^percent  */percent /p' |
    say_progress building; then
    grep -v '^percent' "$log" >&2
    rm "$log"
    exit 1
  fi
  rm "$log"
}

if command -v dpkg-query >/dev/null; then
  install_packages
else
  echo "tools/setup.sh: not a Debian system; using the installed packages" >&2
fi
configure
if [[ $what == quickstart ]]; then set -- quickstart "$@"; fi
build "$@"
