#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Runs all programs and pipelines under a locale with a decimal comma, and compares the results with the C locale.

Output must be equal except for times, and files must be identical. A program without a command here is an error. The
test creates the locale (localedef, package locales).

    comma_locale.py BUILD_ROOT
"""
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import urllib.request

BUILD = pathlib.Path(sys.argv[1]).resolve()
SKIP, LIMIT_S = 77, 120
VIEW = "width=64 height=48 num-buffers=3 is-live=false"
# Run in this order, because commands read files of earlier commands.
COMMANDS = [
    "lf-scene --out film --grid 2x3 --width 64 --height 48 --frames 6 --framerate 29.97 --faults 1",
    "lf-scene --out stills --grid 2x2 --width 64 --height 48 --frames 2 --format png",
    "lf-rig info stills/rig.json",
    "lf-rig check stills/rig.json",
    "lf-rig subset film/rig.json --every 2 --out subset.json",
    "lf-path --rig stills/rig.json --out views.json --frames 3 --width 64 --height 48 --near 1.5 --far 4.25",
    "lf-render --rig stills/rig.json --views views.json --out rendered --focus-near 1.5 --focus-far 4.25",
    "lf-show mosaic --rig stills/rig.json --out mosaic.png",
    "lf-show contributions --rig stills/rig.json --out contributions.png --fov 20.5 --move 0.01,0,0",
    "lf-bench --rig stills/rig.json --seconds 0.05 --focus-distance 2.5",
    "lf-archive film --out archive",
    f"gst-launch-1.0 -q lfviewsrc rig=film/rig.json renderer=gl {VIEW} focus=plane ! video/x-raw,format=I420 ! "
    "filesink location=gl.yuv",
    f"gst-launch-1.0 -q lfviewsrc rig=film/rig.json renderer=cpu {VIEW} focus-near=1.5 focus-far=4.25 yaw=1.5 ! "
    "video/x-raw,format=I420 ! filesink location=cpu.yuv",
    "gst-launch-1.0 -q lfviewsrc rig=stills/rig.json is-live=false location=views.json ! videoconvert ! "
    "video/x-raw,format=RGB ! filesink location=flight.rgb",
    f"lf-run lfviewsrc rig=film/rig.json {VIEW} focus=plane yaw=1.5 ! video/x-raw,format=I420 ! filesink location=run.yuv",
    "lf-report --rig stills/rig.json --views views.json --frames flight.rgb --plane flight.rgb --log run.log --scene "
    "--out .",
    "lf-scene lights --rig stills/rig.json --out lights --seconds 8 --framerate 15 --bar 0.25",
    "lf-calibrate track stills/rig.json --recordings lights --bar --out tracks.json",
    "lf-calibrate solve --tracks tracks.json --prior stills/rig.json --bar 0.25 --out solved.json",
]
DIFFER = {"lf-bench"}  # figures differ from run to run
TIMES = re.compile(r"\d+(?:[.,:]\d+)*\s*(?:ms|s\b|seconds)|\d+:\d\d:\d\d\.\d+|0x[0-9a-f]+|^\s*Execution ended.*$|^Got .*$|^Setting .*$|"
                   r"(?<=\d) +\d+\.\d+$", re.M)  # the last column of lf-render's table is milliseconds


def programs():
    return {path.name for folder in ("tools", "calib") for path in (BUILD / folder).iterdir()
            if path.is_file() and os.access(path, os.X_OK) and re.fullmatch(r"lf-[a-z]+", path.name)}


def environment(extra):
    env = {name: value for name, value in os.environ.items() if not name.startswith(("LC_", "LANG"))}
    env |= {"PATH": f"{BUILD}/tools:{BUILD}/calib:{env['PATH']}", "GST_PLUGIN_PATH": str(BUILD / "gst"),
            "GST_GL_PLATFORM": "egl", "EGL_PLATFORM": "surfaceless", "LIBGL_ALWAYS_SOFTWARE": "1", "GST_DEBUG_NO_COLOR": "1"}
    return env | extra


def has_comma(env):
    text = subprocess.run([sys.executable, "-c", "import locale; locale.setlocale(locale.LC_ALL, ''); "
                           "print(locale.localeconv()['decimal_point'])"], env=env, text=True, capture_output=True).stdout
    return text.strip() == ","


def text_of(output):
    return TIMES.sub("", output)


def run_all(folder, env):
    """Returns {command: (exit status, text)}."""
    results = {}
    for command in COMMANDS:
        if command.startswith("lf-report"):
            # Lines of gst-launch-1.0 -m, each with a timestamp in front.
            lines = (f"{10 + 0.5 * i:.3f} Got message #9 from element \"c\" (element): lightfield-view, view-id=(uint)0, "
                     f"sequence=(uint){i}, pts=(guint64)0, complete=(boolean)true, fragments=(uint)3, missing=(uint)0, "
                     "bytes=(guint64)300, consistency-bytes=(guint64)30, skew-ns=(guint64)0, latency-ns=(guint64)5000000, "
                     "composite-ns=(guint64)1;" for i in range(3))
            (folder / "run.log").write_text("\n".join(lines) + "\n")
        done = subprocess.run(command.split(), cwd=folder, env=env, text=True, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, timeout=LIMIT_S)
        results[command] = done.returncode, text_of(done.stdout)
    return results


def serve(folder, env):
    """Returns array.json of lf-serve, or an error text."""
    server = subprocess.Popen(["lf-serve", "--rig", "stills/rig.json", "--port", "0"], cwd=folder, env=env, text=True,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    try:
        for line in server.stdout:
            if found := re.search(r"http://127\.0\.0\.1:\d+/", line):
                with urllib.request.urlopen(found[0] + "array.json", timeout=60) as answer:
                    return answer.read().decode()
        return "lf-serve ended"
    finally:
        server.send_signal(signal.SIGTERM)
        server.wait(30)


def files_of(folder):
    # Matroska files contain a date and random numbers. The solver's threads add in varying order, which changes the
    # last digits of its numbers.
    def comparable(path):
        if path.name != "solved.json":
            return path.read_bytes()
        return re.sub(r"-?\d+\.\d+(?:e-?\d+)?", "NUMBER", path.read_text()).encode()

    return {str(path.relative_to(folder)): comparable(path) for path in folder.rglob("*")
            if path.is_file() and path.suffix != ".mkv"}


def main():
    wrong = [f"{name}: has no command in this test" for name in sorted(
        programs() - {command.split()[0] for command in COMMANDS} - {"lf-serve"})]
    with tempfile.TemporaryDirectory() as root:
        locales = pathlib.Path(root, "locales")
        locales.mkdir()
        try:
            subprocess.run(["localedef", "-i", "de_DE", "-f", "UTF-8", locales / "de_DE.UTF-8"], capture_output=True)
        except FileNotFoundError:
            pass
        envs = {"c": environment({"LC_ALL": "C"}),
                "comma": environment({"LC_ALL": "de_DE.UTF-8", "LOCPATH": str(locales), "LANGUAGE": "en"})}
        if not has_comma(envs["comma"]):
            print("the locale de_DE.UTF-8 can't be made: tools/setup.sh --tests")
            return SKIP
        texts, files, served = {}, {}, {}
        for name, env in envs.items():
            folder = pathlib.Path(root, name)
            folder.mkdir()
            texts[name] = run_all(folder, env)
            served[name] = serve(folder, env)
            files[name] = files_of(folder)
    for command in COMMANDS:
        (status, text), (comma_status, comma_text) = texts["c"][command], texts["comma"][command]
        program = command.split()[0]
        if status != 0:
            wrong.append(f"{command}: exit status {status}:\n{text}")
        elif comma_status != 0:
            wrong.append(f"{command}: exit status {comma_status} with a comma:\n{comma_text}")
        elif program in DIFFER and re.search(r"\d,\d", comma_text):
            wrong.append(f"{command}: writes a comma:\n{comma_text}")
        elif program not in DIFFER and text != comma_text:
            wrong.append(f"{command}: prints\n{text}\nand with a comma\n{comma_text}")
        if "renderer=gl" in command and re.search(r"WARNING", comma_text):
            wrong.append(f"{command}: with a comma\n{comma_text}")
    for name in sorted(files["c"].keys() | files["comma"].keys()):
        if files["c"].get(name) != files["comma"].get(name):
            wrong.append(f"{name}: is another file with a comma")
    if served["c"] != served["comma"] or '"cameras"' not in served["c"]:
        wrong.append(f"lf-serve: array.json is {served['c'][:300]}, and with a comma {served['comma'][:300]}")
    print(*(wrong or [f"{len(COMMANDS) + 1} commands do the same with a comma"]), sep="\n")
    return 1 if wrong else 0


sys.exit(main())
