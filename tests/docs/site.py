#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Builds the site of the documents (mkdocs.yml) in a temporary folder and checks its pages.

Fails on a warning of MkDocs, a document without an entry in the navigation, a link to a missing page, heading or
picture, Markdown that stays visible as text, and anything that a page loads from another host.

    site.py SOURCE_ROOT
"""
import html.parser
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import urllib.parse

SKIP = 77
# Start of a line of text that should have become a list, a table or a block of code.
MARKDOWN = re.compile(r"^\s*([-*+] |\d+\. |\||```|#+ )|\]\(", re.M)


class Page(html.parser.HTMLParser):
    """Collects anchors, links, loaded files and paragraphs of a page."""

    def __init__(self, path):
        super().__init__()
        self.anchors, self.links, self.loads, self.texts, self.open = set(), [], [], [], []
        self.feed(path.read_text())

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.anchors.add(attributes.get("id"))
        if tag == "a" and attributes.get("href"):
            self.links.append(attributes["href"])
        if tag in ("img", "script") and attributes.get("src"):
            self.loads.append(attributes["src"])
        if tag == "link" and attributes.get("rel") != "canonical":
            self.loads.append(attributes["href"])
        if tag in ("p", "code"):
            self.open.append(tag)
            if tag == "p":
                self.texts.append("")

    def handle_endtag(self, tag):
        if tag in self.open:
            while self.open.pop() != tag:
                pass

    def handle_data(self, data):
        if self.open == ["p"]:
            self.texts[-1] += data


def problems(site):
    pages = {path: Page(path) for path in sorted(site.rglob("*.html"))}
    for path, page in pages.items():
        name = path.relative_to(site)
        for text in page.texts:
            if MARKDOWN.search(text):
                yield f"{name}: not formatted: {text[:100]!r}"
        if name.name in ("404.html", "search.html"):
            continue
        for link in page.loads + page.links:
            url = urllib.parse.urlsplit(link)
            if url.scheme or url.netloc:
                if link in page.loads and url.scheme != "data":
                    yield f"{name}: loads {link}"
                continue
            target = path
            if url.path:
                target = pathlib.Path(os.path.normpath(path.parent / urllib.parse.unquote(url.path)))
                target = target / "index.html" if target.is_dir() else target
            if not target.exists():
                yield f"{name}: no file {link}"
            elif url.fragment and target in pages and urllib.parse.unquote(url.fragment) not in pages[target].anchors:
                yield f"{name}: no heading {link}"


def main():
    if not shutil.which("mkdocs"):
        print("no mkdocs (tools/setup.sh --tests)")
        return SKIP
    with tempfile.TemporaryDirectory() as folder:
        command = ["mkdocs", "build", "--strict", "--config-file", sys.argv[1] + "/mkdocs.yml", "--site-dir", folder]
        environment = os.environ | {"PYTHONDONTWRITEBYTECODE": "1"}
        built = subprocess.run(command, capture_output=True, text=True, env=environment)
        if built.returncode or "not included in the \"nav\"" in built.stderr:
            print(built.stderr)
            return 1
        found = list(problems(pathlib.Path(folder)))
    print("\n".join(found))
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
