#!/bin/bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Compares the bytes of all camera streams with the bytes of views (Yang et al. 2002, Figure 1), and finds the
# break-even: bytes per instant, built-in scene in 320x240.
#   tests/bench/bandwidth.sh [CAMERAS...]   square numbers, default 4 16 64 256
set -eu
root=$(cd "$(dirname "$0")/../.." && pwd)
build=${LF_BUILD:-$root/build}
[ $# -gt 0 ] || set -- 4 16 64 256
views=24
ninja -C "$build" gst/libgstlightfield.so tools/lf-scene tools/lf-path tools/lf-rig >&2
export GST_PLUGIN_PATH=$build/gst${GST_PLUGIN_PATH:+:$GST_PLUGIN_PATH}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

# answers NODES: prints the bytes of the answers to all views of the path; each word lists a node's cameras ("0-3").
answers() {
  local line="lfviewrequest location=views.json ! tee name=r funnel name=f ! filesink location=answers.bin" node=0 cameras
  for cameras in "$@"; do
    line+=" r. ! queue ! n$node.request lfcameranode name=n$node rig=rig.json cameras=$cameras node=$node codec=jpeg ! queue ! f."
    node=$((node + 1))
  done
  gst-launch-1.0 -q $line >&2
  stat -c %s answers.bin
}

"$build/tools/lf-scene" --out one --grid 3x3 --frames 1 >/dev/null 2>&1
"$build/tools/lf-rig" subset one/rig.json --cameras 4 --out middle.json >/dev/null
"$build/tools/lf-scene" --rig middle.json --out middle --frames 60 >/dev/null 2>&1
gst-launch-1.0 -q filesrc location="$(ls middle/*.mkv)" ! matroskademux ! jpegdec ! videoconvert ! \
  x264enc pass=qual quantizer=23 ! h264parse ! filesink location=middle.264 >&2
h264=$(($(stat -c %s middle.264) / 60))

results=()
for count in "$@"; do
  side=$(python3 -c "print(round($count ** 0.5))")
  rm -f ./*.mkv ./*.png
  "$build/tools/lf-scene" --out . --grid "${side}x$side" --frames 4 >/dev/null 2>&1
  "$build/tools/lf-path" --rig rig.json --out views.json --frames $views >/dev/null
  camera=$(($(cat ./*.mkv | wc -c) / (4 * count)))
  together=$(($(answers "0-$((count - 1))") / views))
  alone=$(($(answers $(seq 0 $((count - 1)))) / views))
  results+=("$count $camera $alone $together")
done

python3 - "$h264" "${results[@]}" <<'PYTHON'
import sys
h264 = int(sys.argv[1])
rows = [tuple(map(int, row.split())) for row in sys.argv[2:]]
print("| cameras | all, JPEG 90 | all, H.264 | a view, cameras alone | a view, one node "
      "| 1 view | 4 | 16 | 64 | cross at (JPEG) | (H.264) |")
print("|" + " --- |" * 11)
for count, camera, alone, together in rows:
    everything, coded = count * camera, count * h264
    shares = [f"{views * together / everything:.3g}" for views in (1, 4, 16, 64)]
    crossings = [f"{total / alone:.1f}-{total / together:.1f}" for total in (everything, coded)]
    print(f"| {count} | {everything:,} | {coded:,} | {alone:,} | {together:,} | " + " | ".join(shares + crossings) + " |")
PYTHON
