#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Tests the Python modules; needs their folder in PYTHONPATH:
python_test.py CALIBRATE, the program of examples/calibrate.cc."""
import json
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from pathlib import Path

import lightfield as lf
import lightfield_calibration as lfc
import numpy as np

CALIBRATE = sys.argv.pop(1)
WIDTH, HEIGHT, SIDE, FOCAL, PITCH = 64, 48, 3, 60.0, 0.06


def make_rig():
    lens = lf.Lens(fx=FOCAL, fy=FOCAL, cx=(WIDTH - 1) / 2, cy=(HEIGHT - 1) / 2)
    cameras = [lf.Camera(id=i, width=WIDTH, height=HEIGHT, lens=lens,
                         position=(PITCH * (i % SIDE), PITCH * (i // SIDE), 0))
               for i in range(SIDE * SIDE)]
    return lf.Rig(cameras, lf.Topology.GRID, SIDE, SIDE)


def make_images(seed=1):
    return list(np.random.default_rng(seed).integers(0, 256, (SIDE * SIDE, HEIGHT, WIDTH, 3), np.uint8))


class Images(unittest.TestCase):
    def setUp(self):
        self.rig, self.images = make_rig(), make_images()
        self.view = lf.home_view(self.rig, 80, 60)
        self.renderer = lf.Renderer(self.rig)
        self.expected = self.renderer.render(self.view, self.images)

    def refused(self, text, images=None, **options):
        with self.assertRaisesRegex(lf.Error, text):
            self.renderer.render(self.view, images or self.images, **options)

    def test_memory_is_shared(self):
        padded = np.zeros((HEIGHT, WIDTH + 7, 3), np.uint8)[:, :WIDTH]
        padded[:] = self.images[4]
        out = np.full((60, 100, 3), 7, np.uint8)
        images = self.images[:4] + [padded] + self.images[5:]
        self.assertIs(self.renderer.render(self.view, images, out=out[:, :80]).base, out)
        np.testing.assert_array_equal(out[:, :80], self.expected)
        self.assertTrue((out[:, 80:] == 7).all())
        self.assertFalse(self.expected.flags.owndata)  # the array owns the memory of the library's image
        self.assertTrue(self.expected.flags.writeable)

    def test_planes(self):
        def planes(seed):
            random = np.random.default_rng(seed)
            return tuple(random.integers(0, 256, shape, np.uint8) for shape in [(48, 64), (24, 32), (24, 32)])
        images = [planes(i) for i in range(len(self.rig))]
        y, cb, cr = self.renderer.render(self.view, images)
        self.assertEqual([p.shape for p in (y, cb, cr)], [(60, 80), (30, 40), (30, 40)])
        out = tuple(np.zeros_like(plane) for plane in (y, cb, cr))
        self.renderer.render(self.view, images, out=out)
        for a, b in zip(out, (y, cb, cr)):
            np.testing.assert_array_equal(a, b)
        self.refused("out: is RGB", images, out=np.zeros((60, 80, 3), np.uint8))
        self.refused("tuple must have", images[:8] + [(y, cb)])
        self.refused("half the width", images[:8] + [(y, y, y)])

    def test_errors(self):
        self.assertTrue(issubclass(lf.Error, ValueError))
        whole = self.images
        for text, image in [("uint8", whole[0].astype(float)), ("shape", whole[0][:, :, :2]), ("uint8", "no"),
                            ("adjacent", whole[0][:, ::-1]), ("adjacent", np.asfortranarray(whole[0])),
                            ("camera 0 .*63x48", whole[0][:, 1:])]:
            self.refused(text, [image] + whole[1:])
        out = np.zeros((60, 80, 3), np.uint8)
        out.flags.writeable = False
        self.refused("writeable", out=out)
        self.refused("out: has 80x59 pixels", out=np.zeros((59, 80, 3), np.uint8))
        self.refused("9 cameras", whole[1:])
        with self.assertRaisesRegex(lf.Error, "none.json"):
            lf.load_rig("none.json")
        with self.assertRaisesRegex(TypeError, "no attribute widht"):
            lf.View(widht=3)

    def test_nodes_and_compositor_make_the_same_picture(self):
        nodes = [(lf.Node(self.rig, range(begin, 9, 2)), self.images[begin::2]) for begin in (0, 1)]
        compositor = lf.Compositor(self.rig, 3)
        renderer = lf.Renderer(self.rig)
        for focus in [lf.Focus.PLANE] + 3 * [lf.Focus.AUTO]:
            request = compositor.request(self.view, quality=0, focus=focus, time=5)
            self.assertEqual(lf.read_request(request)[::2], (3, 5))
            for node, frames in nodes:
                self.assertFalse(compositor.is_complete)
                for part in node.answer(request, frames):
                    self.assertEqual(compositor.add(part), "")
            self.assertTrue(compositor.is_complete)
            np.testing.assert_array_equal(compositor.finish(), renderer.render(self.view, self.images, focus=focus))
        self.assertIn("call request() first", compositor.add(b"x"))
        with self.assertRaisesRegex(lf.Error, "not a request"):
            nodes[0][0].answer(b"x", nodes[0][1])

    def test_other_threads_run_during_a_call(self):
        count, stop = 0, False

        def work():
            nonlocal count
            while not stop:
                count += 1
                time.sleep(0)
        before_interval = sys.getswitchinterval()
        sys.setswitchinterval(1000)  # a thread only runs if another thread releases the lock of the interpreter
        thread = threading.Thread(target=work)
        thread.start()
        try:
            for _ in range(2000):
                before = count
                self.renderer.render(self.view, self.images)
                if count > before:
                    break
        finally:
            stop = True
            sys.setswitchinterval(before_interval)
            thread.join()
        self.assertGreater(count, before)

    def test_threads_share_a_renderer(self):
        pictures = [None] * 4

        def work(i):
            pictures[i] = self.renderer.render(self.view, self.images)
        threads = [threading.Thread(target=work, args=[i]) for i in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        for picture in pictures:
            np.testing.assert_array_equal(picture, self.expected)


class Calibration(unittest.TestCase):
    def test_equals_the_program_in_cpp(self):
        random = np.random.default_rng(3)
        focal, width, height = 420.0, 320, 240
        eyes = [(PITCH * (i % 3), PITCH * (i // 3), 0) + random.uniform(-0.005, 0.005, 3) for i in range(9)]
        rows = []
        for place in range(80):
            z = random.uniform(0.8, 3)
            point = np.array([PITCH + random.uniform(-0.3, 0.3) * z, PITCH + random.uniform(-0.22, 0.22) * z, z])
            for camera, eye in enumerate(eyes):
                x, y = (focal * (point - eye)[:2] / (point - eye)[2] + [(width - 1) / 2, (height - 1) / 2]
                        + random.normal(0, 0.2, 2))
                if 0 < x < width - 1 and 0 < y < height - 1:
                    rows.append([camera, place, 0, x, y])
        tracks = {"format": "lightfield-tracks", "version": 1,
                  "cameras": [{"id": i, "width": width, "height": height} for i in range(9)],
                  "positions": [{"observations": [[r[0], r[3], r[4]] for r in rows if r[1] == place]}
                                for place in range(80)]}
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder)
            (path / "tracks.json").write_text(json.dumps(tracks))
            subprocess.run([CALIBRATE, path / "tracks.json", path / "cpp.json"], check=True, capture_output=True)
            steps = []
            found = lfc.calibrate_rig(lfc.load_tracks(str(path / "tracks.json")), progress=steps.append)
            expected = lf.load_rig(str(path / "cpp.json"))
        self.assertGreater(len(steps), 1)
        same = lfc.calibrate_rig(lfc.Tracks([(i, width, height) for i in range(9)], np.array(rows))).rig
        for rig in found.rig, same:
            self.assertEqual(len(rig), 9)
            for i in range(9):
                a, b = rig.camera(i), expected.camera(i)
                # The solver adds up in several threads, so that no two runs have the same bits.
                np.testing.assert_allclose(a.position, b.position, atol=1e-7)
                np.testing.assert_allclose(a.orientation, b.orientation, atol=1e-7)
                np.testing.assert_allclose((a.lens.fx, a.lens.cx), (b.lens.fx, b.lens.cx), atol=1e-4)
        covariance = found.covariances[0]
        self.assertEqual(covariance.matrix.shape, 2 * (len(covariance.parameters),))

    def test_exceptions_reach_the_caller(self):
        tracks = lfc.Tracks([(0, 64, 48)], np.zeros((1, 5)))
        with self.assertRaises(lf.Error):
            lfc.calibrate_rig(tracks)
        with self.assertRaisesRegex(lf.Error, "integers"):
            lfc.Tracks([(0, 64, 48)], np.full((1, 5), -1))
        with self.assertRaisesRegex(lf.Error, "shape"):
            lfc.Tracks([(0, 64, 48)], np.zeros((1, 3)))


if __name__ == "__main__":
    unittest.main()
