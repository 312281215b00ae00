#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Checks the commands of all documents: shell and Python blocks, and commands between backquotes in the text.

Runs launch lines and our quick tools exactly as written, in a folder with a film of 64 cameras and a path. Does not run
commands with placeholders in CAPITALS, devices in /dev, scripts or test programs, but checks that their elements,
properties, links, programs and options exist. Commands of other programs (apt, npm, chronyc) only need valid syntax.

    commands.py BUILD_ROOT SOURCE_ROOT
"""
import ctypes
import functools
import json
import os
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile
import time

import gi

for name in "Gst", "GstGL", "GstGLEGL":
    gi.require_version(name, "1.0")
from gi.repository import GLib, Gst, GstGL, GstGLEGL  # noqa: E402

BUILD, SOURCE = (pathlib.Path(path).resolve() for path in sys.argv[1:3])
PICTURES, PATIENCE_S, LISTENING_S = 3, 60, 1
# Elements in the documents that Debian 12 lacks, or that are in a package without other use.
OF_OTHERS = {"ndisink", "rtspclientsink", "whepclientsrc"}
CAPITALS = re.compile(r"\b[A-Z][A-Z0-9_]{2,}\b")
# Words in capitals that are not placeholders, but part of caps.
THEMSELVES = {"JPEG", "RGB", "LIGHTFIELD", "REQUEST", "ANSWER"}
# The start of a command in the text.
OURS = re.compile(r"(gst-launch-1\.0|lf-[a-z]+|bench-[a-z-]+|(build|tests|tools|pipelines)/[\w./-]+|ninja|meson test) .")


def documents():
    """Returns {name: text} of all documents."""
    names = ["README.md", "CONTRIBUTING.md", "SECURITY.md", "calib/README.md", "web/README.md", "lib/wire/spec.md", "lib/rtp/spec.md"]
    names += sorted(str(path.relative_to(SOURCE)) for path in (SOURCE / "docs").rglob("*.md"))
    return {name: (SOURCE / name).read_text() for name in names}


def shell_blocks(text):
    return [block for block in re.findall(r"^```sh\n(.*?)^```", text, re.S | re.M) if not block.startswith("...")]


def python_blocks(text):
    return re.findall(r"^```python\n(.*?)^```", text, re.S | re.M)


def run_python(block):
    """Runs a program of a document in the folder with the film. Raises Wrong if the program fails or prints nothing."""
    result = subprocess.run([sys.executable, "-"], input=block, capture_output=True, text=True, timeout=PATIENCE_S)
    if result.returncode != 0 or not result.stdout:
        raise Wrong(result.stderr or "prints nothing")
    return f"prints {result.stdout.count(chr(10))} lines"


def inline_commands(text):
    text = re.sub(r"^```.*?^```", "", text, flags=re.S | re.M)
    return [re.sub(r"\s+", " ", code) for code in re.findall(r"`([^`]+)`", text) if OURS.match(code)]


def has_closed_quotes(text):
    try:
        shlex.split(text, comments=True)
    except ValueError:
        return False
    return True


def simple_commands(block):
    """Yields the commands of a block, each as a list of words."""
    block = re.sub(r"\\\n", " ", block)
    command = ""
    for line in block.splitlines():
        command += line + "\n"
        if not has_closed_quotes(command):
            continue
        lexer = shlex.shlex(command, posix=True, punctuation_chars="();<>|&")
        command = ""
        lexer.whitespace_split, lexer.commenters = True, "#"
        words = []
        for word in [*lexer, ";"]:
            if word in (";", "&&", "||", "|", "&"):
                if words:
                    yield words
                words = []
            else:
                words.append(word)


def is_only_verified(words):
    text = " ".join(words)
    return "/dev/" in text or any(word not in THEMSELVES for word in CAPITALS.findall(text))


class Wrong(Exception):
    pass


# --- Launch lines -----------------------------------------------------------------------------------------------------

@functools.cache
def display():
    """Returns Mesa's OpenGL display without a screen. GStreamer 1.22 does not find this display itself."""
    egl = ctypes.CDLL("libEGL.so.1")
    egl.eglGetPlatformDisplay.restype = ctypes.c_void_p
    egl.eglGetPlatformDisplay.argtypes = [ctypes.c_uint, ctypes.c_void_p, ctypes.c_void_p]
    egl.eglInitialize.argtypes = [ctypes.c_void_p] * 3
    surfaceless = 0x31DD  # EGL_PLATFORM_SURFACELESS_MESA
    found = egl.eglGetPlatformDisplay(surfaceless, None, None)
    egl.eglInitialize(found, None, None)
    context = Gst.Context.new("gst.gl.GLDisplay", True)
    GstGL.context_set_gl_display(context, GstGLEGL.GLDisplayEGL.new_with_egl_display(found))
    return context


def launch(words):
    """Returns a gst-launch-1.0 pipeline without windows, or None with a missing element of OF_OTHERS."""
    line = " ".join(word for word in words if not word.startswith("-")).replace("$PWD", os.getcwd())
    if any(re.search(rf"\b{name}\b", line) and not Gst.ElementFactory.find(name) for name in OF_OTHERS):
        return None
    line = line.replace("autovideosink", "fakesink sync=true").replace("glimagesink", "glupload ! fakesink sync=true")
    try:
        made = Gst.parse_launch_full(line, None, Gst.ParseFlags.FATAL_ERRORS)
    except GLib.Error as error:
        raise Wrong(error.message) from error
    pipeline = made if isinstance(made, Gst.Pipeline) else Gst.Pipeline()
    if pipeline is not made:
        pipeline.add(made)
    if re.search(r"\bgl[a-z]+", line):
        pipeline.set_context(display())
    return pipeline


def run_line(words):
    """Runs a pipeline to its end, until every sink has a few frames, or briefly if the pipeline listens or records."""
    pipeline = launch(words)
    if pipeline is None:
        return "not here"
    counts = {}

    def count(pad, _info, name):
        counts[name] += 1
        return Gst.PadProbeReturn.OK

    sinks = pipeline.iterate_sinks()
    while (found := sinks.next())[0] == Gst.IteratorResult.OK:
        if pad := found[1].get_static_pad("sink"):
            counts[found[1].name] = 0
            pad.add_probe(Gst.PadProbeType.BUFFER, count, found[1].name)
    text = " ".join(words)
    listens = re.search(r"\b(udpsrc|tcpserversrc|lfnodesink|udpsink|playbin|record)\b", text)
    pipeline.set_state(Gst.State.PLAYING)
    begun, said = time.monotonic(), ""
    try:
        while True:
            message = pipeline.get_bus().timed_pop_filtered(50 * Gst.MSECOND, Gst.MessageType.ERROR | Gst.MessageType.EOS)
            if message and message.type == Gst.MessageType.ERROR:
                raise Wrong(message.parse_error()[0].message)
            if message:
                said = "to its end"
            elif listens and time.monotonic() > begun + LISTENING_S:
                said = "listens"
            elif counts and not listens and all(n >= PICTURES for n in counts.values()) and "multifilesink" not in text:
                said = f"{PICTURES} pictures"
            if said:
                if not listens and any(n == 0 for n in counts.values()):
                    raise Wrong("ended without a picture")
                return said
            if time.monotonic() > begun + PATIENCE_S:
                raise Wrong(f"no pictures within {PATIENCE_S} s")
    finally:
        pipeline.set_state(Gst.State.NULL)


# --- Programs ---------------------------------------------------------------------------------------------------------

@functools.cache
def help_of(program, *subcommand):
    """Returns the --help text of a program. Scripts pass options on: returns the texts of a script, of the scripts in
    its folder, and of the tools in the script."""
    if program.suffix != ".sh":
        return subprocess.run([program, *subcommand, "--help"], capture_output=True, text=True, timeout=60).stdout
    ours = [BUILD / "tools" / name for name in set(re.findall(r"\blf-[a-z]+\b", program.read_text()))]
    texts = [path.read_text() for path in program.parent.glob("*.sh")]
    return "".join(texts + [help_of(path) for path in ours if path.is_file()])


def find_program(name):
    """Finds a program of ours by its path or installed name. Returns None for other programs."""
    if "/" in name:
        path = (BUILD / name[len("build/"):]) if name.startswith("build/") else SOURCE / name
        if path.exists() or path.name in TARGETS:
            return path
        raise Wrong(f"there is no {name}")
    for folder in ("tools", "calib", "tests/bench"):
        if (BUILD / folder / name).is_file():
            return BUILD / folder / name
    if name in TARGETS:
        return BUILD / "tests/bench" / name
    if name.startswith(("lf-", "bench-")):
        raise Wrong(f"there is no program {name}")
    return None


def check_options(program, words):
    if not program.is_file() or program.name.startswith(("test-", "bench-sum")):
        return "known"  # GoogleTest's or Google Benchmark's options, or not built
    text, subcommand = help_of(program), []
    level = text
    for word in words:
        if not re.fullmatch(r"[a-z][a-z-]*", word) or not re.search(rf"(^|\s){word}\b", level):
            break
        subcommand.append(word)
        level = help_of(program, *subcommand)
        text += level
    for word in words:
        option = word.split("=")[0]
        if option.startswith("-") and not re.search(rf"(^|[\s,|(\[]){re.escape(option)}\b", text):
            raise Wrong(f"{program.name} {' '.join(subcommand)} has no option {option}")
    return "options are known"


def check_names(words, known, with_option):
    """Checks the names in `ninja -C build TARGET...` or `meson test -C build [--suite SUITE] [NAME...]`."""
    names = [w for i, w in enumerate(words) if not w.startswith("-") and (i == 0 or words[i - 1] != "-C")]
    for name in names[with_option:]:
        if name.split("/")[-1] not in known:
            raise Wrong(f"there is no {name}")
    return "names are known"


# Tools that are quick and find all their input files.
RUN = {"lf-rig", "lf-path", "lf-show"}


def check(words, is_mention):
    """Runs or checks a command and returns the result. Commands in running text (`is_mention`) do not run. Raises Wrong."""
    words = [word for i, word in enumerate(words) if not re.fullmatch(r"[<>]+", word) and
             not (i > 0 and re.fullmatch(r"[<>]+", words[i - 1]))]
    name, rest = words[0], words[1:]
    if name == "gst-launch-1.0":
        if not is_mention and not is_only_verified(words):
            return run_line(rest)
        pipeline = launch(rest)
        return "not here" if pipeline is None else "elements and properties are known"
    if name == "ninja":
        return check_names(rest, TARGETS, 0)
    if words[:2] == ["meson", "test"]:
        return check_names(rest, TESTS, 1)
    program = find_program(name)
    if program is None:
        return "of others"
    if name in RUN and not is_mention and not is_only_verified(words):
        result = subprocess.run([program, *rest], capture_output=True, text=True, timeout=PATIENCE_S)
        if result.returncode != 0:
            raise Wrong(result.stderr or result.stdout)
        return "runs"
    return check_options(program, rest)


def make_film():
    """Creates the files that documents assume: a film with its rig, a path, requests in a file, and a key."""
    tools = BUILD / "tools"
    quiet = {"check": True, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    subprocess.run([tools / "lf-scene", "--out", ".", "--width", "48", "--height", "36", "--frames", "8"], **quiet)
    subprocess.run([tools / "lf-path", "--rig", "rig.json", "--out", "views.json", "--frames", "8"], **quiet)
    pathlib.Path("lightfield.key").write_text("0f" * 32 + "\n")
    pathlib.Path("lightfield.key").chmod(0o600)
    run_line("lfviewrequest location=views.json ! filesink location=path.lfq".split())
    pathlib.Path("quickstart-out").mkdir()
    run_line(("lfviewsrc rig=rig.json location=views.json is-live=false ! videoconvert ! jpegenc ! matroskamux ! "
              "filesink location=quickstart-out/view.mkv").split())


# Wrong commands, to test the checks themselves.
WRONG = """\
gst-launch-1.0 lfviewsrc rig=rig.json nosuch=1 ! videoconvert ! autovideosink
gst-launch-1.0 lfnosuch ! fakesink
gst-launch-1.0 lfviewsrc rig=rig.json ! lfcompositor ! fakesink
gst-launch-1.0 lfcamsrc rig=nosuch.json ! videoconvert ! autovideosink
lf-rig check nosuch.json
lf-bench --nosuch
lf-nosuch --help
pipelines/publish-janus.sh --rig rig.json --nosuch 1
pipelines/nosuch.sh
ninja -C build nosuch
meson test -C build --suite nosuch
"""


def introspect(what):
    return json.loads(subprocess.run(["meson", "introspect", what, BUILD], capture_output=True, text=True, check=True).stdout)


def main():
    global TARGETS, TESTS
    os.environ["GST_PLUGIN_PATH"] = str(BUILD / "gst")
    os.environ |= {"GST_GL_PLATFORM": "egl", "GST_GL_WINDOW": "egl-device"}  # without a display
    Gst.init(None)
    TARGETS = {pathlib.Path(name).name for target in introspect("--targets")
               for name in [target["name"], *target["filename"]]}
    TARGETS |= {"benchmarks", "elements-md", "tools-md", "install", "uninstall"}
    tests = introspect("--tests")
    TESTS = {test["name"] for test in tests} | {suite.split(":")[-1] for test in tests for suite in test["suite"]}
    failures, checked = 0, {}
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        make_film()
        for words in simple_commands(WRONG):
            try:
                print(f"FAILED to find out: {' '.join(words)}: {check(words, False)}")
                failures += 1
            except Wrong:
                pass
        for name, text in documents().items():
            for block in python_blocks(text):
                try:
                    checked[block] = run_python(block)
                    print(f"{name}: a program in Python: {checked[block]}", flush=True)
                except (Wrong, subprocess.TimeoutExpired) as error:
                    failures += 1
                    print(f"FAILED {name}: {block}\n    {error}", flush=True)
            blocks = shell_blocks(text)
            for block in blocks:
                parsed = subprocess.run(["bash", "-n"], input=block, text=True, capture_output=True)
                if parsed.returncode != 0:
                    failures += 1
                    print(f"FAILED {name}: {parsed.stderr}{block}")
            of_text = inline_commands(text)
            for words, is_mention in [(words, code in of_text) for code in blocks + of_text for words in simple_commands(code)]:
                key = " ".join(words)
                if key in checked:
                    continue
                begun = time.monotonic()
                try:
                    checked[key] = check(words, is_mention)
                    print(f"{name}: {key[:100]}: {checked[key]} ({time.monotonic() - begun:.1f} s)", flush=True)
                except (Wrong, subprocess.TimeoutExpired, OSError) as error:
                    failures += 1
                    print(f"FAILED {name}: {key}\n    {error}", flush=True)
        os.chdir("/")
    print(f"{len(checked)} commands checked, {failures} wrong")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
