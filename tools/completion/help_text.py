# SPDX-License-Identifier: LGPL-2.1-or-later
"""Parser of the --help texts of our programs."""
import dataclasses
import re
import subprocess
import sys

COLUMN = 28  # width of CLI11's column of names


@dataclasses.dataclass
class Row:
    head: str
    text: str


def help_of(command):
    result = subprocess.run([*command, "--help"], capture_output=True, text=True, timeout=60)
    if result.returncode != 0:
        sys.exit(f"{command[0]} --help: {result.stderr or result.stdout}")
    return result.stdout


def parse(text):
    """Returns (description, {heading: rows}) of a --help text of CLI11."""
    description, _, rest = text.partition("Usage:")
    lines, sections, rows = rest.splitlines()[1:], {}, []
    for i, line in enumerate(lines):
        indent = len(line) - len(line.lstrip())
        if heading := re.fullmatch(r"\s*(Positionals|Options|Subcommands):", line):
            rows = sections.setdefault(heading[1], [])
        elif not line.strip() or line.lstrip().startswith("["):
            continue
        elif indent >= COLUMN:
            rows[-1].text = f"{rows[-1].text} {line.strip()}".strip()
        else:
            column = indent + COLUMN
            head, tail = line[:column], line[column:]
            follows = i + 1 < len(lines) and re.match(" {%d}" % COLUMN, lines[i + 1])
            if follows or not head.endswith(" ") or head.count("[") != head.count("]"):
                head, tail = line, ""
            rows.append(Row(head.strip(), tail.strip()))
    return " ".join(description.split()), sections


def split_head(head):
    """Splits "--rig RIG.json Excludes: --grid" into ("--rig", "RIG.json", {"Excludes": ["--grid"]})."""
    names, _, rest = head.partition(" ")
    others = {}
    for label in "Excludes", "Needs":
        if found := re.search(label + r": ((?:--?[\w-]+ ?)+)", rest):
            others[label] = sorted(found[1].split())  # CLI11 orders options by the addresses of its objects
            rest = rest.replace(found[0], "")
    return names, rest.strip(), others


def choices(kind):
    """Returns the possible values of a type such as "TEXT:{h264,vp8}=h264", or an empty list if the type has no list."""
    found = re.search(r":\{(.*?)\}", kind)
    return found[1].split(",") if found else []
