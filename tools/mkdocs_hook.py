# SPDX-License-Identifier: LGPL-2.1-or-later
"""Adapts documents written for GitHub to MkDocs (mkdocs.yml).

Documents outside docs/ become pages of the site, README.md its index. Links to pages and pictures are rewritten to the
site's folders; links to sources keep only their text. Nested lists are indented by four spaces, as Python-Markdown
requires.
"""
import os
import re

from mkdocs.structure.files import File

PAGES = ["README.md", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md", "calib/README.md", "web/README.md",
         "lib/rtp/spec.md", "lib/wire/spec.md"]
LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)\s]+)\)")


def on_files(files, config):
    root = os.path.dirname(config["config_file_path"])
    for page in PAGES:
        if os.path.exists(os.path.join(root, page)):
            files.append(File(page, root, config["site_dir"], config["use_directory_urls"]))
    return files


def site_link(target, page, root, files):
    """Returns a link to a file of the checkout from a page, or None if the site lacks the file."""
    path, _, anchor = target.partition("#")
    found = os.path.relpath(os.path.normpath(os.path.join(os.path.dirname(page.file.abs_src_path), path)), root)
    in_site = found[len("docs/"):] if found.startswith("docs/") else found
    if files.get_file_from_path(in_site) is None:
        return None
    return os.path.relpath(in_site, os.path.dirname(page.file.src_path) or ".") + ("#" + anchor if anchor else "")


def indent_lists(text):
    lines, in_code = [], False
    columns = []  # start of the text of each enclosing list item
    in_paragraph = False  # of its own, not of a list item
    for line in text.split("\n"):
        if not line.strip():
            lines.append("")
            in_paragraph = False
            continue
        item = not in_code and re.match(r" *(?:[-*+]|\d+\.) +", line)
        column = len(line) - len(line.lstrip())
        while columns and column < columns[-1] and not in_code:
            columns.pop()
        inner = line[columns[-1] if columns else 0:]
        if columns and not in_code:
            inner = inner.lstrip()
        if item and in_paragraph:
            lines.append("")  # Python-Markdown would continue the paragraph
        in_paragraph = not item and (in_paragraph or not lines or not lines[-1])
        lines.append(" " * 4 * len(columns) + inner)
        if item:
            columns.append(item.end())
        if inner.startswith("```"):
            in_code, in_paragraph = not in_code, False
    return "\n".join(lines)


def on_page_markdown(markdown, page, config, files):
    root = os.path.dirname(config["config_file_path"])

    def rewritten(match):
        kind, text, target = match.groups()
        text = LINK.sub(rewritten, text)
        if re.match(r"[a-z]+:|#", target):
            return f"{kind}[{text}]({target})"
        link = site_link(target, page, root, files)
        return f"{kind}[{text}]({link})" if link else text

    parts = re.split(r"(^```.*?^```)", markdown, flags=re.S | re.M)
    parts[::2] = [LINK.sub(rewritten, part) for part in parts[::2]]
    return indent_lists("".join(parts))


def on_page_content(html, page, config, files):
    """Lets wide tables scroll without the page."""
    return html.replace("<table>", '<div class="table-responsive"><table>').replace("</table>", "</table></div>")
