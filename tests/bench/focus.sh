#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Measures the cost of a focal surface in a whole pipeline: CPU time of all elements per picture, with 64 Motion JPEG
# cameras that show the built-in scene.
#   tests/bench/focus.sh [ROUNDS]        alternates with a plane; the view moves, every request has depth hypotheses
#   tests/bench/focus.sh quilt [ROUNDS]  a quilt of 8 x 6 views of 420x560, compared with 48 single views
set -euo pipefail
export LC_ALL=C.UTF-8  # numbers with a decimal point
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
build=${LF_BUILD:-$root/build}
measured=surface
if [[ ${1:-} == quilt ]]; then
  measured=quilt
  shift
fi
rounds=${1:-5}
ninja -C "$build" gst/libgstlightfield.so tools/lf-scene tools/lf-path >&2
export GST_PLUGIN_PATH=$build/gst${GST_PLUGIN_PATH:+:$GST_PLUGIN_PATH}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$build/tools/lf-scene" --out "$work" --grid 8x8 --width 320 --height 240 --frames 30 --framerate 15 >/dev/null
rig=$work/rig.json
median() { printf '%s\n' "$@" | sort -g | sed -n "$((($# + 1) / 2))p"; }

surface() {
  local few=50 many=400 n i codec planes surfaces ratios
  for n in "$few" "$many"; do
    "$build/tools/lf-path" --rig "$rig" --out "$work/$n.json" --frames "$n" --framerate 15 --near 1.2 --far 4.5 >/dev/null
  done

  # Prints CPU seconds for N pictures.
  seconds() { # N NODE COMPOSITOR
    local TIMEFORMAT='%U %S' node=($2) compositor=($3)
    { time gst-launch-1.0 -q lfviewrequest "location=$work/$1.json" "rig=$rig" framerate=15/1 is-live=false ! tee name=r \
      r. ! queue ! n.request \
      lfcameranode name=n "rig=$rig" framerate=15/1 is-live=false loop=true "${node[@]}" ! queue ! c.sink_0 \
      r. ! queue ! c.request \
      lfcompositor name=c "rig=$rig" "${compositor[@]}" ! fakesink sync=false >/dev/null; } 2>&1 | awk '{print $1 + $2}'
  }
  # Prints milliseconds per picture, without startup and shutdown.
  picture() { awk -v a="$(seconds $few "$@")" -v b="$(seconds $many "$@")" -v n=$((many - few)) 'BEGIN {print 1e3 * (b - a) / n}'; }

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
}

quilt() {
  local sets=12 n i quilts views ratios
  # The views of a set have one time and the viewpoints of a quilt, within a centimetre.
  for n in 1 $((sets + 1)); do
    awk -v sets="$n" 'BEGIN {
      print "{\"format\": \"lightfield-views\", \"version\": 1, \"views\": ["
      for (i = 0; i < sets * 48; i++)
        printf "{\"name\": \"v%04d\", \"time\": %.6f, \"position\": [%.6f, 0, 0], \"orientation\": [1, 0, 0, 0], \"width\": 420, " \
          "\"height\": 560, \"fov_y\": 40, \"focus_distance\": 2.6}%s\n", i, int(i / 48) / 15, (i % 48 / 47 - 0.5) * 0.3,
          i < sets * 48 - 1 ? "," : ""
      print "]}" }' >"$work/$n.json"
  done

  # Prints CPU seconds for N sets.
  seconds() { # N quilt|views
    local TIMEFORMAT='%U %S' what=("location=$work/$1.json")
    [[ $2 == views ]] || what=("num-buffers=$1" views=quilt columns=8 rows=6 view-cone=7 width=420 height=560)
    { time gst-launch-1.0 -q lfviewsrc "rig=$rig" is-live=false "${what[@]}" ! fakesink >/dev/null; } 2>&1 |
      awk '{print $1 + $2}'
  }
  # Prints milliseconds per set, without startup and shutdown.
  set_of() { awk -v a="$(seconds 1 "$1")" -v b="$(seconds $((sets + 1)) "$1")" -v n=$sets 'BEGIN {print 1e3 * (b - a) / n}'; }

  quilts=() views=() ratios=()
  for ((i = 0; i < rounds; i++)); do
    quilts+=("$(set_of quilt)")
    views+=("$(set_of views)")
    ratios+=("$(awk -v a="${quilts[-1]}" -v b="${views[-1]}" 'BEGIN {print b / a}')")
  done
  printf 'a quilt %.0f ms, a view of it %.2f; 48 views one by one %.0f ms: %.2f times\n' "$(median "${quilts[@]}")" \
    "$(median "${quilts[@]}" | awk '{print $1 / 48}')" "$(median "${views[@]}")" "$(median "${ratios[@]}")"
}

"$measured"
