#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# A viewer host: sends requests for its view to the compositor host and shows the pictures that come back.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

usage() {
  cat <<END
usage: pipelines/viewer.sh --rig RIG.json --compositor HOST:PORT --video PORT [OPTION...]

  --rig RIG.json          the whole array, the same file on every host
  --compositor HOST:PORT  where the requests go
  --video PORT            where the pictures come in
  --view ID               this viewer's number, each its own (default: 0)
  --path VIEWS.json       a camera path, over and over; without it the view stands in the middle of the array
  --size WxH              of the picture (default: that of the cameras)
  --framerate N/D         (default: 30/1)
  --capture-delay MS      how old a capture must be before it is asked for: what the cameras take (default: 100)
  --sink PIPELINE         what is done with the pictures (default: autovideosink sync=false)
  --link PIPELINE         elements between the payloader of requests and the network, such as 'srtpenc key=...'
  --set 'NAME=VALUE'      a property of lfviewrequest, such as yaw=20, quality=80; may be repeated
END
}

rig= compositor= video= view=0 path= size= framerate=30/1 delay=100 sink='autovideosink sync=false'
link=identity
settings=()
while (($#)); do
  [[ $1 != --help && $1 != -h ]] || { usage; exit; }
  (($# > 1)) || die "$1 needs a value (see --help)"
  case $1 in
    --rig) need_file "$@"; rig=$2 ;;
    --compositor) need_address "$@"; compositor=$2 ;;
    --video) need_port "$@"; video=$2 ;;
    --view) view=$2 ;;
    --path) need_file "$@"; path=$2 ;;
    --size) [[ $2 =~ ^[0-9]+x[0-9]+$ ]] || die "--size $2: must be WxH"; size=$2 ;;
    --framerate) framerate=$2 ;;
    --capture-delay) delay=$2 ;;
    --sink) sink=$2 ;;
    --link) link=$2 ;;
    --set) settings+=("$2") ;;
    *) die "unknown option $1 (see --help)" ;;
  esac
  shift 2
done
[[ -n $rig && -n $compositor && -n $video ]] || die "--rig, --compositor and --video are needed (see --help)"
[[ -z $path ]] || settings+=("location=$path" loop=true)
[[ -z $size ]] || settings+=("width=${size%x*}" "height=${size#*x}")

mapfile -t in < <(receive "$video" "$video_caps")
mapfile -t out < <(send "$compositor")
read -ra tail <<<"$sink"
read -ra link <<<"$link"
launch lfviewrequest "rig=$rig" "view-id=$view" is-live=true "framerate=$framerate" \
  "capture-delay=$((delay * 1000000))" navigation-from=pictures "${settings[@]}" ! rtplfpay ! "${link[@]}" ! "${out[@]}" \
  "${in[@]}" ! rtpjpegdepay ! jpegdec name=pictures ! videoconvert ! "${tail[@]}"
