#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Quality of the pictures that the page redraws, for random movements against ground truth, and the drawing time:
# reprojection.sh BUILD [MOVEMENTS]. Pictures are written to BUILD/tests/web/reprojection.
set -euo pipefail
here=$(dirname "$(realpath "$0")")
LF_MOVEMENTS=${2:-200} exec "$here/../web/browser.sh" "$(realpath "$1")" "$here/../web/reprojection.mjs"
