#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Options without an effect in combination with other options, or with an invalid value, must cause an error.

    unused_options.py BUILD_ROOT [unittest arguments]
"""
import contextlib
import http.server
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import threading
import unittest

BUILD = pathlib.Path(sys.argv.pop(1)).resolve()
os.environ["GST_PLUGIN_PATH"] = str(BUILD / "gst")

# Program, arguments, text of the error. The files need not exist: command lines are checked first.
REFUSED = [
    ("lf-calibrate", "all r.json --lights l --page 8090", "--record"),
    ("lf-calibrate", "all r.json --lights l --charuco 5X5_100", "--boards"),
    ("lf-calibrate", "all r.json --lights l --board 9x6", "--boards"),
    ("lf-calibrate", "features r.json --out o --features -1", "--features"),
    ("lf-calibrate", "features r.json --out o --features 0", "--features"),
    ("lf-calibrate", "features r.json --out o --references -3", "--references"),
    ("lf-calibrate", "features r.json --out o --least-cameras 0", "--least-cameras"),
    ("lf-calibrate", "intrinsics a.png --board 9x6 --marker 0.7 --out o", "--charuco"),
    ("lf-calibrate", "intrinsics a.png --board 9x6 --charuco 5X5_100 --marker 7 --out o", "--marker"),
    ("lf-calibrate", "intrinsics a.png --board 9x6 --views 9 --out o", "--views"),
    ("lf-calibrate", "solve --tracks t.json --out o --bar 0.3 --pitch 0.1", "--pitch"),
    ("lf-calibrate", "solve --tracks t.json --out o --distance 1,2,0.3 --pitch 0.1", "--pitch"),
    ("lf-calibrate", "solve --tracks t.json --out o --distance 1,2,nan", "--distance"),
    ("lf-calibrate", "solve --tracks t.json --out o --first-pixel 1", "--first-pixel"),
    ("lf-render", "--rig r.json --leave-one-out --out o --gains on", "--gains"),
    ("lf-render", "--rig r.json --leave-one-out --out o --truth t", "--truth"),
    ("lf-render", "--rig r.json --views v.json --out o --focus-distance 2", "--leave-one-out"),
    ("lf-render", "--rig r.json --views v.json --out o --focus plane --gains on", "--gains"),
    ("lf-render", "--rig r.json --views v.json --out o --focus plane --focus-near 1", "--focus-near"),
    ("lf-render", "--rig r.json --views v.json --out o --focus plane --focus-far 1", "--focus-far"),
    ("lf-render", "--rig r.json --views v.json --out o --focus-near -1", "--focus-near"),
    ("lf-rig", "new --grid 2x2 --rows 3 --pitch 1 --fov 60 --out o", "--rows"),
    ("lf-rig", "new --arc 4 --rows 3 --pitch 1 --radius 3 --fov 60 --out o", "--rows"),
    ("lf-rig", "new --grid 2x2 --radius 3 --pitch 1 --fov 60 --out o", "--radius"),
    ("lf-scene", "--out a chart --rig r.json --out o", "--out"),
    ("lf-scene", "--frames 3 lights --rig r.json --out o", "--frames"),
    ("lf-scene", "--out o --format png --quality 50", "--quality"),
    ("lf-show", "contributions --rig r.json --out o.png --framerate 30", "--framerate"),
]


class UnusedOptions(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        camera = {"width": 64, "height": 48, "model": "SIMPLE_PINHOLE", "params": [60, 31.5, 23.5], "orientation": [1, 0, 0, 0]}
        cameras = [{"id": i, "name": f"cam{i}", **camera, "position": [0.1 * (i % 3), 0.1 * (i // 3), 0]} for i in range(9)]
        self.write("r.json", {"format": "lightfield-rig", "version": 1, "cameras": cameras,
                              "topology": {"type": "grid", "rows": 3, "columns": 3}})
        self.write("t.json", {"format": "lightfield-tracks", "version": 1, "bar": False,
                              "cameras": [{"id": 0, "width": 64, "height": 48}], "positions": []})
        self.monitor = [{"name": f"cam{i}", "psnr": 30, "gain": 1, "shift": 0.02, "fault": None} for i in range(9)]

    def write(self, name, value):
        (self.folder / name).write_text(value if isinstance(value, str) else json.dumps(value))

    def run_tool(self, name, arguments):
        folder = "calib" if name == "lf-calibrate" else "tools"
        done = subprocess.run([BUILD / folder / name, *arguments.split()], cwd=self.folder, text=True, timeout=120,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        return done.returncode, done.stdout

    def test_unused_options_are_refused_by_name(self):
        for name, arguments, option in REFUSED:
            with self.subTest(command=f"{name} {arguments}"):
                status, said = self.run_tool(name, arguments)
                self.assertEqual(status, 1, said)
                self.assertIn(option, said)
                self.assertFalse((self.folder / "o").exists())

    def test_check_exits_with_0_or_1_only(self):
        self.write("monitor.json", {"turns": 90, "cameras": self.monitor})
        self.assertEqual(self.run_tool("lf-calibrate", "check r.json --monitor monitor.json")[0], 0)
        moved = [dict(c) for c in self.monitor]
        moved[4].update(fault="direction", shift=3)
        self.write("moved.json", {"turns": 90, "cameras": moved})
        self.assertEqual(self.run_tool("lf-calibrate", "check r.json --monitor moved.json")[0], 1)

    def test_check_of_invalid_input_exits_with_2(self):
        def damaged(**changed):
            cameras = [dict(c) for c in self.monitor]
            cameras[2].update(changed)
            return {"turns": 90, "cameras": cameras}

        files = {
            "number.json": 7, "list.json": [1], "camera.json": {"cameras": [1] * 9}, "cameras.json": {"cameras": 7},
            "name.json": damaged(name=3), "shift.json": damaged(shift="far"), "gain.json": damaged(gain=[]),
            "fault.json": damaged(fault=5), "psnr.json": damaged(psnr={}),
            "turns.json": {"turns": "many", "cameras": self.monitor}, "cut.json": "{\"cameras\": [",
        }
        for name, value in files.items():
            self.write(name, value)
        commands = [f"check r.json --monitor {name}" for name in files]
        commands += ["check", "check r.json", "check r.json --monitor", "check r.json --nonsense",
                     "check r.json --tracks t.json --bar nan", "check r.json --tracks t.json --bar -1",
                     "check r.json --tracks t.json --token-file f", "check r.json --monitor number.json --bar 0.3",
                     "check none.json --tracks t.json", "check r.json --tracks number.json"]
        for command in commands:
            with self.subTest(command=command):
                status, said = self.run_tool("lf-calibrate", command)
                self.assertEqual(status, 2, said)
                self.assertTrue(said.startswith("lf-calibrate: "), said)
                self.assertNotIn("json.exception", said)
        status, said = self.run_tool("lf-calibrate", "report number.json")
        self.assertEqual((status, "json.exception" in said), (1, False), said)

    def test_check_reads_a_bounded_body_of_one_server(self):
        asked = []

        class Server(http.server.BaseHTTPRequestHandler):
            def do_GET(self):
                asked.append(self.path)
                self.send_response(302 if self.path.startswith("/moved") else 200)
                self.send_header("Location", "/elsewhere/monitor.json")
                self.end_headers()
                with contextlib.suppress(OSError):
                    while self.path.startswith("/endless"):
                        self.wfile.write(b" " * 65536)

            def log_message(self, *_):
                pass

        server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Server)
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, daemon=True).start()
        self.addCleanup(server.server_close)
        self.addCleanup(server.shutdown)
        for path, reason in [("endless", "has more than"), ("moved", "answers 302")]:
            status, said = self.run_tool(
                "lf-calibrate", f"check r.json --monitor http://127.0.0.1:{server.server_port}/{path}")
            self.assertEqual(status, 2, said)
            self.assertIn(reason, said)
        self.assertEqual(asked, ["/endless/monitor.json", "/moved/monitor.json"])


if __name__ == "__main__":
    unittest.main(verbosity=2)
