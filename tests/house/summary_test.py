#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Tests tests/run.sh and tests/summary.py with logs in the format of `meson test`: summary_test.py RUN SUMMARY."""
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

SUMMARY, RUN = sys.argv.pop(), sys.argv.pop()
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


# Stands for `meson test`. The programs named in FAIL_FIRST fail at the first try, those in FAIL fail at every try.
MESON = r"""#!/usr/bin/env python3
import json, os, pathlib, sys
log = sys.argv[sys.argv.index("--logbase") + 1] if "--logbase" in sys.argv else "testlog"
names = {"testlog": ["lib"], "live": ["janus"], "again": [name for name in sys.argv if name in ("lib", "janus")]}[log]
failing = os.environ["FAIL"].split() + (os.environ["FAIL_FIRST"].split() if log != "again" else [])
result = lambda name: "FAIL" if name in failing else "OK"
case = lambda name: f"<testcase name='lf:unit / {name}'>" + ("<failure/>" if name in failing else "") + "</testcase>"
logs = pathlib.Path("build/meson-logs")
logs.mkdir(parents=True, exist_ok=True)
(logs / f"{log}.json").write_text("".join(json.dumps({"name": f"lf:unit / {n}", "result": result(n)}) + chr(10) for n in names))
(logs / f"{log}.junit.xml").write_text(
    "<testsuites>" + "".join(f"<testsuite name='lf.lf:unit / {n}'>{case(n)}</testsuite>" for n in names) + "</testsuites>")
sys.exit(any(name in failing for name in names))
"""


class Run(unittest.TestCase):
    def test_exit_status(self):
        for fail_first, fail, status in (("", "", 0), ("lib", "", 0), ("janus", "", 0), ("lib janus", "", 0), ("", "lib", 1), ("lib", "janus", 1)):
            with self.subTest(fail_first=fail_first, fail=fail), tempfile.TemporaryDirectory() as folder:
                root = pathlib.Path(folder)
                for path, text in {"tools/setup.sh": "#!/bin/sh\n", "bin/meson": MESON}.items():
                    (root / path).parent.mkdir()
                    (root / path).write_text(text)
                    (root / path).chmod(0o755)
                (root / "tests").mkdir()
                for file in RUN, SUMMARY:
                    shutil.copy(file, root / "tests")
                environment = os.environ | {"PATH": f"{root}/bin:{os.environ['PATH']}", "FAIL_FIRST": fail_first, "FAIL": fail}
                done = subprocess.run([root / "tests/run.sh"], capture_output=True, text=True, env=environment, check=False)
                self.assertEqual(done.returncode, status, done.stdout + done.stderr)
                failed = len(fail.split())
                self.assertEqual(done.stdout.splitlines()[-1], f"{2 - failed} passed, {failed} failed, 0 skipped")


unittest.main()
