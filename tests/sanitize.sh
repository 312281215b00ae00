#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Builds with sanitizers, in a folder of its own, and runs the tests under them. Slow: not part of tests/run.sh.
#   tests/sanitize.sh address   AddressSanitizer, LeakSanitizer and UndefinedBehaviorSanitizer: all quick suites
#   tests/sanitize.sh thread    ThreadSanitizer: elements and pipelines, with GLib and GStreamer built for it, too
# Further arguments go to meson test, like names of tests. ThreadSanitizer's reports lie in build-thread/reports.PROCESS.
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
tools/setup.sh --tests lib/liblightfield.a # for the packages
[[ -f $build/build.ninja ]] ||
  meson setup "$build" -Db_sanitize="$sanitizers" -Db_lundef=false -Doptimization=1 -Ddebug=true >/dev/null
ninja -C "$build" --quiet gst/libgstlightfield.so tests/check-sanitizer
rm -f "$build"/reports.*

export LSAN_OPTIONS="suppressions=$PWD/tests/sanitize/lsan.supp:print_suppressions=0"
# Tests that memory does not grow are not to count what was freed, which the sanitizer keeps to know it again.
export ASAN_OPTIONS=quarantine_size_mb=32:thread_local_quarantine_size_kb=64
export UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1
# Locks of elements, streams and pads come in any order in GStreamer itself: hence no detect_deadlocks. Where a library's
# thread-local memory is 16 bytes behind a page's start, ThreadSanitizer of GCC 12 takes what lies before it for a header
# of glibc 2.19, and ends the program for want of the memory it reads there: hence no intercept_tls_get_addr.
export TSAN_OPTIONS="suppressions=$PWD/tests/sanitize/tsan.supp:history_size=7:detect_deadlocks=0"
TSAN_OPTIONS+=:intercept_tls_get_addr=0
export GST_REGISTRY_FORK=no # the scanner is no program of ours and can't load a sanitized plugin
if [[ $sanitizers == thread ]]; then
  libraries=$build/libraries
  tests/sanitize/libraries.sh "$libraries"
  # In place of the installed ones, and for programs of ours alone: others lack what these need. Where
  # addresses are random, ThreadSanitizer of GCC 12 now and then can't place its own memory.
  plugins=$libraries/plugins:$(pkg-config --variable=pluginsdir gstreamer-1.0)
  with=(setarch -R env "PATH=$libraries/bin:$PATH" "LD_LIBRARY_PATH=$libraries/lib" "GST_PLUGIN_SYSTEM_PATH=$plugins"
    G_SLICE=always-malloc)
  # What other plugins do when they are looked at is theirs alone.
  "${with[@]}" GST_PLUGIN_PATH="$build/gst" GST_REGISTRY="$build/gst/test-registry.bin" TSAN_OPTIONS=report_bugs=0 \
    "$libraries/bin/gst-inspect-1.0" lfviewsrc >/dev/null
  "${with[@]}" tests/sanitize/check.sh "$build/tests/check-sanitizer"
  TSAN_OPTIONS+=":log_path=$build/reports"
  what=(--suite threads --wrapper "${with[*]}") log=testlog-setarch # named after the wrapper
else
  # GStreamer's own programs get the sanitizer from outside. Leaks there are the leaks tracer's to find.
  runtime=$(g++ -print-file-name=libasan.so):$(g++ -print-file-name=libstdc++.so)
  mkdir -p "$build/launchers"
  for program in gst-launch-1.0 gst-play-1.0; do
    printf '#!/bin/sh\nLD_PRELOAD=%s ASAN_OPTIONS=%s:detect_leaks=0 exec %s "$@"\n' "$runtime" "$ASAN_OPTIONS" \
      "$(command -v $program)" >"$build/launchers/$program"
    chmod +x "$build/launchers/$program"
  done
  PATH=$build/launchers:$PATH
  # Documents are looked at by programs that can't load a sanitized plugin, as examples are.
  what=(--no-suite slow --no-suite documents) log=testlog
fi
status=0
meson test -C "$build" --timeout-multiplier 10 --print-errorlogs "${what[@]}" "$@" || status=$?
# Which reports there are, and how many of each.
find "$build" -maxdepth 1 -name 'reports.*' -exec cat {} + | sed -n 's/^SUMMARY: //p' | sort | uniq -c | sort -rn
python3 tests/summary.py "$build/meson-logs/$log" || status=1
exit "$status"
