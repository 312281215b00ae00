#!/bin/bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Compares the size and quality of archived recordings of the built-in scene, dB against bytes: JPEG from the cameras,
# H.264 per camera, and H.264 of a row of cameras in one stream, with the frames of an instant one after another.
set -eu
root=$(cd "$(dirname "$0")/../.." && pwd)
build=${LF_BUILD:-$root/build}
cameras=8 frames=20
ninja -C "$build" tools/lf-scene >&2
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"$build/tools/lf-scene" --out film --grid "1x$cameras" --frames $frames --framerate 30 >/dev/null 2>&1
"$build/tools/lf-scene" --out truth --grid "1x$cameras" --frames $frames --framerate 30 --format png >/dev/null 2>&1
yuv=video/x-raw,format=I420,colorimetry=1:4:0:0
for i in $(seq 0 $((cameras - 1))); do
  name=cam_00_0$i
  gst-launch-1.0 -q multifilesrc location="truth/${name}_%04d.png" caps=image/png,framerate=30/1 ! pngdec ! videoconvert ! \
    $yuv ! filesink location="truth$i.yuv"
  gst-launch-1.0 -q filesrc location="film/$name.mkv" ! matroskademux ! jpegdec idct-method=islow ! videoconvert ! $yuv ! \
    filesink location="jpeg$i.yuv"
done

/usr/bin/python3 - $cameras $frames <<'PYTHON'
import glob, math, os, subprocess, sys
cameras, frames = int(sys.argv[1]), int(sys.argv[2])
SIZE, LUMA = 320 * 240 * 3 // 2, 320 * 240
read = lambda path: open(path, "rb").read()
truth, jpeg = ([read(f"{kind}{i}.yuv") for i in range(cameras)] for kind in ("truth", "jpeg"))

def psnr(films):
    """PSNR of luma over all frames."""
    squares = 0
    for film, true in zip(films, truth):
        for frame in range(frames):
            a, b = (of[frame * SIZE:frame * SIZE + LUMA] for of in (film, true))
            squares += sum((x - y) ** 2 for x, y in zip(a, b))
    return 10 * math.log10(255 ** 2 * LUMA * cameras * frames / squares)

def coded(film, quantizer, options):
    """Encodes raw frames; returns the size in bytes and the decoded frames."""
    open("raw.yuv", "wb").write(film)
    form = "rawvideoparse format=i420 width=320 height=240 framerate=30/1 colorimetry=1:4:0:0"
    subprocess.run(f"gst-launch-1.0 -q filesrc location=raw.yuv ! {form} ! x264enc pass=qual quantizer={quantizer} {options} ! "
                   "video/x-h264,profile=main,stream-format=byte-stream ! filesink location=coded.264".split(), check=True)
    subprocess.run("gst-launch-1.0 -q filesrc location=coded.264 ! h264parse ! openh264dec ! "
                   "video/x-raw,format=I420 ! filesink location=shown.yuv".split(), check=True)
    shown = read("shown.yuv")
    assert len(shown) == len(film), (len(shown), len(film))
    return os.path.getsize("coded.264"), shown

def row(kind, size, films):
    print(f"| {kind} | {size // (cameras * frames):,} | {psnr(films):.2f} |", flush=True)

print("| | bytes a frame | PSNR, dB |\n| --- | --- | --- |")
row("JPEG 90, as it came", sum(map(os.path.getsize, glob.glob("film/*.mkv"))), jpeg)
for quantizer in (13, 18, 23, 28):
    own = [coded(film, quantizer, "key-int-max=30 bframes=0") for film in jpeg]
    row(f"H.264 of each camera, quantizer {quantizer}", sum(size for size, _ in own), [shown for _, shown in own])
for quantizer in (13, 18, 23, 28):
    film = b"".join(jpeg[i][f * SIZE:(f + 1) * SIZE] for f in range(frames) for i in range(cameras))
    size, shown = coded(film, quantizer, f"key-int-max={30 * cameras} bframes=0 ref={2 * cameras}")
    row(f"H.264 of the row as one film, quantizer {quantizer}", size,
        [b"".join(shown[(f * cameras + i) * SIZE:(f * cameras + i + 1) * SIZE] for f in range(frames)) for i in range(cameras)])
PYTHON
