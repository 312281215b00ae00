#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Builds with sanitizers and runs the tests under them. Slow: not part of tests/run.sh.
#   tests/sanitize.sh address   AddressSanitizer, LeakSanitizer and UndefinedBehaviorSanitizer: all quick suites
#   tests/sanitize.sh thread    ThreadSanitizer: where our own threads meet (GLib's locks are invisible to it)
# Further arguments go to meson test.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

case "${1:-}" in
  address) sanitizers=address,undefined tests=() ;;
  thread) sanitizers=thread tests=(camera-frames camera-inputs jpeg worker-pool) ;;
  *)
    sed -n '3,6s/^# //p' "$0"
    exit 2
    ;;
esac
build=build-$1
shift
tools/setup.sh lib/liblightfield.a  # for the packages
[[ -f $build/build.ninja ]] ||
  meson setup "$build" -Db_sanitize="$sanitizers" -Db_lundef=false -Doptimization=1 -Ddebug=true >/dev/null
ninja -C "$build" --quiet "${tests[@]/#/tests/test-}"

export LSAN_OPTIONS="suppressions=$PWD/tests/lsan.supp:print_suppressions=0"
export UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1 TSAN_OPTIONS=halt_on_error=1
export GST_REGISTRY_FORK=no  # the scanner is no program of ours and can't load a sanitized plugin
# Nor is gst-launch-1.0: it gets the sanitizer from outside. Leaks there are the leaks tracer's to find.
runtime=$(g++ -print-file-name=libasan.so):$(g++ -print-file-name=libstdc++.so)
[[ $sanitizers == thread ]] || export LF_LAUNCH_ENV="LD_PRELOAD=$runtime ASAN_OPTIONS=detect_leaks=0"
meson test -C "$build" --no-rebuild --no-suite slow --timeout-multiplier 10 --print-errorlogs "${tests[@]}" "$@"
