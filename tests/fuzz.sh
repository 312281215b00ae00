#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Throws damaged input at all that reads bytes from outside (libFuzzer with AddressSanitizer and UndefinedBehaviorSanitizer;
# needs clang). tests/run.sh runs the same targets on tests/fuzz/corpus alone.
#   tests/fuzz.sh TARGET RUNS [OPTION...]   TARGET: answer control depacketizer frame framing import json moments offer
#     packetizer parse request
#   tests/fuzz.sh TARGET keep               puts a few small inputs that cover most into tests/fuzz/corpus/TARGET
# Options are libFuzzer's.
# Begins with real units. What it finds to be new is kept in build-fuzz/corpus/TARGET, what breaks in build-fuzz/found/.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

if [[ ! ${2:-} =~ ^([0-9]+|keep)$ || ! -f tests/fuzz/$1_fuzz.cc ]]; then
  sed -n '3,9s/^# //p' "$0"
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
kept=tests/fuzz/corpus/$target
mkdir -p "$kept"
if [[ $runs == keep ]]; then
  rm -rf "$build/kept"
  mkdir "$build/kept"
  # Those that cover most, of those that are small: they are written in this order.
  "$build/tests/fuzz/fuzz-$target" -set_cover_merge=1 -use_counters=0 -use_cmp=0 -max_len=2048 \
    -artifact_prefix="$build/found/$target-" "$build/kept" "$kept" "$build/corpus/$target"
  while read -r name; do mv "$build/kept/$name" "$kept/"; done < <(find "$build/kept" -type f -printf '%T@ %f\n' |
    sort -n | head -n 40 | cut -d ' ' -f 2)
  exit
fi
export UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1
export LSAN_OPTIONS="suppressions=$PWD/tests/sanitize/lsan.supp:print_suppressions=0" # GLib's own tables
exec "$build/tests/fuzz/fuzz-$target" -runs="$runs" -max_len=8192 -rss_limit_mb=2048 -timeout=10 -print_final_stats=1 \
  -artifact_prefix="$build/found/$target-" "$@" "$build/corpus/$target" "$build/seeds/$target" "$kept"
