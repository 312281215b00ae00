#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# What a quilt of 8 x 6 views of 420x560 from 64 Motion JPEG cameras costs through a focal surface, beside as many views one
# after the other: processor time, all elements together, in turn.
# tests/bench/quilt.sh [ROUNDS]
set -euo pipefail
export LC_ALL=C.UTF-8  # numbers with a decimal point
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
build=${LF_BUILD:-$root/build}
rounds=${1:-5}
sets=12
ninja -C "$build" gst/libgstlightfield.so tools/lf-scene >&2
export GST_PLUGIN_PATH=$build/gst${GST_PLUGIN_PATH:+:$GST_PLUGIN_PATH}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$build/tools/lf-scene" --out "$work" --grid 8x8 --width 320 --height 240 --frames 30 --framerate 15 >/dev/null
# The eyes of a set have one time, and stand where those of a quilt do, within a centimetre.
for n in 1 $((sets + 1)); do
  awk -v sets="$n" 'BEGIN {
    print "{\"format\": \"lightfield-views\", \"version\": 1, \"views\": ["
    for (i = 0; i < sets * 48; i++)
      printf "{\"name\": \"v%04d\", \"time\": %.6f, \"position\": [%.6f, 0, 0], \"orientation\": [1, 0, 0, 0], \"width\": 420, " \
        "\"height\": 560, \"fov_y\": 40, \"focus_distance\": 2.6}%s\n", i, int(i / 48) / 15, (i % 48 / 47 - 0.5) * 0.3,
        i < sets * 48 - 1 ? "," : ""
    print "]}" }' >"$work/$n.json"
done

# Seconds of processor time for N sets.
seconds() { # N quilt|views
  local TIMEFORMAT='%U %S' what=("location=$work/$1.json")
  [[ $2 == views ]] || what=("num-buffers=$1" views=quilt columns=8 rows=6 view-cone=7 width=420 height=560)
  { time gst-launch-1.0 -q lfviewsrc "rig=$work/rig.json" is-live=false "${what[@]}" ! fakesink >/dev/null; } 2>&1 |
    awk '{print $1 + $2}'
}
# Milliseconds a set, without what starting and ending takes.
set_of() { awk -v a="$(seconds 1 "$1")" -v b="$(seconds $((sets + 1)) "$1")" -v n=$sets 'BEGIN {print 1e3 * (b - a) / n}'; }
median() { printf '%s\n' "$@" | sort -g | sed -n "$((($# + 1) / 2))p"; }

quilts=() views=() ratios=()
for ((i = 0; i < rounds; i++)); do
  quilts+=("$(set_of quilt)")
  views+=("$(set_of views)")
  ratios+=("$(awk -v a="${quilts[-1]}" -v b="${views[-1]}" 'BEGIN {print b / a}')")
done
printf 'a quilt %.0f ms, a view of it %.2f; 48 views one by one %.0f ms: %.2f times\n' "$(median "${quilts[@]}")" \
  "$(median "${quilts[@]}" | awk '{print $1 / 48}')" "$(median "${views[@]}")" "$(median "${ratios[@]}")"
