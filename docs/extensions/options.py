# SPDX-License-Identifier: BSD-3-Clause
"""The options of commands and methods as reStructuredText, from where they are declared.

``.. command-options:: synth`` lists the options of ``simdtex synth``. A definition list below it adds to some of them
what a page has to say beside their help::

    --known
       More on ``--known``.
"""

import re
from importlib import import_module
from textwrap import dedent, indent

import click

from simdtex.cli.command import entries_of
from simdtex.commands import load
from simdtex.options import UNSET, quoted, table


def additions(lines):
    """The texts of a definition list, by the option that each is about."""
    found = {}
    for block in re.split(r"^(?=--)", "\n".join(lines).strip(), flags=re.MULTILINE):
        name, _, text = block.partition("\n")
        found |= {name.strip(): dedent(text).strip()} if name else {}
    return found


def command_options(name, lines=()):
    """The options of a command, each with its help, its default and what the lines add."""
    more, written = additions(lines), [f".. program:: simdtex {name}", ""]
    for one in load(name).params:
        if not isinstance(one, click.Option):
            continue
        context = click.Context(load(name))
        value = "" if one.is_flag else f" {one.make_metavar(context)}"
        names = ", ".join(f"{flag}{value}" for flag in (*one.opts, *one.secondary_opts))
        entries = [(title, text) for title, (_, text) in entries_of(one, context)]
        of_methods = [f"{title.split()[1]} {text}" for title, text in entries if title.startswith("Method ")]
        text = "\n".join(f"- {text}" for text in of_methods) if of_methods else entries[0][1]
        text = re.sub(r"  \[(?:default: )?(.*?)\]", r" Default: \1.", text)
        text = re.sub(
            r"(?<=[\s.])(--[\w-]+)", r"``\1``", text.replace("Default: required.", "Required.").replace("`", "``")
        )
        written += [f".. option:: {names}", "", indent(text.replace("*", r"\*"), "   "), ""]
        extra = more.pop(max(one.opts, key=len), "")
        written += [indent(extra, "   "), ""] if extra else []
    assert not more, f"simdtex {name} has no option {', '.join(more)}"
    return "\n".join(written).splitlines()


def paper_values(method):
    """The options of a method whose values in the paper are known."""
    rows = [".. list-table::", "   :header-rows: 1", "   :widths: 25 20 20 35", "", "   * - Option", "     - Default"]
    rows += ["     - In the paper", "     - Symbol, equation"]
    for name, one in table(import_module(f"simdtex.methods.{method}.options").Options).items():
        if one.paper is not UNSET or one.symbol:
            paper = "" if one.paper is UNSET else f"``{quoted(one.paper)}``"
            default = "" if one.default is None else f"``{quoted(one.default)}``"
            rows += [f"   * - ``{name}``", f"     - {default}", f"     - {paper}", f"     - {one.symbol}"]
    return rows


def setup(app):
    from docutils import nodes
    from docutils.parsers.rst import Directive
    from docutils.statemachine import StringList

    class Listing(Directive):
        """A directive whose text a function writes."""

        required_arguments = 1
        has_content = True

        def run(self):
            node, content = nodes.Element(), [list(self.content)] if self.content else []
            written = StringList(type(self).write(self.arguments[0], *content), self.arguments[0])
            self.state.nested_parse(written, self.content_offset, node)
            return node.children

    for name, write in (("command-options", command_options), ("paper-values", paper_values)):
        app.add_directive(name, type(name, (Listing,), {"write": staticmethod(write)}))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
