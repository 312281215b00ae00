#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Builds with sanitizers in a separate folder and runs the tests. Slow: not part of tests/run.sh.
#   tests/sanitize.sh address   AddressSanitizer, LeakSanitizer and UndefinedBehaviorSanitizer: all quick suites
#   tests/sanitize.sh thread    ThreadSanitizer: suite `threads`, with instrumented builds of GLib and GStreamer
# Passes further arguments, such as test names, to meson test. ThreadSanitizer writes build-thread/reports.PROCESS.
# The last line counts test cases.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

case "${1:-}" in
  address) sanitizers=address,undefined ;;
  thread) sanitizers=thread ;;
  *)
    sed -n '3,7s/^# //p' "$0"
    exit 2
    ;;
esac
build=$PWD/build-$1
shift
tools/setup.sh --tests lib/liblightfield.a # installs packages
[[ -f $build/build.ninja ]] ||
  meson setup "$build" -Db_sanitize="$sanitizers" -Db_lundef=false -Doptimization=1 -Ddebug=true >/dev/null
ninja -C "$build" --quiet gst/libgstlightfield.so tests/check-sanitizer
rm -f "$build"/reports.*

export LSAN_OPTIONS="suppressions=$PWD/tests/sanitize/lsan.supp:print_suppressions=0"
# A small quarantine: tests of memory growth would count the freed memory that the sanitizer keeps.
export ASAN_OPTIONS=quarantine_size_mb=32:thread_local_quarantine_size_kb=64
export UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1
# No detect_deadlocks: GStreamer itself locks elements, streams and pads in varying order. No intercept_tls_get_addr: if
# thread-local memory starts 16 bytes behind a page's start, GCC 12's ThreadSanitizer reads a header of glibc 2.19 in
# front of that page and crashes.
export TSAN_OPTIONS="suppressions=$PWD/tests/sanitize/tsan.supp:history_size=7:detect_deadlocks=0"
TSAN_OPTIONS+=:intercept_tls_get_addr=0
export GST_REGISTRY_FORK=no # the scanner cannot load a sanitized plugin
if [[ $sanitizers == thread ]]; then
  libraries=$build/libraries
  tests/sanitize/libraries.sh "$libraries"
  # Only for our programs, because others lack the sanitizer runtime. setarch -R disables random addresses, with which
  # GCC 12's ThreadSanitizer sometimes cannot map its own memory.
  plugins=$libraries/plugins:$(pkg-config --variable=pluginsdir gstreamer-1.0)
  with=(setarch -R env "PATH=$libraries/bin:$PATH" "LD_LIBRARY_PATH=$libraries/lib" "GST_PLUGIN_SYSTEM_PATH=$plugins"
    G_SLICE=always-malloc)
  # Ignores reports while GStreamer scans plugins: races in other plugins are not our bugs.
  "${with[@]}" GST_PLUGIN_PATH="$build/gst" GST_REGISTRY="$build/gst/test-registry.bin" TSAN_OPTIONS=report_bugs=0 \
    "$libraries/bin/gst-inspect-1.0" lfviewsrc >/dev/null
  "${with[@]}" tests/sanitize/check.sh "$build/tests/check-sanitizer"
  TSAN_OPTIONS+=":log_path=$build/reports"
  what=(--suite threads --wrapper "${with[*]}") log=testlog-setarch # named after the wrapper
else
  # GStreamer's own programs preload the sanitizer. GStreamer's leaks tracer detects their leaks instead.
  runtime=$(g++ -print-file-name=libasan.so):$(g++ -print-file-name=libstdc++.so)
  mkdir -p "$build/launchers"
  for program in gst-launch-1.0 gst-play-1.0; do
    printf '#!/bin/sh\nLD_PRELOAD=%s ASAN_OPTIONS=%s:detect_leaks=0 exec %s "$@"\n' "$runtime" "$ASAN_OPTIONS" \
      "$(command -v $program)" >"$build/launchers/$program"
    chmod +x "$build/launchers/$program"
  done
  PATH=$build/launchers:$PATH
  # Programs of the suite `documents` cannot load a sanitized plugin.
  what=(--no-suite slow --no-suite documents) log=testlog
fi
status=0
meson test -C "$build" --timeout-multiplier 10 --print-errorlogs "${what[@]}" "$@" || status=$?
find "$build" -maxdepth 1 -name 'reports.*' -exec cat {} + | sed -n 's/^SUMMARY: //p' | sort | uniq -c | sort -rn
python3 tests/summary.py "$build/meson-logs/$log" || status=1
exit "$status"
