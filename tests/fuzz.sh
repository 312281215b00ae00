#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Throws damaged input at all that reads bytes off a network (libFuzzer with AddressSanitizer and
# UndefinedBehaviorSanitizer; needs clang). Not part of tests/run.sh.
#   tests/fuzz.sh TARGET RUNS [OPTION...]   TARGET: answer control depacketizer framing moments offer
#     packetizer request
# Options are libFuzzer's.
# Begins with real units. What it finds to be new is kept in build-fuzz/corpus/TARGET, what breaks in build-fuzz/found/.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

if [[ ! ${2:-} =~ ^[0-9]+$ || ! -f tests/fuzz/$1_fuzz.cc ]]; then
  sed -n '3,7s/^# //p' "$0"
  exit 2
fi
target=$1 runs=$2 build=build-fuzz
shift 2
command -v clang++ >/dev/null || { echo "tests/fuzz.sh: clang++ is not installed" >&2; exit 1; }
[[ -f $build/build.ninja ]] ||
  CXX=clang++ meson setup "$build" -Dfuzz=true -Dtests=false -Db_sanitize=address,undefined -Db_lundef=false \
    -Dbuildtype=debugoptimized >/dev/null
ninja -C "$build" --quiet "tests/fuzz/fuzz-$target" tests/fuzz/fuzz-seeds
mkdir -p "$build/corpus/$target" "$build/found"
rm -rf "$build/seeds"
"$build/tests/fuzz/fuzz-seeds" "$build/seeds"
export UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1
exec "$build/tests/fuzz/fuzz-$target" -runs="$runs" -max_len=8192 -rss_limit_mb=2048 -timeout=10 -print_final_stats=1 \
  -artifact_prefix="$build/found/$target-" "$@" "$build/corpus/$target" "$build/seeds/$target"
