#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Viewers with nodes=auto find the camera hosts of an inventory by DNS-SD. Each host (network namespace) has its own D-Bus
and Debian's avahi-daemon, with the files of lf-rig deploy. Needs root.

    discovery.py BUILD_ROOT
"""
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/soak"))
from hosts import Network, until  # noqa: E402

BUILD = pathlib.Path(sys.argv[1]).resolve()
BUS = """<busconfig><listen>unix:path={}</listen><auth>EXTERNAL</auth><policy context="default">
<allow user="*"/><allow own="*"/><allow send_destination="*"/><allow receive_sender="*"/></policy></busconfig>"""
COMPLETE = "complete=(boolean)true"
AVAHI = "mount -t tmpfs none /run && mount --bind {services} {etc} && exec {daemon} --no-drop-root --no-rlimits --file={config}"


class Hosts:
    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        self.environment = {**os.environ, "GST_PLUGIN_PATH": f"{BUILD}/gst", "GST_REGISTRY": f"{folder}/registry"}
        self.network = Network(["cam0", "cam1", "wall", "stranger"], 0)
        self.avahi = {}

    def run(self, tool, *words):
        subprocess.run([f"{BUILD}/tools/{tool}", *words], cwd=self.folder, check=True, env=self.environment,
                       stdout=subprocess.DEVNULL)

    def write_configuration(self):
        for name, width in ("rig", "80"), ("other", "96"):
            self.run("lf-scene", "--out", name, "--grid", "2x2", "--width", width, "--height", "60", "--frames", "5",
                     "--samples", "1")
        key = self.folder / "key"
        key.touch(0o600)
        key.write_text("0123456789abcdef" * 4)
        hosts = {name: {"name": name, "address": self.network.address(name)} for name in ("cam0", "cam1", "wall")}
        (self.folder / "inventory.json").write_text(json.dumps({
            "format": "lightfield-inventory", "version": 1, "rig": "rig/rig.json", "key": "key",
            "cameras": [{**hosts["cam0"], "cameras": "0-1"}, {**hosts["cam1"], "cameras": "2,3"}],
            "compositors": [{**hosts["wall"], "output": "fakesink"}]}))
        self.run("lf-rig", "deploy", "inventory.json", "--out", "out")

    def start(self, name, host, command, **more):
        environment = {**self.environment, "DBUS_SYSTEM_BUS_ADDRESS": f"unix:path={self.folder}/bus-{host}"}
        return self.network.start(name, host, ["env", "-C", str(self.folder), *command], log=self.folder / f"{name}.log",
                                  environment=environment, **more)

    def start_avahi(self, host):
        bus, services, config = (self.folder / f"{kind}-{host}" for kind in ("bus", "services", "avahi"))
        (self.folder / f"{host}.xml").write_text(BUS.format(bus))
        self.start(f"dbus-{host}", host, ["dbus-daemon", "--nofork", f"--config-file={self.folder}/{host}.xml"])
        until(bus.exists, "the bus listens")
        services.mkdir()
        announced = self.folder / f"out/{host}/etc/avahi/services"
        if announced.exists():
            shutil.copytree(announced, services, dirs_exist_ok=True)
        config.write_text(f"[server]\nhost-name={host}\nallow-interfaces=eth0\n")
        command = AVAHI.format(services=services, etc="/etc/avahi/services", daemon=shutil.which("avahi-daemon"),
                               config=config)
        self.avahi[host] = self.start(f"avahi-{host}", host, ["sh", "-c", command])

    def start_cameras(self, host):
        text = (self.folder / f"out/{host}/etc/lightfield/camera-{host}.conf").read_text()
        options = re.search("^LIGHTFIELD_OPTIONS=(.*)", text, re.M)[1].replace("/etc/lightfield/rig.json", "rig/rig.json")
        self.start(host, host, ["gst-launch-1.0", "lfnodesink", "key-file=key", *options.split()])


def check(hosts):
    lines = []

    def view(host="wall", rig="rig"):
        """Returns the output of a viewer, until a complete picture or 30 pictures."""
        lines.clear()
        program = hosts.start("view", host, [
            "gst-launch-1.0", "-m", "lfviewsrc", "nodes=auto", f"rig={rig}/rig.json", "key-file=key", "post-messages=true",
            "framerate=10/1", "latency=300000000", "!", "fakesink", "sync=false"], on_line=lines.append)
        began = time.monotonic()
        until(lambda: any(COMPLETE in line for line in lines) or not program.is_running() or
              sum("lightfield-view," in line for line in lines) > 30, "pictures")
        print(f"# {host}, {rig}: {time.monotonic() - began:.1f} s")
        program.stop(10)
        return "".join(line for line in lines if "lightfield-view," in line or "nodes: " in line)

    assert "needs the service avahi-daemon" in view(), lines
    for host in "cam0", "cam1", "wall", "stranger":
        hosts.start_avahi(host)
    for host in "cam0", "cam1":
        hosts.start_cameras(host)
    time.sleep(5)  # until the hosts have announced themselves
    text = view()
    assert COMPLETE in text and "no host announces" not in text, text
    lines.clear()
    serve = hosts.start("serve", "wall", [f"{BUILD}/tools/lf-serve", "--nodes", "auto", "--rig", "rig/rig.json", "--key-file",
                                          "key"], on_line=lines.append)
    until(lambda: any("serving" in line for line in lines) or not serve.is_running(), "lf-serve starts")
    assert serve.stop(10, signal.SIGTERM) and not any("warning" in line for line in lines), lines
    text = view(rig="other")
    assert "no camera host announces cameras of this rig" in text and "lightfield-view," not in text, text
    assert "and a connection to this machine" in view("stranger"), lines
    assert hosts.avahi["cam1"].stop(10)
    time.sleep(3)  # records without a host expire after a second
    text = view()
    assert "no host announces the cameras 2, 3" in text and "lightfield-view," in text, text


def main():
    if os.geteuid() != 0 or not shutil.which("avahi-daemon"):
        print("needs root and avahi-daemon")
        sys.exit(77)  # skipped
    with tempfile.TemporaryDirectory() as folder:
        hosts = Hosts(folder)
        try:
            hosts.write_configuration()
            check(hosts)
        finally:
            hosts.network.close()
            for log in sorted(pathlib.Path(folder).glob("*.log")):
                print(f"# {log.name}: " + " | ".join(log.read_text().splitlines()[-4:]))
    print("ok")


main()
