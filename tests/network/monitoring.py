#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Debian's Prometheus with the configuration of pipelines/prometheus watches two lf-serve, two camera hosts and a
compositor. A camera host and a server are killed, and their alerts must fire. Also checks the metrics (promtool), the
dashboard, and the systemd units (systemd-analyze).

    monitoring.py BUILD_ROOT
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
import time
import urllib.request

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/soak"))
from hosts import free_port, until  # noqa: E402

BUILD = pathlib.Path(sys.argv[1]).resolve()
PROMETHEUS = ROOT / "pipelines/prometheus"
MOST_EXPOSURE = 30  # tenths, of systemd-analyze security


def get(port, path):
    return urllib.request.urlopen(f"http://127.0.0.1:{port}/{path}", timeout=5).read().decode()


class Programs(list):
    def start(self, folder, *command):
        log = open(f"{folder}/{len(self)}.log", "wb")
        self.append(subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, cwd=folder,
                                     env={**os.environ, "GST_PLUGIN_PATH": f"{BUILD}/gst"}))
        return self[-1]


def check_files():
    """The rules and the systemd units."""
    subprocess.run(["promtool", "check", "rules", PROMETHEUS / "lightfield-rules.yml"], check=True)
    for unit in (ROOT / "debian").glob("*.service"):
        subprocess.run(["systemd-analyze", "security", "--offline=true", "--no-pager", f"--threshold={MOST_EXPOSURE}", unit],
                       check=True, stdout=subprocess.DEVNULL)
        assert {"Type=notify", "WatchdogSec=30"} <= set(unit.read_text().splitlines()), unit


def check_metrics(texts):
    for text in texts:
        subprocess.run(["promtool", "check", "metrics"], input=text, text=True, check=True)
    names = set(re.findall(r"^# TYPE (\S+)", "".join(texts), re.M))
    names |= {name + "_bucket" for name in names}
    for file in ("lightfield-rules.yml", "grafana-dashboard.json"):
        used = set(re.findall(r"\blightfield_\w+", (PROMETHEUS / file).read_text()))
        assert used and used <= names, f"{file}: no such metric: {used - names}"


def main():
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # ends the programs
    programs = Programs()
    check_files()
    with tempfile.TemporaryDirectory() as folder:
        try:
            watch(folder, programs)
        finally:
            for program in programs:
                program.kill()
                program.wait()
            for log in sorted(pathlib.Path(folder).glob("*.log")):
                print(f"# {log.name}: " + " | ".join(log.read_text(errors="replace").splitlines()[-3:]))


def watch(folder, programs):
    subprocess.run([f"{BUILD}/tools/lf-scene", "--out", f"{folder}/film", "--grid", "2x2", "--width", "160", "--height",
                    "120", "--frames", "10", "--framerate", "10", "--samples", "1"], check=True, capture_output=True,
                   env={**os.environ, "GST_PLUGIN_PATH": f"{BUILD}/gst"})
    rig, servers = f"{folder}/film/rig.json", [free_port(), free_port()]
    requests, answers = ([[free_port(socket.SOCK_DGRAM) for _ in servers] for _ in range(2)] for _ in range(2))
    hosts = [free_port() for _ in range(3)]
    nodes = [programs.start(folder, f"{BUILD}/tools/lf-run", "--metrics", str(hosts[n]), "lfnodesink", f"rig={rig}",
                            f"cameras={'0-1' if n == 0 else '2-3'}", f"node={n}",
                            "listen=" + ",".join(f"127.0.0.1:{port}" for port in requests[n]),
                            "answers=" + ",".join(f"127.0.0.1:{port}" for port in answers[n])) for n in range(2)]
    programs.start(folder, f"{BUILD}/tools/lf-run", "--metrics", str(hosts[2]), "lfviewsrc", f"rig={rig}", "width=160",
                   "height=120", "framerate=5/1", "node::is-live=true", "!", "fakesink", "sync=false")
    serving = [programs.start(folder, f"{BUILD}/tools/lf-serve", "--rig", rig, "--port", str(port), "--framerate", "5",
                              "--nodes", ",".join(f"127.0.0.1:{requests[n][s]}:{answers[n][s]}" for n in range(2)))
               for s, port in enumerate(servers)]
    for port in servers:
        until(lambda: get(port, "readyz"), "lf-serve is ready")
    programs.start(folder, f"{BUILD}/tests/watch", f"http://127.0.0.1:{servers[0]}/", "1", "160", "120", "600")
    until(lambda: re.search(r"^lightfield_pictures_total [1-9]", get(servers[0], "metrics"), re.M), "a viewer watches")
    until(lambda: re.search(r"^lightfield_pictures_total [1-9]", get(hosts[2], "metrics"), re.M), "the compositor runs")
    check_metrics([get(port, "metrics") for port in [servers[0], *hosts]])

    config = (PROMETHEUS / "prometheus.yml").read_text()
    targets = iter([servers, hosts])
    config = re.sub(r"targets: .*",
                    lambda _: "targets: " + json.dumps([f"127.0.0.1:{port}" for port in next(targets)]), config)
    config = config.replace("lightfield-rules.yml", str(PROMETHEUS / "lightfield-rules.yml")).replace(": 5s", ": 1s")
    pathlib.Path(f"{folder}/prometheus.yml").write_text(config)
    own = free_port()
    programs.start(folder, "prometheus", f"--config.file={folder}/prometheus.yml", f"--web.listen-address=127.0.0.1:{own}",
                   f"--storage.tsdb.path={folder}/data")

    def value(query):
        result = json.loads(get(own, "api/v1/query?query=" + query))["data"]["result"]
        return [float(entry["value"][1]) for entry in result]

    def alerts():
        found = json.loads(get(own, "api/v1/alerts"))["data"]["alerts"]
        return {alert["labels"]["alertname"]: alert["labels"] for alert in found if alert["state"] == "firing"}
    until(lambda: value("up") == [1] * 5, "Prometheus reads all programs")
    assert not alerts(), alerts()

    for killed, *names in ((nodes[1], "LightfieldCameraHostSilent", "LightfieldHostDown"),
                           (serving[1], "LightfieldServerDown")):
        began = time.monotonic()
        killed.send_signal(signal.SIGKILL)
        for name in names:
            labels = until(lambda: alerts().get(name), f"{name} fires")
            print(f"# {name} fires {time.monotonic() - began:.1f} s after the kill: {labels}")
    print("ok")


main()
