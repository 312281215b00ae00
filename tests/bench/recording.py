#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Measures recordings of the built-in scene and prints the results line by line.

    recording.py [--seconds N]

Two viewers move in front of 64 JPEG cameras of 320x240 at 30 frames/s. Measures the age of their pictures (p50, p95: from
capture to the sink) without, with, and again without a recording; frames missing in the recording; the contents of a
recording after its process was killed; the time of seeks to random seconds; size and seeks after transcoding (lf-archive);
writing and playing 256 cameras.
"""
import argparse
import json
import math
import pathlib
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time

import gi

gi.require_version("Gst", "1.0")
gi.require_version("GstApp", "1.0")
from gi.repository import Gst, GstApp  # noqa: E402,F401

RATE = 30
PERIOD = Gst.SECOND / RATE


def share(values, part):
    values = sorted(values)
    return values[min(len(values) - 1, int(part * len(values)))]


def film(folder, side, frames):
    subprocess.run(["lf-scene", "--out", folder, "--grid", f"{side}x{side}", "--frames", str(frames), "--framerate", str(RATE)],
                   check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return folder / "rig.json"


def fail_at_errors(pipeline):
    message = pipeline.get_bus().pop_filtered(Gst.MessageType.ERROR)
    if message:
        sys.exit("error: " + message.parse_error()[0].message)


def fly(rig, seconds, record=None):
    """Returns the ages of two moving viewers' pictures, ms, and the node's stats."""
    line = (f"lfviewsrc name=v rig={rig} framerate=30/1 {f'record={record}' if record else ''} "
            "v.src ! appsink name=one sync=false v.src_0 ! appsink name=two sync=false")
    pipeline = Gst.parse_launch(line)
    ages, lock, begun = [], threading.Lock(), time.monotonic()

    def see(sink):
        sample = sink.emit("pull-sample")
        now = pipeline.get_clock().get_time() - pipeline.get_base_time()
        if time.monotonic() - begun > 3:  # the focal surface is found
            with lock:
                ages.append((now - sample.get_buffer().pts) / Gst.MSECOND)
        return Gst.FlowReturn.OK

    for name in ("one", "two"):
        sink = pipeline.get_by_name(name)
        sink.set_property("emit-signals", True)
        sink.connect("new-sample", see)
    pipeline.set_state(Gst.State.PLAYING)
    views = [pipeline.get_by_name("v").get_by_name(name) for name in ("view", "view_0")]
    begun = time.monotonic()
    while time.monotonic() - begun < seconds:
        fail_at_errors(pipeline)
        for phase, view in enumerate(views):
            view.set_property("x", 0.05 * math.sin(time.monotonic() - begun + 2 * phase))
        time.sleep(0.02)
    stats = pipeline.get_by_name("v").get_by_name("node").get_property("stats")
    pipeline.set_state(Gst.State.NULL)
    return ages, stats


def times_of(path):
    """Returns the timestamps of a file's frames, and its end, ns."""
    pipeline = Gst.parse_launch(f"filesrc location={path} ! matroskademux name=d d.video_0 ! appsink name=s sync=false")
    pipeline.set_state(Gst.State.PLAYING)
    times, end = [], 0
    while sample := pipeline.get_by_name("s").emit("try-pull-sample", 5 * Gst.SECOND):
        frame = sample.get_buffer()
        times.append(frame.pts)
        if frame.duration != Gst.CLOCK_TIME_NONE:
            end = frame.pts + frame.duration
    pipeline.set_state(Gst.State.NULL)
    return times, end


def report_viewers(ages, what):
    print(f"{what}: {len(ages)} pictures of two viewers, age p50 {share(ages, .5):.1f} ms, p95 {share(ages, .95):.1f} ms",
          flush=True)


def report_recorded(folder, stats, count):
    cameras = stats.get_value("cameras")
    fields = [cameras.get_value(f"camera-{i}") for i in range(count)]
    recorded, unrecorded, dropped = (sum(field.get_value(name) for field in fields)
                                     for name in ("recorded", "unrecorded", "dropped"))
    gaps, length = 0, 0
    for i in range(count):
        times, end = times_of(folder / f"camera{i}.mkv")
        gaps += sum(max(0, round((b - a) / PERIOD) - 1) for a, b in zip(times, times[1:]))
        length = max(length, end)
    size = sum(path.stat().st_size for path in folder.glob("*.mkv"))
    print(f"{count} cameras: {recorded} frames recorded in {length / Gst.SECOND:.1f} s, {unrecorded} left out, {dropped} dropped "
          f"before by the cameras, {gaps} missing within the films; {size / 1e6:.1f} MB", flush=True)
    return length / Gst.SECOND


def report_kill(rig, folder):
    with subprocess.Popen(["gst-launch-1.0", "-q", "lfcameranode", f"rig={rig}", "is-live=true", "loop=true", f"record={folder}"]) as node:
        time.sleep(10)
        at = {path.name: path.stat().st_mtime for path in folder.glob("*.mkv")}
        node.send_signal(signal.SIGKILL)
    wanted = time.time() - min(at.values())
    ends = [times_of(path)[0] for path in sorted(folder.glob("*.mkv"))]
    newest = max(times[-1] for times in ends)
    lost = max(newest - times[-1] for times in ends) / Gst.SECOND
    print(f"killed after 10 s: {len(ends)} films, the shortest ends {lost:.3f} s before the longest, which has {newest / Gst.SECOND:.2f} s "
          f"(files were last written {wanted:.2f} s before)", flush=True)
    return newest / Gst.SECOND


def seeks(rig, length, count=30):
    """Returns the times of seeks to random seconds, until the picture arrives, ms."""
    rng, took = random.Random(1), []
    with tempfile.NamedTemporaryFile("w", suffix=".json") as file:
        tour = pathlib.Path(file.name)
        subprocess.run(["lf-path", "--rig", rig, "--out", tour, "--frames", str(max(2, int(length * 10))), "--framerate", "10",
                        "--near", "1", "--far", "4"], check=True, stdout=subprocess.DEVNULL)
        views = json.loads(tour.read_text())
        for view in views["views"]:
            view["position"] = views["views"][0]["position"]
        tour.write_text(json.dumps(views))
        pipeline = Gst.parse_launch(f"lfviewsrc rig={rig} is-live=false location={tour} ! appsink name=s sync=false")
        pipeline.set_state(Gst.State.PAUSED)
        sink = pipeline.get_by_name("s")
        sink.emit("try-pull-preroll", 30 * Gst.SECOND)
        for _ in range(count):
            to = rng.randrange(int(length)) * Gst.SECOND
            begun = time.monotonic()
            pipeline.seek_simple(Gst.Format.TIME, Gst.SeekFlags.FLUSH, to)
            if not sink.emit("try-pull-preroll", 30 * Gst.SECOND):
                fail_at_errors(pipeline)
                sys.exit("no picture after a seek")
            took.append(1000 * (time.monotonic() - begun))
        pipeline.set_state(Gst.State.NULL)
    return took


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60, help="length of each run of the viewers (default: 60)")
    options = parser.parse_args()
    Gst.init(None)
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(temporary)
        rig = film(folder / "film", 8, 30)
        recording = folder / "recording"
        before, _ = fly(rig, options.seconds)
        report_viewers(before, "without a recording")
        during, stats = fly(rig, options.seconds, recording)
        report_viewers(during, "with a recording")
        after, _ = fly(rig, options.seconds)
        report_viewers(after, "without one again")
        reference = (share(before, .95) + share(after, .95)) / 2
        print(f"p95 with a recording: {share(during, .95) / reference:.2f} times that without")
        length = report_recorded(recording, stats, 64)
        killed = report_kill(rig, folder / "killed")
        for what, path in (("JPEG", recording), ("archive", folder / "archive")):
            if what == "archive":
                begun, length = time.monotonic(), killed
                told = subprocess.run(["lf-archive", folder / "killed", "--out", path], check=True, capture_output=True,
                                      text=True).stdout
                print(told.splitlines()[-1].split(": ", 1)[1] + f", in {time.monotonic() - begun:.0f} s", flush=True)
            took = seeks(path / "rig.json", length)
            print(f"{what}: {len(took)} seeks, median {share(took, .5):.0f} ms, p95 {share(took, .95):.0f}, worst {max(took):.0f}",
                  flush=True)
        many = film(folder / "many", 16, 4)
        ages, stats = fly(many, 10, folder / "of-many")
        report_viewers(ages, "256 cameras, with a recording")
        report_recorded(folder / "of-many", stats, 256)
        ages, _ = fly(folder / "of-many" / "rig.json", 10)
        report_viewers(ages, "256 cameras, played")


main()
