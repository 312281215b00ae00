#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Figures of public light fields: renders photographs that were held out, and writes a page beside published figures.

The script downloads nothing. Each SET is a folder of one of these kinds:

- an LLFF capture (poses_bounds.npy, and photographs in images_4, images_8 or images). Every eighth photograph is held
  out, as in the publications.
- an LLFF capture with films (cam00.mp4, ...), as in the Neural 3D Video dataset. The first camera is held out, and the
  first frame is compared.
- a scene of the HCI 4D Light Field Benchmark (parameters.cfg), or a grid of images with names of the Stanford archive.
  Odd rows and columns are held out.
- Technicolor's films (cameras_parameters.txt). Camera 10, in the third row and column, is held out, and the first frame
  is compared.
- a scene of the DeepView Video dataset (models.json), filmed by Google's rig of 46 fisheye cameras. camera_0001 is held
  out, and the first frame is compared.
- rig.json with views.json and a folder truth, in the formats of this project.

Needs NumPy and Pillow. Set GST_PLUGIN_PATH to another plugin than BUILD/gst if necessary.
"""
import argparse
import json
import math
import os
import pathlib
import re
import shutil
import statistics
import subprocess
import sys
import tempfile

import numpy
from PIL import Image, ImageChops

ROOT = pathlib.Path(__file__).resolve().parents[2]
NERF = "Mildenhall et al. 2020, NeRF, table of the real scenes (LLFF is the learned method of 2019)"
DYNERF = "Li et al. 2022, Neural 3D Video Synthesis, table of flame_salmon (means of 10 s)"
# PSNR in dB by the name of the folder: (source, {method: PSNR}).
PUBLISHED = {name: (NERF, {"LLFF": llff, "NeRF": nerf}) for name, llff, nerf in (
    ("fern", 22.85, 25.17), ("flower", 25.46, 27.40), ("fortress", 29.40, 31.16), ("horns", 24.70, 27.45),
    ("leaves", 19.52, 20.92), ("orchids", 18.52, 20.36), ("room", 28.42, 32.70), ("trex", 24.15, 26.80))}
STG = "Li et al. 2024, Spacetime Gaussian Feature Splatting, tables 12 and 13 (means of 50 frames)"
PUBLISHED |= {name: (STG, {"HyperReel": hyperreel, "STG": stg}) for name, hyperreel, stg in (
    ("Birthday", 29.99, 32.09), ("Fabien", 34.70, 35.70), ("Painter", 35.91, 36.44), ("Theater", 33.32, 30.99),
    ("Trains", 29.74, 32.58), ("01_Welder", 25.55, 26.84), ("02_Flames", 30.63, 30.57),
    ("04_Truck", 27.18, 27.31), ("09_Alexa_Meade_Exhibit", 31.26, 29.34), ("10_Alexa_Meade_Face_Paint_1", 29.31, 30.59),
    ("11_Alexa_Meade_Face_Paint_2", 27.34, 29.90), ("12_Cave", 30.06, 29.61))}
PUBLISHED["flame_salmon_1"] = (DYNERF, {"LLFF": 23.24, "DyNeRF": 29.58})


class Failure(Exception):
    """A set that cannot be measured; the text says why."""


def run(*arguments):
    done = subprocess.run([str(a) for a in arguments], text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          check=False)
    if done.returncode:
        raise Failure(f"{pathlib.Path(arguments[0]).name} failed: {done.stdout.strip()}")
    return done.stdout


def tool(name, *arguments):
    return run(OPTIONS.build / "tools" / name, *arguments)


def image_folder(folder):
    """The reduced photographs that publications use, otherwise the originals."""
    return next((folder / name for name in ("images_4", "images_8", "images") if (folder / name).is_dir()), None)


def import_set(folder, rig):
    """Writes the rig file of a set. Returns the indices of the cameras that are held out, and of those that are kept."""
    images = image_folder(folder)
    if (folder / "poses_bounds.npy").exists():
        tool("lf-rig", "import", "llff", folder, "--out", rig, *(("--images", images) if images else ()))
    elif (folder / "models.json").exists():
        tool("lf-rig", "import", "deepview", folder / "models.json", "--out", rig)
    else:
        kind = ("technicolor" if (folder / "cameras_parameters.txt").exists() else
                "hci" if (folder / "parameters.cfg").exists() else "stanford")
        tool("lf-rig", "import", kind, folder, "--out", rig)
    description = json.loads(rig.read_text())
    indices = range(len(description["cameras"]))
    if (folder / "poses_bounds.npy").exists():
        held_out = [index for index in indices if index % 8 == 0] if images else [0]
    elif (folder / "models.json").exists():
        held_out = [index for index in indices if description["cameras"][index]["name"] == "camera_0001"]
    elif (folder / "cameras_parameters.txt").exists():
        held_out = [10]
    else:
        topology = description["topology"]
        if topology["type"] != "grid":
            raise Failure("the images are not a grid")
        places = [divmod(index, topology["columns"]) for index in indices]
        return ([index for index in indices if places[index][0] % 2 == places[index][1] % 2 == 1],
                [index for index in indices if places[index][0] % 2 == places[index][1] % 2 == 0])
    if not set(held_out) < set(indices):
        raise Failure("the camera that publications hold out is missing")
    return held_out, [index for index in indices if index not in held_out]


def first_frame(source, still):
    """Writes the first frame of a film, or of a sequence of pictures with a %d in their name."""
    if "%" in source.name:
        picture = next((path for path in (source.with_name(source.name % n) for n in (0, 1)) if path.exists()), None)
        if not picture:
            raise Failure(f"{source}: no first picture")
        return Image.open(picture).convert("RGB").save(still)
    run("gst-launch-1.0", "-q", "uridecodebin", f"uri={source.resolve().as_uri()}", "!", "videoconvert", "!", "pngenc",
        "snapshot=true", "!", "filesink", f"location={still}")


def split(folder, work):
    """Returns the rig, the views and the folder with the truth of a set."""
    if (folder / "views.json").exists():
        return folder / "rig.json", folder / "views.json", folder / "truth"
    held_out, kept = import_set(folder, work / "all.json")
    rig = json.loads((work / "all.json").read_text())
    truth = work / "truth"
    truth.mkdir()
    views = []
    for index in sorted(held_out + kept):
        camera = rig["cameras"][index]
        if "source" in camera and "image" not in camera:
            camera["image"] = f"{camera['name']}.png"
            first_frame(work / camera.pop("source"), work / camera["image"])
        if index not in held_out:
            continue
        name = f"v{index:03}"
        Image.open(work / camera["image"]).convert("RGB").save(truth / f"{name}.png")
        views.append({"name": name, **{key: camera[key] for key in (
            "position", "orientation", "width", "height", "model", "params")}})
    (work / "all.json").write_text(json.dumps(rig))
    tool("lf-rig", "subset", work / "all.json", "--cameras", ",".join(str(rig["cameras"][i]["id"]) for i in kept), "--out", work / "rig.json")
    tool("lf-path", "--rig", work / "rig.json", "--out", work / "path.json", "--frames", 16)
    planes = [view["focal_plane"] for view in json.loads((work / "path.json").read_text())["views"]]
    plane = sorted(planes, key=lambda p: abs(p[3]))[len(planes) // 2]
    (work / "views.json").write_text(json.dumps({"format": "lightfield-views", "version": 1, "views": [
        {**view, "time": 0, "focal_plane": plane} for view in views]}))
    return work / "rig.json", work / "views.json", truth


def speed(rig):
    """Nanoseconds a pixel and bytes a view of JPEG answers on a focal surface, on one thread."""
    said = tool("lf-bench", "--rig", rig, "--held-out", 0)
    width, height = map(int, re.search(r"views of (\d+)x(\d+)", said).groups())
    row = re.search(r"JPEG \d+, focal surface +([\d.]+) +\d+ +(\d+)", said)
    return float(row[1]) * 1e6 / (width * height), int(row[2])


def delay(rig):
    """Milliseconds from a request to its picture in a live pipeline: the median of the second half of 120 pictures."""
    said = run("gst-launch-1.0", "-m", "lfviewsrc", f"rig={rig}", "post-messages=true", "num-buffers=120", "!", "fakesink",
               "sync=false")
    found = [int(t) for t in re.findall(r"latency-ns=\(guint64\)(\d+)", said)]
    if not found:
        raise Failure("the live pipeline showed no picture")
    return statistics.median(found[len(found) // 2:]) * 1e-6


def psnr(truth, picture):
    """PSNR in dB of all pixels, as in publications: pixels that no camera sees are black."""
    pair = [numpy.asarray(Image.open(path).convert("RGB"), dtype=numpy.float64) for path in (truth, picture)]
    return 10 * math.log10(255 ** 2 / max(1e-9, numpy.mean((pair[0] - pair[1]) ** 2)))


def mean_psnr(views):
    return statistics.fmean(view["psnr"] for view in views)


def measure(folder, out):
    """Returns the figures of a set; writes pictures to `out`."""
    with tempfile.TemporaryDirectory() as name:
        work = pathlib.Path(name)
        rig, views, truth = split(folder, work)
        found = {}
        for focus in ("plane", "surface"):
            tool("lf-render", "--rig", rig, "--views", views, "--truth", truth, "--focus", focus, "--out", work / focus,
                 "--json", work / "table.json")
            found[focus] = json.loads((work / "table.json").read_text())["views"]
            for view in found[focus]:
                view["psnr"] = psnr(truth / f"{view['name']}.png", work / focus / f"{view['name']}.png")
        out.mkdir(parents=True, exist_ok=True)
        for view in found["surface"]:
            triple = [Image.open(f / f"{view['name']}.png").convert("RGB") for f in (truth, work / "surface")]
            triple.append(ImageChops.difference(*triple).point(lambda v: min(255, 3 * v)))
            sheet = Image.new("RGB", (sum(i.width for i in triple), triple[0].height))
            for index, image in enumerate(triple):
                sheet.paste(image, (index * image.width, 0))
            sheet.save(out / f"{view['name']}.jpg", quality=88)
        found["cameras"] = len(json.loads(rig.read_text())["cameras"])
        found["ns"], found["bytes"] = speed(rig)
        found["delay"] = delay(rig)
        return found


def page(sets, failures):
    lines = ["# Figures of public light fields", "", "PSNR in dB and SSIM of held-out photographs, at the defaults. The PSNR "
             "includes all pixels, the SSIM only those in the share *seen* by the kept cameras. *ns* is the time for a pixel of a view on one thread, "
             "with JPEG answers on a focal surface; *bytes* is the size of these answers; *delay* is the time from a request "
             "to its picture in a live pipeline on this machine.", "",
             "| set | cameras | views | plane, dB | surface, dB | SSIM | seen, % | ns | bytes | delay, ms | published, dB |",
             "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |"]
    for name, found in sets.items():
        surface = found["surface"]
        published = PUBLISHED.get(name, ("", {}))[1]
        lines.append(f"| {name} | {found['cameras']} | {len(surface)} | {mean_psnr(found['plane']):.2f} | "
                     f"{mean_psnr(surface):.2f} | {statistics.fmean(v['ssim'] for v in surface):.3f} | "
                     f"{100 * statistics.fmean(v['coverage'] for v in surface):.1f} | {found['ns']:.0f} | {found['bytes']} | "
                     f"{found['delay']:.0f} | {', '.join(f'{k} {v:.2f}' for k, v in published.items())} |")
    sources = sorted({PUBLISHED[name][0] for name in sets if name in PUBLISHED})
    if sources:
        lines += ["", "Published figures: " + "; ".join(sources) + "."]
    for name, text in failures.items():
        lines += ["", f"**{name}** could not be measured: {text}"]
    for name, found in sets.items():
        lines += ["", f"## {name}", "", "Truth, view, and three times the difference.", "",
                  "| view | plane, dB | surface, dB | SSIM | seen, % |", "| --- | --- | --- | --- | --- |"]
        for plane, surface in zip(found["plane"], found["surface"]):
            lines.append(f"| [{surface['name']}]({name}/{surface['name']}.jpg) | {plane['psnr']:.2f} | "
                         f"{surface['psnr']:.2f} | {surface['ssim']:.3f} | {100 * surface['coverage']:.1f} |")
        worst = min(found["surface"], key=lambda v: v["psnr"])["name"]
        lines += ["", f"![worst view of {name}]({name}/{worst}.jpg)"]
    return "\n".join(lines) + "\n"


def main():
    sets, failures = {}, {}
    for folder in OPTIONS.sets:
        name = folder.resolve().name
        print(f"{name} ...", flush=True)
        shutil.rmtree(OPTIONS.out / name, ignore_errors=True)
        try:
            sets[name] = measure(folder.resolve(), OPTIONS.out / name)
        except Failure as failure:
            failures[name] = str(failure)
    text = page(sets, failures)
    OPTIONS.out.mkdir(parents=True, exist_ok=True)
    (OPTIONS.out / "index.md").write_text(text)
    print(text)
    return bool(failures)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", nargs="+", type=pathlib.Path, metavar="SET", help="folder of a set")
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build", help="build folder (default: build)")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("public-sets"),
                        help="folder for the page index.md and its pictures (default: public-sets)")
    OPTIONS = parser.parse_args()
    os.environ.setdefault("GST_PLUGIN_PATH", str(OPTIONS.build.resolve() / "gst"))
    sys.exit(main())
