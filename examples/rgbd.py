#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Uses a light field as a depth camera for OpenCV. The program receives pictures with the depth of each pixel, and
writes the last picture beside its depths to rgbd.png. Near objects are red, and pixels with uncertain depths black. It
needs the packages python3-opencv, python3-gi and gir1.2-gst-plugins-base-1.0.

    python3 rgbd.py rig.json [PICTURES]
"""
import sys

import cv2
import gi
import numpy as np

gi.require_version("Gst", "1.0")
gi.require_version("GstApp", "1.0")
gi.require_version("GstVideo", "1.0")
from gi.repository import Gst, GstApp, GstVideo  # noqa: E402,F401  (GstApp adds the methods of appsink)

PIPELINE = ("lfviewsrc name=v width=320 height=240 framerate=15/1 "
            "v.src ! videoconvert ! video/x-raw,format=BGR ! appsink name=colour max-buffers=8 drop=true "
            "v.depth_src ! appsink name=depth max-buffers=8 drop=true "
            "v.confidence_src ! appsink name=confidence max-buffers=8 drop=true")


def pixels_of(sample, dtype, channels=1):
    """Returns the pixels of a sample as an array of height x width or height x width x channels."""
    info = GstVideo.VideoInfo.new_from_caps(sample.get_caps())
    buffer = sample.get_buffer()
    rows = np.frombuffer(buffer.extract_dup(0, buffer.get_size()), np.uint8).reshape(info.height, info.stride[0])
    values = rows[:, :info.width * channels * np.dtype(dtype).itemsize].copy().view(dtype)
    return values if channels == 1 else values.reshape(info.height, info.width, channels)


def depths_of(sample):
    """Returns the depths in metres along the optical axis: NaN where the depth is unknown, and infinity is possible."""
    caps = sample.get_caps().get_structure(0)
    values = pixels_of(sample, "<u2")
    with np.errstate(divide="ignore"):
        depths = 1 / (caps.get_value("depth-offset") + values * caps.get_value("depth-scale"))
    return np.where(values == 0, np.nan, depths)


def sample_at(sink, time):
    """Takes samples from a sink until one has this time. Returns None at the end of the stream."""
    while (sample := sink.try_pull_sample(10 * Gst.SECOND)) and sample.get_buffer().pts < time:
        pass
    return sample


def main():
    Gst.init(None)
    if len(sys.argv) < 2:
        sys.exit("usage: rgbd.py RIG.json [PICTURES]")
    pictures = int(sys.argv[2]) if len(sys.argv) > 2 else 30
    pipeline = Gst.parse_launch(PIPELINE)
    pipeline.get_by_name("v").set_property("rig", sys.argv[1])
    sinks = [pipeline.get_by_name(name) for name in ("colour", "depth", "confidence")]
    pipeline.set_state(Gst.State.PLAYING)
    shown = 0
    while shown < pictures:
        # The three pictures of one instant have the same time. A slow program loses some of them.
        first = sample_at(sinks[0], 0)
        if first is None:
            break
        time = first.get_buffer().pts
        others = [sample_at(sink, time) for sink in sinks[1:]]
        if not all(sample and sample.get_buffer().pts == time for sample in others):
            continue
        colour, depths = pixels_of(first, np.uint8, 3), depths_of(others[0])
        is_certain = pixels_of(others[1], np.uint8) > 127
        nearest = depths[is_certain].min(initial=np.inf)
        print(f"picture {shown}: {is_certain.sum()} certain depths, the nearest at {nearest:.3f} m")
        shown += 1
        if shown == pictures:
            grey = np.where(is_certain, 255 * nearest / depths, 0).astype(np.uint8)
            false_colours = cv2.applyColorMap(grey, cv2.COLORMAP_JET)
            false_colours[~is_certain] = 0
            cv2.imwrite("rgbd.png", np.hstack([colour, false_colours]))
    message = pipeline.get_bus().pop_filtered(Gst.MessageType.ERROR)
    if message:
        print(message.parse_error()[0].message, file=sys.stderr)
    pipeline.set_state(Gst.State.NULL)
    return 0 if shown == pictures and not message else 1


if __name__ == "__main__":
    sys.exit(main())
