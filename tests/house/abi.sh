#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Compares the binary interface of the public API with the recorded one, and fails for any difference. Compatible
# additions are recorded with a new version number. Anything else also needs a new soname.
#   abi.sh LIBRARY RECORD             LIBRARY: the code of lib/api with debug information; RECORD: lib/api/lightfield.abi
#   abi.sh --record LIBRARY RECORD    writes RECORD
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
record=false
if [[ $1 == --record ]]; then record=true; shift; fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# Members and parameters of the standard library count as bytes, because their types belong to the compiler.
cat >"$work/standard" <<'END'
[suppress_type]
name_regexp = ^(std|__gnu_cxx)::
drop = yes
END
abidw --headers-dir "$root/include" --drop-private-types --drop-undefined-syms --exported-interfaces-only \
  --no-corpus-path --no-comp-dir-path --no-show-locs --no-elf-needed --no-parameter-names --no-architecture \
  --type-id-style hash --suppr "$work/standard" --out-file "$work/now" "$1"
if $record; then cp "$work/now" "$2"; fi
abidiff "$2" "$work/now" || {
  echo "If programs compiled before this change still work: ninja -C build record-abi. Otherwise, also change soversion."
  exit 1
}
