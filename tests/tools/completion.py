#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Completes command lines with the files that tools/completion/completion.py writes for bash.

    completion.py BUILD_ROOT [unittest arguments]
"""
import pathlib
import subprocess
import sys
import tempfile
import unittest

BUILD = pathlib.Path(sys.argv.pop(1)).resolve()
SCRIPT = pathlib.Path(__file__).resolve().parents[2] / "tools/completion/completion.py"

# Command line up to the cursor, and all completions of its last word.
CASES = [
    ("lf-scene --format ", "mjpeg png"),
    ("lf-scene --format p", "png"),
    ("lf-scene --format = p", "png"),  # --format=p, as bash splits it
    ("lf-scene --format =", "mjpeg png"),
    ("lf-scene --fr", "--frames --framerate"),
    ("lf-scene ", "chart lights"),
    ("lf-scene --out ", ""),  # bash then completes names of files
    ("lf-scene --out chart --frames 3 li", "lights"),
    ("lf-scene lights --sp", "--speed"),
    ("lf-scene lights --format --sp", "--speed"),  # lights has no --format
    ("lf-rig im", "import"),
    ("lf-rig import --out rig.json col", "colmap"),
    ("lf-rig import colmap --rig", "--rig-id"),
    ("lf-rig check x", ""),
    ("lf-serve --focus-mode s", "surface"),
    ("lf-calibrate all --re", None),
    ("lf-path --", None),
]


class Completion(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(cls.enterClassContext(tempfile.TemporaryDirectory()))
        programs = [path for folder in ("tools", "calib") for path in sorted((BUILD / folder).glob("lf-*"))
                    if path.is_file()]
        cls.names = [path.name for path in programs]
        subprocess.run([SCRIPT, cls.folder, *programs], check=True)

    def complete(self, line):
        words = line.split(" ")
        function = "_" + words[0].replace("-", "_")
        script = 'source "$1" && shift && function=$1 && shift && COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)) && ' \
                 '$function && printf "%s\\n" "${COMPREPLY[@]}"'
        result = subprocess.run(["bash", "--norc", "-euc", script, "-", self.folder / words[0], function, *words],
                                capture_output=True, text=True, check=True)
        self.assertEqual(result.stderr, "")
        return result.stdout.split()

    def test_lines(self):
        for line, expected in CASES:
            with self.subTest(line):
                found = self.complete(line)
                if expected is None:
                    self.assertTrue(found)
                    self.assertTrue(all(word.startswith(line.split(" ")[-1]) for word in found), found)
                else:
                    self.assertEqual(found, expected.split())

    def test_every_program_completes_its_options(self):
        self.assertGreaterEqual(len(self.names), 10)
        for name in self.names:
            with self.subTest(name):
                self.assertIn("--version", self.complete(f"{name} --"))


unittest.main()
