#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# A compositor host: passes its viewers' requests on to the camera hosts and sends each viewer the picture.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

usage() {
  cat <<END
usage: pipelines/compositor-node.sh --rig RIG.json --requests PORT --node HOST:OUT:IN --view ID:HOST:PORT [OPTION...]

  --rig RIG.json         the whole array, the same file on every host
  --requests PORT        where the viewers' requests come in; ADDRESS:PORT of this host, GROUP:PORT for multicast
  --node HOST:OUT:IN     a camera host, its port for requests, and the port here for its answers, or ADDRESS:PORT here;
                         repeat for each
  --view ID:HOST:PORT    a viewer: its view id, and where its pictures go as Motion JPEG over RTP; repeat for each
  --key-file FILE        the secret that all hosts share: openssl rand -hex 32 >FILE, chmod 600 FILE
  --peers LIST           addresses, names and networks that requests are taken from (default: with a key all that have
                         it, else the viewers)
  --latency MS           how long a request may take before its picture is made of what there is (default: 60)
  --quality Q            of the pictures, 1 to 100 (default: 90)
  --sink PIPELINE        what is done with the pictures of a view in place of sending them; VIEW in it is its id
  --set 'NAME=VALUE'     a property of lfcompositor, such as focus=plane, max-missed=10; may be repeated
END
}

rig= requests= latency=60 quality=90 sink= key_file= peers=
nodes=() views=() settings=()
while (($#)); do
  [[ $1 != --help && $1 != -h ]] || { usage; exit; }
  (($# > 1)) || die "$1 needs a value (see --help)"
  case $1 in
    --rig) need_file "$@"; rig=$2 ;;
    --requests) need_port "$1" "${2##*:}"; requests=$2 ;;
    --node) need_node "$@"; nodes+=("$2") ;;
    --view)
      need_address "$1" "${2#*:}"
      [[ ${2%%:*} =~ ^[0-9]{1,6}$ ]] || die "--view $2: must be ID:HOST:PORT"
      views+=("$2") ;;
    --key-file) need_file "$@"; key_file=$2 ;;
    --peers) peers=$2 ;;
    --latency) latency=$2 ;;
    --quality) quality=$2 ;;
    --sink) sink=$2 ;;
    --set) settings+=("$2") ;;
    *) die "unknown option $1 (see --help)" ;;
  esac
  shift 2
done
[[ -n $rig && -n $requests ]] || die "--rig and --requests are needed (see --help)"
((${#nodes[@]} && ${#views[@]})) || die "at least one --node and one --view are needed (see --help)"
if [[ -z $key_file$peers ]]; then
  peers=127.0.0.0/8,::1
  for view in "${views[@]}"; do
    host=${view#*:}
    peers+=,${host%:*}
  done
fi

pipeline=(lfviewsrc name=v "rig=$rig" "nodes=$(join "${nodes[@]}")" "listen=$requests"
  ${key_file:+"key-file=$key_file"} ${peers:+"peers=$peers"} "latency=$((latency * 1000000))" post-messages=true
  "${settings[@]}")
for view in "${views[@]}"; do
  id=$((10#${view%%:*}))
  # View 0 is that of the pad that is always there.
  pad=src
  ((id == 0)) || pad=src_$((id - 1))
  if [[ -n $sink ]]; then
    read -ra tail <<<"${sink//VIEW/$id}"
  else
    mapfile -t out < <(send "${view#*:}")
    tail=(videoconvert ! video/x-raw,format=I420 ! jpegenc "quality=$quality" ! rtpjpegpay ! "${out[@]}")
  fi
  pipeline+=("v.$pad" ! queue ! "${tail[@]}")
done
launch "${pipeline[@]}"
