#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Generates web/custom-elements.json, which editors read, from web/README.md and web/lightfield-viewer.d.ts:
custom_elements.py SOURCE [--check]. With --check, fails if the file differs."""
import json
import re
import sys
from pathlib import Path

TAG, CLASS = "lightfield-viewer", "LightfieldViewer"


def described(entry, comment):
    text = " ".join(re.sub(r"^\s*(/\*\*|\*/|\*)|\*/$", "", line).strip() for line in comment.splitlines()).strip()
    return entry | ({"description": text} if text else {})


def rows(readme, head):
    """The rows of the table whose first column has this heading."""
    table = re.search(rf"^\| {head} \|.*\n\|.*\n((?:\|.*\n)+)", readme, re.M)[1]
    return [[cell.strip() for cell in line.strip("|\n").split(" | ")] for line in table.splitlines()]


def members(types):
    body = re.search(rf"export class {CLASS} .*?\n(.*?)\n}}", types, re.S)[1]
    pattern = (r"^(?P<comment>(?:  /\*\*(?:[^*]|\*(?!/))*\*/\n)?)"
               r"  (?P<modifier>readonly |get )?(?P<name>\w+)(?P<arguments>\([^)]*\))?\??: (?P<type>[^\n]*);$")
    for found in re.finditer(pattern, body, re.M):
        name, kind = found["name"], found["type"]
        if name.endswith("EventListener"):
            continue
        if found["arguments"] and found["modifier"] != "get ":
            member = {"kind": "method", "name": name, "return": {"type": {"text": kind}}}
        else:
            member = {"kind": "field", "name": name, "type": {"text": kind}}
            if found["modifier"] == "readonly ":
                member["readonly"] = True
        yield described(member, found["comment"])


def events(types):
    body = re.search(rf"interface {CLASS}EventMap {{\n(.*?)\n}}", types, re.S)[1]
    for comment, name, kind in re.findall(r"^((?:  /\*\*(?:[^*]|\*(?!/))*\*/\n)?)  '?([\w-]+)'?: (.*);$", body, re.M):
        yield described({"name": name, "type": {"text": kind}}, comment)


def manifest(web):
    readme, types = (web / "README.md").read_text(), (web / "lightfield-viewer.d.ts").read_text()
    parts = re.search(r"Parts: ([^.]*)\.", readme)[1]
    reference = {"name": CLASS, "module": "lightfield-viewer.js"}
    element = {
        "kind": "class", "customElement": True, "name": CLASS, "tagName": TAG, "superclass": {"name": "HTMLElement"},
        "description": re.search(rf"/\*\* (.*?) \*/\nexport class {CLASS}", types)[1],
        "attributes": [{"name": name.strip("`"), "fieldName": field.strip("`"), "description": text}
                       for name, field, text in rows(readme, "attribute")],
        "members": list(members(types)),
        "events": list(events(types)),
        "slots": [{"name": name} for name in ("poster", "controls", "error")],
        "cssParts": [{"name": name} for name in re.findall(r"`(\w+)`", parts)],
        "cssProperties": [{"name": name, "description": text} for names, text in rows(readme, "property")
                          for name in re.findall(r"--[\w-]+", names)],
    }
    return {"schemaVersion": "1.0.0", "readme": "README.md", "modules": [{
        "kind": "javascript-module", "path": "lightfield-viewer.js", "declarations": [element],
        "exports": [{"kind": "js", "name": CLASS, "declaration": reference},
                    {"kind": "custom-element-definition", "name": TAG, "declaration": reference}]}]}


def main():
    web = Path(sys.argv[1]) / "web"
    path, text = web / "custom-elements.json", json.dumps(manifest(web), indent=1) + "\n"
    if "--check" not in sys.argv:
        path.write_text(text)
    elif path.read_text() != text:
        sys.exit(f"{path} is out of date: ninja -C build custom-elements-json")


main()
