#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Checks the layers ("floors") of the source folders ("rooms"): files include only files of their own layer and below.

Prints the layers and the folders that each folder includes. Two folders of one layer may not include each other. Exits 1
for an include of a higher layer, a cycle, a folder without a layer, a missing folder, an include of GStreamer in lib/,
and a type name that a namespace defines twice: the linker keeps only one of two equally named templates, even if their
types differ.

    floors.py SOURCE_ROOT
"""
import collections
import pathlib
import re
import sys

FLOORS = {
    "lib": [
        ["base"],
        ["geometry"],
        ["image", "rig", "view"],
        ["depth", "render"],
        ["focus", "jpeg"],
        ["wire"],
        ["composite", "node", "rtp"],
        ["calibration", "quality", "scene"],
        ["api"],
    ],
    "gst": [
        ["common", "without_gl"],
        ["camsrc", "display", "recording", "parse", "rtp", "viewrequest", "fragment", "compositor"],
        ["bins"],
    ],
}


def included_rooms(building):
    """Returns {folder: {included folder: [file, ...]}} for "lib" or "gst"."""
    found = collections.defaultdict(lambda: collections.defaultdict(list))
    rooms = {folder.name for folder in building.iterdir() if folder.is_dir()}
    for room in rooms:
        for path in sorted((building / room).rglob("*")):
            if path.suffix not in (".h", ".cc"):
                continue
            for name in re.findall(r'^#include "([^"]+)"', path.read_text(), re.M):
                other, _, rest = name.partition("/")
                if other != room and (building / other / rest).is_file():
                    found[room][other].append(f"{path.name} ({name})")
    return rooms, found


def types_of(path):
    """Returns the qualified names of a file's types, without nested types and anonymous namespaces."""
    within, types = [], []
    for line in path.read_text().splitlines():
        if opened := re.match(r"(?:inline )?namespace ?([\w:]*) \{", line):
            within.append(opened[1])
        elif line.startswith("}  // namespace") and within:
            within.pop()
        elif all(within) and (defined := re.match(r"(?:struct|class|union|enum(?: class)?) (\w+)(?: final)?(?: :[^;]*)? \{", line)):
            types.append("::".join([*within, defined[1]]))
    return types


def repeated_types(root):
    places = collections.defaultdict(list)
    for building in ("lib", "gst", "tools", "calib"):
        for path in sorted((root / building).rglob("*")):
            for name in types_of(path) if path.suffix in (".h", ".cc") else ():
                places[name].append(str(path.relative_to(root)))
    return [f"{name} is two types: {', '.join(files)}" for name, files in sorted(places.items()) if len(files) > 1]


def main():
    root = pathlib.Path(sys.argv[1])
    faults = []
    for building, floors in FLOORS.items():
        rooms, found = included_rooms(root / building)
        height = {room: number for number, floor in enumerate(floors) for room in floor}
        faults += [f"{building}/{room} stands on no floor" for room in sorted(rooms - height.keys())]
        faults += [f"{building}/{room} is not there" for room in sorted(height.keys() - rooms)]
        for number in reversed(range(len(floors))):
            for room in floors[number]:
                print(f"{building} {number}  {room:12} -> {' '.join(sorted(found[room])) or '-'}")
                for other, files in found[room].items():
                    if height.get(other, 0) > number:
                        faults.append(f"{building}/{room} points up to {other}: {', '.join(files)}")
                    elif room in found[other] and room < other:
                        faults.append(f"{building}/{room} and {other} know each other: {', '.join(files + found[other][room])}")
    library = re.compile(r'^#include [<"](gst/|glib)', re.M)
    faults += [f"{path.relative_to(root)} knows GStreamer"
               for path in sorted((root / "lib").rglob("*")) if path.suffix in (".h", ".cc") and library.search(path.read_text())]
    faults += repeated_types(root)
    for fault in faults:
        print(fault, file=sys.stderr)
    return bool(faults)


if __name__ == "__main__":
    sys.exit(main())
