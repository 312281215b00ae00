#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Counts the instructions of the hottest kernels for one view (bench-render once), and compares the counts with
# instructions.json. Unlike timings, counts do not depend on the load of the machine.
#   tests/bench/instructions.sh            fails if a kernel needs 2 % more than recorded
#   tests/bench/instructions.sh --record   records the current counts
# callgrind counts on a simulated processor with AVX2 at most. Counts depend on the compiler: with another compiler, or
# without valgrind, the exit status is 77 (skipped).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

record=0
case "${1:-}" in
  '') ;;
  --record) record=1 ;;
  *)
    sed -n '3,8s/^# //p' "$0"
    exit 2
    ;;
esac
json=tests/bench/instructions.json
program=build/tests/bench/bench-render
unset MALLOC_PERTURB_  # set by meson test: filling memory takes instructions
command -v valgrind >/dev/null || { echo "instructions.sh: needs valgrind: apt-get install valgrind" >&2; exit 77; }
[[ -x $program ]] || { echo "instructions.sh: $program is not built" >&2; exit 77; }

python3 - "$json" "$record" "$program" "$(c++ --version | head -n 1)" <<'END'
import json
import re
import subprocess
import sys

path, record, program, compiler = sys.argv[1], sys.argv[2] == '1', sys.argv[3], sys.argv[4]


def count(kernel):
    """Returns the instructions of one call of render_once() with this method."""
    run = subprocess.run(['valgrind', '--tool=callgrind', '--callgrind-out-file=/dev/null',
                          '--toggle-collect=render_once', program, 'once', kernel],
                         stderr=subprocess.PIPE, text=True)
    counted = re.search(r'Collected : (\d+)', run.stderr)
    if run.returncode or not counted or counted[1] == '0':
        sys.exit(f'{kernel}: not counted\n{run.stderr}')
    return int(counted[1])


with open(path, encoding='utf-8') as file:
    recorded = json.load(file)
if recorded['compiler'] != compiler and not record:
    print(f'recorded with {recorded["compiler"]}, this is {compiler}')
    sys.exit(77)
failed = False
for kernel, before in recorded['kernels'].items():
    now = count(kernel)
    change = 100 * (now / before - 1) if before else 0
    too_many = not record and change > 2
    failed = failed or too_many
    print(f'{kernel:40} {now:>12,} instructions  {change:+6.2f} %{"  MORE THAN RECORDED" if too_many else ""}')
    recorded['kernels'][kernel] = now
if record:
    recorded['compiler'] = compiler
    with open(path, 'w', encoding='utf-8') as file:
        file.write(json.dumps(recorded, indent=1) + '\n')
sys.exit(failed)
END
