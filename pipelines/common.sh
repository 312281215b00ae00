# SPDX-License-Identifier: LGPL-2.1-or-later
# What the pipelines that span hosts share; sourced.
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
# An installed plugin serves as well as one built here.
[[ ! -d $root/build/gst ]] || export GST_PLUGIN_PATH=${GST_PLUGIN_PATH:+$GST_PLUGIN_PATH:}$root/build/gst

# Late requests are of no use.
leaky_queue=(queue leaky=downstream max-size-buffers=2 max-size-time=0 max-size-bytes=0)

die() {
  echo "$(basename "$0"): $*" >&2
  exit 1
}

# Checks the value of an option: a file that is there, HOST:PORT, a port.
need_file() { [[ -f $2 ]] || die "$1 $2: no such file"; }
need_port() { [[ $2 =~ ^[0-9]+$ ]] && (($2 > 0 && $2 < 65536)) || die "$1 $2: not a port"; }
need_address() {
  [[ $2 =~ ^.+:[0-9]+$ ]] || die "$1 $2: must be HOST:PORT"
  need_port "$1" "${2##*:}"
}
need_node() {
  local node='^.+:[0-9]+(:\[[^]]+\]|:[0-9.]+\.[0-9]+)?:[0-9]+$'
  [[ $2 =~ $node ]] || die "$1 $2: must be HOST:PORT-THERE:[ADDRESS-HERE:]PORT-HERE"
  need_port "$1" "${2##*:}"
}

# The items of a list with commas between.
join() { local IFS=,; echo "$*"; }

# Pictures by RTP, under the key of $key_file if there is one: without, from the HOST alone, or from this machine.
receive_pictures() { # [ADDRESS:]PORT HOST
  local address=() gate=("key-file=$key_file")
  # A name may stand for an address of either family: where there is IPv6, its socket takes both.
  ! grep -qs . /proc/net/if_inet6 || address=(address=::)
  [[ $1 != *:* ]] || address=("address=${1%:*}")
  [[ -n $key_file ]] || gate=("peers=$2,127.0.0.0/8,::1")
  printf '%s\n' udpsrc "${address[@]}" "port=${1##*:}" buffer-size=8388608 \
    caps=application/x-rtp,media=video,clock-rate=90000,encoding-name=JPEG,payload=26 ! lfrtpgate "${gate[@]}"
}
send() { # HOST:PORT
  [[ -z $key_file ]] || printf '%s\n' lfrtpseal "key-file=$key_file" !
  printf '%s\n' udpsink "host=${1%:*}" "port=${1##*:}" sync=false async=false
}

# Runs a pipeline after printing it as a command that can be pasted. Its elements bring along the clock that all hosts
# share: the time of day, which chrony or PTP keeps equal.
launch() {
  printf 'gst-launch-1.0 -m %s\n' "$(printf '%q ' "$@")"
  exec gst-launch-1.0 -m "$@"
}
