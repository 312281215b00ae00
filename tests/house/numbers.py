#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Checks that the code writes and reads numbers with a decimal point in every locale.

An application that loads the plugin or the library may have called setlocale(LC_ALL, ""). Then printf(), strtod() and
functions based on them use a comma in many countries, which breaks shaders, caps, files and messages to other programs.
Code in lib/ and gst/ must write numbers with number_text() and format_text(). It must read numbers with
std::from_chars() or in the scope of a ScopedCLocale. Our programs must not set a locale. Prints each violation, and
exits 1 if there is any.

    numbers.py SOURCE_ROOT
"""
import pathlib
import re
import sys

FLOAT_FORMAT = r'"[^"]*%[-+ #0]*(?:\*|\d+)?(?:\.(?:\*|\d+))?l?[aefgAEFG][^"]*"'
PRINTING = re.compile(
    r"\b(?:std::)?(?:f|s|sn|v|vsn|d|as)?printf\(|\bg_(?:strdup_|string_append_|string_|snprintf|print(?:err|f)?)\w*\(|"
    r"\bGST_(?:ELEMENT_)?(?:ERROR|WARNING|INFO)\w*\(")
READING = re.compile(r"\b(?:std::)?(?:strtod|strtof|strtold|stod|stof|stold|atof)\(")
SCANNING = re.compile(r"\b(?:std::)?[fs]?scanf\(")
LOCALES = re.compile(r"\bsetlocale\(|\bstd::locale\(\"|\bstd::locale::global\(")
GUARD = "ScopedCLocale"
DECLARED = re.compile(r"\b(?:double|float|gdouble|gfloat)\s+((?:\w+(?:\s*=[^,;(){}]*)?\s*,\s*)*\w+)")
INTEGERS = re.compile(r"\b(?:auto|bool|char|int|long|short|unsigned|size_t|s?size_t|g?u?int\d*(?:_t)?|\w+Index|\w+Time)\s+"
                      r"((?:\w+(?:\s*=[^,;(){}]*)?\s*,\s*)*\w+)")
# Implements number_text() and format_text().
OURS = {"lib/base/text.h"}


def argument(text, begin):
    """Returns the text from `begin` to the matching closing bracket; `begin` is behind the opening bracket."""
    depth, at = 1, begin
    while depth and at < len(text):
        depth += {"(": 1, ")": -1}.get(text[at], 0)
        at += 1
    return text[begin:at - 1]


def names(pattern, text):
    return {re.match(r"\w+", part.strip())[0] for match in pattern.finditer(text) for part in match[1].split(",")
            if re.match(r"\w+", part.strip())}


def function_before(text, at):
    """Returns the text of the function up to `at`, from the last closing brace or namespace without indentation."""
    return text[max(text.rfind("\n}", 0, at), text.rfind("\nnamespace", 0, at), 0):at]


def main():
    root = pathlib.Path(sys.argv[1])
    texts = {}
    for folder in "lib", "gst", "tools", "calib":
        for path in sorted((root / folder).rglob("*")):
            if path.suffix in (".cc", ".h"):
                texts[str(path.relative_to(root))] = re.sub(r"//[^\n]*", "", path.read_text())
    floats = set().union(*(names(DECLARED, text) for text in texts.values()))
    integers = set().union(*(names(INTEGERS, text) for text in texts.values()))
    wrong = []
    for name, text in texts.items():
        if name in OURS:
            continue
        own, own_integers = names(DECLARED, text), names(INTEGERS, text)

        def report(at, what):
            wrong.append(f"{name}:{text.count(chr(10), 0, at) + 1}: {what}")

        for match in re.finditer(r"std::to_string\(", text):
            of = argument(text, match.end())
            last = "" if of.endswith(")") else (re.findall(r"[A-Za-z_]\w*", of) or [""])[-1]  # ignores results of calls
            is_float = re.search(r"\d\.\d|\d[eE][-+]?\d|\b(?:double|float)\b|\.[xyz]\b", of) or (
                "." not in of and last in own - own_integers or (re.match("k[A-Z]", last) and last in floats - integers))
            is_float = is_float and not re.match(r"(?:std::l*round|static_cast<(?!double|float)\w+)\b", of)
            if is_float:
                report(match.start(), f"std::to_string({of}) of a floating point number: use number_text() or format_text()")
        for match in LOCALES.finditer(text):
            report(match.start(), "nothing here chooses a locale")
        if not name.startswith(("lib/", "gst/")):
            continue
        for match in PRINTING.finditer(text):
            if re.search(FLOAT_FORMAT, re.sub(r"format_text\([^()]*", "", argument(text, match.end()))):
                report(match.start(), f"{match[0]}...) writes numbers by the locale: use format_text()")
        for match in READING.finditer(text):
            if GUARD not in function_before(text, match.start()):
                report(match.start(), f"{match[0]}...) reads numbers by the locale: use std::from_chars() or {GUARD}")
        for match in SCANNING.finditer(text):
            if re.search(FLOAT_FORMAT, argument(text, match.end())) and GUARD not in function_before(text, match.start()):
                report(match.start(), f"{match[0]}...) reads numbers by the locale: use std::from_chars() or {GUARD}")
    print(*wrong, sep="\n", end="\n" if wrong else "")
    return 1 if wrong else 0


sys.exit(main())
