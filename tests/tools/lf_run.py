#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""lf-run runs a camera host and a compositor: their metrics, and their reports to systemd (a datagram socket).

    lf_run.py BUILD_ROOT
"""
import atexit
import json
import os
import pathlib
import queue
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import urllib.error
import urllib.request

BUILD = pathlib.Path(sys.argv[1]).resolve()
ENVIRONMENT = {**os.environ, "GST_PLUGIN_PATH": f"{BUILD}/gst", "GST_REGISTRY": f"{BUILD}/gst/test-registry.bin",
               "G_DEBUG": "fatal-criticals"}


def free_port(kind=socket.SOCK_STREAM):
    with socket.socket(socket.AF_INET, kind) as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def start(*words, **more):
    program = subprocess.Popen([f"{BUILD}/tools/lf-run", *words], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                               text=True, env={**ENVIRONMENT, **more})
    atexit.register(program.kill)
    return program


def get(port, path="metrics"):
    return urllib.request.urlopen(f"http://127.0.0.1:{port}/{path}", timeout=10).read().decode()


def metric(port, name):
    found = re.search(rf"^lightfield_{re.escape(name)} (\S+)$", get(port), re.M)
    assert found, f"{name}:\n{get(port)}"
    return float(found[1])


def until(condition, what, seconds=90):
    end = time.monotonic() + seconds
    while True:
        try:
            if condition():
                return
        except OSError:  # the program does not listen yet
            pass
        assert time.monotonic() < end, f"never: {what}"
        time.sleep(0.1)


def write_rig(folder):
    """A rig without sources: the cameras show the built-in scene."""
    cameras = [{"id": i, "name": f"cam{i}", "width": 160, "height": 120, "model": "RADIAL",
                "params": [200, 79.5, 59.5, 0, 0], "position": [0.1 * (i % 2), 0.1 * (i // 2), 0], "orientation": [1, 0, 0, 0]} for i in range(4)]
    path = pathlib.Path(folder, "rig.json")
    path.write_text(json.dumps({"format": "lightfield-rig", "version": 1, "cameras": cameras,
                                "topology": {"type": "grid", "rows": 2, "columns": 2}}))
    return path


def check_failures():
    for words, message in ((["--metrics", "1,2", "fakesrc"], "must be PORT or ADDRESS:PORT"),
                           (["no-such-element"], "no-such-element"), (["fakesrc", "!", "fakesink", "no-such=1"], "no-such"),
                           (["filesrc", "location=/none", "!", "fakesink"], "Resource not found")):
        program = start(*words)
        text = program.communicate(timeout=60)[0]
        assert program.returncode not in (0, -signal.SIGABRT) and message in text, (words, program.returncode, text)
    assert start("fakesrc", "num-buffers=2", "!", "fakesink").wait(60) == 0, "the end of the stream is no error"


def check(folder):
    rig, key = write_rig(folder), pathlib.Path(folder, "key")
    key.touch(0o600)
    key.write_text("0123456789abcdef" * 4)
    notifications = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    notifications.bind(f"{folder}/notify")
    states = queue.Queue()  # lf-run waits if the buffer of the socket is full

    def read():
        while True:
            states.put(notifications.recv(256).decode())
    threading.Thread(target=read, daemon=True).start()

    def receives(state):
        while states.get(timeout=60) != state:
            pass

    ports = [free_port(), free_port()]
    requests, answers = free_port(socket.SOCK_DGRAM), free_port(socket.SOCK_DGRAM)
    node = start("--metrics", str(ports[0]), "lfnodesink", f"rig={rig}", f"key-file={key}", f"listen=127.0.0.1:{requests}",
                 f"answers=127.0.0.1:{answers}", NOTIFY_SOCKET=f"{folder}/notify", WATCHDOG_USEC="200000")
    compositor = start("--metrics", f"127.0.0.1:{ports[1]}", "lfviewsrc", f"rig={rig}", f"key-file={key}",
                       f"nodes=127.0.0.1:{requests}:127.0.0.1:{answers}", "framerate=10/1", "width=160", "height=120", "!",
                       "fakesink")
    try:
        for state in "READY=1", "WATCHDOG=1", "WATCHDOG=1":
            receives(state)
        until(lambda: get(ports[0], "healthz") == get(ports[1], "readyz") == "ok\n", "both run")
        until(lambda: metric(ports[1], "pictures_total") > 20, "pictures are composed")
        for name in ("requests_total", "answers_total", "answer_bytes_total", "answer_seconds_count", "sent_bytes_total",
                     "accepted_packets_total"):
            assert metric(ports[0], name) > 0, name
        for name in "skew_seconds_count", "picture_latency_seconds_count", "composed_bytes_total", "received_bytes_total":
            assert metric(ports[1], name) > 0, name
        assert metric(ports[0], 'dropped_packets_total{reason="forged"}') == 0
        assert metric(ports[0], "cameras") == metric(ports[0], "cameras_working") == 4
        for camera in range(4):
            assert metric(ports[0], f'camera_up{{camera="{camera}"}}') == 1
            assert metric(ports[0], f'camera_frame_age_seconds{{camera="{camera}"}}') < 60
        for path, status in ("", 404), ("whep", 404):
            try:
                get(ports[0], path)
                raise AssertionError(path)
            except urllib.error.HTTPError as error:
                assert error.code == status, error
        stranger = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        stranger.sendto(b"\x80" * 100, ("127.0.0.1", requests))
        until(lambda: sum(map(float, re.findall(r"^lightfield_dropped_packets_total.* (\S+)", get(ports[0]), re.M))) == 1,
              "a stranger's packet is counted")
        print("# " + " ".join(line for line in get(ports[0]).splitlines() if "answer_seconds_" in line or "max" in line))
    finally:
        outputs = []
        for program in node, compositor:
            program.terminate()
            outputs.append(program.communicate(timeout=60)[0])
    assert node.returncode == compositor.returncode == 0, outputs
    receives("STOPPING=1")


def main():
    check_failures()
    for test in (check,):
        with tempfile.TemporaryDirectory() as folder:
            test(folder)
    print("ok")


main()
