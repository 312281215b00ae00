#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Runs the launch lines for SRT and RTSP of docs/guides/pipelines.md on this host, and receives their pictures. The RTSP
line needs rtspclientsink (Debian: gstreamer1.0-rtsp) and GStreamer's RTSP server (gir1.2-gst-rtsp-server-1.0).

    studio.py BUILD_ROOT
"""
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time

import gi
gi.require_version("Gst", "1.0")
from gi.repository import GLib, Gst  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = pathlib.Path(sys.argv[1]).resolve()
PICTURES, PATIENCE_S = 20, 60
TO_PICTURES = "decodebin ! videoconvert ! video/x-raw,format=RGB ! fakesink name=sink sync=false signal-handoffs=true"
sizes = []  # of the received pictures, in bytes


def launch_line(element):
    text = (ROOT / "docs/guides/pipelines.md").read_text()
    line = next(line for line in re.findall(r"```sh\n(.*?)```", text, re.S) if f" {element} " in line)
    for name, value in ("RIG.json", "rig.json"), ("VIEWS.json", "views.json"), ("HOST", "127.0.0.1"):
        line = line.replace(name, value)
    return line


def count(pipeline):
    pipeline.get_by_name("sink").connect("handoff", lambda _sink, buffer, _pad: sizes.append(buffer.get_size()))


def srt_receiver():
    pipeline = Gst.parse_launch("srtsrc uri=srt://127.0.0.1:7001 ! tsdemux ! " + TO_PICTURES)
    count(pipeline)
    pipeline.set_state(Gst.State.PLAYING)
    return pipeline


def rtsp_receiver():
    gi.require_version("GstRtspServer", "1.0")
    from gi.repository import GstRtspServer
    server, factory = GstRtspServer.RTSPServer(address="127.0.0.1", service="8554"), GstRtspServer.RTSPMediaFactory()
    factory.set_transport_mode(GstRtspServer.RTSPTransportMode.RECORD)
    factory.set_launch(f"( rtph264depay name=depay0 ! {TO_PICTURES} )")
    factory.connect("media-configure", lambda _factory, media: count(media.get_element()))
    server.get_mount_points().add_factory("/flight", factory)
    server.attach(None)
    return server


def receive(name, element, receiver, server=None):
    """The RTSP server must run before the sender, and the SRT sender before the receiver."""
    sizes.clear()
    receiving = server() if server else None
    with open(f"{name}.log", "w") as log:
        sender = subprocess.Popen(["bash", "-c", "exec " + launch_line(element)], stdout=log, stderr=subprocess.STDOUT)
    try:
        if receiver:
            time.sleep(4)  # until the sender listens
            receiving = receiver()
        end = time.monotonic() + PATIENCE_S
        while len(sizes) < PICTURES and time.monotonic() < end:
            GLib.MainContext.default().iteration(False)
            time.sleep(0.01)
    finally:
        sender.kill()
        sender.wait()
    if isinstance(receiving, Gst.Pipeline):
        receiving.set_state(Gst.State.NULL)
    if len(sizes) < PICTURES or set(sizes) != {160 * 120 * 3}:
        sys.exit(f"{name}: {len(sizes)} pictures\n" + pathlib.Path(f"{name}.log").read_text())
    print(f"{name}: {len(sizes)} pictures", flush=True)


def main():
    os.environ["GST_PLUGIN_PATH"] = str(BUILD / "gst")
    Gst.init(None)
    needed = ["srtsrc", "x264enc", "rtspclientsink"]
    if missing := [name for name in needed if not Gst.ElementFactory.find(name)]:
        print(f"missing: {missing}")
        sys.exit(77)  # skipped
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        tools = BUILD / "tools"
        subprocess.run([tools / "lf-scene", "--out", ".", "--grid", "2x2", "--width", "160", "--height", "120", "--frames",
                        "15"], check=True, stderr=subprocess.DEVNULL)
        subprocess.run([tools / "lf-path", "--rig", "rig.json", "--out", "views.json", "--frames", "30"], check=True)
        receive("RTSP", "rtspclientsink", None, rtsp_receiver)
        receive("SRT", "srtsink", srt_receiver)
        os.chdir("/")


main()
