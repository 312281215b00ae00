#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Sets up and runs all tests but the slow ones (`meson test -C build --suite slow`). Programs of live pictures run beside
# others on a machine that may have more to do: up to three that fail run once more, alone, and that is told. The last
# line counts test cases.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

tools/setup.sh --tests
status=0 logs=(build/meson-logs/testlog)
meson test -C build --no-rebuild --no-suite slow --print-errorlogs "$@" || status=$?
if ((status)); then
  mapfile -t failed < <(python3 tests/summary.py --failed "${logs[0]}")
  if ((${#failed[@]} >= 1 && ${#failed[@]} <= 3)); then
    status=0
    meson test -C build --no-rebuild --num-processes 1 --print-errorlogs --logbase again "${failed[@]##* / }" || status=$?
    logs+=(build/meson-logs/again)
  fi
fi
python3 tests/summary.py "${logs[@]}" || status=1
exit "$status"
