#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Renders a camera path through the light field and sends it as RTP to the WebRTC server Janus, where any number of
# browsers can watch. The folder pipelines/janus/ has a configuration of Janus' streaming plugin and a page for it.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
# If this checkout has a build, the pipeline uses its plugin instead of the installed one.
[[ ! -d $root/build/gst ]] || export GST_PLUGIN_PATH=${GST_PLUGIN_PATH:+$GST_PLUGIN_PATH:}$root/build/gst

die() {
  echo "$(basename "$0"): $*" >&2
  exit 1
}

# Each need_* function checks the value of an option, and ends the script if the value is invalid.
need_file() { [[ -f $2 ]] || die "$1 $2: no such file"; }
need_port() { [[ $2 =~ ^[0-9]+$ ]] && (($2 > 0 && $2 < 65536)) || die "$1 $2: must be a port number from 1 to 65535"; }
need_address() {
  [[ $2 =~ ^.+:[0-9]+$ ]] || die "$1 $2: must be HOST:PORT"
  need_port "$1" "${2##*:}"
}
need_node() {
  local node='^.+:[0-9]+(:\[[^]]+\]|:[0-9.]+\.[0-9]+)?:[0-9]+$'
  [[ $2 =~ $node ]] || die "$1 $2: must be HOST:PORT-THERE:[ADDRESS-HERE:]PORT-HERE"
  need_port "$1" "${2##*:}"
}

usage() {
  cat <<END
usage: pipelines/publish-janus.sh --rig RIG.json --path VIEWS.json [OPTION...]

  --rig RIG.json      rig file of the array
  --path VIEWS.json   camera path, such as lf-path writes. The path is played in a loop, with the size and the times
                      of its views
  --node HOST:OUT:IN  host that runs cameras with an lfnodesink. Requests are sent to its port OUT. Its answers arrive
                      at the local port IN, which may also be ADDRESS:PORT. Repeat this option for each host (default:
                      all cameras are on this machine)
  --key-file FILE     file with the secret that encrypts packets from and to the camera hosts. The video for Janus is
                      not encrypted
  --to HOST:PORT      video port of the mountpoint, the stream in Janus (default: localhost:5004)
  --codec h264|vp8    codec of the mountpoint (default: h264)
  --bitrate KBITS     bit rate of the video, in kbit/s (default: 3000)
  --framerate N       frame rate of the cameras (default: 30)
  --capture-delay MS  time between the capture of a frame and a request for it, in milliseconds. It must exceed the
                      latency of the cameras (default: 100)
  --set 'NAME=VALUE'  property of lfviewsrc, such as focus=plane; may be repeated
  --print             print the pipeline up to its RTP packets instead of running it. A WHIP client can use the output:
                      whip-client -u URL -V "\$(pipelines/publish-janus.sh --rig ... --path ... --print)"
END
}

rig= path= to=localhost:5004 codec=h264 bitrate=3000 framerate=30 delay=100 print=false hosts_key=
nodes=() settings=()
while (($#)); do
  [[ $1 != --help && $1 != -h ]] || { usage; exit; }
  [[ $1 != --print ]] || { print=true; shift; continue; }
  (($# > 1)) || die "$1 needs a value (see --help)"
  case $1 in
    --rig) need_file "$@"; rig=$2 ;;
    --path) need_file "$@"; path=$2 ;;
    --node) need_node "$@"; nodes+=("$2") ;;
    --key-file) need_file "$@"; hosts_key=$2 ;;
    --to) need_address "$@"; to=$2 ;;
    --set) settings+=("$2") ;;
    --codec) [[ $2 == h264 || $2 == vp8 ]] || die "--codec $2: must be h264 or vp8"; codec=$2 ;;
    --bitrate | --framerate | --capture-delay)
      [[ $2 =~ ^[0-9]+$ ]] || die "$1 $2: must be a whole number"
      case $1 in
        --bitrate) bitrate=$2 ;;
        --framerate) framerate=$2 ;;
        *) delay=$2 ;;
      esac ;;
    *) die "unknown option $1 (see --help)" ;;
  esac
  shift 2
done
[[ -n $rig && -n $path ]] || die "--rig and --path are required (see --help)"

# One key frame per second, because new viewers must wait for the next key frame.
case $codec in
  h264)
    encode=(x264enc tune=zerolatency speed-preset=veryfast "bitrate=$bitrate" "key-int-max=$framerate" !
      video/x-h264,profile=constrained-baseline ! rtph264pay config-interval=-1 aggregate-mode=zero-latency) ;;
  vp8)
    encode=(vp8enc deadline=1 end-usage=cbr "target-bitrate=$((bitrate * 1000))" "keyframe-max-dist=$framerate" !
      rtpvp8pay picture-id-mode=15-bit) ;;
esac
if ((${#nodes[@]})); then
  cameras=("nodes=$(IFS=,; echo "${nodes[*]}")" ${hosts_key:+"key-file=$hosts_key"})
else
  cameras=("node::framerate=$framerate/1")
fi
pipeline=(lfviewsrc "rig=$rig" "location=$path" loop=true "framerate=$framerate/1" "${cameras[@]}"
  "capture-delay=$((delay * 1000000))" "${settings[@]}" !
  queue leaky=downstream max-size-buffers=2 max-size-time=0 max-size-bytes=0 ! videoconvert ! video/x-raw,format=I420 !
  "${encode[@]}" pt=96 ssrc=2 mtu=1200)

if $print; then
  printf '%s ! queue ! application/x-rtp,media=video,encoding-name=%s,payload=96\n' "${pipeline[*]}" "${codec^^}"
else
  pipeline+=(! udpsink "host=${to%:*}" "port=${to##*:}" sync=false async=false)
  printf 'gst-launch-1.0 -m %s\n' "$(printf '%q ' "${pipeline[@]}")"
  exec gst-launch-1.0 -m "${pipeline[@]}"
fi
