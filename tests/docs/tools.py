#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Generates docs/reference/tools.md from the --help texts of all programs.

usage: tools.py BUILD_ROOT FILE [--check]

With --check, writes nothing and exits 1 if FILE is outdated.
"""
import argparse
import difflib
import pathlib
import re
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "tools/completion"))
from help_text import choices, help_of, parse, split_head

HEAD = """# Tools

This page is generated: `ninja -C build tools-md` makes it from the `--help` texts of the programs. All programs and
subcommands have the option `--help`, and all programs have `--version`.

## Overview

| tool | what it does | options |
| --- | --- | --- |
"""

TYPES = {"INT": "integer", "UINT": "integer", "FLOAT": "number", "TEXT": "text"}


def values(kind):
    """Describes a type such as "INT:INT in [1 - 100]" for a reader."""
    name, _, limit = kind.partition(":")
    word = TYPES.get(name, f"`{name}`" if name else "")
    if listed := choices(kind):
        return ", ".join(f"`{value}`" for value in listed)
    if bounds := re.search(r"\[(\S+) - (\S+)\]", limit):
        return f"{word}, {bounds[1]} to {bounds[2]}"
    if limit.startswith(("PATH", "FILE", "DIR")):
        return "path" if name == "TEXT" else word
    return word + {"POSITIVE": ", more than 0", "NONNEGATIVE": ", 0 or more"}.get(limit, "")


def table_row(row):
    """Returns a row of an option or a positional argument."""
    names, rest, others = split_head(row.head)
    words = {"Excludes": "not with", "Needs": "requires"}
    notes = [words[label] + " " + ", ".join(f"`{name}`" for name in named) for label, named in others.items()]
    if re.search(r"\bREQUIRED\b", rest):
        notes.insert(0, "required")
    if re.search(r"\.\.\.", rest) and "repeat" not in row.text:
        notes.append("may be repeated")
    rest = re.sub(r"\b(REQUIRED)\b|\.\.\.", "", rest).strip()
    kind, equals, default = rest.rpartition("=")
    if not equals or re.fullmatch(r"[A-Z]+", default):
        kind, default = rest, ""
    if names == "--threads" and default:
        default = "number of processors"  # of the machine that generates the page
    elif default:
        default = f"`{default.strip('[]')}`"
    text = row.text + ("" if not notes else f" ({'; '.join(notes)})")
    names = ", ".join(f"`{name}`" for name in names.split(","))
    return "| " + " | ".join(cell.strip().replace("|", "\\|") for cell in (names, values(kind), default, text)) + " |"


def sections_of(command, depth):
    """Yields the Markdown of a command and its subcommands."""
    description, sections = parse(help_of(command))
    name = " ".join([command[0].name, *command[1:]])
    yield f"\n{'#' * depth} {name}\n\n{description.rstrip('.')}.\n"
    rows = [row for heading in ("Positionals", "Options") for row in sections.get(heading, [])
            if not row.head.startswith(("-h,", "--version"))]
    if rows:
        yield "\n| option | value | default | what it is |\n| --- | --- | --- | --- |\n"
        yield "".join(table_row(row) + "\n" for row in rows)
    for row in sections.get("Subcommands", []):
        yield from sections_of([*command, row.head], depth + 1)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("file", type=pathlib.Path)
    parser.add_argument("--check", action="store_true")
    args = parser.parse_args()
    programs = sorted((path for folder in ("tools", "calib") for path in (args.build / folder).glob("lf-*")
                       if path.is_file()), key=lambda path: path.name)
    text = HEAD
    for program in programs:
        what = parse(help_of([program]))[0].split(". ")[0].rstrip(".").replace("|", "\\|")
        text += f"| `{program.name}` | {what} | [options](#{program.name}) |\n"
    text += "".join(part for program in programs for part in sections_of([program], 2))
    if not args.check:
        args.file.write_text(text)
        return
    page = args.file.read_text() if args.file.exists() else ""
    if page != text:
        sys.stderr.writelines(difflib.unified_diff(page.splitlines(True), text.splitlines(True), "page", "programs", n=0))
        sys.exit(f"{args.file} is outdated: ninja -C build tools-md")


main()
