#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Builds and runs all tests except the slow suite (`meson test -C build --suite slow`). The programs of the suite `live`
# run one at a time. The other programs run beside them at a lower priority, one more at a time than there are
# processors, because many programs wait for live frames. Runs up to three failed programs again, one at a time, in case
# other load was the reason. A line names each program that passed at the second try. The last line counts test cases.
# Arguments select tests as for `meson test`.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

tools/setup.sh --tests
status=0 logs=(build/meson-logs/testlog)
run=(meson test -C build --no-rebuild --no-suite slow --print-errorlogs)
beside=(--num-processes "$(($(nproc) + 1))")
if (($#)); then
  "${run[@]}" "${beside[@]}" "$@" || status=$?
else
  trap 'kill $(jobs -p) 2>/dev/null || true' EXIT  # kill fails if no job is left
  "${run[@]}" --suite live --num-processes 1 --logbase live &
  nice -n 5 "${run[@]}" --no-suite live "${beside[@]}" || status=$?
  wait $! || status=$?
  logs+=(build/meson-logs/live)
fi
if ((status)); then
  mapfile -t failed < <(python3 tests/summary.py --failed "${logs[@]}")
  if ((${#failed[@]} >= 1 && ${#failed[@]} <= 3)); then
    status=0
    meson test -C build --no-rebuild --num-processes 1 --print-errorlogs --logbase again "${failed[@]}" || status=$?
    logs+=(build/meson-logs/again)
  fi
fi
python3 tests/summary.py "${logs[@]}" || status=1
exit "$status"
