# SPDX-License-Identifier: BSD-3-Clause
"""The help of a command: what it does, the calls that are used most, and its options in groups by purpose."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import click

from simdtex.cli.ending import reporting, settle

Examples = Sequence[tuple[str, str]]
"""Words after ``simdtex``, and what they do."""

JOB, DATA, OUTPUTS = FIRST = ("Job", "Data and guides", "Further outputs")
RUNS, DEVICE_GROUP = LAST = ("Large outputs and interrupted runs", "Device and messages")
"""The groups of options before and after those of the methods."""

FEW = 14
"""Options that are listed without groups, at most."""

OPTION_WORDS = {
    "--size": ("--scale", "--width", "--height", "--resolution", "--shape", "--out-size"),
    "--seed": ("--rng", "--random-seed", "--random-state", "--variations", "--variation"),
    "--number": ("--count", "--n", "--realisations", "--realizations", "--variations"),
    "--order": ("--patch-size", "--window", "--radius", "--neighbourhood", "--neighborhood", "--kernel"),
    "--device": ("--gpu", "--cpu", "--platform", "--cuda", "--opencl"),
    "--output": ("--out", "--output-file", "--outfile", "--dest"),
    "--mask": ("--hole", "--inpaint"),
    "--boundary": ("--tile", "--tileable", "--wrap"),
    "simdtex tile": ("--seamless", "--tile", "--tileable", "--tiling", "--wrap"),
    "simdtex fill": ("--inpaint", "--hole"),
}
"""Words of other programs for options, by our option or command."""


class Command(click.Command):
    """Command with ``examples`` of its use, and the names of its ``usual`` options.

    The usual options are all that ``--help`` lists; ``--help-all`` lists all options, in groups by purpose. Without
    usual options ``--help`` lists all.
    """

    def __init__(self, *args: Any, examples: Examples = (), usual: str = "", **given: Any) -> None:
        super().__init__(*args, **given)
        self.examples, self.usual = examples, usual.split()
        if usual:
            flags = {"is_flag": True, "is_eager": True, "expose_value": False}
            self.params.append(click.Option(["--help-all"], callback=_help_all, help="Show all options.", **flags))

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse and keep the words of a command line; an option of another program names ours."""
        ctx.meta[WORDS] = list(args)
        try:
            return super().parse_args(ctx, args)
        except ValueError as error:
            settle(error)
            raise
        except click.NoSuchOption as error:
            own = {flag for param in self.params for flag in param.opts}
            ours = [ours for ours, theirs in OPTION_WORDS.items() if error.option_name in theirs]
            if found := [one for one in ours if one in own or not one.startswith("-")]:
                ctx.fail(f"No such option '{error.option_name}': use {' or '.join(found)}.")
            raise

    def format_help_text(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write what the command does, and the examples."""
        super().format_help_text(ctx, formatter)
        write_examples(self.examples, formatter)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the usual options, or all in groups if there are many."""
        entries = {_name(one): entries_of(one, ctx) for one in self.get_params(ctx)}
        if self.usual and not ctx.meta.get(ALL):
            records = [entries[name][0][1] for name in (*self.usual, "help")]
            with formatter.section("Usual options"):
                formatter.write_dl(records)
            formatter.write_paragraph()
            others = sum(map(bool, entries.values())) - len(records) - 1  # --help-all itself
            formatter.write_text(f"`{ctx.command_path} --help-all` lists the other {others} options too.")
            return
        groups: dict[str, list[tuple[str, str]]] = {title: [] for title in FIRST}
        for title, record in (entry for one in entries.values() for entry in one):
            groups.setdefault(title, []).append(record)
        of_methods = {title: groups.pop(title) for title in sorted(groups, key=_method) if _method(title)}
        last = {title: groups.pop(title) for title in LAST if title in groups}
        groups |= of_methods | last
        if sum(map(len, groups.values())) <= FEW:
            groups = {"Options": [record for group in groups.values() for record in group]}
        for title, records in groups.items():
            if records:
                with formatter.section(title):
                    formatter.write_dl(records)


def _method(title: str) -> str:
    """Return the method that a title names, if it names one."""
    return title.partition(":")[0] if title.startswith("Method ") else ""


ALL, WORDS = f"{__name__}.all", f"{__name__}.words"
"""Keys of a context's `meta`: whether all options are listed, and the words after the name of the command."""


def _help_all(ctx: click.Context, _: click.Parameter, wanted: bool) -> None:
    if wanted and not ctx.resilient_parsing:
        ctx.meta[ALL] = True
        click.echo(ctx.get_help())
        ctx.exit()


def _name(param: click.Parameter) -> str:
    return "help" if "--help" in param.opts else str(param.name)


def entries_of(param: click.Parameter, ctx: click.Context) -> list[tuple[str, tuple[str, str]]]:
    """Return the group, the names and the help of an option: one entry for each method that reads it differently."""
    record = param.get_help_record(ctx)
    if record is None or not isinstance(param, click.Option):
        return []
    methods: dict[str, str] = getattr(param, "methods", {})
    group = getattr(param, "group", DEVICE_GROUP if _name(param).startswith("help") else JOB)
    if methods and any(one.name == "method" for one in ctx.command.params):
        return [(f"Method {method}: {group.lower()}", (record[0], text)) for method, text in methods.items()]
    return [(group, record)]


def write_examples(examples: Examples, formatter: click.HelpFormatter) -> None:
    """Write examples, each with what it does above it."""
    for number, (words, what) in enumerate(examples):
        if not number:
            formatter.write_paragraph()
        formatter.indent()
        formatter.write_text(f"# {what}")
        formatter.write(f"{'':{formatter.current_indent}}simdtex {words}\n")  # one line, to be copied
        formatter.dedent()


def command(*examples: tuple[str, str], usual: str = "") -> Callable[[Callable[..., None]], click.Command]:
    """Return a decorator that makes a command of a function, whose errors are reported in one sentence."""

    def decorate(function: Callable[..., None]) -> click.Command:
        return click.command(cls=Command, examples=examples, usual=usual)(reporting()(function))

    return decorate
