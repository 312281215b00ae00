#!/bin/bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# The system on several hosts: bytes into the compositor over the number of cameras and through a tree (wire_bench.cc), and
# the round trip of a view taken apart (roundtrip_bench.cc; needs root, for network namespaces).
# tests/bench/network.sh [wire|roundtrip] [--views N] [--plots DIR] [--json FILE]
set -eu
root=$(cd "$(dirname "$0")/../.." && pwd)
build=${LF_BUILD:-$root/build}
which=("${1:-wire}")
if [[ ${1:-} == wire || ${1:-} == roundtrip ]]; then
  shift
else
  which=(wire roundtrip)
fi
ninja -C "$build" gst/libgstlightfield.so tools/lf-scene "${which[@]/#/tests/bench-}" >&2
export GST_PLUGIN_PATH=$build/gst${GST_PLUGIN_PATH:+:$GST_PLUGIN_PATH}
for bench in "${which[@]}"; do "$build/tests/bench-$bench" "$@"; done
