#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Arrays of all shapes, and with wide baselines, in front of the built-in scene: compares views along a short path with
ground truth, on the plane in focus and through the focal surface.

The path leads from a camera of the array to its neighbour, diagonally if possible: views in between are farthest from all
cameras. Views are 320x240, cameras 480x360 with the same focal length and therefore a wider field of view.
"""
import argparse
import json
import math
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
FOV, VIEW_FOV, VIEWS, FOCUS = 50, 34.52, 8, 2.2  # degrees, degrees, number, metres


def tool(name, *arguments):
    """Runs a program of this project; exits with its output on failure."""
    run = subprocess.run([OPTIONS.build / "tools" / name, *map(str, arguments)], capture_output=True, text=True, check=False)
    if run.returncode:
        sys.exit(f"{name} {' '.join(map(str, arguments))}: {run.stderr}{run.stdout}")


def new_rig(path, *shape):
    tool("lf-rig", "new", *shape, "--fov", FOV, "--width", 480, "--height", 360, "--out", path)


def path_between(rig, first, second):
    """Views between two cameras of a rig, in the format of views.json."""
    a, b = (rig["cameras"][i] for i in (first, second))
    # q and -q are one orientation.
    sign = 1 if sum(p * q for p, q in zip(a["orientation"], b["orientation"])) > 0 else -1
    views = []
    for i in range(VIEWS):
        t = (i + 0.5) / VIEWS
        turned = [(1 - t) * p + t * sign * q for p, q in zip(a["orientation"], b["orientation"])]
        length = math.hypot(*turned)
        views.append({"name": f"view_{i}", "time": 0, "width": 320, "height": 240, "fov_y": VIEW_FOV,
                      "position": [(1 - t) * p + t * q for p, q in zip(a["position"], b["position"])],
                      "orientation": [q / length for q in turned], "focus_distance": FOCUS})
    return {"format": "lightfield-views", "version": 1, "views": views}


def measure(folder, name, pitch, first, second, some="", surface=()):
    """Prints a row of the table for the rig in `folder`, recorded if necessary, or for `some` of its cameras (ids);
    `surface`: additional options for the focal surface."""
    film = folder / "film"
    views = folder / "views.json"
    if not film.exists():
        views.write_text(json.dumps(path_between(json.loads((folder / "rig.json").read_text()), first, second)))
        tool("lf-scene", "--rig", folder / "rig.json", "--out", film, "--frames", 1, "--truth", views)
    rig = film / "rig.json"
    if some:
        tool("lf-rig", "subset", rig, "--cameras", some, "--out", film / "some.json")
        rig = film / "some.json"
    mean = {}
    for focus in ("plane", "surface"):
        tool("lf-render", "--rig", rig, "--views", views, "--truth", film / "truth", "--focus", focus, "--out",
             folder / focus, "--json", folder / "figures.json", *(surface if focus == "surface" else ()))
        mean[focus] = json.loads((folder / "figures.json").read_text())["mean"]
    cameras = len(json.loads(rig.read_text())["cameras"])
    print(f"| {name} | {cameras} | {pitch} | {100 * mean['surface']['coverage']:.1f} | {mean['plane']['psnr_db']:.2f} | "
          f"{mean['surface']['psnr_db']:.2f} | {mean['surface']['psnr_db'] - mean['plane']['psnr_db']:+.2f} |", flush=True)


def main():
    print("| array | cameras | metres apart | covered, % | plane, dB | surface, dB | |\n| --- | --- | --- | --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as work:
        def folder(name):
            path = pathlib.Path(work) / name
            path.mkdir()
            return path

        here = folder("grid")
        new_rig(here / "rig.json", "--grid", "8x8", "--pitch", 0.04)
        measure(here, "grid 8x8", 0.04, 27, 36)
        # Cells on the path also lack cameras.
        holes = {2, 9, 13, 20, 28, 30, 33, 41, 43, 50, 54, 60}
        measure(here, "grid 8x8 with 12 holes", 0.04, 27, 36, ",".join(str(i) for i in range(64) if i not in holes))
        here = folder("line")
        new_rig(here / "rig.json", "--line", 16, "--pitch", 0.04)
        measure(here, "line", 0.04, 7, 8)
        here = folder("arc")
        new_rig(here / "rig.json", "--arc", 16, "--pitch", 0.04, "--radius", FOCUS)
        measure(here, f"arc around what is {FOCUS} m away", 0.04, 7, 8)
        here = folder("ring")
        new_rig(here / "rig.json", "--ring", 16, "--radius", 0.1)
        measure(here, "ring that looks forward, of 0.1 m", 0.04, 0, 6)
        here = folder("small ring")
        new_rig(here / "rig.json", "--ring", 6, "--radius", 0.1)
        measure(here, "the same of 6 cameras", 0.1, 0, 2)
        here = folder("outward")
        new_rig(here / "rig.json", "--outward", 32, "--radius", 0.2, "--pitch", 0.04)
        measure(here, "cylinder that looks outward, of 0.2 m", 0.04, 0, 33)
        here = folder("inward")
        new_rig(here / "rig.json", "--inward", 64, "--radius", FOCUS, "--pitch", 0.2)
        measure(here, f"cylinder that looks inward, of {FOCUS} m", 0.2, 0, 65)
        near = {row * 64 + column % 64 for row in (0, 1) for column in range(-3, 5)}
        measure(here, "of these the nearest", 0.2, 0, 65, ",".join(map(str, sorted(near))))
        for pitch in (0.04, 0.1, 0.2, 0.4):
            here = folder(f"grid-{pitch}")
            new_rig(here / "rig.json", "--grid", "3x5", "--pitch", pitch)
            measure(here, "grid 3x5", pitch, 6, 12)
        measure(here, "the same with --focus-near 1.1", 0.4, 6, 12, surface=("--focus-near", 1.1))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build", help="the folder of the programs")
    OPTIONS = parser.parse_args()
    main()
