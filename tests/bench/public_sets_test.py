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


def run_scene(folder, *options):
    """Films the built-in scene with 4x4 cameras, and returns the cameras of the rig."""
    subprocess.run([BUILD / "tools/lf-scene", "--out", folder, "--frames", "1", *options], check=True,
                   stdout=subprocess.DEVNULL)
    return json.loads((folder / "rig.json").read_text())["cameras"]


def write_hci(folder, film, cameras):
    """A scene of the 4D Light Field Benchmark whose images are not shifted."""
    folder.mkdir()
    for index, camera in enumerate(cameras):
        shutil.copy(film / camera["image"], folder / f"input_Cam{index:03}.png")
    width, height = cameras[0]["width"], cameras[0]["height"]
    pitch = cameras[1]["position"][0] - cameras[0]["position"][0]
    (folder / "parameters.cfg").write_text(
        f"[intrinsics]\nfocal_length_mm = {cameras[0]['params'][0] * 35 / width}\nsensor_size_mm = 35\n"
        f"image_resolution_x_px = {width}\nimage_resolution_y_px = {height}\n"
        f"[extrinsics]\nnum_cams_x = 4\nnum_cams_y = 4\nbaseline_mm = {1000 * pitch}\nfocus_distance_m = 0\n")


def write_technicolor(folder, film, cameras):
    folder.mkdir()
    lines = ["f cu cv ar sk qw qx qy qz tx ty tz"]
    for index, camera in enumerate(cameras):
        shutil.copy(film / camera["image"], folder / f"Painter_undist_00001_{index:02}.png")
        w, x, y, z = camera["orientation"]
        translation = -axes(camera["orientation"]).T @ camera["position"]
        f, cx, cy = camera["params"][:3]
        lines.append(" ".join(repr(float(n)) for n in (f, cx + 0.5, cy + 0.5, 1, 0, w, -x, -y, -z, *translation)))
    (folder / "cameras_parameters.txt").write_text("\n".join(lines) + "\n")


def write_deepview(folder, film, plain_cameras):
    """A scene of the DeepView Video dataset with fisheye lenses that do not turn."""
    folder.mkdir()
    f, cx, cy = plain_cameras[0]["params"][:3]
    rig = json.loads((film / "rig.json").read_text())
    for camera in rig["cameras"]:
        camera.pop("source")
        camera.pop("image")
        camera |= {"model": "OPENCV_FISHEYE", "params": [f, f, cx, cy, 0.05, -0.01, 0, 0]}
    (folder / "fisheye.json").write_text(json.dumps(rig))
    fisheye = film.with_name("fisheye")
    models = []
    for index, camera in enumerate(run_scene(fisheye, "--rig", folder / "fisheye.json")):
        name = f"camera_{index + 1:04}"
        shutil.copy(fisheye / camera["source"], folder / f"{name}.mp4")
        assert numpy.allclose(axes(camera["orientation"]), numpy.eye(3))
        models.append({"name": name, "position": camera["position"], "orientation": [0, 0, 0], "focal_length": f,
                       "pixel_aspect_ratio": 1.0, "principal_point": [cx, cy], "height": float(camera["height"]),
                       "width": float(camera["width"]), "radial_distortion": [0.05, -0.01, 0],
                       "projection_type": "fisheye"})
    (folder / "fisheye.json").unlink()
    (folder / "models.json").write_text(json.dumps(models))


class PublicSets(unittest.TestCase):
    def test_measures_every_kind_and_names_what_fails(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            film = folder / "film"
            cameras = run_scene(film, "--grid", "4x4", "--width", "160", "--height", "120")
            gantry, shop, fern, broken = (folder / name for name in ("gantry", "shop", "fern", "broken"))
            (fern / "images").mkdir(parents=True)
            for made in gantry, shop, broken:
                made.mkdir()
            poses = []
            for index, camera in enumerate(cameras):
                x, y, _ = camera["position"]
                place = f"{index // 4:02}_{index % 4:02}_{1000 * y:.3f}_{1000 * x:.3f}"
                shutil.copy(film / camera["image"], gantry / f"out_{place}_.png")
                shutil.copy(film / camera["image"], shop / f"Camera_{place}_{camera['params'][0] * 36 / 160:.3f}_36.png")
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
            write_hci(folder / "hci", film, cameras)
            write_technicolor(folder / "Painter", film, cameras)
            write_deepview(folder / "02_Flames", film, cameras)
            (broken / "poses_bounds.npy").write_bytes(b"no numbers")
            done = subprocess.run([SCRIPT, gantry, shop, broken, fern, films, folder / "hci", folder / "Painter",
                                   folder / "02_Flames", "--build", BUILD, "--out", folder / "page"], text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
            self.assertEqual(done.returncode, 1, done.stdout)
            self.assertTrue((folder / "page/index.md").exists(), done.stdout)
            text = (folder / "page/index.md").read_text()
            self.assertIn("**broken** could not be measured", text)
            self.assertIn("LLFF 22.85, NeRF 25.17", text)
            self.assertIn("HyperReel 35.91, STG 36.44", text)
            rows = {row[1].strip(): row for row in (line.split("|") for line in text.split("\n")) if len(row) == 13}
            for kind, views, kept in (("gantry", 4, 4), ("shop", 4, 4), ("fern", 2, 14), ("films", 1, 15), ("hci", 4, 4),
                                      ("Painter", 1, 15), ("02_Flames", 1, 15)):
                self.assertEqual([int(rows[kind][2]), int(rows[kind][3])], [kept, views], text)
                self.assertGreater(float(rows[kind][5]), 18, text)
                self.assertEqual(len(list((folder / "page" / kind).iterdir())), views)


unittest.main()
