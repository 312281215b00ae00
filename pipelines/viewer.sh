#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# A viewer host: flies a view and shows its pictures, which a compositor host makes, or, from the answers of the camera
# hosts, this one.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

usage() {
  cat <<END
usage: pipelines/viewer.sh --rig RIG.json --compositor HOST:PORT --video PORT [OPTION...]
       pipelines/viewer.sh --rig RIG.json --node HOST:OUT:IN [--node ...] [OPTION...]

  --rig RIG.json          the whole array, the same file on every host
  --compositor HOST:PORT  where the requests go
  --video PORT            where the pictures come in; ADDRESS:PORT of this host
  --node HOST:OUT:IN      in place of both: a camera host, its port for requests, and the port here for its answers, or
                          ADDRESS:PORT here; repeat for each
  --key-file FILE         the secret that all hosts share: openssl rand -hex 32 >FILE, chmod 600 FILE
  --view ID               this viewer's number, each its own (default: 0)
  --path VIEWS.json       a camera path, over and over; without it the view stands in the middle of the array
  --size WxH              of the picture (default: that of the cameras)
  --framerate N/D         (default: 30/1)
  --capture-delay MS      how old a capture must be before it is asked for: what the cameras take (default: 100)
  --sink PIPELINE         what is done with the pictures (default: autovideosink sync=false)
  --set 'NAME=VALUE'      a property of lfviewrequest, such as yaw=20, quality=80; may be repeated
END
}

rig= compositor= video= view= path= size= framerate=30/1 delay=100 sink='autovideosink sync=false' key_file=
nodes=() settings=()
while (($#)); do
  [[ $1 != --help && $1 != -h ]] || { usage; exit; }
  (($# > 1)) || die "$1 needs a value (see --help)"
  case $1 in
    --rig) need_file "$@"; rig=$2 ;;
    --compositor) need_address "$@"; compositor=$2 ;;
    --video) need_port "$1" "${2##*:}"; video=$2 ;;
    --node) need_node "$@"; nodes+=("$2") ;;
    --key-file) need_file "$@"; key_file=$2 ;;
    --view) view=$2 ;;
    --path) need_file "$@"; path=$2 ;;
    --size) [[ $2 =~ ^[0-9]+x[0-9]+$ ]] || die "--size $2: must be WxH"; size=$2 ;;
    --framerate) framerate=$2 ;;
    --capture-delay) delay=$2 ;;
    --sink) sink=$2 ;;
    --set) settings+=("$2") ;;
    *) die "unknown option $1 (see --help)" ;;
  esac
  shift 2
done
[[ -n $rig ]] || die "--rig is needed (see --help)"
[[ -z $path ]] || settings+=("location=$path" loop=true)
[[ -z $size ]] || settings+=("width=${size%x*}" "height=${size#*x}")
properties=("rig=$rig" is-live=true "framerate=$framerate" "capture-delay=$((delay * 1000000))" "${settings[@]}")
read -ra tail <<<"$sink"

if ((${#nodes[@]})); then
  [[ -z $compositor$video$view ]] || die "--node stands for --compositor, --video and --view (see --help)"
  launch lfviewsrc "nodes=$(join "${nodes[@]}")" ${key_file:+"key-file=$key_file"} "${properties[@]}" ! \
    "${leaky_queue[@]}" ! videoconvert ! "${tail[@]}"
fi

[[ -n $compositor && -n $video ]] || die "--compositor and --video are needed, or --node (see --help)"
mapfile -t in < <(receive_pictures "$video" "${compositor%:*}")
mapfile -t out < <(send "$compositor")
launch lfviewrequest "view-id=${view:-0}" navigation-from=pictures "${properties[@]}" ! rtplfpay ! "${out[@]}" \
  "${in[@]}" ! rtpjpegdepay ! jpegdec name=pictures ! videoconvert ! "${tail[@]}"
