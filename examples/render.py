#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Renders a view from images in NumPy arrays. The picture has the same bits as the picture of render.cc, whose header
comment shows the commands that make the images. Needs the package python3-lightfield.

    python3 render.py scene/rig.json out.ppm
"""
import sys
from pathlib import Path

import lightfield as lf
import numpy as np


def read_ppm(path):
    data = path.read_bytes()
    magic, width, height, levels = data[:64].split()[:4]
    if (magic, levels) != (b"P6", b"255"):
        raise lf.Error(f"{path}: not an 8-bit binary PPM")
    shape = int(height), int(width), 3
    return np.frombuffer(data, np.uint8, offset=len(data) - np.prod(shape)).reshape(shape)


def main():
    if len(sys.argv) < 3:
        sys.exit("usage: render.py RIG.json OUT.ppm")
    rig = lf.load_rig(sys.argv[1])
    folder = Path(sys.argv[1]).parent
    images = [read_ppm((folder / rig.camera(i).image).with_suffix(".ppm")) for i in range(len(rig))]

    renderer = lf.Renderer(rig)
    view = lf.home_view(rig, 640, 480)
    picture = np.empty((view.height, view.width, 3), np.uint8)
    # Every call improves the focal surface. A video passes a new frame each time; for a still, pass the same images
    # repeatedly.
    for _ in range(16):
        renderer.render(view, images, focus=lf.Focus.AUTO, out=picture)
    Path(sys.argv[2]).write_bytes(b"P6 %d %d 255\n" % (view.width, view.height) + picture.tobytes())
    print(f"{sys.argv[2]}: {view.width}x{view.height} pixels from {len(renderer.cameras(view))} of {len(rig)} cameras")


if __name__ == "__main__":
    try:
        main()
    except lf.Error as error:
        sys.exit(str(error))
