#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Writes completions for bash from the --help texts of programs.

usage: completion.py FOLDER PROGRAM...

FOLDER receives one file per program, with the name of the program. If FOLDER is a relative path, it is inside the
prefix to which Meson installs.
"""
import os
import pathlib
import re
import sys
import tempfile

import help_text

# COMP_WORDBREAKS contains "=", so bash splits --name=value into three words.
FUNCTION = """\
# Completion of {name} for bash, generated from its --help texts.
_{function}() {{
  local word=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD - 1]}} command={name} i
  local words='' options='' values=''
  if [[ $word == = ]]; then
    word=''
  elif [[ $before == = ]]; then
    before=${{COMP_WORDS[COMP_CWORD - 2]}}
  fi
  for ((i = 1; i < COMP_CWORD; i++)); do
    case "$command ${{COMP_WORDS[i]}}" in
{subcommands}{valued}      *) ;;
    esac
  done
  case $command in
{cases}  esac
  case "$command $before" in
{choices}    *) ;;
  esac
  if [[ $values ]]; then
    words=$values
  elif ((i > COMP_CWORD)); then
    words=''
  elif [[ $word == -* ]]; then
    words=$options
  fi
  mapfile -t COMPREPLY < <(compgen -W "$words" -- "$word")
}}
# Without a match, bash completes names of files.
complete -o default -F _{function} {name}
"""


def commands_of(program, *subcommands):
    """Yields (words of the command, sections of its help text) for a program and all of its subcommands."""
    sections = help_text.parse(help_text.help_of([program, *subcommands]))[1]
    yield " ".join([program.name, *subcommands]), sections
    for row in sections.get("Subcommands", []):
        yield from commands_of(program, *subcommands, row.head)


def branch(patterns, action, indent):
    """Returns a branch of a case statement, or nothing without patterns."""
    return " " * indent + " | ".join(f"'{pattern}'" for pattern in patterns) + f") {action} ;;\n" if patterns else ""


def completion(program):
    commands, valued, cases, choices = [], [], "", ""
    for command, sections in commands_of(program):
        commands.append(command)
        options = []
        for row in sections.get("Options", []):
            names, kind, _ = help_text.split_head(row.head)
            patterns = [f"{command} {name}" for name in names.split(",")]
            # Short names need no completion, but can have a value.
            options += [name for name in names.split(",") if name.startswith("--")]
            if kind:
                valued += patterns
            if values := help_text.choices(kind):
                choices += branch(patterns, f"values='{' '.join(values)}'", 4)
        words = [row.head for row in sections.get("Subcommands", [])]
        # A command that accepts nothing else gets its options.
        if not words and "Positionals" not in sections:
            words = options
        cases += branch([command], f"words='{' '.join(words)}' options='{' '.join(options)}'", 4)
    next_word = '[[ ${COMP_WORDS[i + 1]} != = ]] || ((i += 1)); ((i += 1))'
    return FUNCTION.format(name=program.name, function=re.sub(r"\W", "_", program.name), cases=cases, choices=choices,
                           subcommands=branch(commands[1:], 'command+=" ${COMP_WORDS[i]}"', 6),
                           valued=branch(valued, next_word, 6))


def main():
    folder = pathlib.Path(os.environ.get("MESON_INSTALL_DESTDIR_PREFIX", ""), sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        # The help texts do not depend on plugins, so GStreamer need not search for any.
        os.environ |= {"GST_PLUGIN_SYSTEM_PATH_1_0": "", "GST_REGISTRY": f"{scratch}/registry"}
        for name in sys.argv[2:]:
            program = pathlib.Path(name)
            file = folder / program.name
            file.write_text(completion(program))
            file.chmod(0o644)


main()
