#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Builds the project, renders a camera path through a light field with gst-launch-1.0, and writes a report.
set -euo pipefail
export LC_ALL=C.UTF-8  # numbers with a decimal point

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
out=quickstart-out
rig=
frames=120
framerate=15
window=false
trust=false

usage() {
  cat <<END
usage: pipelines/quickstart.sh [--out DIR] [--rig RIG.json] [--trust-rig] [--frames N] [--window]

Moves a virtual camera through a light field on a smooth path with changing focus. Writes the film view.mkv, the
contact sheet sheet.png and the measurements report.json.

  --out DIR       folder for the output (default: quickstart-out)
  --rig RIG.json  rig file to use instead of the built-in scene, which has an 8x8 array. Live cameras are first recorded
                  to DIR/film, for the duration of the path
  --trust-rig     allow the rig file to use any GStreamer element. Such a file can write files and run programs, so use
                  this option only with rig files from people you trust
  --frames N      length of the path in frames (default: $frames)
  --window        open an interactive window at the end. Dragging orbits, dragging with shift pans, the wheel zooms, and
                  the wheel with ctrl focuses. Keys: arrows, w s a d q e, + -, [ ], r
END
}

while (($#)); do
  case $1 in
    --out | --rig | --frames)
      if (($# < 2)); then
        echo "quickstart.sh: $1 needs a value" >&2
        exit 1
      fi
      printf -v "${1#--}" %s "$2"
      shift 2
      ;;
    --window) window=true; shift ;;
    --trust-rig) trust=true; shift ;;
    --help | -h) usage; exit ;;
    *)
      echo "quickstart.sh: unknown option $1 (see --help)" >&2
      exit 1
      ;;
  esac
done
if [[ ! $frames =~ ^[1-9][0-9]{0,5}$ ]]; then
  echo "quickstart.sh: --frames $frames: must be a number from 1 to 999999" >&2
  exit 1
fi
if [[ -n $rig && ! -f $rig ]]; then
  echo "quickstart.sh: --rig $rig: no such file" >&2
  exit 1
fi
if $window && [[ -z ${DISPLAY:-}${WAYLAND_DISPLAY:-} ]]; then
  echo "quickstart.sh: --window requires a display, but neither DISPLAY nor WAYLAND_DISPLAY is set" >&2
  exit 1
fi

# Live cameras and windows need more GStreamer packages than the built-in scene.
if [[ -n $rig ]] || $window; then
  "$root/tools/setup.sh" quickstart
else
  "$root/tools/setup.sh" --quickstart
fi
export GST_PLUGIN_PATH=$root/build/gst${GST_PLUGIN_PATH:+:$GST_PLUGIN_PATH}
PATH=$root/build/tools:$PATH
mkdir -p "$out"
work=$(mktemp -d "$out/.quickstart.XXXXXX")
trap 'rm -rf "$work"' EXIT

# Succeeds if a source is not a file: another URI, or a launch description.
names_live_cameras() {
  python3 - "$1" <<'END'
import json, os, sys
folder = os.path.dirname(sys.argv[1])
sources = [camera.get('source', '') for camera in json.load(open(sys.argv[1]))['cameras']]
is_file = lambda source: source.startswith('file:') or '%' in source or os.path.exists(os.path.join(folder, source))
sys.exit(all(not source or is_file(source) for source in sources))
END
}

# Films are cached between runs; a changed scene gets a new film.
if [[ -z $rig ]]; then
  cache=${XDG_CACHE_HOME:+$XDG_CACHE_HOME/gst-lightfield}
  cache=${cache:-$root/.cache}
  version=$(cat "$root"/lib/scene/*.{cc,h} "$root"/tools/lf_scene.cc | sha256sum | cut -c1-12)
  film=$cache/scene-8x8-320x240-60-frames-$framerate-fps-$version
  rig=$film/rig.json
  if [[ ! -f $rig ]]; then
    echo "filming the built-in scene with 8x8 cameras (once, kept in $film)"
    lf-scene --out "$film" --grid 8x8 --width 320 --height 240 --frames 60 --framerate "$framerate"
  fi
  # Nearest and farthest depth of the scene, metres. The film is one period long, so that it loops.
  path=(--near 1.2 --far 4.5)
  report=(--scene)
else
  path=()
  report=()
  if names_live_cameras "$rig"; then
    echo "filming with the cameras of $rig, to $out/film"
    # The previous film stays until the new film is complete.
    gst-launch-1.0 -q lfviewsrc "rig=$rig" "trusted=$trust" "framerate=$framerate/1" width=64 height=48 focus=plane \
      "record=$work/film" "num-buffers=$((frames + framerate))" ! fakesink sync=false
    if [[ ! -s $work/film/rig.json ]] || ! compgen -G "$work/film/*.mkv" >/dev/null; then
      echo "quickstart.sh: the cameras of $rig delivered no film; $out/film is unchanged" >&2
      exit 1
    fi
    [[ ! -e $out/film ]] || mv -T "$out/film" "$work/film-before"
    mv -T "$work/film" "$out/film"
    rig=$out/film/rig.json
    trust=false  # a film needs no trust
  fi
fi
lf-path --rig "$rig" --out "$out/views.json" --frames "$frames" --framerate "$framerate" "${path[@]}"

# Prints a pipeline as a command to copy, with $out instead of the temporary $work, and runs it. Writes its messages
# about pictures to the file $1, with a clock in front of each line.
launch() {
  local log=$1
  shift
  local command="$*"
  printf '\ngst-launch-1.0 -m %s\n' "${command//"$work"/"$out"}"
  if ! gst-launch-1.0 -m "$@" 2>"$log.errors" | grep --line-buffered -F lightfield-view, |
    while IFS= read -r line; do printf '%s %s\n' "$EPOCHREALTIME" "$line"; done >"$log"; then
    cat "$log.errors" >&2
    echo "quickstart.sh: the pipeline failed" >&2
    exit 1
  fi
}

# lfviewsrc contains everything from the cameras to the pictures.
light_field() { # is-live, more properties
  pipeline=(lfviewsrc "rig=$rig" "trusted=$trust" "location=$out/views.json" "framerate=$framerate/1" "is-live=$1" post-messages=true
    "${@:2}")
}

light_field false
launch "$work/log" "${pipeline[@]}" ! tee name=o \
  o. ! queue ! videoconvert ! jpegenc quality=95 ! matroskamux ! filesink "location=$out/view.mkv" \
  o. ! queue ! videoconvert ! video/x-raw,format=RGB ! filesink "location=$work/frames.rgb"

# The same views focused on a plane, for comparison.
light_field false focus=plane
launch "$work/plane-log" "${pipeline[@]}" ! videoconvert ! video/x-raw,format=RGB ! \
  filesink "location=$work/plane.rgb"

# In live mode only one request is in flight, so that its latency has no queueing time.
light_field true
launch "$work/live-log" "${pipeline[@]}" ! fakesink sync=false

echo
lf-report --rig "$rig" --views "$out/views.json" --frames "$work/frames.rgb" --plane "$work/plane.rgb" --log "$work/log" \
  --live-log "$work/live-log" --out "$out" "${report[@]}"
echo "in $out: view.mkv, sheet.png, report.json, views.json"

if $window; then
  echo "opening a window; close it to quit"
  gst-launch-1.0 -q lfviewsrc "rig=$rig" "trusted=$trust" framerate=30/1 ! videoconvert ! autovideosink
fi
