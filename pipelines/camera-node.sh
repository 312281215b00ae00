#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# A camera host: some cameras of a rig, which answer view requests that come over RTP.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

usage() {
  cat <<END
usage: pipelines/camera-node.sh --rig RIG.json --requests PORT --answers HOST:PORT [OPTION...]

  --rig RIG.json        the whole array, the same file on every host
  --requests PORT       where view requests come in; GROUP:PORT for multicast
  --answers HOST:PORT   the compositor host that sends them; repeat both for further compositor hosts, in the same order
  --cameras LIST        ids of this host's cameras, such as 0-15,20 (default: all)
  --node N              this host's number, each its own (default: 0)
  --framerate N/D       of cameras whose source has none (default: 30/1)
  --mtu BYTES           of a packet (default: 1400; jumbo frames: 8900)
  --bitrate BITS        paces the packets of an answer, bits per second (default: 1000000000; 0: all at once)
  --link PIPELINE       elements between payloader and network, such as 'srtpenc key=...'
  --set 'NAME=VALUE'    a property of lfcameranode, such as codec=raw16, loop=false; may be repeated
END
}

rig= cameras= node=0 framerate=30/1 mtu=1400 bitrate=1000000000 link=
requests=() answers=() settings=()
while (($#)); do
  [[ $1 != --help && $1 != -h ]] || { usage; exit; }
  (($# > 1)) || die "$1 needs a value (see --help)"
  case $1 in
    --rig) need_file "$@"; rig=$2 ;;
    --requests) need_port "$1" "${2##*:}"; requests+=("$2") ;;
    --answers) need_address "$@"; answers+=("$2") ;;
    --cameras) cameras=$2 ;;
    --node) node=$2 ;;
    --framerate) framerate=$2 ;;
    --mtu) mtu=$2 ;;
    --bitrate) bitrate=$2 ;;
    --link) link=$2 ;;
    --set) settings+=("$2") ;;
    *) die "unknown option $1 (see --help)" ;;
  esac
  shift 2
done
[[ -n $rig ]] || die "--rig is missing (see --help)"
((${#requests[@]} && ${#requests[@]} == ${#answers[@]})) || die "each --requests needs its --answers (see --help)"

properties=("rig=$rig" "node=$node" "framerate=$framerate")
[[ -z $cameras ]] || properties+=("cameras=$cameras")
if [[ -z $link ]]; then
  listen=$(IFS=,; echo "${requests[*]}") to=$(IFS=,; echo "${answers[*]}")
  launch lfnodesink "${properties[@]}" "listen=$listen" "answers=$to" "mtu=$mtu" "max-bitrate=$bitrate" "${settings[@]}"
fi

# With elements in between, what is inside lfnodesink, one by one.
pipeline=(lfcameranode name=n "${properties[@]}" is-live=true loop=true
  strip-pixels=5120 # 16 rows of 320: about a packet, so that a lost one loses no more
  "${settings[@]}")
read -ra link <<<"$link"
for i in "${!requests[@]}"; do
  pad=
  ((i == 0)) || pad=_$((i - 1))
  mapfile -t in < <(receive "${requests[i]}" "$request_caps")
  mapfile -t out < <(send "${answers[i]}")
  pipeline+=("${in[@]}" ! rtplfdepay ! "${leaky_queue[@]}" ! "n.request$pad"
    "n.src$pad" ! queue max-size-buffers=16 max-size-time=0 max-size-bytes=0 ! rtplfpay "mtu=$mtu" "max-bitrate=$bitrate" ! "${link[@]}" ! "${out[@]}")
done
launch "${pipeline[@]}"
