#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Sets up and runs all tests but the slow ones (`meson test -C build --suite slow`). The last line counts test cases.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

tools/setup.sh --tests
status=0
meson test -C build --no-rebuild --no-suite slow --print-errorlogs "$@" || status=$?
python3 tests/summary.py build/meson-logs/testlog.json build/meson-logs/testlog.junit.xml || status=1
exit "$status"
