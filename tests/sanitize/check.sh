#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Checks that ThreadSanitizer reports a race between GStreamer threads, and no false positives.
#   tests/sanitize/check.sh CHECK-SANITIZER   see check.cc
set -euo pipefail
for way in lock queue state race; do
  status=0
  output=$("$1" "$way" 2>&1) || status=$?
  expected=0
  [[ $way == race ]] && expected=66
  ((status == expected)) && continue
  echo "$output"
  echo "check-sanitizer $way: exit status $status, expected $expected" >&2
  exit 1
done
