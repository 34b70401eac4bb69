# SPDX-License-Identifier: BSD-3-Clause
"""The help of a command: what it does, the calls that are used most, and its options in groups by purpose."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import click

from simdtex.cli.ending import reporting

Examples = Sequence[tuple[str, str]]
"""Words after ``simdtex``, and what they do."""

JOB, DATA, OUTPUTS = FIRST = ("Job", "Data and guides", "Further outputs")
RUNS, DEVICE_GROUP = LAST = ("Large outputs and interrupted runs", "Device and messages")
"""The groups of options before and after those of the methods."""

FEW = 14
"""Options that are listed without groups, at most."""


class Command(click.Command):
    """Command with ``examples`` of its use: words after ``simdtex``, and what they do."""

    def __init__(self, *args: Any, examples: Examples = (), **given: Any) -> None:
        super().__init__(*args, **given)
        self.examples = examples

    def format_help_text(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write what the command does, and the examples."""
        super().format_help_text(ctx, formatter)
        write_examples(self.examples, formatter)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options, in groups if there are many."""
        groups: dict[str, list[tuple[str, str]]] = {title: [] for title in FIRST}
        for param in self.get_params(ctx):
            record = param.get_help_record(ctx)
            if isinstance(param, click.Option) and record:
                own = DEVICE_GROUP if param.name == "help" else JOB
                groups.setdefault(getattr(param, "group", own), []).append(record)
        last = {title: groups.pop(title) for title in LAST if title in groups}
        groups |= last
        if sum(map(len, groups.values())) <= FEW:
            groups = {"Options": [record for group in groups.values() for record in group]}
        for title, records in groups.items():
            if records:
                with formatter.section(title):
                    formatter.write_dl(records)


def write_examples(examples: Examples, formatter: click.HelpFormatter) -> None:
    """Write examples, each with what it does above it."""
    for number, (words, what) in enumerate(examples):
        if not number:
            formatter.write_paragraph()
        formatter.indent()
        formatter.write_text(f"# {what}")
        formatter.write(f"{'':{formatter.current_indent}}simdtex {words}\n")  # one line, to be copied
        formatter.dedent()


def command(*examples: tuple[str, str]) -> Callable[[Callable[..., None]], click.Command]:
    """Return a decorator that makes a command of a function, whose errors are reported in one sentence."""

    def decorate(function: Callable[..., None]) -> click.Command:
        return click.command(cls=Command, examples=examples)(reporting()(function))

    return decorate
