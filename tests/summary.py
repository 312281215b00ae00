# SPDX-License-Identifier: LGPL-2.1-or-later
"""Counts the test cases of a run of `meson test`: summary.py testlog.json testlog.junit.xml.

Says why cases were skipped. The last line is "N passed, N failed, N skipped"; exit status 1 if any failed or none ran.
"""

import json
import sys
import xml.etree.ElementTree as ElementTree


def main(log_path, junit_path):
    passed = failed = skipped = 0
    for case in ElementTree.parse(junit_path).iter('testcase'):
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
    with open(log_path, encoding='utf-8') as log:
        programs = [json.loads(line) for line in log]
    broken = [p['name'] for p in programs if p['result'] not in ('OK', 'SKIP', 'EXPECTEDFAIL')]
    for name in broken:
        print(f'failed: {name}')
    failed = max(failed, len(broken))
    print(f'{passed} passed, {failed} failed, {skipped} skipped')
    return 1 if failed or not passed else 0


if __name__ == '__main__':
    sys.exit(main(*sys.argv[1:]))
