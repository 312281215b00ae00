#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Films a flight over a slow network, to look for jumps and torn silhouettes:
# flight.sh BUILD [SECONDS [ROUND_TRIP_MS]]. The pictures are in BUILD/tests/web/flight.
set -euo pipefail
here=$(dirname "$(realpath "$0")")
LF_SECONDS=${2:-60} LF_ROUND_TRIP=${3:-100} exec "$here/../web/browser.sh" "$(realpath "$1")" "$here/../web/flight.mjs"
