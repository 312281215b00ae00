#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Generates docs/reference/elements.md from the plugin's introspection data and from the documentation comments in gst/.

usage: elements.py PLUGIN.so SOURCES FILE [--check]

With --check, writes nothing and exits 1 if FILE is outdated.
"""
import argparse
import difflib
import pathlib
import re
import sys

import gi

gi.require_version("Gst", "1.0")
from gi.repository import GObject, Gst  # noqa: E402

HEAD = """# Elements

This page is generated: `ninja -C build elements-md` makes it from the plugin and from the comments in [gst](../../gst).
`gst-inspect-1.0 ELEMENT` prints the same reference for the installed plugin.
"""

LIMITS = """
## limits

{elements} refuse requests that exceed
the property `limits`: a structure such as `limits="limits,max-pixels=4000000,max-views=100"`. Missing fields have their
default values. An element ignores fields with unknown names, wrong types or values out of range, and posts a warning that
names the field: at once while the element runs, else when it starts. Reading the property returns all fields.

[`lfcameranode`](#lfcameranode) and [`lfnodesink`](#lfnodesink) pass the limits to their [`lffragment`](#lffragment), and
[`lfviewsrc`](#lfviewsrc) passes them to its compositors and cameras. `lfnodesink` and `lfviewsrc` also pass them to their
[`rtplfdepay`](#rtplfdepay). [limits.md](limits.md) explains the effect of each limit and
the other bounds on the cost of a message.

| limit | type | unit | range | default | what it is |
| --- | --- | --- | --- | --- | --- |
{rows}
"""

# Base classes with properties that every element has.
INHERITED = {"GstObject", "GstBin", "GstBaseSrc", "GstBaseSink", "GstPushSrc", "GstAggregator", "GstElement", "GstVideoFilter", "GstBaseTransform",
             "GstPad", "GstAggregatorPad", "GstGhostPad", "GstProxyPad"}

WHEN = ((1 << 12, "any time"), (1 << 11, "paused or before"), (1 << 10, "ready or before"))


def comment_of(element, sources):
    """Returns the element's documentation comment as Markdown."""
    for path in sorted(sources.rglob("*.cc")):
        match = re.search(r"SECTION:element-" + element + r"\n(.*?)\*/", path.read_text(), re.S)
        if match:
            break
    else:
        sys.exit(f"elements.py: {element} has no documentation comment")
    lines = [re.sub(r"^ \* ?", "", line).rstrip() for line in match[1].splitlines()]
    text = "\n".join(line for line in lines if not line.startswith(("@title", "@short_description"))).strip()
    text = text.replace("|[\n", "\n```sh\n").replace("\n]|", "\n```\n\n")
    text = re.sub(r"#element-(\w+)", r"[`\1`](#\1)", text)
    text = text.replace("#Gst", "Gst")
    text = re.sub(r"^#+ (.*)\n*", r"### \1\n\n", text, flags=re.M)
    return re.sub(r"\n{3,}", "\n\n", re.sub(r"```\n\n +", "```\n\n", text)).strip()


TYPES = {"gchararray": "string", "gboolean": "boolean", "gint": "int", "guint": "uint", "gint64": "int64",
         "guint64": "uint64", "gdouble": "double", "gfloat": "float"}


def names_of_type(prop):
    gtype = prop.value_type
    if gtype.is_a(GObject.GEnum.__gtype__):
        values = type(prop.default_value).__enum_values__
        return ", ".join(values[key].value_nick for key in sorted(values))
    return TYPES.get(gtype.name, gtype.name)


def number(value):
    if isinstance(value, float):
        if abs(value) > 1e300:
            return "-" if value < 0 else "max"
        return f"{value:g}"
    return "max" if value in (2**31 - 1, 2**32 - 1, 2**63 - 1, 2**64 - 1) else str(value)


def default_of(prop, value):
    gtype = prop.value_type
    if gtype.is_a(GObject.GEnum.__gtype__):
        return value.value_nick
    if gtype.name == "gboolean":
        return "true" if value else "false"
    if value is None or gtype.name.startswith("Gst") and gtype.name != "GstFraction":
        return ""
    if hasattr(value, "num"):
        return f"{value.num:.0f}/{value.denom:.0f}"
    return number(value) if isinstance(value, (int, float)) else str(value)


def value_at_first(element, prop):
    """Returns the value of a new element, like gst-inspect-1.0. Exits if the default of one of our classes differs."""
    both = GObject.ParamFlags.READABLE | GObject.ParamFlags.WRITABLE
    if int(prop.flags) & both != both:
        return prop.default_value
    value = element.get_property(prop.name)
    is_known = not isinstance(value, (Gst.Fraction, Gst.Structure))  # PyGObject has no defaults for these types
    if prop.owner_type.name.startswith("Lf") and is_known and value != prop.default_value:
        sys.exit(f"elements.py: {element.get_factory().get_name()} {prop.name}: its class says {prop.default_value}, "
                 f"it has {value}")
    return value


def range_of(prop):
    lo, hi = getattr(prop, "minimum", None), getattr(prop, "maximum", None)
    return "" if lo is None or isinstance(lo, bool) else f"{number(lo)} to {number(hi)}"


def when_of(prop):
    flags = int(prop.flags)
    if not flags & GObject.ParamFlags.WRITABLE:
        return "read"
    if flags & GObject.ParamFlags.CONSTRUCT_ONLY:
        return "made"
    return next((name for bit, name in WHEN if flags & bit), "ready or before")


def table_of(properties, element):
    """Returns the rows of a table of properties, without inherited properties of GStreamer's base classes."""
    rows = []
    for prop in sorted(properties, key=lambda p: p.name):
        if prop.owner_type.name in INHERITED:
            continue
        default = default_of(prop, value_at_first(element, prop) if element else prop.default_value)
        what = prop.blurb
        if prop.name == "limits":
            what = what.split(": ")[0] + ". See [limits](#limits)"
        rows.append(f"| `{prop.name}` | {names_of_type(prop)} | {range_of(prop)} | {default} | {when_of(prop)} | "
                    f"{what} |")
    return rows


def limits_section(factories):
    """Returns the section about the property `limits`. Its blurb lists limits as NAME (UNIT, RANGE: MEANING)."""
    elements = [element for element in (f.create() for f in factories) if element.find_property("limits")]
    first = elements[0].get_property("limits")
    rows, names = [], set()
    for name, unit, numbers, what in re.findall(r"([\w-]+) \(([^,]+), ([^:]+): ([^)]+)\)",
                                                elements[0].find_property("limits").blurb):
        names.add(name)
        rows.append(f"| `{name}` | {TYPES[first.get_field_type(name).name]} | {unit} | {numbers} | "
                    f"{number(first.get_value(name))} | {what} |")
    if names != {first.nth_field_name(i) for i in range(first.n_fields())}:
        sys.exit("elements.py: limits: its description names other limits than its value has")
    links = [f"[`{name}`](#{name})" for name in (element.get_factory().get_name() for element in elements)]
    return LIMITS.format(elements=", ".join(links[:-1]) + " and " + links[-1], rows="\n".join(rows))


def pad_properties(element):
    """Returns tables of pad properties."""
    out = []
    for templ in sorted(element.get_pad_template_list(), key=lambda t: t.name_template):
        gtype = templ.get_property("gtype")
        if not gtype.is_a(Gst.Pad.__gtype__) or gtype.name in INHERITED:
            continue
        rows = table_of(GObject.list_properties(gtype), None)
        if rows:
            out.append(f"\n| property of pad `{templ.name_template}` | type | range | default | settable | what it is |\n"
                       "| --- | --- | --- | --- | --- | --- |")
            out += rows
    return out


def comment_of_signal(gtype, name, sources):
    """Returns a signal's documentation comment as (description, list of parameters)."""
    for path in sorted(sources.rglob("*.cc")):
        match = re.search(rf"/\*\*\n\s*\* {gtype.name}::{name}:\n(.*?)\*/", path.read_text(), re.S)
        if match:
            break
    else:
        sys.exit(f"elements.py: signal {name} of {gtype.name} has no documentation comment")
    lines = [re.sub(r"^\s*\* ?", "", line).strip() for line in match[1].splitlines()]
    text = " ".join("<p>" if not line else line for line in lines)
    text = re.sub(r"@(\w+)", r"`\1`", text).replace("%FALSE", "FALSE").replace("%TRUE", "TRUE")
    head, *rest = [part.strip() for part in text.split("<p>") if part.strip()]
    parameters = re.sub(r"^`\w+`: the element ?", "", head)
    return " ".join(rest), re.sub(r" (?=`\w+`: )", "<br>", parameters)


def action_signals(element, sources):
    """Returns a table of the element's action signals, which applications emit."""
    rows = []
    for signal in sorted(GObject.signal_list_names(element)):
        query = GObject.signal_query(signal, element.__gtype__)
        if query.itype != element.__gtype__ or not query.signal_flags & GObject.SignalFlags.ACTION:
            continue
        types = ", ".join(gtype.name for gtype in query.param_types)
        what, parameters = comment_of_signal(element.__gtype__, signal, sources)
        rows.append(f"| `{signal}` ({types}) -> {query.return_type.name} | {parameters} | {what} |")
    return ["\n| action signal | parameters | what it does |\n| --- | --- | --- |", *rows] if rows else []


def section(factory, sources):
    name = factory.get_name()
    out = [f"\n## {name}\n", factory.get_metadata("description") + ".\n", comment_of(name, sources) + "\n"]
    out.append("| pad | direction | presence | caps |\n| --- | --- | --- | --- |")
    for pad in sorted(factory.get_static_pad_templates(), key=lambda p: p.name_template):
        caps = pad.get_caps().to_string().replace("; ", "<br>").replace("|", "\\|")
        out.append(f"| `{pad.name_template}` | {pad.direction.value_nick} | {pad.presence.value_nick} | {caps} |")
    element = factory.create()
    rows = table_of(element.list_properties(), element)
    if rows:
        out += ["\n| property | type | range | default | settable | what it is |\n| --- | --- | --- | --- | --- | --- |"]
        out += rows
    out += pad_properties(element)
    out += action_signals(element, sources)
    return "\n".join(out) + "\n"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("plugin")
    parser.add_argument("sources", type=pathlib.Path)
    parser.add_argument("file", type=pathlib.Path)
    parser.add_argument("--check", action="store_true")
    args = parser.parse_args()
    Gst.init([])
    plugin = Gst.Plugin.load_file(args.plugin)
    Gst.Registry.get().add_plugin(plugin)
    features = Gst.Registry.get().get_feature_list_by_plugin(plugin.get_name())
    factories = sorted((f.load() for f in features if isinstance(f, Gst.ElementFactory)), key=lambda f: f.get_name())
    text = HEAD + limits_section(factories) + "".join(section(f, args.sources) for f in factories)
    if not args.check:
        args.file.write_text(text)
        return
    page = args.file.read_text() if args.file.exists() else ""
    if page != text:
        sys.stderr.writelines(difflib.unified_diff(page.splitlines(True), text.splitlines(True), "page", "plugin", n=0))
        sys.exit(f"{args.file} is outdated: ninja -C build elements-md")


main()
