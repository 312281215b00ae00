#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Thumbnails, time codes, subtitles and sound files beside recordings are ignored.

    sidecar_files.py BUILD_ROOT [unittest arguments]
"""
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

BUILD = pathlib.Path(sys.argv.pop(1)).resolve()
os.environ["GST_PLUGIN_PATH"] = str(BUILD / "gst")
NAMES = ["cam_00_00", "cam_00_01", "cam_01_00", "cam_01_01"]


def run(*words, status=0):
    done = subprocess.run([*map(str, words)], text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=300)
    if status is not None and done.returncode != status:
        raise AssertionError(f"{words}: status {done.returncode}: {done.stdout}")
    return done.stdout


class SidecarFiles(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.temporary.name)
        cls.rig = cls.folder / "rig.json"
        run(BUILD / "tools/lf-rig", "new", "--grid", "2x2", "--pitch", "0.06", "--fov", "45", "--width", 320, "--height", 240,
            "--out", cls.rig)
        run(BUILD / "tools/lf-scene", "chart", "--rig", cls.rig, "--out", cls.folder / "chart", "--places", 4, "--faults", 7)
        run("gst-launch-1.0", "-q", "videotestsrc", "num-buffers=1", "!", "video/x-raw,width=160,height=120", "!", "jpegenc",
            "!", "filesink", f"location={cls.folder}/thumbnail")
        cls.alone = cls.colours(cls.folder / "chart")

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    @classmethod
    def colours(cls, recording, status=0):
        out = cls.folder / "out.json"
        out.unlink(missing_ok=True)
        said = run(BUILD / "calib/lf-calibrate", "colour", cls.rig, "--recording", recording, "--out", out, status=status)
        return out.read_bytes() if status == 0 else said

    def copy(self):
        copy = self.folder / "copy"
        shutil.rmtree(copy, ignore_errors=True)
        shutil.copytree(self.folder / "chart", copy)
        return copy

    def test_sidecar_files_are_ignored(self):
        copy = self.copy()
        for name in NAMES:
            shutil.copy(self.folder / "thumbnail", copy / f"{name}.THM")
            (copy / f"{name}.txt").write_text("# timecode format v2\n0\n")
            (copy / f"{name}.csv").write_text("frame,time\n0,0\n")
            (copy / f"{name}.srt").write_text("1\n00:00:00,000 --> 00:00:01,000\n1/50 s\n")
        self.assertEqual(self.colours(copy), self.alone)

    def test_sidecar_file_of_one_camera_is_ignored(self):
        copy = self.copy()
        (copy / "cam_01_00.txt").write_text("# timecode format v2\n")
        self.assertEqual(self.colours(copy), self.alone)

    def test_two_films_of_a_camera_are_an_error(self):
        copy = self.copy()
        shutil.copy(copy / "cam_00_01.mkv", copy / "cam_00_01.avi")
        said = self.colours(copy, status=1)
        for fact in ("cam_00_01.avi", "both films", "camera cam_00_01"):
            self.assertIn(fact, said)

    def test_lights(self):
        lights = self.folder / "lights"
        run(BUILD / "tools/lf-scene", "lights", "--rig", self.rig, "--out", lights, "--seconds", 2)

        def tracks():
            run(BUILD / "calib/lf-calibrate", "track", self.rig, "--recordings", lights, "--bar", "--out",
                self.folder / "tracks.json", status=None)
            return (self.folder / "tracks.json").read_bytes()

        alone = tracks()
        for name in NAMES:
            (lights / f"{name}.txt").write_text("x")
            shutil.copy(self.folder / "thumbnail", lights / f"{name}.THM")
        (self.folder / "tracks.json").unlink()
        self.assertEqual(tracks(), alone)
        # The error for a camera without a recording names the files found.
        (lights / "cam_00_00.mkv").unlink()
        said = run(BUILD / "calib/lf-calibrate", "track", self.rig, "--recordings", lights, "--bar", "--out",
                   self.folder / "tracks.json", status=None)
        for fact in ("no recording", "cam_00_00.*", "cam_00_00.THM", "a still", "cam_00_00.txt", "a video"):
            self.assertIn(fact, said)


if __name__ == "__main__":
    unittest.main(verbosity=2)
