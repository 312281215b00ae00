#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# A compositor host: passes its viewers' requests on to the camera hosts and sends each viewer the picture.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

usage() {
  cat <<END
usage: pipelines/compositor-node.sh --rig RIG.json --requests PORT --node HOST:PORT:PORT --view ID:HOST:PORT [OPTION...]

  --rig RIG.json         the whole array, the same file on every host
  --requests PORT        where the viewers' requests come in; GROUP:PORT for multicast
  --node HOST:OUT:IN     a camera host, its port for requests, and the port here for its answers; repeat for each
  --view ID:HOST:PORT    a viewer: its view id, and where its pictures go as Motion JPEG over RTP; repeat for each
  --latency MS           how long a request may take before its picture is made of what there is (default: 60)
  --quality Q            of the pictures, 1 to 100 (default: 90)
  --sink PIPELINE        what is done with the pictures of a view in place of sending them; VIEW in it is its id
  --link PIPELINE        elements between the payloader of requests and the network, such as 'srtpenc key=...'
  --set 'NAME=VALUE'     a property of lfcompositor, such as focus=plane, max-missed=10; may be repeated
END
}

rig= requests= latency=60 quality=90 sink= link=identity
nodes=() views=() settings=()
while (($#)); do
  [[ $1 != --help && $1 != -h ]] || { usage; exit; }
  (($# > 1)) || die "$1 needs a value (see --help)"
  case $1 in
    --rig) need_file "$@"; rig=$2 ;;
    --requests) need_port "$1" "${2##*:}"; requests=$2 ;;
    --node) need_address "$1" "${2%:*}"; need_port "$1" "${2##*:}"; nodes+=("$2") ;;
    --view) need_address "$1" "${2#*:}"; views+=("$2") ;;
    --latency) latency=$2 ;;
    --quality) quality=$2 ;;
    --sink) sink=$2 ;;
    --link) link=$2 ;;
    --set) settings+=("$2") ;;
    *) die "unknown option $1 (see --help)" ;;
  esac
  shift 2
done
[[ -n $rig && -n $requests ]] || die "--rig and --requests are needed (see --help)"
((${#nodes[@]} && ${#views[@]})) || die "at least one --node and one --view are needed (see --help)"

clients=$(IFS=,; echo "${nodes[*]%:*}")
read -ra link <<<"$link"
mapfile -t in < <(receive "$requests" "$request_caps")
pipeline=("${in[@]}" ! rtplfdepay ! lfviewrequest is-live=true "rig=$rig" ! tee name=r
  r. ! "${leaky_queue[@]}" ! rtplfpay ! "${link[@]}" ! multiudpsink "clients=$clients" sync=false async=false)
for i in "${!nodes[@]}"; do
  mapfile -t in < <(receive "${nodes[i]##*:}" "$answer_caps")
  pipeline+=("${in[@]}" ! rtplfdepay ! tee "name=a$i")
done
for view in "${views[@]}"; do
  id=${view%%:*}
  pipeline+=(r. ! "${leaky_queue[@]}" ! "c$id.request"
    lfcompositor "name=c$id" "view-id=$id" "rig=$rig" "latency=$((latency * 1000000))" post-messages=true
    "${settings[@]}" ! queue !)
  if [[ -n $sink ]]; then
    read -ra tail <<<"${sink//VIEW/$id}"
  else
    mapfile -t out < <(send "${view#*:}")
    tail=(videoconvert ! video/x-raw,format=I420 ! jpegenc "quality=$quality" ! rtpjpegpay ! "${out[@]}")
  fi
  pipeline+=("${tail[@]}")
  # A compositor that falls behind loses answers of its own alone; bursts of parts have room.
  for i in "${!nodes[@]}"; do
    pipeline+=("a$i." ! queue leaky=downstream max-size-buffers=4096 max-size-time=0 max-size-bytes=67108864 !
      "c$id.sink_$i")
  done
done
launch "${pipeline[@]}"
