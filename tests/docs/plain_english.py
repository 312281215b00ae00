#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Counts turns of phrase that make technical English hard to read, per 1,000 words.

usage: plain_english.py [--list N] [--json] [--at-most FLAGS] PATH...      folders (searched for documents and sources) or files

Reads paragraphs of Markdown and reStructuredText (code blocks left out), comments of C, C++ and JavaScript, and quoted
texts of 4 words and more in C and C++ (messages, property blurbs). It is a yardstick, not a style guide. Measured with
the same script: COLMAP 5.7 in documents and 2.2 in code, libcamera 6.2 and 3.1, MediaMTX 4.0 in documents. --list N prints the
N worst sentences with their places. --at-most FLAGS exits with 1, after the worst sentences, if there are more flags per 1,000 words.
"""
import argparse, collections, json, os, re, sys

FLAGS = {
    # name: pattern, applied to each sentence (case-insensitive)
    "archaic word": r"\b(anew|whoever|whatever it|nobody|somebody|likewise|beforehand|afterwards|thereof|therein|amid|apiece|hitherto|asunder|in place of|so much as|of its own|by itself alone|at last|for want of|in vain|as good as|be it)\b",
    "clause as noun": r"(^|[,;:(] ?|\b(of|by|from|in|with|than|and|to|is|are|says?|tells?|has|have|takes?|gives?|needs?|knows?|sees?|makes?|keeps?|leaves?|asks?|for|about|on|as|at) )(what|who|whom|whoever|whose) (?!if\b|the\b.*\?|to\b|'s\b)",
    "is to be": r"\b(is|are|was|were|has|have|had|be) (not )?to (be|have|do|come|go|know|ask|tell|find|find|make|show|take|give|say|see|wait|keep|stand)\b",
    "those that, that of": r"\b(those (that|of|which|who|whose|with|in|it|they)|that of|the (one|ones) (that|of|which|whose)|that is (not )?(its|theirs)|the others?'?|the same of|such a one)\b",
    "lonely pronoun": r"\b(it|them|they|these|those|this|theirs|others|one|both|such|all)[.;:]?$",
    "comes of": r"\b(com(es?|ing)|came|goes|go|went) (of|to be|to\b(?! the)|out of|about|along|by|on its)\b|\b(stands?|stood) (for|in|on|beside|at|there|still)\b|\bhas (in|of|to)\b",
    "inverted opening": r"^(Of|To|With|From|Beside|Besides|Behind|Out of|Into|Of these|Among|Beyond|Within|Between|Where|Whether|What|Who|Whose|That|Which|As many|As long|As soon|So|Nor|Neither|Else|Only|Not|Once|Hardly|Such|Both|Like|All that|All of) ",
    "of which, whom": r"\b(of|in|by|from|for|with|to|at|on|through|after|before) (which|whom)\b|\bwhose\b",
    "told, asked": r"\b(is|are|was|be|been) (told|asked|said|shown to|made out|let|held|looked|gone|come|had|meant|known)\b",
}
FLAGS = {k: re.compile(v, re.I) for k, v in FLAGS.items()}
LONG = 30  # words


def sentences(text):
    text = re.sub(r"\s+", " ", text).strip()
    for s in re.split(r"(?<=[.!?])\s+(?=[A-Z`*\[(])|(?<=[.;])\s{2,}", text):
        if len(re.findall(r"[A-Za-z]{2,}", s)) >= 4:
            yield s


def markdown(text, rst):
    text = re.sub(r"(?ms)^(```|~~~).*?^\1\s*$", "\n\n", text)
    if rst:
        text = re.sub(r"(?m)^\.\. .*\n((?:[ \t]+.*)?\n)*", "\n", text)
        text = re.sub(r"(?ms)::\s*\n\n((?:[ \t]+.*\n|\n)+)", ".\n\n", text)
    out = []
    for block in re.split(r"\n\s*\n|\n(?=\s*(?:[-*+]|\d+\.) )|\n(?=\|)|\n(?=#)", text):
        if re.match(r"\s*(    |\t|#|<|!\[|={3}|-{3})", block):
            continue
        if block.lstrip().startswith("|"):
            out += [c for c in block.split("|") if len(c.split()) > 7]
            continue
        out.append(re.sub(r"^\s*([-*+]|\d+\.) ", "", block))
    return [re.sub(r"\[([^\]]*)\]\([^)]*\)|`+([^`]*)`+|\*\*?|<[^>]*>", r"\1\2", b) for b in out]


def comments(text):
    text = re.sub(r'"(\\.|[^"\\\n])*"', '""', text)
    out, block = [], []
    for m in re.finditer(r"/\*.*?\*/|//[^\n]*", text, re.S):
        s = m.group(0)
        if "SPDX" in s or "Copyright" in s or "All rights reserved" in s:
            continue
        if s.startswith("//"):
            own_line = text[text.rfind("\n", 0, m.start()) + 1:m.start()].strip() == ""
            if own_line and block and text[block[-1][1]:m.start()].strip() == "":
                block.append((s, m.end()))
            else:
                out.append(block)
                block = [(s, m.end())]
        else:
            out.append(block)
            block = []
            out.append([(re.sub(r"(?s)\|\[.*?\]\|", "", s), 0)])
    out.append(block)
    return ["\n".join(re.sub(r"^\s*(//+!?<?|/\*+!?|\*/|\*)\s?|\*/\s*$", "", line) for s, _ in b for line in s.split("\n")) for b in out if b]


def quoted(text):
    joined = re.sub(r'"\s*\n\s*"', "", text)
    return [s for s in re.findall(r'"((?:\\.|[^"\\\n])*)"', joined) if len(re.findall(r"[A-Za-z]{2,}", s)) >= 4 and not re.search(r"#include|[{};]|\\n.*\\n", s)]


def texts(path):
    text = open(path, encoding="utf-8", errors="replace").read()
    if path.endswith((".md", ".rst")):
        return markdown(text, path.endswith(".rst"))
    parts = comments(text)
    return parts + (quoted(text) if path.endswith((".cc", ".h", ".cpp")) and "test" not in path else [])


def files(paths):
    for p in paths:
        if os.path.isfile(p):
            yield p
        for folder, dirs, names in os.walk(p):
            dirs[:] = [d for d in dirs if not d.startswith(".") and d not in ("build", "thirdparty", "third_party", "ext", "node_modules", "subprojects", "3rdparty")]
            for n in sorted(names):
                if n.endswith((".md", ".rst", ".cc", ".h", ".cpp", ".js", ".hpp", ".go", ".rs")):
                    yield os.path.join(folder, n)


def main():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("paths", nargs="+")
    a.add_argument("--list", type=int, default=0)
    a.add_argument("--json", action="store_true")
    a.add_argument("--at-most", type=float)
    o = a.parse_args()
    words = n = long_ones = 0
    counts, worst = collections.Counter(), []
    for f in files(o.paths):
        for t in texts(f):
            for s in sentences(t):
                w = len(re.findall(r"[A-Za-z]+", s))
                words, n = words + w, n + 1
                hit = [k for k, p in FLAGS.items() for _ in p.findall(s)]
                if w > LONG:
                    long_ones += 1
                counts.update(hit)
                if hit:
                    worst.append((len(hit) / w * 10 + len(hit), f, s, sorted(set(hit))))
    total = sum(counts.values())
    out = {"words": words, "sentences": n, "flags_per_1000_words": round(1000 * total / max(words, 1), 1), "long_percent": round(100 * long_ones / max(n, 1), 1),
           "by_kind_per_1000": {k: round(1000 * counts[k] / max(words, 1), 2) for k in FLAGS}}
    if o.json:
        print(json.dumps(out))
        return
    failed = o.at_most is not None and out["flags_per_1000_words"] > o.at_most
    for _, f, s, k in sorted(worst, reverse=True)[: max(o.list, 40 if failed else 0)]:
        print(f"{f}: {s[:300]}\n    {', '.join(k)}")
    print(f"{n} sentences, {words} words: {out['flags_per_1000_words']} flags per 1,000 words, {out['long_percent']} % longer than {LONG} words")
    for k, v in out["by_kind_per_1000"].items():
        print(f"  {v:6.2f}  {k}")
    if words == 0 or failed:
        sys.exit(f"{words} words with {out['flags_per_1000_words']} flags per 1,000; at most {o.at_most} are allowed")


main()
