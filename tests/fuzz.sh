#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Fuzzes all parsers of external data (libFuzzer with AddressSanitizer and UndefinedBehaviorSanitizer; needs clang).
# tests/run.sh replays only tests/fuzz/corpus with the same targets.
#   tests/fuzz.sh TARGET RUNS [OPTION...]   TARGET: answer control depacketizer frame framing http import json moments
#     offer packetizer parse request
#   tests/fuzz.sh --fast TARGET RUNS [...]  without sanitizers, 5 to 50 times as fast; the next run with sanitizers
#                                           starts with the inputs that this run keeps
#   tests/fuzz.sh TARGET keep               adds a few small inputs with the most coverage to tests/fuzz/corpus/TARGET
# Options are libFuzzer's. LF_IMPORTER=k tests/fuzz.sh import RUNS tests one importer only, for example k, Kalibr (the
# letters are in tests/fuzz/files_fuzz.cc).
# Starts with valid units. Keeps new inputs in build-fuzz/corpus/TARGET and failures in build-fuzz/found/.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

sanitizers=address,undefined kind=debugoptimized build=build-fuzz
if [[ ${1:-} == --fast ]]; then
  shift
  sanitizers=none kind=release build=build-fuzz-fast
fi
if [[ ! ${2:-} =~ ^([0-9]+|keep)$ || -z $(grep -l "LF_FUZZ_TARGET($1)" tests/fuzz/*_fuzz.cc) ]]; then
  sed -n '3,12s/^# //p' "$0"
  exit 2
fi
target=$1 runs=$2 data=build-fuzz
shift 2
command -v clang++ >/dev/null || { echo "tests/fuzz.sh: clang++ is not installed" >&2; exit 1; }
[[ -f $build/build.ninja ]] ||
  CXX=clang++ meson setup "$build" -Dfuzz=true -Dtests=disabled -Db_sanitize="$sanitizers" -Db_lundef=false \
    -Dbuildtype="$kind" >/dev/null
ninja -C "$build" --quiet "tests/fuzz/fuzz-$target" tests/fuzz/fuzz-seeds
mkdir -p "$data/corpus/$target" "$data/found"
rm -rf "$data/seeds"
"$build/tests/fuzz/fuzz-seeds" "$data/seeds"
kept=tests/fuzz/corpus/$target
mkdir -p "$kept"
if [[ $runs == keep ]]; then
  rm -rf "$data/kept"
  mkdir "$data/kept"
  # Keeps small inputs; libFuzzer writes the inputs with the most coverage first.
  "$build/tests/fuzz/fuzz-$target" -set_cover_merge=1 -use_counters=0 -use_cmp=0 -max_len=2048 \
    -artifact_prefix="$data/found/$target-" "$data/kept" "$kept" "$data/corpus/$target"
  while read -r name; do mv "$data/kept/$name" "$kept/"; done < <(find "$data/kept" -type f -printf '%T@ %f\n' |
    sort -n | head -n 40 | cut -d ' ' -f 2)
  exit
fi
# Targets that read files write a file for each input: use memory instead of a disk.
[[ -w /dev/shm ]] && export TMPDIR=/dev/shm
export UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1
export LSAN_OPTIONS="suppressions=$PWD/tests/sanitize/lsan.supp:print_suppressions=0" # GLib's own tables
exec "$build/tests/fuzz/fuzz-$target" -runs="$runs" -max_len=8192 -rss_limit_mb=2048 -timeout=10 -print_final_stats=1 \
  -artifact_prefix="$data/found/$target-" "$@" "$data/corpus/$target" "$data/seeds/$target" "$kept"
