#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Runs the launch lines for SRT, RTSP and RTMP of docs/guides/pipelines.md on this host, and receives their pictures. The
RTSP line needs rtspclientsink (Debian: gstreamer1.0-rtsp) and GStreamer's RTSP server (gir1.2-gst-rtsp-server-1.0). The
server for RTMP is FFmpeg, in python3-opencv. If OBS Studio (obs-studio) and Xvfb are installed, OBS opens the SRT stream,
and LF_ARTEFACTS receives obs.png, a picture of the screen.

    studio.py BUILD_ROOT
"""
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time

import cv2
import gi
gi.require_version("Gst", "1.0")
from gi.repository import GLib, Gst  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = pathlib.Path(sys.argv[1]).resolve()
PICTURES, PATIENCE_S = 20, 60
DISPLAY = ":77"
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


def send(name, element):
    with open(f"{name}.log", "w") as log:
        return subprocess.Popen(["bash", "-c", "exec " + launch_line(element)], stdout=log, stderr=subprocess.STDOUT)


def receive_rtmp():
    program = f"import cv2; v = cv2.VideoCapture('rtmp://127.0.0.1/live/KEY'); print({{v.read()[1].shape for _ in range({PICTURES})}})"
    server = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True,
                              env={**os.environ, "OPENCV_FFMPEG_CAPTURE_OPTIONS": "listen;1"})
    sender = None
    try:
        while "0100007F:078F 00000000:0000 0A" not in pathlib.Path("/proc/net/tcp").read_text():  # port 1935 listens
            time.sleep(0.1)
            assert server.poll() is None, "no FFmpeg"
        sender = send("RTMP", "rtmp2sink")
        shapes = server.communicate(timeout=PATIENCE_S)[0].strip()
    finally:
        for program in filter(None, [server, sender]):
            program.kill()
            program.wait()
    assert shapes == "{(120, 160, 3)}", shapes + pathlib.Path("RTMP.log").read_text()
    print(f"RTMP: {PICTURES} pictures", flush=True)


def configure_obs(home):
    """A scene with one source, the stream."""
    stream = {"id": "ffmpeg_source", "name": "SRT", "settings": {"input": "srt://127.0.0.1:7001", "input_format": "mpegts",
                                                                "is_local_file": False}}
    item = {"name": "SRT", "id": 1, "visible": True, "bounds_type": 2, "bounds": {"x": 640.0, "y": 480.0}, "align": 5}
    scene = {"id": "scene", "name": "Scene", "settings": {"id_counter": 1, "items": [item]}}
    scenes = {"name": "Light", "current_scene": "Scene", "scene_order": [{"name": "Scene"}], "sources": [stream, scene]}
    for name, text in (("global.ini", "[General]\nFirstRun=true\n"), ("basic/scenes/Light.json", json.dumps(scenes)),
                       ("basic/profiles/Light/basic.ini", "[General]\nName=Light\n[Video]\nBaseCX=640\nBaseCY=480\n")):
        file = home / ".config/obs-studio" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)


def colourful_share(picture):
    """Returns the share of pixels with saturated colours. The upper half of the window of OBS has only the picture and
    shades of grey."""
    pipeline = Gst.parse_launch(f"ximagesrc display-name={DISPLAY} num-buffers=1 ! videoconvert ! pngenc ! "
                                f"filesink location={picture}")
    pipeline.set_state(Gst.State.PLAYING)
    pipeline.get_bus().timed_pop_filtered(Gst.CLOCK_TIME_NONE, Gst.MessageType.EOS | Gst.MessageType.ERROR)
    pipeline.set_state(Gst.State.NULL)
    image = cv2.imread(str(picture))[40:384].astype(int)
    return ((image.max(axis=2) - image.min(axis=2)) > 60).mean()


def receive_obs():
    home = pathlib.Path("obs").resolve()
    configure_obs(home)
    environment = {**os.environ, "HOME": str(home), "DISPLAY": DISPLAY, "XDG_RUNTIME_DIR": str(home),
                   "LIBGL_ALWAYS_SOFTWARE": "1", "QT_X11_NO_MITSHM": "1"}
    programs = [send("OBS", "srtsink"), subprocess.Popen(["Xvfb", DISPLAY, "-screen", "0", "1024x768x24"])]
    try:
        time.sleep(4)
        with open("obs.log", "w") as log:
            programs.append(subprocess.Popen(["obs", "--multi", "--collection", "Light", "--profile", "Light"], stdout=log,
                                             stderr=subprocess.STDOUT, env=environment))
        picture = pathlib.Path(os.environ.get("LF_ARTEFACTS", "."), "obs.png")
        end = time.monotonic() + PATIENCE_S
        while (share := colourful_share(picture)) < 0.05:
            assert time.monotonic() < end, f"{share:.3f}\n" + pathlib.Path("obs.log").read_text()[-2000:]
        print(f"OBS: {100 * share:.0f} % of the upper half of the screen has saturated colours", flush=True)
    finally:
        for program in reversed(programs):
            program.kill()
            program.wait()


def receive(name, element, receiver, server=None):
    """The RTSP server must run before the sender, and the SRT sender before the receiver."""
    sizes.clear()
    receiving = server() if server else None
    sender = send(name, element)
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
        receive_rtmp()
        if all(map(shutil.which, ["obs", "Xvfb"])):
            receive_obs()
        os.chdir("/")


main()
