#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Measures the gain of a GPU for docs/performance.md: sums including the upload of images, with and without the
# download of sums or frames; depth hypotheses; and whole pipelines of 64 Motion JPEG cameras of 320x240.
# tests/bench/card.sh [PICTURES]
#
# Without a GPU everything runs on a software renderer, and the figures are meaningless.
set -euo pipefail
export LC_ALL=C.UTF-8  # numbers with a decimal point
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
build=${LF_BUILD:-$root/build}
pictures=${1:-300}
if command -v ninja >/dev/null; then
  ninja -C "$build" gst/libgstlightfield.so tools/lf-scene tests/bench-sum-renderer tests/bench-focus >&2
fi
export GST_PLUGIN_PATH=$build/gst${GST_PLUGIN_PATH:+:$GST_PLUGIN_PATH}
if [[ -z ${DISPLAY:-}${WAYLAND_DISPLAY:-} ]]; then
  export GST_GL_PLATFORM=${GST_GL_PLATFORM:-egl} GST_GL_WINDOW=${GST_GL_WINDOW:-egl-device}
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

"$build/tests/bench-sum-renderer" --benchmark_min_time=0.3 --benchmark_filter='UploadedS|Stayed' 2>"$work/log" ||
  cat "$work/log"
"$build/tests/bench-focus" --benchmark_min_time=0.3 --benchmark_filter=Hypotheses 2>"$work/log" || cat "$work/log"

"$build/tools/lf-scene" --out "$work" --grid 8x8 --width 320 --height 240 --frames 30 --framerate 15 >/dev/null

# Prints wall-clock seconds and CPU seconds for N pictures.
seconds() { # N what sink
  local TIMEFORMAT='%R %U %S'
  # shellcheck disable=SC2086
  { time gst-launch-1.0 -q lfviewsrc "rig=$work/rig.json" is-live=false "num-buffers=$1" $2 ! $3 >/dev/null; } 2>&1 |
    awk 'END {print $1, $2 + $3}'
}
# Prints milliseconds per picture, without startup and shutdown.
row() { # N what sink
  local few=$((10 + $1 / 10))
  awk -v n="$1" -v a="$(seconds "$few" "$2" "$3")" -v b="$(seconds $((few + $1)) "$2" "$3")" \
    'BEGIN {split(a, s); split(b, l); printf "%.2f, %.1f", 1e3 * (l[1] - s[1]) / n, 1e3 * (l[2] - s[2]) / n}'
}

echo
echo '| milliseconds a picture, of all processors | renderer=cpu | renderer=gl | renderer=gl, glupload |'
echo '| --- | --- | --- | --- |'
for size in 640x480 1920x1080 3840x2160; do
  what="width=${size%x*} height=${size#*x}"
  printf '| %s | %s | %s | %s |\n' "$size" "$(row "$pictures" "$what renderer=cpu" fakesink)" \
    "$(row "$pictures" "$what renderer=gl" fakesink)" "$(row "$pictures" "$what renderer=gl" 'glupload ! fakesink')"
done
sets=$((pictures / 20 + 1))
what='views=quilt columns=9 rows=5 view-cone=7 width=512 height=512'
printf '| quilt of 9x5 views of 512x512 | %s | %s | %s |\n' "$(row "$sets" "$what renderer=cpu" fakesink)" \
  "$(row "$sets" "$what renderer=gl" fakesink)" "$(row "$sets" "$what renderer=gl" 'glupload ! fakesink')"
