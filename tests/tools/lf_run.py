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
from xml.etree import ElementTree

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "soak"))
from hosts import free_port, until  # noqa: E402

BUILD = pathlib.Path(sys.argv[1]).resolve()
ENVIRONMENT = {**os.environ, "GST_PLUGIN_PATH": f"{BUILD}/gst", "GST_REGISTRY": f"{BUILD}/gst/test-registry.bin",
               "G_DEBUG": "fatal-criticals"}


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


class Service:
    """A program with the interface of systemd."""

    def __init__(self, folder, *words):
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(f"{folder}/notify-{time.monotonic_ns()}")
        self.socket.settimeout(60)
        self.program = start(*words, NOTIFY_SOCKET=self.socket.getsockname(), WATCHDOG_USEC="1000000")
        while self.socket.recv(256) != b"READY=1":
            pass

    def reports(self, seconds):
        """Counts the reports to the watchdog."""
        end, count = time.monotonic() + seconds, 0
        while (left := end - time.monotonic()) > 0:
            self.socket.settimeout(left)
            try:
                count += self.socket.recv(256) == b"WATCHDOG=1"
            except TimeoutError:
                break
        return count


def check_watchdog(folder):
    """A sink that does not return from its buffer, because a pipe is full; a sink that waits for a client; a node that sends
    no answers; a compositor that makes no pictures."""
    os.mkfifo(f"{folder}/pipe")
    pipe = os.open(f"{folder}/pipe", os.O_RDWR | os.O_NONBLOCK)
    service = Service(folder, "videotestsrc", "is-live=true", "!", "video/x-raw,width=320,height=240", "!", "queue",
                      "leaky=downstream", "!", "filesink", "buffer-mode=unbuffered", "async=false", "sync=false",
                      f"location={folder}/pipe")
    service.reports(2)
    assert service.reports(2) == 0, "the sink is blocked"
    reading = True

    def read():
        while reading:
            try:
                os.read(pipe, 1 << 20)
            except BlockingIOError:
                time.sleep(0.01)
    reader = threading.Thread(target=read)
    reader.start()
    service.reports(1)
    for _ in range(30):
        if service.reports(2) > 2:
            break
    else:
        raise AssertionError("the sink works again")
    service.program.terminate()
    output = service.program.communicate(timeout=60)[0]
    reading = False
    reader.join()
    os.close(pipe)
    lines = {"running", "warning: filesink0 does not return from a buffer", "works again"}
    assert set(output.splitlines()) == lines, output

    service = Service(folder, "videotestsrc", "is-live=true", "!", "queue", "leaky=downstream", "!",
                      "srtsink", f"uri=srt://127.0.0.1:{free_port(socket.SOCK_DGRAM)}?mode=listener", "async=false", "sync=false")
    service.reports(2)
    assert service.reports(2) > 2, "the sink only waits for a client"
    service.program.terminate()
    output = service.program.communicate(timeout=60)[0]
    assert "does not return" not in output, output

    rig = write_rig(folder)
    request, queue = ["lfviewrequest", f"rig={rig}", "is-live=true", "framerate=10/1"], ["queue", "leaky=downstream", "!"]
    node, stop = ["lfcameranode", "name=n", f"rig={rig}", "is-live=true", "!"], ["identity", "sleep-time=60000000", "!"]
    for words, problem in (
            ([*request, "!", *queue, "n.request", *node, *stop, "fakesink", "async=false"],
             "lffragment has input, but makes no answers"),
            ([*request, "!", "tee", "name=t", "!", *queue, "n.request", "t.", "!", *queue, "c.request", *node, "rtplfpay", "!",
              "rtplfdepay", "!", *queue, "c.sink_0", "lfcompositor", "name=c", f"rig={rig}", "!", *stop, "fakesink", "async=false"],
             "lfcompositor has input, but makes no pictures")):
        service = Service(folder, *words)
        service.reports(3)
        assert service.reports(2) == 0, problem
        service.program.kill()
        output = service.program.communicate(timeout=60)[0]
        assert f"warning: {problem}\n" in output, output


def check_reload(folder):
    """The units copy their key at the start and at a reload. systemd does not run here, so a shell runs their commands."""
    root = pathlib.Path(folder)
    for name in "credentials", "secrets":
        (root / name).mkdir()
    for unit in (pathlib.Path(__file__).resolve().parents[2] / "debian").glob("*.service"):
        text = unit.read_text().replace("%i", "a").replace("%d", f"{folder}/credentials").replace("%t", folder)
        text = text.replace("/etc/lightfield/secrets", f"{folder}/secrets").replace("%%", "%").replace("$$", "$")
        directory = root / re.search("^RuntimeDirectory=(.*)", text, re.M)[1]
        directory.mkdir()
        (root / "credentials/secret_key").write_text("old")
        (root / "secrets/key").write_text("new")
        for command, key in ("ExecStartPre=-?(.*)", "old"), (r"ExecReload=\+(.*)", "new"):
            subprocess.run(["sh", "-c", re.search(f"^{command}", text, re.M)[1]], check=True)
            copy = directory / "key"
            assert [*directory.iterdir()] == [copy], unit
            assert copy.read_text() == key and copy.stat().st_mode & 0o777 == 0o400, unit
        if unit.stem != "lightfield-serve":
            assert f"key-file={copy}" in text, unit


def inventory(**changes):
    return {"format": "lightfield-inventory", "version": 1, "rig": "rig.json", "key": "key",
            "views": [{"name": "tour", "file": "views.json"}],
            "cameras": [{"name": "cam0", "address": "127.0.1.1", "cameras": "0-1"},
                        {"name": "cam1", "address": "127.0.1.2", "cameras": "2,3", "options": "mtu=1400"}],
            "servers": [{"name": name, "address": f"127.0.1.{i + 3}", "options": "--viewers 8"}
                        for i, name in enumerate(["r1", "2r"])],
            "compositors": [{"name": "wall", "address": "127.0.1.5", "options": "location=/etc/lightfield/views/tour.json loop=true framerate=10/1",
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
    subprocess.run([f"{BUILD}/tools/lf-path", "--rig", "rig.json", "--out", "views.json", "--frames", "3"], cwd=folder, check=True)
    pathlib.Path(folder, "haproxy.cfg").write_text(template.read_text())
    two = inventory()["cameras"]
    for changes, message in (({"cameras": two[:1]}, "camera 2 belongs to no host"),
                             ({"cameras": [two[0], {**two[1], "cameras": "1-3"}]}, "1 belongs to cam0 and to cam1"),
                             ({"cameras": [two[0], {**two[1], "name": "cam0"}]}, "cameras[1].name"),
                             ({"cameras": [two[0], {**two[1], "name": "a b"}]}, "must match"),
                             ({"cameras": [two[0], {**two[1], "address": "127.0.1.1"}]}, "cameras[1].address: 127.0.1.1 is also"),
                             ({"cameras": [{**two[0], "address": "fd00::1"}, {**two[1], "address": "FD00:0::1"}]},
                              "cameras[1].address: fd00::1 is also"),
                             ({"cameras": [two[0], {**two[1], "address": "127.0.1"}]}, "is not an IP address"),
                             ({"compositors": [{**inventory()["compositors"][0], "address": "127.0.1.3"}]},
                              "compositors[0].address: 127.0.1.3 is also"),
                             ({"views": [{"name": "tour", "file": "key"}]}, "key"),
                             ({"views": 2 * inventory()["views"]}, "views[1].name"),
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

    service = ElementTree.parse(out / "cam1/etc/avahi/services/lightfield.service").getroot().find("service")
    assert service.find("type").text == "_lightfield._udp"
    records = [record.text for record in service.findall("txt-record")]
    assert re.fullmatch("rig=[0-9a-f]{16}", records[0]) and records[1:] == [
        "cameras=2,3", "client0=127.0.1.2:6000:127.0.1.3:6101", "client1=127.0.1.2:6001:127.0.1.4:6101",
        "client2=127.0.1.2:6002:127.0.1.5:6101"], records

    def words(host, file, variable):
        folder = str(out / host / "etc/lightfield")
        text = pathlib.Path(folder, file).read_text().replace("/etc/lightfield", folder)
        return re.search(rf"^{variable}=(.*)", text, re.M)[1].split()

    serve = words("r1", "serve.conf", "LIGHTFIELD_OPTIONS")
    assert serve[2:4] == ["--nodes", "127.0.1.1:6000:127.0.1.3:6100,127.0.1.2:6000:127.0.1.3:6101"], serve
    assert serve[-4:] == ["--path", "tour=" + str(out / "r1/etc/lightfield/views/tour.json"), "--viewers", "8"], serve
    for host in "r1", "2r", "wall":
        assert (out / host / "etc/lightfield/views/tour.json").read_text() == pathlib.Path(folder, "views.json").read_text()
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
    for test in check, check_watchdog, check_reload, check_deploy:
        with tempfile.TemporaryDirectory() as folder:
            test(folder)
    print("ok")


main()
