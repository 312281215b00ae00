#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Live views must continue when all hosts' clocks are set. libfaketime sets the time of a camera host and a viewer.

Sets the clock forward by 600 s, back, and back by an hour. After each step, complete frames must arrive again within
15 s, and each side must log the step once.

    clock_step.py BUILD_ROOT
"""
import json
import os
import pathlib
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time

BUILD = pathlib.Path(sys.argv[1]).resolve()
STEPS = ("+600", "+0", "-3600")
PATIENCE_S, START_S, WHOLE = 15, 60, 8
SKIP = 77


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def rig():
    """Returns a rig of four cameras in a square, looking along z."""
    source = "videotestsrc is-live=true ! video/x-raw,format=I420,width=160,height=120,framerate=10/1"
    cameras = [
        {"id": i, "name": f"cam{i}", "width": 160, "height": 120, "model": "SIMPLE_PINHOLE", "params": [140, 79.5, 59.5],
         "position": [0.1 * (i % 2), 0.1 * (i // 2), 0], "orientation": [1, 0, 0, 0], "source": source}
        for i in range(4)]
    return {"format": "lightfield-rig", "version": 1, "topology": {"type": "delaunay"}, "cameras": cameras}


class Program:
    """A gst-launch-1.0 with its output lines."""

    def __init__(self, arguments, env):
        self.whole, self.warnings, self.lines = 0, [], []
        self.process = subprocess.Popen(["gst-launch-1.0", "-m", *arguments], stdout=subprocess.PIPE,
                                        stderr=subprocess.STDOUT, text=True, env=env, start_new_session=True)
        self.reader = threading.Thread(target=self.read, daemon=True)
        self.reader.start()

    def read(self):
        for line in self.process.stdout:
            if "lightfield-view," in line:
                missing, complete = (re.search(name + r"=\(\w+\)(\w+)", line)[1] for name in ("missing", "complete"))
                self.whole += missing == "0" and complete == "true"
                continue
            self.lines.append(line.rstrip())
            if re.match(r"WARNING|ERROR", line):
                self.warnings.append(line.rstrip())

    def end(self):
        os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()


def more_whole_pictures(viewer, seconds):
    before, end = viewer.whole, time.monotonic() + seconds
    while time.monotonic() < end:
        if viewer.whole >= before + WHOLE:
            return True
        time.sleep(0.1)
    return False


def main():
    libraries = sorted(pathlib.Path("/usr/lib").glob("*/faketime/libfaketimeMT.so.1"))
    if not libraries:
        print("libfaketime is not installed: tools/setup.sh --tests")
        return SKIP
    with tempfile.TemporaryDirectory() as folder:
        clock, rig_path = pathlib.Path(folder, "clock"), pathlib.Path(folder, "rig.json")
        rig_path.write_text(json.dumps(rig()))
        clock.write_text("+0")
        env = dict(os.environ, LD_PRELOAD=str(libraries[0]), FAKETIME_TIMESTAMP_FILE=str(clock), FAKETIME_NO_CACHE="1",
                   FAKETIME_DONT_FAKE_MONOTONIC="1", DONT_FAKE_MONOTONIC="1", GST_PLUGIN_PATH=str(BUILD / "gst"),
                   GST_DEBUG_NO_COLOR="1")
        requests, answers = free_port(), free_port()
        # No explicit choice of clock, as in normal operation.
        node = Program(["lfnodesink", f"rig={rig_path}", "node=0", f"listen=127.0.0.1:{requests}",
                        f"answers=127.0.0.1:{answers}"], env)
        viewer = Program(["lfviewsrc", f"rig={rig_path}", f"nodes=127.0.0.1:{requests}:{answers}", "post-messages=true",
                          "framerate=10/1", "width=320", "height=240", "!", "fakesink", "sync=false"], env)
        programs, wrong = {"viewer": viewer, "node": node}, []
        try:
            if not more_whole_pictures(viewer, START_S):
                print("\n".join(["no pictures before the clock is set", *viewer.lines[-20:], *node.lines[-20:]]))
                return 1
            for step in STEPS:
                told = {name: len(program.warnings) for name, program in programs.items()}
                clock.write_text(step)
                if not more_whole_pictures(viewer, PATIENCE_S):
                    wrong.append(f"clock {step}: no whole pictures within {PATIENCE_S} s")
                for name, program in programs.items():
                    if program.process.poll() is not None:
                        wrong.append(f"clock {step}: the {name} ended")
                    of_clock = [line for line in program.warnings[told[name]:] if "machine was set" in line]
                    if len(of_clock) != 1:
                        wrong.append(f"clock {step}: the {name} tells of the step {len(of_clock)} times")
        finally:
            for program in programs.values():
                program.end()
        for name, program in programs.items():
            wrong and print(f"{name}:", *program.warnings[-10:], sep="\n  ")
        print(*(wrong or ["live pictures go on"]), sep="\n")
        return 1 if wrong else 0


sys.exit(main())
