#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# A camera host: some cameras of a rig, which answer view requests that come over RTP.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

usage() {
  cat <<END
usage: pipelines/camera-node.sh --rig RIG.json --requests PORT --answers HOST:PORT [OPTION...]

  --rig RIG.json        the whole array, the same file on every host
  --requests PORT       where view requests come in; ADDRESS:PORT of this host, GROUP:PORT for multicast
  --answers HOST:PORT   the compositor host that sends them; repeat both for further compositor hosts, in the same order
  --key-file FILE       the secret that all hosts share: openssl rand -hex 32 >FILE, chmod 600 FILE
  --peers LIST          addresses, names and networks that requests are taken from (default: with a key all that have
                        it, else the hosts of --answers)
  --cameras LIST        ids of this host's cameras, such as 0-15,20 (default: all)
  --node N              this host's number, each its own (default: 0)
  --framerate N/D       of cameras whose source has none (default: 30/1)
  --mtu BYTES           of a packet (default: 1400; jumbo frames: 8900)
  --bitrate BITS        paces the packets of an answer, bits per second (default: 1000000000; 0: all at once)
  --trust-rig           let the rig run any GStreamer element: such a file may write files and run programs
  --set 'NAME=VALUE'    a property of lfcameranode, such as codec=raw16, loop=false; may be repeated
END
}

rig= cameras= node=0 framerate=30/1 mtu=1400 bitrate=1000000000 key_file= peers=
requests=() answers=() settings=()
while (($#)); do
  [[ $1 != --help && $1 != -h ]] || { usage; exit; }
  [[ $1 != --trust-rig ]] || { settings+=(trusted=true); shift; continue; }
  (($# > 1)) || die "$1 needs a value (see --help)"
  case $1 in
    --rig) need_file "$@"; rig=$2 ;;
    --requests) need_port "$1" "${2##*:}"; requests+=("$2") ;;
    --answers) need_address "$@"; answers+=("$2") ;;
    --key-file) need_file "$@"; key_file=$2 ;;
    --peers) peers=$2 ;;
    --cameras) cameras=$2 ;;
    --node) node=$2 ;;
    --framerate) framerate=$2 ;;
    --mtu) mtu=$2 ;;
    --bitrate) bitrate=$2 ;;
    --set) settings+=("$2") ;;
    *) die "unknown option $1 (see --help)" ;;
  esac
  shift 2
done
[[ -n $rig ]] || die "--rig is missing (see --help)"
((${#requests[@]} && ${#requests[@]} == ${#answers[@]})) || die "each --requests needs its --answers (see --help)"

launch lfnodesink "rig=$rig" "node=$node" "framerate=$framerate" ${cameras:+"cameras=$cameras"} "listen=$(join "${requests[@]}")" \
  "answers=$(join "${answers[@]}")" ${key_file:+"key-file=$key_file"} ${peers:+"peers=$peers"} "mtu=$mtu" \
  "max-bitrate=$bitrate" "${settings[@]}"
