#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# What a focal surface costs in a whole pipeline: processor time of a picture, all elements together, beside that of one plane's
# in turn. 64 Motion JPEG cameras film the built-in scene, the eye moves, every request has trials.
# tests/bench/focus.sh [ROUNDS]
set -euo pipefail
export LC_ALL=C.UTF-8  # numbers with a decimal point
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
build=${LF_BUILD:-$root/build}
rounds=${1:-5}
few=50
many=400
ninja -C "$build" gst/libgstlightfield.so tools/lf-scene tools/lf-path >&2
export GST_PLUGIN_PATH=$build/gst${GST_PLUGIN_PATH:+:$GST_PLUGIN_PATH}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$build/tools/lf-scene" --out "$work" --grid 8x8 --width 320 --height 240 --frames 30 --framerate 15 >/dev/null
rig=$work/rig.json
for n in "$few" "$many"; do
  "$build/tools/lf-path" --rig "$rig" --out "$work/$n.json" --frames "$n" --framerate 15 --near 1.2 --far 4.5 >/dev/null
done

# Seconds of processor time for N pictures.
seconds() { # N NODE COMPOSITOR
  local TIMEFORMAT='%U %S' node=($2) compositor=($3)
  { time gst-launch-1.0 -q lfviewrequest "location=$work/$1.json" "rig=$rig" framerate=15/1 is-live=false ! tee name=r \
    r. ! queue ! n.request \
    lfcameranode name=n "rig=$rig" framerate=15/1 is-live=false loop=true "${node[@]}" ! queue ! c.sink_0 \
    r. ! queue ! c.request \
    lfcompositor name=c "rig=$rig" "${compositor[@]}" ! fakesink sync=false >/dev/null; } 2>&1 | awk '{print $1 + $2}'
}
# Milliseconds a picture, without what starting and ending takes.
picture() { awk -v a="$(seconds $few "$@")" -v b="$(seconds $many "$@")" -v n=$((many - few)) 'BEGIN {print 1e3 * (b - a) / n}'; }
median() { printf '%s\n' "$@" | sort -g | sed -n "$((($# + 1) / 2))p"; }

printf '%-34s %10s %10s %8s\n' '' 'plane, ms' 'surface' 'ratio'
for codec in auto jpeg; do
  planes=() surfaces=() ratios=()
  for ((i = 0; i < rounds; i++)); do
    planes+=("$(picture "codec=$codec resampling=bilinear" focus=plane)")
    surfaces+=("$(picture "codec=$codec resampling=sharpened" focus=surface)")
    ratios+=("$(awk -v a="${planes[-1]}" -v b="${surfaces[-1]}" 'BEGIN {print b / a}')")
  done
  printf '%-34s %10.2f %10.2f %8.2f\n' "codec=$codec, sharpened" "$(median "${planes[@]}")" "$(median "${surfaces[@]}")" \
    "$(median "${ratios[@]}")"
done
