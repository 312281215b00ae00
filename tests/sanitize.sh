#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Builds with sanitizers and runs the tests under them. Slow: not part of tests/run.sh.
#   tests/sanitize.sh address   AddressSanitizer, LeakSanitizer and UndefinedBehaviorSanitizer: all quick suites
#   tests/sanitize.sh thread    ThreadSanitizer: where our own threads meet (GLib's locks are invisible to it)
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

case "${1:-}" in
  address) sanitizers=address,undefined tests=() ;;
  thread) sanitizers=thread tests=(camera-frames) ;;
  *)
    sed -n '3,5s/^# //p' "$0"
    exit 2
    ;;
esac
shift
tools/setup.sh lib/liblightfield.a  # for the packages
build=build-${sanitizers%%,*}
[[ -f $build/build.ninja ]] ||
  meson setup "$build" -Db_sanitize="$sanitizers" -Db_lundef=false -Doptimization=1 -Ddebug=true >/dev/null
if ((${#tests[@]})); then ninja -C "$build" --quiet "${tests[@]/#/tests/test-}"; else ninja -C "$build" --quiet; fi
# The libraries below us keep some memory until the end of the process; ours must not.
export LSAN_OPTIONS="suppressions=$PWD/tests/lsan.supp:print_suppressions=0" ASAN_OPTIONS=detect_stack_use_after_return=1
export UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1 TSAN_OPTIONS=halt_on_error=1
meson test -C "$build" --no-rebuild --no-suite slow --timeout-multiplier 10 --print-errorlogs "${tests[@]}" "$@"
