#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Tests tests/summary.py with logs in the format of `meson test`: summary_test.py SUMMARY."""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

SUMMARY = sys.argv.pop()
CASES = {"passed": "<testcase name='{}'/>", "failed": "<testcase name='{}'><failure/></testcase>",
         "skipped": "<testcase name='{}' classname='C'><skipped message='x_test.cc:1&#10;no camera'/></testcase>"}


def write_logs(path, programs):
    """Writes logs. `programs`: {name: (result, protocol, {case: result})}; a crashed program has no cases."""
    lines, suites = [], []
    for name, (result, protocol, cases) in programs.items():
        program = f"lightfield:web+threads / {name}"
        lines.append(json.dumps({"name": program, "result": result}))
        suite = {"gtest": f"lightfield.{program}.Suite", "tap": f"lightfield.{program}", "exitcode": "lightfield"}[protocol]
        inner = "".join(CASES[outcome].format(program if protocol == "exitcode" else case) for case, outcome in cases.items())
        suites.append(f"<testsuite name='{suite}'>{inner}</testsuite>")
    pathlib.Path(f"{path}.json").write_text("\n".join(lines))
    pathlib.Path(f"{path}.junit.xml").write_text(f"<testsuites>{''.join(suites)}</testsuites>")


class Summary(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.first, self.again = (str(pathlib.Path(self.folder.name) / name) for name in ("first", "again"))

    def summary(self, *args):
        done = subprocess.run([sys.executable, SUMMARY, *args], capture_output=True, text=True, check=False)
        self.assertEqual(done.stderr, "")
        return done.returncode, done.stdout.splitlines()

    def test_counts_all_cases(self):
        write_logs(self.first, {"lib": ("OK", "gtest", {"a": "passed", "b": "passed", "c": "skipped"}),
                                "floors": ("OK", "exitcode", {"floors": "passed"})})
        self.assertEqual(self.summary(self.first), (0, ["skipped: C c: no camera", "3 passed, 0 failed, 1 skipped"]))

    def test_failures(self):
        write_logs(self.first, {"lib": ("FAIL", "gtest", {"a": "passed", "b": "failed"}),
                                "late": ("TIMEOUT", "tap", {"c": "passed"})})
        self.assertEqual(self.summary(self.first), (1, ["failed: lib", "failed: late", "2 passed, 2 failed, 0 skipped"]))
        self.assertEqual(self.summary("--failed", self.first), (0, ["lib", "late"]))

    def test_runs_at_the_same_time(self):
        write_logs(self.first, {"lib": ("FAIL", "gtest", {"a": "failed", "b": "passed"})})
        write_logs(self.again, {"browser": ("OK", "tap", {"c": "passed"}), "turn": ("FAIL", "tap", {"d": "failed"})})
        self.assertEqual(self.summary(self.first, self.again), (1, ["failed: lib", "failed: turn", "2 passed, 2 failed, 0 skipped"]))
        self.assertEqual(self.summary("--failed", self.first, self.again), (0, ["lib", "turn"]))

    def test_a_second_try_replaces_the_first(self):
        for protocol in "gtest", "tap", "exitcode":
            with self.subTest(protocol):
                name = "lf-serve" if protocol != "exitcode" else "a"
                write_logs(self.first, {"lib": ("OK", "gtest", {"x": "passed"}), "lf-serve-media": ("OK", "gtest", {"y": "passed"}),
                                        name: ("FAIL", protocol, {"a": "failed"})})
                write_logs(self.again, {name: ("OK", protocol, {"a": "passed"})})
                self.assertEqual(self.summary(self.first, self.again),
                                 (0, [f"passed at the second try: {name}", "3 passed, 0 failed, 0 skipped"]))

    def test_a_crash_is_replaced_too(self):
        write_logs(self.first, {"lib": ("OK", "gtest", {"x": "passed"}), "loss": ("FAIL", "exitcode", {"loss": "failed"})})
        write_logs(self.again, {"loss": ("OK", "gtest", {"a": "passed", "b": "passed"})})
        self.assertEqual(self.summary(self.first, self.again), (0, ["passed at the second try: loss", "3 passed, 0 failed, 0 skipped"]))

    def test_a_second_failure_is_a_failure(self):
        write_logs(self.first, {"lib": ("FAIL", "tap", {"x": "failed"})})
        write_logs(self.again, {"lib": ("FAIL", "tap", {"x": "failed"})})
        self.assertEqual(self.summary(self.first, self.again), (1, ["failed: lib", "0 passed, 1 failed, 0 skipped"]))


unittest.main()
