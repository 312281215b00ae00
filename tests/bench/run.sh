#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Builds and runs a benchmark of the whole system.
#   tests/bench/run.sh pipeline [--seconds N] [--json FILE] [throughput] [live] [latency] [overhead]
#     64 cameras in one process: pictures per second, a live view of JPEG cameras, latency, GStreamer's overhead
#     (pipeline_bench.cc).
#   tests/bench/run.sh wire [--views N] [--plots DIR] [--json FILE]
#     Bytes into the compositor, by number of cameras and in a tree (wire_bench.cc).
#   tests/bench/run.sh roundtrip [--views N] [--plots DIR] [--json FILE]
#     Breakdown of the round trip of a view (roundtrip_bench.cc); needs root, for network namespaces.
#   tests/bench/run.sh recording [--seconds N]
#     Cost and completeness of a recording: 64 JPEG cameras of 320x240 at 30 frames/s with two moving viewers, contents
#     after a kill, seeks, and 256 cameras (recording.py).
set -eu
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
build=${LF_BUILD:-$root/build}
which=${1:-}
shift || true
case $which in
  pipeline) needed=(tests/bench-pipeline) ;;
  wire | roundtrip) needed=(tests/bench-"$which" tools/lf-scene) ;;
  recording) needed=(tools/lf-scene tools/lf-archive) ;;
  *)
    sed -n '3,14s/^# \?//p' "${BASH_SOURCE[0]}" >&2
    exit 2
    ;;
esac
ninja -C "$build" gst/libgstlightfield.so "${needed[@]}" >&2
if [[ $which == pipeline ]]; then exec "$build/tests/bench-pipeline" "$@"; fi
export GST_PLUGIN_PATH=$build/gst${GST_PLUGIN_PATH:+:$GST_PLUGIN_PATH}
if [[ $which == recording ]]; then
  export PATH=$build/tools:$PATH
  exec /usr/bin/python3 "$root/tests/bench/recording.py" "$@"
fi
exec "$build/tests/bench-$which" "$@"
