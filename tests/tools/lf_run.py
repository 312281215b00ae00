#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""lf-run runs a camera host and a compositor: their metrics, and their reports to systemd (a datagram socket). Then it runs
the configuration that lf-rig deploy makes from an inventory.

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
        until(lambda: get(ports[0], "readyz") == get(ports[1], "readyz") == "ok\n", "both run")
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


def inventory(**changes):
    return {"format": "lightfield-inventory", "version": 1, "rig": "rig.json", "key": "key",
            "cameras": [{"name": "cam0", "address": "127.0.1.1", "cameras": "0-1"},
                        {"name": "cam1", "address": "127.0.1.2", "cameras": "2,3", "options": "mtu=1400"}],
            "servers": [{"name": name, "address": f"127.0.1.{i + 3}", "options": "--viewers 8"}
                        for i, name in enumerate(["r1", "2r"])],
            "compositors": [{"name": "wall", "address": "127.0.1.5", "options": "width=160 height=120 framerate=10/1",
                             "output": "fakesink"}],
            "proxy": {"address": "127.0.1.6", "host": "example.org", "template": "haproxy.cfg"}, **changes}


def deploy(folder, made):
    made = {key: value for key, value in made.items() if value is not None}
    pathlib.Path(folder, "inventory.json").write_text(json.dumps(made))
    return subprocess.run([f"{BUILD}/tools/lf-rig", "deploy", "inventory.json", "--out", "out"], cwd=folder, text=True,
                          capture_output=True, env=ENVIRONMENT, umask=0o077)


def check_deploy(folder):
    write_rig(folder)
    key, out = pathlib.Path(folder, "key"), pathlib.Path(folder, "out")
    key.touch(0o600)
    key.write_text("0123456789abcdef" * 4)
    template = pathlib.Path(__file__).resolve().parents[2] / "pipelines/haproxy/haproxy.cfg"
    pathlib.Path(folder, "haproxy.cfg").write_text(template.read_text())
    two = inventory()["cameras"]
    for changes, message in (({"cameras": two[:1]}, "camera 2 belongs to no host"),
                             ({"cameras": [two[0], {**two[1], "cameras": "1-3"}]}, "1 belongs to cam0 and to cam1"),
                             ({"cameras": [two[0], {**two[1], "name": "cam0"}]}, "cameras[1].name"),
                             ({"cameras": [two[0], {**two[1], "name": "a b"}]}, "must match"),
                             ({"cameras": []}, "no camera hosts"), ({"servers": [], "compositors": []}, "no hosts"),
                             ({"servers": []}, "there are no servers"),
                             ({"servers": inventory()["servers"][:1], "proxy": None}, "--listen"),
                             ({"compositors": [{"name": "wall", "address": "10.0.0.1"}]}, "output"),
                             ({"key": "none"}, "none"), ({"version": 2}, "version")):
        failed = deploy(folder, inventory(**changes))
        assert failed.returncode == 1 and message in failed.stderr, (changes, failed)
    for _ in range(2):  # the second time replaces the files
        made = deploy(folder, inventory())
        assert made.returncode == 0, made
    assert made.stdout.splitlines() == ["cam0: lightfield-camera@cam0", "cam1: lightfield-camera@cam1",
                                        "r1: lightfield-serve", "2r: lightfield-serve",
                                        "wall: lightfield-compositor@wall", "proxy: haproxy"], made
    for host in "cam0", "cam1", "r1", "2r", "wall":
        copy = out / host / "etc/lightfield/secrets/key"
        assert copy.read_text() == key.read_text() and copy.stat().st_mode & 0o777 == 0o600, host
        modes = [place.stat().st_mode & 0o777 for place in (copy.parent, copy.parents[1], copy.parents[1] / "rig.json")]
        assert modes == [0o700, 0o755, 0o644], (host, modes)
    assert out.stat().st_mode & 0o777 == 0o700
    proxy = (out / "proxy/etc/haproxy/haproxy.cfg").read_text()
    assert re.findall(r"  server (.*)", proxy) == ["r1 127.0.1.3:8080", "2r 127.0.1.4:8080",
                                                   "r1 127.0.1.3:8080 track views/r1", "2r 127.0.1.4:8080 track views/2r"]
    targets = json.loads((out / "prometheus-targets.json").read_text())
    assert [group["targets"] for group in targets] == [["127.0.1.3:8080", "127.0.1.4:8080"],
                                                       ["127.0.1.1:9110", "127.0.1.2:9110", "127.0.1.5:9120"]]

    def words(host, file, variable):
        folder = str(out / host / "etc/lightfield")
        text = pathlib.Path(folder, file).read_text().replace("/etc/lightfield", folder)
        return re.search(rf"^{variable}=(.*)", text, re.M)[1].split()

    serve = words("r1", "serve.conf", "LIGHTFIELD_OPTIONS")
    assert serve[2:4] == ["--nodes", "127.0.1.1:6000:127.0.1.3:6100,127.0.1.2:6000:127.0.1.3:6101"], serve
    assert serve[-2:] == ["--viewers", "8"], serve
    programs = [start("--metrics", *words(host, file, "LIGHTFIELD_METRICS"), element, f"key-file={key}",
                      *words(host, file, variable))
                for host, file, element, variable in (
                    ("cam0", "camera-cam0.conf", "lfnodesink", "LIGHTFIELD_OPTIONS"),
                    ("cam1", "camera-cam1.conf", "lfnodesink", "LIGHTFIELD_OPTIONS"),
                    ("wall", "compositor-wall.conf", "lfviewsrc", "LIGHTFIELD_PIPELINE"))]
    try:
        def complete():
            url = "http://127.0.1.5:9120/metrics"
            text = urllib.request.urlopen(url, timeout=10).read().decode()
            composed, incomplete = (float(re.search(rf"^lightfield_{name} (.*)", text, re.M)[1])
                                    for name in ("pictures_total", "incomplete_pictures_total"))
            return composed - incomplete > 10
        until(complete, "the compositor of the inventory makes complete pictures")
    finally:
        for program in programs:
            program.terminate()
            output = program.communicate(timeout=60)[0]
            assert program.returncode == 0, output


def main():
    check_failures()
    for test in check, check_deploy:
        with tempfile.TemporaryDirectory() as folder:
            test(folder)
    print("ok")


main()
