#!/bin/bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Whole pipelines with 64 cameras: pictures per second, a live view of JPEG cameras, latency, what GStreamer adds. See pipeline_bench.cc.
# tests/bench/pipeline.sh [--seconds N] [--json FILE] [throughput] [live] [latency] [overhead]
set -eu
root=$(cd "$(dirname "$0")/../.." && pwd)
build=${LF_BUILD:-$root/build}
ninja -C "$build" gst/libgstlightfield.so tests/bench-pipeline >&2
exec "$build/tests/bench-pipeline" "$@"
