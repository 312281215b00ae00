#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Runs the whole system under load, packet loss and failures. Not part of tests/run.sh; needs root (network namespaces).
#   tests/soak.sh --minutes N [--out FOLDER]    N >= 3; writes figures and a plot to FOLDER (default: build/soak)
# 64 cameras on six hosts, a compositor host with two viewers, a viewer that connects directly to the nodes, and an
# lf-serve with a browser. Viewers and the browser come and go, nodes are killed and restarted, cameras fail and
# recover, and every host loses 1 % of incoming packets. An unknown host and a viewer's host together send 100 hostile
# packets per second.
# Writes samples.csv, pictures.csv, events.csv and soak.svg. The last lines are the invariants (tests/soak/laws.py): no
# memory growth after the warm-up, descriptors and threads back at their base without viewers, complete frames without
# long pauses, and programs that end on request. The exit status is 0 if all invariants hold.
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
# Installs the browser's packages here, because the soak's namespaces have no Internet access.
browser=()
if tests/web/browser.sh "$PWD/build" tests/web/soak_page.mjs | grep -m 1 SKIP; then browser=(--no-browser); fi
exec python3 tests/soak/soak.py --minutes "$minutes" --build "$PWD/build" --out "$out" --film "$film" "${browser[@]}"
