# SPDX-License-Identifier: LGPL-2.1-or-later
"""Counts the test cases of `meson test` runs: summary.py LOGS..., each a path without .json and .junit.xml.

If several runs have the same program, the results of the last run count. Names each program that passed at the second
try. Prints the reason of every skipped case. The last line is "N passed, N failed, N skipped". The exit status is 1 if
a case failed or no case passed.

summary.py --failed LOGS... prints the names of the programs that failed.
"""

import json
import re
import sys
import xml.etree.ElementTree as ElementTree


def short_name(name):
    """Meson calls a program "SUITES / NAME" if it belongs to a suite."""
    return name.rpartition(' / ')[2]


def programs_of(logs):
    """Returns {name: result} for all programs."""
    with open(f'{logs}.json', encoding='utf-8') as log:
        return {short_name(program['name']): program['result'] for program in map(json.loads, log)}


def failed_of(programs):
    return [name for name, result in programs.items() if result not in ('OK', 'SKIP', 'EXPECTEDFAIL')]


def failed_in_all(runs):
    return failed_of({name: result for logs in runs for name, result in programs_of(logs).items()})


def cases_of(logs):
    """Yields (program, case) for all test cases."""
    with open(f'{logs}.junit.xml', encoding='utf-8', errors='replace') as log:
        # The log contains raw output with characters that XML forbids, such as terminal colours.
        text = re.sub('[\x00-\x08\x0b\x0c\x0e-\x1f\ufffe\uffff]', '', log.read())
    for suite in ElementTree.fromstring(text.encode()).iter('testsuite'):
        # "PROJECT.PROGRAM.SUITE" for GoogleTest, "PROJECT.PROGRAM" for TAP, "PROJECT" for programs without cases.
        names = suite.get('name', '').split('.')
        for case in suite.iter('testcase'):
            yield short_name(names[1] if len(names) > 1 else case.get('name')), case


def main(runs):
    last, failures = {}, {}
    for logs in runs:
        programs = programs_of(logs)
        last |= dict.fromkeys(programs, logs)
        failures |= dict.fromkeys(failed_of(programs))
    cases = [case for logs in runs for program, case in cases_of(logs) if last[program] == logs]
    passed = failed = skipped = 0
    for case in cases:
        skip = case.find('skipped')
        if case.find('failure') is not None or case.find('error') is not None:
            failed += 1
        elif skip is not None:
            skipped += 1
            # GoogleTest writes the source location on the first line and the reason on the following lines.
            lines = (skip.get('message') or '').strip().splitlines()
            reason = ' '.join(lines[1:] or lines)
            print(f'skipped: {case.get("classname", "")} {case.get("name", "")}: {reason}')
        else:
            passed += 1

    # A program can fail with only passed cases: on exit, or at its time limit.
    broken = failed_in_all(runs)
    for name in failures:
        print(f'failed: {name}' if name in broken else f'passed at the second try: {name}')
    failed = max(failed, len(broken))
    print(f'{passed} passed, {failed} failed, {skipped} skipped')
    return 1 if failed or not passed else 0


if __name__ == '__main__':
    if sys.argv[1] == '--failed':
        print('\n'.join(failed_in_all(sys.argv[2:])))
    else:
        sys.exit(main(sys.argv[1:]))
