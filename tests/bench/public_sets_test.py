#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""public_sets.py with sets that are made from the built-in scene, and with a damaged set.

    public_sets_test.py BUILD_ROOT [unittest arguments]
"""
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

import numpy

BUILD = pathlib.Path(sys.argv.pop(1)).resolve()
SCRIPT = pathlib.Path(__file__).with_name("public_sets.py")


def axes(orientation):
    """The columns right, down and forward of a camera, from its quaternion."""
    w, x, y, z = orientation
    return numpy.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


class PublicSets(unittest.TestCase):
    def test_measures_every_kind_and_names_what_fails(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            film = folder / "film"
            subprocess.run([BUILD / "tools/lf-scene", "--out", film, "--grid", "4x4", "--width", "160", "--height", "120",
                            "--frames", "1"], check=True, stdout=subprocess.DEVNULL)
            cameras = json.loads((film / "rig.json").read_text())["cameras"]
            gantry, fern, broken = folder / "gantry", folder / "fern", folder / "broken"
            (fern / "images").mkdir(parents=True)
            gantry.mkdir()
            broken.mkdir()
            poses = []
            for index, camera in enumerate(cameras):
                x, y, _ = camera["position"]
                shutil.copy(film / camera["image"], gantry / f"out_{index // 4:02}_{index % 4:02}_{1000 * y:.3f}_{1000 * x:.3f}_.png")
                shutil.copy(film / camera["image"], fern / "images" / f"photograph_{index:02}.png")
                right, down, forward = axes(camera["orientation"]).T
                pose = numpy.stack([down, right, -forward, camera["position"], [120, 160, camera["params"][0]]], axis=1)
                poses.append(numpy.append(pose.ravel(), [1.2, 4.5]))
            numpy.save(fern / "poses_bounds.npy", numpy.array(poses))
            films = folder / "films"
            films.mkdir()
            shutil.copy(fern / "poses_bounds.npy", films)
            for index, camera in enumerate(cameras):
                shutil.copy(film / camera["source"], films / f"cam{index:02}.mkv")
            (broken / "poses_bounds.npy").write_bytes(b"no numbers")
            done = subprocess.run([SCRIPT, gantry, broken, fern, films, "--build", BUILD, "--out", folder / "page"], text=True,
                                  stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
            self.assertEqual(done.returncode, 1, done.stdout)
            text = (folder / "page/index.md").read_text()
            self.assertIn("**broken** could not be measured", text)
            self.assertIn("LLFF 22.85, NeRF 25.17", text)
            rows = {row[1].strip(): row for row in (line.split("|") for line in text.split("\n")) if len(row) == 13}
            for kind, views, kept in (("gantry", 4, 4), ("fern", 2, 14), ("films", 1, 15)):
                self.assertEqual([int(rows[kind][2]), int(rows[kind][3])], [kept, views], text)
                self.assertGreater(float(rows[kind][5]), 18, text)
                self.assertEqual(len(list((folder / "page" / kind).iterdir())), views)


unittest.main()
