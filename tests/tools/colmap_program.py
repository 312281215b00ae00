#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""COLMAP reconstructs pictures of the built-in scene. lf-rig imports the model, and lf-render renders it.

    colmap_program.py BUILD_ROOT

Needs Debian's package colmap; otherwise, the test is skipped. The exit status 77 means skipped.
"""
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

import numpy

BUILD = pathlib.Path(sys.argv[1]).resolve()
CAMERAS, WIDTH, HEIGHT = 8, 480, 360
MOST_POSITION_ERROR = 0.02  # of the distance between neighbouring cameras
MOST_LOSS = 0.5  # dB of the prediction of a camera from the others, compared with the true rig


def run(folder, program, *arguments):
    done = subprocess.run([str(program), *(str(a) for a in arguments)], cwd=folder, text=True, stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, check=False, env={"QT_QPA_PLATFORM": "offscreen", "HOME": str(folder)})
    if done.returncode:
        sys.exit(f"{program} failed:\n{done.stdout}")
    return done.stdout


def positions(rig):
    """The camera positions by the name of the camera."""
    return {pathlib.Path(camera["image"]).stem: numpy.array(camera["position"]) for camera in rig["cameras"]}


def values(path):
    """The words of the records of a text model, sorted by record. Numbers are rounded to 1e-12."""
    def value(word):
        try:
            return round(float(word), 12)
        except ValueError:
            return word
    lines = (line for line in path.read_text().splitlines() if line and not line.startswith("#"))
    return sorted([value(word) for word in line.split()] for line in lines)


def scale_and_error(found, truth):
    """Returns the scale of the best similarity transform from `found` to `truth` (Umeyama), and the largest distance."""
    a, b = (points - points.mean(axis=0) for points in (found, truth))
    u, s, v = numpy.linalg.svd(b.T @ a)
    sign = numpy.diag([1, 1, numpy.linalg.det(u @ v)])
    scale = (s * numpy.diag(sign)).sum() / (a ** 2).sum()
    return scale, numpy.linalg.norm(scale * a @ (u @ sign @ v).T - b, axis=1).max()


def mean_psnr(folder, tools, rig):
    run(folder, tools / "lf-render", "--rig", rig, "--leave-one-out", "--out", "pictures", "--json", "table.json")
    return json.loads((folder / "table.json").read_text())["mean"]["psnr_db"]


def main():
    if not shutil.which("colmap"):
        print("colmap is not installed")
        sys.exit(77)
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        tools = BUILD / "tools"
        run(folder, tools / "lf-rig", "new", "--arc", CAMERAS, "--pitch", 0.2, "--radius", 2.5, "--fov", 50, "--width", WIDTH,
            "--height", HEIGHT, "--out", "arc.json")
        run(folder, tools / "lf-scene", "--rig", "arc.json", "--out", "film", "--frames", 1)
        (folder / "images").mkdir()
        rig = json.loads((folder / "film/rig.json").read_text())
        for camera in rig["cameras"]:
            shutil.copy(folder / "film" / camera["image"], folder / "images")
        f, cx, cy = rig["cameras"][0]["params"][:3]
        run(folder, "colmap", "feature_extractor", "--database_path", "db", "--image_path", "images",
            "--ImageReader.single_camera", 1, "--ImageReader.camera_model", "SIMPLE_PINHOLE",
            "--ImageReader.camera_params", f"{f},{cx + 0.5},{cy + 0.5}", "--SiftExtraction.use_gpu", 0)
        run(folder, "colmap", "exhaustive_matcher", "--database_path", "db", "--SiftMatching.use_gpu", 0)
        (folder / "sparse").mkdir()
        run(folder, "colmap", "mapper", "--database_path", "db", "--image_path", "images", "--output_path", "sparse",
            "--Mapper.ba_refine_focal_length", 0, "--Mapper.ba_refine_extra_params", 0)
        said = run(folder, tools / "lf-rig", "import", ".", "--out", "found.json")
        assert "colmap: 8 cameras from sparse/0/images.bin, images in images" in said and "--scale" in said, said

        truth = positions(rig)
        found = positions(json.loads((folder / "found.json").read_text()))
        names = sorted(truth)
        assert sorted(found) == names, said
        scale, error = scale_and_error(*(numpy.array([of[name] for name in names]) for of in (found, truth)))
        pitch = numpy.linalg.norm(truth[names[1]] - truth[names[0]])
        print(f"scale {scale:.4f}, position error {error / pitch:.4f} of the pitch")
        assert error < MOST_POSITION_ERROR * pitch

        # COLMAP reads the exported binary model, with and without rigs, and writes the exported text model.
        run(folder, tools / "lf-rig", "export", "colmap", "found.json", "text")
        for model, option in (("plain", ()), ("rigs", ("--rig-id", 1))):
            run(folder, tools / "lf-rig", "export", "colmap", "found.json", model, "--binary", *option)
            (folder / "converted").mkdir(exist_ok=True)
            run(folder, "colmap", "model_converter", "--input_path", model, "--output_path", "converted",
                "--output_type", "TXT")
            for file in ("cameras.txt", "images.txt"):
                assert values(folder / "converted" / file) == values(folder / "text" / file), file

        said = run(folder, tools / "lf-rig", "import", ".", "--scale", scale, "--out", "found.json")
        distance = float(re.search(r"row, ([0-9.]+) m between neighbouring cameras\n", said)[1])
        assert abs(distance / pitch - 1) < MOST_POSITION_ERROR, said
        run(folder, tools / "lf-rig", "check", "found.json")
        ours, best = (mean_psnr(folder, tools, rig) for rig in ("found.json", "film/rig.json"))
        print(f"cameras predicted from the others: {ours:.2f} dB, with the true rig {best:.2f} dB")
        assert ours > best - MOST_LOSS


main()
