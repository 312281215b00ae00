# SPDX-License-Identifier: LGPL-2.1-or-later
"""Counts the test cases of a run of `meson test`: summary.py LOGS [LOGS_AGAIN], each the path before .json and .junit.xml.

LOGS_AGAIN are those of a second run of programs that failed in the first one: what these are in the second run counts,
and is told. Says why cases were skipped. The last line is "N passed, N failed, N skipped"; exit status 1 if any failed
or none ran. summary.py --failed LOGS prints the names of the programs that failed.
"""

import json
import re
import sys
import xml.etree.ElementTree as ElementTree


def programs_of(logs):
    """The results of all programs, by name."""
    with open(f'{logs}.json', encoding='utf-8') as log:
        return {program['name']: program['result'] for program in map(json.loads, log)}


def failed_of(programs):
    return [name for name, result in programs.items() if result not in ('OK', 'SKIP', 'EXPECTEDFAIL')]


def cases_of(logs):
    """Test cases and the suites that they are of, which are named after programs where these have cases of their own."""
    with open(f'{logs}.junit.xml', encoding='utf-8', errors='replace') as log:
        # What programs have printed is in it as it was, colours for a terminal, too, and XML has no such characters.
        text = re.sub('[\x00-\x08\x0b\x0c\x0e-\x1f\ufffe\uffff]', '', log.read())
    for suite in ElementTree.fromstring(text.encode()).iter('testsuite'):
        for case in suite.iter('testcase'):
            yield suite.get('name', ''), case


def main(logs, again=None):
    first = programs_of(logs)
    second = programs_of(again) if again else {}

    def is_of_second(suite, case):
        return any(case.get('name') == name or f'.{name}.' in suite for name in second)

    cases = [case for suite, case in cases_of(logs) if not is_of_second(suite, case)]
    cases += [case for _, case in cases_of(again)] if again else []
    passed = failed = skipped = 0
    for case in cases:
        skip = case.find('skipped')
        if case.find('failure') is not None or case.find('error') is not None:
            failed += 1
        elif skip is not None:
            skipped += 1
            # GoogleTest puts the place into the first line and the reason into the others.
            lines = (skip.get('message') or '').strip().splitlines()
            reason = ' '.join(lines[1:] or lines)
            print(f'skipped: {case.get("classname", "")} {case.get("name", "")}: {reason}')
        else:
            passed += 1

    # A program can fail as a whole with all its cases passed: at exit, or by running out of time.
    broken = failed_of(first | second)
    for name in failed_of(first):
        print(f'failed: {name}' if name in broken else f'failed among others, passed alone: {name}')
    failed = max(failed, len(broken))
    print(f'{passed} passed, {failed} failed, {skipped} skipped')
    return 1 if failed or not passed else 0


if __name__ == '__main__':
    if sys.argv[1] == '--failed':
        print('\n'.join(failed_of(programs_of(sys.argv[2]))))
    else:
        sys.exit(main(*sys.argv[1:]))
