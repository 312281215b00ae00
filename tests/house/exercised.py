#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Checks that tests use all documented features.

The features are the options of each tool and of its commands (--help), the properties of each element and the fields of
`limits` (docs/reference/elements.md), and the attributes, properties, methods and events of <lightfield-viewer> (web/). A test
file uses a feature if it names the tool (and command), element or web element, and contains the exact name of the
option, property or attribute as code. The names may be in files of tests/ that the test includes.
tests/house/unexercised.txt lists features without a test, each with a reason. Fails for a feature without test and
entry, and for an unneeded entry: the list may only shrink.

    exercised.py SOURCE_ROOT TOOL...
"""
import os
import pathlib
import re
import subprocess
import sys

MOST = 24  # entries in unexercised.txt; lower this number with every removed entry
SOURCE = pathlib.Path(sys.argv[1])
TESTS = SOURCE / "tests"
# Files in these folders name options and properties without using them.
NO_TESTS = ("house", "docs", "fuzz", "bench")


def without_comments(path):
    text = path.read_text(errors="replace")
    if path.suffix in (".cc", ".h", ".mjs", ".tsx"):
        return re.sub(r"(?<![:\"'`])//[^\n]*|/\*.*?\*/", "", text, flags=re.S)
    return re.sub(r"(?m)^\s*#.*$", "", text)


def read_tests():
    """Returns {path: text}; the text includes the included files of tests/."""
    own = {}
    for folder in TESTS, SOURCE / "pipelines":
        for path in sorted(folder.rglob("*")):
            inner = path.relative_to(folder).parts
            if path.suffix in (".cc", ".h", ".mjs", ".tsx", ".sh", ".py") and inner[0] not in NO_TESTS:
                own[path] = without_comments(path)

    def included(path, seen):
        if path in seen or path not in own:
            return ""
        seen.add(path)
        names = re.findall(r'#include "([^"]+)"', own[path]) + re.findall(r"from '\./([^']+)'", own[path])
        inner = [folder / name for name in names for folder in (TESTS, path.parent)]
        inner += [one.with_suffix(".cc") for one in inner if one.suffix == ".h"]
        return own[path] + "".join(included(one, seen) for one in inner)
    return {path: included(path, set()) for path in own}


class Test:
    """The names, options and settings in the text of a test."""

    def __init__(self, text):
        self.text = text
        self.names = set(re.findall(r"[\w-]+", text)) | set(re.findall(r"\w+", text))
        self.options = set(re.findall(r"(?<![\w-])--[a-z][\w-]*", text))
        self.settings = set(re.findall(r"(?<![\w:-])([\w:-]+)=", text)) | set(re.findall(r'"([\w:-]+)"', text))
        # Helpers of tests/web/harness.mjs and served.h run lf-serve.
        if re.search(r"\bserve\(|\bServed\b", text):
            self.names.add("lf-serve")


def help_of(tool, *command):
    return subprocess.run([tool, *command, "--help"], capture_output=True, text=True, check=True).stdout


def options(tests, tool, command=()):
    """Returns {feature: True if used} for a tool and its commands."""
    name, found = os.path.basename(tool), {}
    text = help_of(tool, *command)
    head, _, commands = text.partition("\nSubcommands:\n")
    for option in re.findall(r"^ +(?:-\w,)?(--[a-z][\w-]*)", head, re.M):
        if option not in ("--help", "--version"):
            found[" ".join([name, *command, option])] = any(
                test.names.issuperset([name, *command]) and option in test.options for test in tests)
    for word in re.findall(r"^  ([a-z][\w-]*)", commands, re.M):
        found |= options(tests, tool, (*command, word))
    return found


def properties(tests):
    found, element = {}, None
    for line in (SOURCE / "docs/reference/elements.md").read_text().splitlines():
        if title := re.fullmatch(r"## (\w+)", line):
            element = title[1]
        cells = [cell.strip() for cell in line.split("|")]
        if len(cells) == 8 and (name := re.fullmatch(r"`([\w:-]+)`", cells[1])):
            found[f"{element} {name[1]}"] = any(
                element in test.names and (name[1] in test.settings or name[1] == "stats" and "stat" in test.names)
                for test in tests)
    return found


def web(tests):
    readme, types = ((SOURCE / "web" / name).read_text() for name in ("README.md", "lightfield-viewer.d.ts"))
    found, viewers = {}, [test.text for test in tests if "lightfield-viewer" in test.names]

    def uses(pattern):
        return any(re.search(pattern, text) for text in viewers)
    attributes, events = (re.search(rf"\n\| {head} \|.*?\n\n", readme, re.S)[0] for head in ("attribute", "event"))
    for name in re.findall(r"^\| `([\w-]+)`", attributes, re.M):
        pattern = rf"""<lightfield-viewer[^>]*\s{name}[\s=>]|open\([^)]*\b{name}\b|Attribute\('{name}'|\+? '{name}' """
        found[f"attribute {name}"] = uses(pattern)
    for line in re.findall(r"^\| `.*$", events, re.M):
        for name in re.findall(r"`([\w-]+)`", line.split("|")[1]):
            found[f"event {name}"] = uses(rf"'{name}'|\bon{name}=")
    body = re.search(r"export class LightfieldViewer.*?\n}", types, re.S)[0]
    for line in body.splitlines():
        if method := re.match(r"  (\w+)\(", line):
            if not method[1].endswith("EventListener"):
                found[f"method {method[1]}()"] = uses(rf"\.{method[1]}\(")
        elif member := re.match(r"  (?:readonly |get )?(\w+)(?:\(\))?\??:", line):
            found[f"property {member[1]}"] = uses(rf"\.{member[1]}\b|\b{member[1]}=\{{")
    return found


def main():
    tests = [Test(text) for text in read_tests().values()]
    found = properties(tests) | web(tests)
    for tool in sys.argv[2:]:
        found |= options(tests, tool)
    lines = (TESTS / "house/unexercised.txt").read_text().splitlines()
    listed = dict(line.split(": ", 1) for line in lines if line and not line.startswith("#"))
    problems = [f"{name}: no test uses it. Write a test of what it does." for name, used in found.items()
                if not used and name not in listed]
    problems += [f"unexercised.txt: {name}: {'a test uses it' if name in found else 'there is no such thing'}. Remove the line."
                 for name in listed if found.get(name, True)]
    if len(listed) != MOST:
        problems.append(f"unexercised.txt has {len(listed)} entries, and exercised.py says MOST = {MOST}: it may only shrink")
    print(f"{len(found)} promises, {sum(found.values())} with a test, {len(listed)} listed without")
    print("\n".join(problems))
    sys.exit(1 if problems else 0)


main()
