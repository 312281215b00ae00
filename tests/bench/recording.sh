#!/bin/bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# What a recording costs and holds: 64 cameras of 320x240 in JPEG at 30 frames a second while two viewers fly, what is
# left after a kill, seeks, and 256 cameras. See recording.py. tests/bench/recording.sh [--seconds N]
set -eu
root=$(cd "$(dirname "$0")/../.." && pwd)
build=${LF_BUILD:-$root/build}
ninja -C "$build" gst/libgstlightfield.so tools/lf-scene tools/lf-archive >&2
export GST_PLUGIN_PATH=$build/gst${GST_PLUGIN_PATH:+:$GST_PLUGIN_PATH} PATH=$build/tools:$PATH
exec /usr/bin/python3 "$root/tests/bench/recording.py" "$@"
