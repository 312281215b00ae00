#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Checks that only lib/base/file.h reads and writes files, and that programs print only with tools/terminal.h.

Its writer keeps the old file until the new file is complete, preserves modes and links, and syncs. Its reader rejects
devices, FIFOs and huge files. Prints each other place that opens a file, and exits 1 if there is any. Ignores
GStreamer's sinks, which write growing recordings. tools/terminal.h removes escape sequences of hostile files and
cameras.

    writers.py SOURCE_ROOT
"""
import pathlib
import re
import sys

FORBIDDEN = re.compile(
    r"std::(?:o|w|wo)?fstream\b|\bf(?:re)?open\(|\bcv::im(?:read|write)\b|\bg_file_set_contents|\bcreat\(|"
    r"cv::FileStorage\s+\w+\([^;]*FileStorage::(?:WRITE|READ)(?![^;]*MEMORY)|\bfs::copy_file\(|std::ifstream\b"
)
# Kernel files (/proc, /sys), which have no size; secrets, which are wiped from memory; and the first bytes of films, images
# and files to import.
ALLOWED = {
    "calib/recordings.cc": "std::ifstream",
    "gst/bins/rtp_link.cc": "std::ifstream",
    "gst/camsrc/picture_sources.cc": "std::ifstream",
    "gst/common/codecs.cc": "std::ifstream",
    "gst/rtp/srtp.cc": "std::ifstream",
    "lib/rig/camera_source.cc": "std::ifstream",
    "lib/rig/import_format.cc": "std::ifstream",
    "lib/rig/rig_report.cc": "std::ifstream",
    "lib/rig/still_image_cache.cc": "std::ifstream",
    "tools/cameras/links.cc": "std::ifstream",
    "tools/lf_report.cc": "std::ifstream",
    "tools/serve/http_server.cc": "std::ifstream",
    "tools/serve/adaptation.h": "std::ifstream",
}
PRINTING = re.compile(r"std::v?f?printf\(|std::f?puts\(|std::(?:cout|cerr)\b|\bg_print(?:err)?\(")
PRINTERS = ("tools/terminal.h", "tools/progress.h", "tools/serve/process.cc")


def places(root):
    for building in ("lib", "gst", "tools", "calib"):
        for path in sorted((root / building).rglob("*")):
            if path.suffix not in (".h", ".cc"):
                continue
            name = str(path.relative_to(root))
            for number, line in enumerate(path.read_text().splitlines(), 1):
                code = line.split("//")[0]
                for found in FORBIDDEN.findall(code):
                    if ALLOWED.get(name) != found:
                        yield f"{name}:{number}: {found}: use lib/base/file.h"
                for found in PRINTING.findall(code):
                    if building in ("tools", "calib") and name not in PRINTERS:
                        yield f"{name}:{number}: {found}: use tools/terminal.h"


def main():
    faults = list(places(pathlib.Path(sys.argv[1])))
    print("\n".join(faults) or "files are read and written in one place")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
