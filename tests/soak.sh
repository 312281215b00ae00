#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# The whole system for a while under all that can happen to it. Not part of tests/run.sh; needs root (network namespaces).
#   tests/soak.sh --minutes N [--out FOLDER]    at least 3; figures and the plot go to build/soak, or there
# 64 cameras on six hosts, a compositor host with two viewers, a viewer of the nodes themselves, and a browser at an
# lf-serve of the nodes. Viewers and browser come and go, nodes are killed and started again, cameras are lost and found,
# 1 % of the packets that come to a host are lost, and a stranger and somebody at a viewer's host send 100 hostile packets
# a second.
# Writes samples.csv, pictures.csv, events.csv and soak.svg. Its last lines are the laws (tests/soak/laws.py): no growth of
# memory after the warm-up, descriptors and threads at their base when nobody watches, pictures that are complete and do
# not pause, and programs that end when they are asked to. Exit status 0 if all hold.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

minutes= out=$PWD/build/soak
while (($#)); do
  case $1 in
    --minutes) minutes=${2:-}; shift ;;
    --out) out=$(realpath -m "${2:-}"); shift ;;
    *) minutes=; break ;;
  esac
  shift
done
if [[ ! $minutes =~ ^[0-9]+$ ]] || ((minutes < 3)); then
  sed -n '3,12s/^# //p' "$0"
  exit 2
fi
((EUID == 0)) || { echo "tests/soak.sh: network namespaces need root" >&2; exit 1; }
command -v iptables >/dev/null || { echo "tests/soak.sh: iptables is not installed" >&2; exit 1; }

ninja -C build --quiet gst/libgstlightfield.so tools/lf-serve tools/lf-scene tools/lf-path
mkdir -p "$out" build/soak
film=$PWD/build/soak/film
if [[ ! -f $film/rig.json ]]; then
  echo "filming the built-in scene with 64 cameras"
  build/tools/lf-scene --out "$film.part" --frames 30 --framerate 15 --samples 1
  mv "$film.part" "$film"
fi
# What the browser needs is installed while there is a network.
browser=()
if tests/web/browser.sh "$PWD/build" tests/web/soak_page.mjs | grep -m 1 SKIP; then browser=(--no-browser); fi
exec python3 tests/soak/soak.py --minutes "$minutes" --build "$PWD/build" --out "$out" --film "$film" "${browser[@]}"
