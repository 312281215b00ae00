#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Imports, checks and renders rigs from other programs.

Every input must end in a correct image, or in an error with a remedy.

    foreign_rigs.py BUILD_ROOT [unittest arguments]
"""
import json
import math
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

BUILD = pathlib.Path(sys.argv.pop(1)).resolve()
os.environ["GST_PLUGIN_PATH"] = str(BUILD / "gst")
IDENTITY = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]


def shifted(x):
    return [[1, 0, 0, x], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]


class ForeignRigs(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def tool(self, name, *arguments, status=0):
        done = subprocess.run([BUILD / "tools" / name, *map(str, arguments)], cwd=self.folder, text=True,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=300)
        if status is not None:
            self.assertEqual(done.returncode, status, f"{name} {arguments}: {done.stdout}")
        return done.stdout

    def import_rig(self, kind, *arguments):
        said = self.tool("lf-rig", "import", kind, *arguments, "--out", "rig.json")
        return json.loads((self.folder / "rig.json").read_text()), said

    def refused(self, kind, *arguments):
        (self.folder / "none.json").unlink(missing_ok=True)
        said = self.tool("lf-rig", "import", kind, *arguments, "--out", "none.json", status=1)
        self.assertFalse((self.folder / "none.json").exists())
        return said

    def assert_mentions(self, said, *facts):
        self.assertTrue(any(all(fact in line for fact in facts) for line in said.splitlines()), f"{facts} in {said}")

    def write(self, name, text):
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text if isinstance(text, str) else json.dumps(text))
        return name

    def film(self, rig=("--grid", "3x3"), size=(160, 120)):
        """Creates images of the built-in scene in the folder s, and a view in the middle with its ground truth in t."""
        shape = ("--width", size[0], "--height", size[1]) if rig[0] == "--grid" else ()
        self.tool("lf-scene", *rig, *shape, "--frames", 1, "--format", "png", "--samples", 1, "--out", "s")
        self.tool("lf-path", "--rig", "s/rig.json", "--out", "views.json", "--frames", 1, "--near", 1, "--far", 4)
        self.tool("lf-scene", "--rig", "s/rig.json", "--frames", 1, "--format", "png", "--samples", 1, "--truth",
                  "views.json", "--out", "t")
        return json.loads((self.folder / "s/rig.json").read_text())

    def psnr(self, rig):
        self.tool("lf-render", "--rig", rig, "--views", "views.json", "--out", "o", "--truth", "t/truth", "--json", "o.json")
        return json.loads((self.folder / "o.json").read_text())["views"][0]["psnr_db"]

    def write_colmap(self, rig, names, jpeg=False):
        """Creates a COLMAP model of a grid rig in the folder m, with renamed images."""
        p = rig["cameras"][0]["params"]
        size = "%d %d" % (rig["cameras"][0]["width"], rig["cameras"][0]["height"])
        self.write("m/cameras.txt", "1 RADIAL %s %r %r %r %r %r\n" % (size, p[0], p[1] + .5, p[2] + .5, p[3], p[4]))
        lines = []
        (self.folder / "m/images").mkdir()
        for i, (camera, name) in enumerate(zip(rig["cameras"], names)):
            shutil.copy(self.folder / "s" / camera["image"], self.folder / "m/images" / name)
            lines.append("%d 1 0 0 0 %r %r %r 1 %s\n\n" % (i + 1, *[-x for x in camera["position"]], name))
        self.write("m/images.txt", "".join(lines))

    # Lenses that a rig cannot hold.

    def test_other_lenses_are_refused(self):
        def opencv(more):
            return ("image_width: 1280\nimage_height: 960\ncamera_matrix: {rows: 3, cols: 3, data: [402.5, 0, 641.2, 0, "
                    "402.1, 478.9, 0, 0, 1]}\ndistortion_coefficients: {rows: 1, cols: 4, data: [-0.03, 0.01, -0.01, 0]}\n"
                    + more)

        def nerf(top, frame=None):
            return {"w": 640, "h": 480, "fl_x": 400, **top,
                    "frames": [{"file_path": "a.png", "transform_matrix": IDENTITY, **(frame or {})}]}

        def kalibr(more):
            return ("cam0:\n  camera_model: pinhole\n  intrinsics: [400, 400, 320, 240]\n  distortion_model: radtan\n"
                    "  distortion_coeffs: [0, 0, 0, 0]\n  resolution: [640, 480]\n" + more)

        cases = [
            ("opencv", opencv("distortion_model: fov\n"), "distortion_model"),
            ("opencv", opencv("xi: 1.1\n"), "xi"),
            ("opencv", opencv("").replace("[402.5, 0,", "[402.5, 3,"), "camera_matrix"),
            ("nerf", nerf({"camera_model": "FISHEYE624"}), "camera_model"),
            ("nerf", nerf({"camera_model": "EQUIRECTANGULAR"}), "camera_model"),
            ("nerf", nerf({}, {"equirectangular": True}), "frames[0].equirectangular"),
            ("nerf", nerf({"sk_x": 0.7}), "sk_x"),
            ("nerf", nerf({"rolling_shutter": [0, 0, 0, 0.03]}), "rolling_shutter"),
            ("kalibr", kalibr("").replace("radtan", "fov"), "cam0.distortion_model"),
            ("kalibr", kalibr("").replace("pinhole", "omni"), "cam0.camera_model"),
            ("kalibr", kalibr("  line_delay: 3.0e-05\n"), "cam0.line_delay"),
        ]
        for kind, text, place in cases:
            with self.subTest(kind=kind, place=place):
                said = self.refused(kind, self.write("input", text))
                self.assertIn(f"input: {place}: ", said)
                self.assertRegex(said, "cannot (hold|be imported)")
        self.write("m/cameras.txt", "1 FOV 640 480 400 400 320 240 0.1\n")
        self.write("m/images.txt", "1 1 0 0 0 0 0 0 1 a.png\n\n")
        self.assert_mentions(self.refused("colmap", "m"), "camera 1", "FOV", "colmap image_undistorter")

    def test_several_instants_are_refused(self):
        frames = [{"file_path": f"{i}.png", "time": i / 10, "transform_matrix": shifted(i)} for i in range(3)]
        said = self.refused("nerf", self.write("t.json", {"w": 8, "h": 6, "fl_x": 7, "frames": frames}))
        self.assert_mentions(said, "frames[1].time", "0.1", "has 0")

    # Kalibr.

    def test_kalibr_keeps_time_shifts_and_cameras_after_a_gap(self):
        def camera(number, x, more=""):
            return (f"cam{number}:\n  camera_model: pinhole\n  intrinsics: [458.6, 457.3, 367.2, 248.4]\n"
                    f"  distortion_model: radtan\n  distortion_coeffs: [-0.28, 0.07, 0.0002, 0.00002]\n"
                    f"  resolution: [752, 480]\n  T_cam_imu: {shifted(-x)}\n  rostopic: /cam{number}/image_raw\n{more}")

        chain = (camera(0, 0, "  timeshift_cam_imu: 0.0019\n") +
                 camera(1, 0.1, f"  timeshift_cam_imu: 0.0269\n  T_cn_cnm1: {shifted(-0.1)}\n") +
                 camera(3, 0.3, f"  T_cn_cnm1: {shifted(-0.1)}\n"))
        rig, _ = self.import_rig("kalibr", self.write("chain.yaml", chain))
        self.assertEqual([c["name"] for c in rig["cameras"]], ["cam0", "cam1", "cam3"])
        self.assertEqual([c.get("time_offset", 0) for c in rig["cameras"]], [0.0019, 0.0269, 0])
        self.assertAlmostEqual(rig["cameras"][2]["position"][0], 0.3)
        gone = chain.replace(f"  T_cam_imu: {shifted(-0.3)}\n", "")
        self.assert_mentions(self.refused("kalibr", self.write("gone.yaml", gone)), "cam3.T_cn_cnm1", "cam2")
        _, said = self.import_rig("kalibr", self.write("more.yaml", chain + "imu0: {rate: 200}\n"))
        self.assert_mentions(said, "note:", "not read", "imu0")

    # Numbers.

    def test_whole_numbers_may_be_floats(self):
        self.write("t.json", {"fl_x": 1375.5, "w": 1080.0, "h": 1920.0, "aabb_scale": 4, "frames": [
            {"file_path": "images/0001.jpg", "sharpness": 31.7, "transform_matrix": IDENTITY}]})
        rig, said = self.import_rig("nerf", "t.json")
        self.assertEqual((rig["cameras"][0]["width"], rig["cameras"][0]["height"]), (1080, 1920))
        self.assertNotIn("note:", said)
        self.write("m/cameras.txt", "1 PINHOLE 640.0 480.0 400 400 320 240\n")
        self.write("m/images.txt", "1 1 0 0 0 0 0 0 1 a.png\n\n")
        rig, _ = self.import_rig("colmap", "m")
        self.assertEqual(rig["cameras"][0]["width"], 640)
        # Also rig.json and views.json.
        for key in ("id", "width", "height"):
            rig["cameras"][0][key] = float(rig["cameras"][0][key])
        rig["cameras"][0]["controls"] = {"gain": 3}
        rig["version"] = 1.0
        rig["cameras"][0].pop("image", None)
        self.write("rig.json", rig)
        self.tool("lf-rig", "check", "rig.json")
        rig["cameras"][0]["width"] = 640.5
        self.write("rig.json", rig)
        self.assert_mentions(self.tool("lf-rig", "check", "rig.json", status=1), "cameras[0].width", "integer", "640.5")

    # Order and shape.

    def test_a_grid_of_unpadded_names(self):
        rig = self.film(("--grid", "4x4"))
        self.write_colmap(rig, [f"cam{i + 1}.png" for i in range(16)])
        self.tool("lf-rig", "import", "colmap", "m", "--out", "plain.json")
        self.tool("lf-rig", "import", "colmap", "m", "--grid", "4x4", "--out", "grid.json")
        self.assert_mentions(self.tool("lf-rig", "check", "grid.json"), "0 errors", "0 warnings")
        names = [c["name"] for c in json.loads((self.folder / "grid.json").read_text())["cameras"]]
        self.assertEqual(names, [f"cam{i + 1}" for i in range(16)])
        self.assertGreater(self.psnr("grid.json"), self.psnr("plain.json") - 0.5)
        # Swapped rows and columns are harmless, a wrong shape is an error.
        self.assert_mentions(self.refused("colmap", "m", "--grid", "2x8"), "order", "no grid", "2x8")

    def test_cameras_around_a_scene(self):
        self.tool("lf-rig", "new", "--inward", 12, "--rows", 2, "--pitch", 0.3, "--radius", 1.5, "--fov", 60, "--width",
                  120, "--height", 90, "--out", "ring.json")
        self.film(("--rig", "ring.json"))
        self.tool("lf-rig", "export", "nerf", "s/rig.json", "s/transforms.json")
        said = self.tool("lf-rig", "import", "nerf", "s/transforms.json", "--out", "s/back.json")
        self.assert_mentions(said, "cameras", "surround", "look at it")
        for rig in ("s/rig.json", "s/back.json"):
            self.assert_mentions(self.tool("lf-rig", "check", rig), "0 errors", "0 warnings")
        views = []
        for k, degrees in enumerate((15, 45, 105, 195)):
            a = math.radians(degrees)
            views.append({"name": f"v{degrees:03}", "time": 0.1 * k, "width": 120, "height": 90,
                          "position": [1.5 * math.sin(a), 0, 1.5 * (1 - math.cos(a))],
                          "orientation": [math.cos(a / 2), 0, -math.sin(a / 2), 0], "model": "SIMPLE_PINHOLE",
                          "params": [85, 59.5, 44.5], "focus_distance": 1.5})
        self.write("around.json", {"format": "lightfield-views", "version": 1, "views": views})
        covered = []
        for rig in ("s/rig.json", "s/back.json"):
            self.tool("lf-render", "--rig", rig, "--views", "around.json", "--focus", "plane", "--out", "o", "--json",
                      "o.json")
            covered.append([v["coverage"] for v in json.loads((self.folder / "o.json").read_text())["views"]])
        for ring, back in zip(*covered):
            self.assertGreater(ring, 0.7)
            self.assertGreater(back, ring - 0.02)
        # A mesh across the middle is reported.
        rig = json.loads((self.folder / "s/back.json").read_text())
        rig["topology"] = {"type": "delaunay"}
        self.write("s/flat.json", rig)
        self.assert_mentions(self.tool("lf-rig", "check", "s/flat.json"), "not through", "triangles")

    # Five rigs of a user: the image equals the image of the original rig, or the error has a remedy.

    def test_formats_render_the_same_picture(self):
        rig = self.film()
        ours = self.psnr("s/rig.json")
        self.assertGreater(ours, 25)
        cameras, (f, cx, cy, k1, k2) = rig["cameras"], rig["cameras"][0]["params"]
        size = cameras[0]["width"], cameras[0]["height"]
        self.write_colmap(rig, [c["image"] for c in cameras])
        flip = [[1, 0, 0], [0, -1, 0], [0, 0, -1]]
        frames = []
        for c in cameras:
            x, y, z = c["position"]
            # nerfstudio rotates the world by (x, y, z) -> (x, z, -y).
            frames.append({"file_path": "s/" + c["image"], "colmap_im_id": c["id"] + 1, "transform_matrix": [
                [*flip[0], x], [*flip[2], z], [*[-v for v in flip[1]], -y], [0, 0, 0, 1]]})
        self.write("transforms.json", {
            "camera_model": "OPENCV", "w": size[0], "h": float(size[1]), "fl_x": f, "fl_y": f, "cx": cx + .5, "cy": cy + .5,
            "k1": k1, "k2": k2, "p1": 0, "p2": 0, "k3": 0, "k4": 0, "ply_file_path": "sparse_pc.ply",
            "applied_transform": [[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0]], "frames": frames})
        chain, opencv = "", "%YAML:1.0\n---\ncameras:\n"
        for i, c in enumerate(cameras):
            name = pathlib.Path(c["image"]).stem
            step = [-(a - b) for a, b in zip(c["position"], cameras[i - 1]["position"])] if i else [-v for v in c["position"]]
            motion = [[1, 0, 0, step[0]], [0, 1, 0, step[1]], [0, 0, 1, step[2]], [0, 0, 0, 1]]
            chain += (f"cam{i}:\n  camera_model: pinhole\n  intrinsics: [{f}, {f}, {cx}, {cy}]\n  distortion_model: radtan\n"
                      f"  distortion_coeffs: [{k1}, {k2}, 0, 0]\n  resolution: [{size[0]}, {size[1]}]\n"
                      f"  rostopic: /{name}/image_raw\n  {'T_cn_cnm1' if i else 'T_cam_imu'}: {motion}\n")
            place = [-v for v in c["position"]]
            opencv += (f"   - name: {name}\n     image: s/{c['image']}\n     image_width: {size[0]}\n     image_height: "
                       f"{size[1]}\n     camera_matrix: {{rows: 3, cols: 3, data: [{f}, 0, {cx}, 0, {f}, {cy}, 0, 0, 1]}}\n"
                       f"     distortion_coefficients: {{rows: 5, cols: 1, data: [{k1}, {k2}, 0, 0, 0]}}\n"
                       f"     R: {{rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}}\n"
                       f"     T: {{rows: 3, cols: 1, data: {place}}}\n")
        self.write("chain.yaml", chain)
        self.write("cameras.yaml", opencv)
        for kind, place in (("colmap", "m"), ("nerf", "transforms.json"), ("kalibr", "chain.yaml"), ("opencv", "cameras.yaml")):
            with self.subTest(kind=kind):
                found, _ = self.import_rig(kind, place)
                if kind == "kalibr":  # the format has no file names
                    for camera, own in zip(found["cameras"], cameras):
                        camera["image"] = "s/" + own["image"]
                    self.write("rig.json", found)
                self.assert_mentions(self.tool("lf-rig", "check", "rig.json"), "0 errors", "0 warnings")
                self.assertAlmostEqual(self.psnr("rig.json"), ours, delta=0.5)

    def test_opencv_stereo(self):
        matrix = "{rows: 3, cols: 3, data: [400, 0, 320, 0, 400, 240, 0, 0, 1]}"
        lenses = f"%YAML:1.0\n---\nM1: {matrix}\nD1: {{rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}}\nM2: {matrix}\n"
        self.write("intrinsics.yml", lenses)
        self.assert_mentions(self.refused("opencv", "intrinsics.yml"), "image_width", "image_height")
        self.write("intrinsics.yml", lenses + "image_width: 640\nimage_height: 480\n")
        self.assert_mentions(self.refused("opencv", "intrinsics.yml"), "R and T", "second camera", "missing")
        self.write("extrinsics.yml", "%YAML:1.0\n---\nR: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}\n"
                   "T: {rows: 3, cols: 1, data: [-0.12, 0, 0]}\n")
        rig, said = self.import_rig("opencv", "intrinsics.yml")
        self.assertEqual([c["position"][0] for c in rig["cameras"]], [0, 0.12])
        self.assert_mentions(said, "note:", "R and T", "extrinsics.yml")

    def test_folder_of_pictures_only(self):
        for i in range(3):
            self.write(f"photos/IMG_{i}.jpg", "x")
        self.assert_mentions(self.refused("colmap", "photos"), "pictures", "positions", "COLMAP")
        self.assert_mentions(self.refused("stanford", "photos"), "positions", "COLMAP")
        self.write("model/cameras.bin", "x")
        self.assert_mentions(self.refused("colmap", "model"), "model/cameras.bin", "truncated")


if __name__ == "__main__":
    unittest.main(verbosity=2)
