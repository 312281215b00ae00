#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Shows a light field in Python. The program receives pictures, moves the view, and reads statistics. It needs the
packages python3-gi and gir1.2-gst-plugins-base-1.0.

    python3 view.py rig.json [PICTURES]
"""
import sys

import gi

gi.require_version("Gst", "1.0")
gi.require_version("GstApp", "1.0")
from gi.repository import Gst, GstApp  # noqa: E402,F401  (GstApp adds the methods of appsink)


def main():
    Gst.init(None)
    if len(sys.argv) < 2:
        sys.exit("usage: view.py RIG.json [PICTURES]")
    pictures = int(sys.argv[2]) if len(sys.argv) > 2 else 30
    pipeline = Gst.parse_launch(
        "lfviewsrc name=light-field width=320 height=240 framerate=30/1 ! videoconvert ! video/x-raw,format=RGB ! "
        "appsink name=pictures max-buffers=1 drop=true")
    light_field, sink = pipeline.get_by_name("light-field"), pipeline.get_by_name("pictures")
    light_field.set_property("rig", sys.argv[1])
    pipeline.set_state(Gst.State.PLAYING)

    shown = 0
    while shown < pictures:
        sample = sink.try_pull_sample(10 * Gst.SECOND)
        if sample is None:
            break
        buffer = sample.get_buffer()
        data = buffer.extract_dup(0, buffer.get_size())
        print(f"picture {shown}: {len(data)} bytes, mean {sum(data[::97]) / len(data[::97]):.1f}")
        shown += 1
        # The structure may hold any of x, y, z, yaw, pitch, roll, fov, focus-distance and aperture.
        view = Gst.Structure.new_empty("view")
        view.set_value("x", light_field.get_property("x") + 0.002)
        if not light_field.emit("set-view", view):
            sys.exit("cannot move the view")

    message = pipeline.get_bus().pop_filtered(Gst.MessageType.ERROR)
    if message:
        print(message.parse_error()[0].message, file=sys.stderr)
    stats = light_field.get_property("stats")
    complete, incomplete = stats.get_value("complete"), stats.get_value("incomplete")
    # The element may have rendered more pictures than were shown, because appsink drops pictures that the application
    # does not fetch in time.
    print(f"{shown} pictures shown, {complete + incomplete} rendered, {complete} of these complete")
    pipeline.set_state(Gst.State.NULL)
    return 0 if shown == pictures and not message else 1


if __name__ == "__main__":
    sys.exit(main())
