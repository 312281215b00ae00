#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Programs outside of this build: installs BUILD into a fresh prefix, builds examples/ against it with pkg-config alone, and
# runs them. Prints TAP.
# usage: tests/examples.sh BUILD
set -uo pipefail
build=${1:?the build folder}
source=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

number=0
report() { # STATUS NAME LOG
  number=$((number + 1))
  if (($1 == 0)); then
    echo "ok $number - $2"
  else
    sed 's/^/# /' "$3"
    echo "not ok $number - $2"
  fi
}
skip() {
  number=$((number + 1))
  echo "ok $number - $1 # SKIP $2"
}

if nm -D --undefined-only "$build/gst/libgstlightfield.so" | grep -q -e __asan_ -e __tsan_ -e __ubsan_; then
  echo "1..0 # SKIP a build with sanitizers is not for other programs"
  exit
fi
echo 1..10
DESTDIR=$work/root meson install -C "$build" --no-rebuild >"$work/log" 2>&1
report $? "meson install" "$work/log"

pc=$(find "$work/root" -name lightfield.pc)
plugin=$(find "$work/root" -name libgstlightfield.so)
export PKG_CONFIG_PATH=${pc%/*}
sed -i "s|^prefix=|prefix=$work/root|" "${pc%/*}"/*.pc  # what was installed is where it is, not where it is to go
bin=$(dirname "$(find "$work/root" -name lf-scene)")

# What is of others would otherwise hide what is missing in ours.
nm -D --defined-only "$plugin" | grep -v ' gst_plugin_lightfield_\(get_desc\|register\)$' >"$work/log"
if [[ -s $work/log ]]; then status=1; else status=0; fi
report $status "the plugin shows two symbols" "$work/log"
ldd "$plugin" 2>&1 | grep -i -e opencv -e ceres >"$work/log"
if [[ -s $work/log ]]; then status=1; else status=0; fi
report $status "the plugin loads no OpenCV" "$work/log"

compile() { # NAME SOURCE PACKAGE...
  local flags
  if ! flags=$(pkg-config --cflags --libs "${@:3}" 2>"$work/log"); then return 1; fi
  # shellcheck disable=SC2086  # flags are words
  ${CXX:-g++} -std=c++20 -O1 "$2" $flags -o "$work/$1" >"$work/log" 2>&1
}

"$bin/lf-scene" --out "$work/scene" --grid 3x3 --width 64 --height 48 --frames 8 --samples 1 >"$work/log" 2>&1
report $? "lf-scene makes a film" "$work/log"
rig=$work/scene/rig.json
export GST_PLUGIN_PATH=${plugin%/*} GST_REGISTRY=$work/registry.bin G_DEBUG=fatal-criticals

compile view "$source/examples/view.cc" gstreamer-app-1.0 && timeout 60 "$work/view" "$rig" 20 >"$work/log" 2>&1
report $? "examples/view.cc" "$work/log"
"$work/view" "$work/none.json" >"$work/log" 2>&1
if (($? == 1)) && grep -q 'none.json' "$work/log"; then status=0; else status=1; fi
report $status "examples/view.cc says what is wrong" "$work/log"
compile own_frames "$source/examples/own_frames.cc" gstreamer-app-1.0 && timeout 60 "$work/own_frames" >"$work/log" 2>&1
report $? "examples/own_frames.cc" "$work/log"
compile own_transport "$source/examples/own_transport.cc" lightfield && timeout 60 "$work/own_transport" >"$work/log" 2>&1
report $? "examples/own_transport.cc" "$work/log"
python=/usr/bin/python3
if "$python" -c 'import gi; gi.require_version("GstApp", "1.0"); from gi.repository import GstApp' 2>/dev/null; then
  timeout 60 "$python" "$source/examples/view.py" "$rig" 20 >"$work/log" 2>&1
  report $? "examples/view.py" "$work/log"
else
  skip "examples/view.py" "python3-gi and gir1.2-gst-plugins-base-1.0 are not installed"
fi
compile static_plugin "$source/tests/examples/static_plugin.cc" gstlightfield &&
  GST_PLUGIN_PATH='' GST_REGISTRY=$work/other.bin timeout 60 "$work/static_plugin" >"$work/log" 2>&1
report $? "the plugin as a static library" "$work/log"
