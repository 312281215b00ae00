#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Several lf-serve behind HAProxy, with the configuration of pipelines/haproxy. Each program has its own host (network
namespace): two camera hosts, the replicas, the proxy and the viewers. Needs root.

    replicas.py BUILD_ROOT              32 viewers of 320x240 on 4 replicas, the queue, and the failure of a replica
    replicas.py BUILD_ROOT --measure [FRAMERATE]    processor time per picture with 1, 2 and 4 replicas and camera hosts
"""
import json
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/soak"))
from hosts import Network, until  # noqa: E402

if "--help" in sys.argv:
    sys.exit(print(__doc__))
BUILD = pathlib.Path(sys.argv[1]).resolve()
CAMERAS = 16
SEATS, SECONDS = 8, 15  # viewers per replica, length of a measurement
RATE = int(sys.argv[3]) if len(sys.argv) > 3 else 5  # pictures per second
REPLICAS = ["r1", "r2", "r3", "r4"]
HOSTS = ["n0", "n1", "n2", "n3", *REPLICAS, "proxy", "viewers"]
TICKS = os.sysconf("SC_CLK_TCK")


def processor_seconds(programs):
    """Returns the processor time that the programs have used since their start."""
    def used(pid):
        fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / TICKS
    return sum(used(program.pid) for program in programs)


class Cluster:
    def __init__(self, folder, replicas, camera_hosts=2):
        self.folder, self.names, self.camera_hosts = folder, REPLICAS[:replicas], camera_hosts
        self.environment = {**os.environ, "GST_PLUGIN_PATH": f"{BUILD}/gst", "GST_REGISTRY": f"{folder}/registry",
                            "G_DEBUG": "fatal-criticals"}
        self.network = Network(HOSTS, 0)
        self.nodes, self.replicas = [], {}
        self.proxy_address = self.network.address("proxy")
        self.url = f"http://{self.proxy_address}:8080/"

    def start(self, name, host, command, **more):
        return self.network.start(name, host, command, log=f"{self.folder}/{name}.log", environment=self.environment,
                                  **more)

    def run(self, host, *command):
        return subprocess.run(["ip", "netns", "exec", self.network._prefix + host, *command], env=self.environment,
                              capture_output=True, text=True)

    def start_nodes(self):
        ports = ",".join(str(6000 + i) for i in range(len(self.names)))
        share = CAMERAS // self.camera_hosts
        for node in range(self.camera_hosts):
            cameras = f"{node * share}-{(node + 1) * share - 1}"
            answers = ",".join(f"{self.network.address(name)}:{6100 + node}" for name in self.names)
            self.nodes.append(self.start(f"node {node}", f"n{node}", [
                "gst-launch-1.0", "-m", "lfnodesink", f"rig={self.folder}/film/rig.json", f"cameras={cameras}",
                f"node={node}", f"listen={ports}", f"answers={answers}",
                "limits=limits,max-views=64,max-requests-per-second=1000"]))

    def start_replica(self, name):
        nodes = ",".join(f"{self.network.address(f'n{node}')}:{6000 + self.names.index(name)}:{6100 + node}"
                         for node in range(self.camera_hosts))
        self.replicas[name] = self.start(name, name, [
            f"{BUILD}/tools/lf-serve", "--rig", f"{self.folder}/film/rig.json", "--nodes", nodes, "--listen", "0.0.0.0",
            "--insecure", "--replica", name, "--proxy", self.proxy_address, "--media-address",
            self.network.address(name), "--viewers", str(SEATS), "--address-views", "100", "--connects", "100",
            "--framerate", str(RATE), "--focus-mode", "plane"])

    def start_proxy(self):
        text = (ROOT / "pipelines/haproxy/haproxy.cfg").read_text()
        for name in REPLICAS:
            text = re.sub(rf"(server {name}) \S+", rf"\1 {self.network.address(name)}:8080", text)
            if name not in self.names:
                text = re.sub(rf"\n  server {name} .*", "", text)
        pathlib.Path(f"{self.folder}/haproxy.cfg").write_text(text)
        self.proxy = self.start("haproxy", "proxy", ["haproxy", "-db", "-f", f"{self.folder}/haproxy.cfg"])

    def begin(self):
        self.start_nodes()
        for name in self.names:
            self.start_replica(name)
        for name in self.names:
            until(lambda: self.answers(name, "readyz"), f"{name} is ready")
        self.start_proxy()
        until(lambda: self.run("viewers", "curl", "-sf", self.url).returncode == 0, "the proxy serves the page")
        time.sleep(2)  # until HAProxy has checked all replicas

    def answers(self, name, path):
        return self.run(name, "curl", "-sf", f"http://127.0.0.1:8080/{path}").stdout

    def metric(self, name, metric):
        found = re.search(rf"^lightfield_{metric} (\S+)", self.answers(name, "metrics"), re.M)
        return float(found[1]) if found else -1

    def viewers(self):
        return {name: int(self.metric(name, "viewers")) for name in self.replicas if self.replicas[name].is_running()}

    def watch(self, count, seconds):
        """Starts viewers. Returns their program and a list that receives its lines."""
        lines = []
        program = self.start("watch", "viewers", [f"{BUILD}/tests/watch", self.url, str(count), "320", "240",
                                                  str(seconds), self.network.address("viewers")], on_line=lines.append)
        until(lambda: lines or not program.is_running(), f"{count} viewers see pictures", 180)
        if not lines or lines[0].strip() != "ready":
            raise SystemExit(f"watch: {lines}")
        return program, lines

    def offer(self, offer, ticket=""):
        reply = self.run("viewers", "curl", "-s", "-H", "Content-Type: application/sdp", "--data-binary", f"@{offer}",
                         f"{self.url}whep?{ticket and 'ticket=' + ticket}")
        return json.loads(reply.stdout) if reply.stdout.startswith("{") else {}

    def stop(self):
        for program in [*self.nodes, *self.replicas.values()]:
            program.stop(10)
        self.network.close()


def rates(lines):
    until(lambda: len(lines) > 1, "the rates are printed")
    return json.loads(lines[1])["rates"]


def check(cluster):
    count = SEATS * len(REPLICAS)
    program, lines = cluster.watch(count, SECONDS)
    seen = cluster.viewers()
    print(f"# {count} viewers: {seen}")
    assert seen == dict.fromkeys(REPLICAS, SEATS), "each replica has its share, and full replicas are skipped"

    offer = pathlib.Path(cluster.folder, "offer.sdp")
    source = (ROOT / "tests/web/offers.h").read_text().split("browser_offer()")[1].split("}")[0]
    offer.write_text("".join(re.findall(r'"(.*)"', source)).replace("\\r\\n", "\r\n"), newline="")
    full = cluster.offer(offer)
    assert full.get("reason") == "full" and full["ticket"].split("-")[0] in REPLICAS, full
    for _ in range(8):
        again = cluster.offer(offer, full["ticket"])
        assert again.get("ticket") == full["ticket"] and again["place"] == 1, f"the ticket stays at its replica: {again}"

    each = rates(lines)
    until(lambda: not program.is_running(), "the viewers leave")
    print(f"# pictures per second of each viewer: {min(each):.1f} to {max(each):.1f}, of {RATE}")
    assert min(each) > RATE / 3, each
    until(lambda: sum(cluster.viewers().values()) == 0, "all sessions end", 3)
    closed = sum(path.read_text().count("the browser leaves") for path in pathlib.Path(cluster.folder).glob("r?.log"))
    assert closed == count, f"DELETE reaches the replica of its session: {closed}"

    cluster.replicas["r2"].stop(5, signal.SIGKILL)
    began = time.monotonic()
    program, lines = cluster.watch(SEATS, 2)
    print(f"# {SEATS} viewers, one after another, connect within {time.monotonic() - began:.1f} s after the failure")
    assert sum(cluster.viewers().values()) == SEATS
    assert min(rates(lines)) > RATE / 3
    until(lambda: not program.is_running(), "the viewers leave")
    cluster.start_replica("r2")
    until(lambda: cluster.answers("r2", "readyz"), "r2 is ready again")
    time.sleep(3)
    program, lines = cluster.watch(SEATS, 5)
    seen = cluster.viewers()
    assert seen["r2"] >= 1 and sum(seen.values()) == SEATS, f"the replica returns: {seen}"


def measure(folder, replicas, camera_hosts):
    cluster = Cluster(folder, replicas, camera_hosts)
    try:
        cluster.begin()
        count = SEATS * replicas
        _, lines = cluster.watch(count, SECONDS)
        before = [processor_seconds(cluster.replicas.values()), processor_seconds(cluster.nodes)]
        each = rates(lines)
        serve, nodes = (processor_seconds(programs) - used for programs, used in
                        zip([cluster.replicas.values(), cluster.nodes], before))
        pictures = sum(each) * SECONDS
        print(f"| {replicas} | {camera_hosts} | {sum(each):.1f} | {1e3 * serve / pictures:.2f} | "
              f"{1e3 * nodes / pictures:.2f} | {pictures / (serve + nodes):.0f} |", flush=True)
    finally:
        cluster.stop()


def main():
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # removes the folder; Network also removes the hosts
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "GST_PLUGIN_PATH": f"{BUILD}/gst"}
        subprocess.run([f"{BUILD}/tools/lf-scene", "--out", f"{folder}/film", "--grid", "4x4", "--width", "320", "--height",
                        "240", "--frames", "10", "--framerate", str(RATE), "--samples", "1"], check=True,
                       env=environment, capture_output=True)
        if "--measure" in sys.argv:
            print("| replicas | camera hosts | pictures/s | replicas ms/picture | hosts ms/picture | per core second |\n"
                  "| --- | --- | --- | --- | --- | --- |")
            for replicas, camera_hosts in (1, 2), (2, 2), (4, 2), (1, 1), (1, 4):
                measure(folder, replicas, camera_hosts)
            return
        cluster = Cluster(folder, len(REPLICAS))
        try:
            cluster.begin()
            check(cluster)
        finally:
            cluster.stop()
            for name in sorted(pathlib.Path(folder).glob("*.log")):
                print(f"# {name.name}: " + " | ".join(name.read_text().splitlines()[-4:]))
    print("ok")


main()
