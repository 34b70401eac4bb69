# SPDX-License-Identifier: BSD-3-Clause
"""The help of a command: what it does, the calls that are used most, and its options in groups by purpose."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import click

Examples = Sequence[tuple[str, str]]
"""Words after ``simdtex``, and what they do."""

SECTIONS = {
    "The job": (
        *("output", "outputs", "size", "number", "first", "method", "seed", "mask", "samples", "reach"),
        *(
            "left",
            "right",
            "top",
            "bottom",
            "centre",
            "seamless",
            "seamless_x",
            "seamless_y",
            "band",
            "solids",
            "slices",
        ),
        *("names", "temperatures", "seeds", "sweeps", "burn_in", "alphas", "betas", "quick", "path", "folder"),
        *("palette", "pattern", "average", "low", "high", "split", "blend", "pixels"),
    ),
    "What is given, and what is wanted": (
        *("known", "sample_mask", "guide", "guide_weight", "labels", "proportions", "shares", "weights"),
        *("categorical", "categorical_channels", "data_weight", "unsure"),
    ),
    "What is written besides": ("also", "source_map", "picture", "stages", "report"),
    "Method mrf: how it looks": (
        *("preset", "order", "coherence", "balance", "structure", "novelty", "overview", "finish"),
    ),
    "Method mrf: how it is searched, and how fast": ("search", "suggesting", "similar", "chance", "exhaustive"),
    "Method mrf: how it is sampled": (
        *("relaxation", "bandwidth", "xi", "free_sweeps", "pixel", "phases", "coarsest"),
    ),
    "Method mrf: schedules and processor arrays": (*("schedule", "check_schedule", "array", "mapping", "accounting"),),
    "Method multires": (
        *("alpha", "beta", "strain", "target", "thresholds", "sigma", "filter_size", "features", "parity", "seams"),
    ),
    "Method pyramid": ("pyramid", "iterations", "match", "bins", "color", "start"),
    "Levels and edges, of several methods": ("levels", "boundary", "edges", "orientations"),
    "Large outputs, and runs that stop and go on": ("tiles", "workers", "cluster", "dry_run", "checkpoint"),
    "This machine, and what is told": ("device", "jobs", "port", "host", "browser", "profile", "quiet"),
}
"""Titles, and the parameters under each."""

OF_COMMANDS = {"ising": {"start": "The job"}}
"""What a name means where it means something else."""

FEW = 14
"""Options that are listed without groups, at most."""

TITLES = {name: title for title, names in SECTIONS.items() for name in names}


class Command(click.Command):
    """A command with examples.

    Parameters
    ----------
    examples : sequence of (str, str), optional
        What is used most.
    **given
        As of `click.Command`.
    """

    def __init__(self, *args: Any, examples: Examples = (), **given: Any) -> None:
        super().__init__(*args, **given)
        self.examples = examples

    def format_help_text(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """What it does, and the examples."""
        super().format_help_text(ctx, formatter)
        write_examples(self.examples, formatter)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The options, in groups where there are many."""
        options = (param for param in self.get_params(ctx) if isinstance(param, click.Option))
        shown = [(self._title(one), record) for one in options if (record := one.get_help_record(ctx))]
        for title in SECTIONS if len(shown) > FEW else (None,):
            records = [(names, _within(title, text)) for under, (names, text) in shown if title in (None, under)]
            if records:
                with formatter.section(title or "Options"):
                    formatter.write_dl(records)

    def _title(self, param: click.Parameter) -> str:
        own = OF_COMMANDS.get(str(self.name), {})
        return own.get(str(param.name)) or TITLES.get(str(param.name), list(SECTIONS)[-1])


def write_examples(examples: Examples, formatter: click.HelpFormatter) -> None:
    """Write examples, each with what it does above it."""
    for number, (words, what) in enumerate(examples):
        if not number:
            formatter.write_paragraph()
        formatter.indent()
        formatter.write_text(f"# {what}")
        formatter.write(f"{'':{formatter.current_indent}}simdtex {words}\n")  # one line, to be copied
        formatter.dedent()


def _within(title: str | None, text: str) -> str:
    """The help of an option without the method that the title of its group names."""
    method, _, rest = text.partition(": ")
    if not (title and rest and title.split(":")[0] == f"Method {method}"):
        return text
    return rest[:1].upper() + rest[1:]


def command(*examples: tuple[str, str]) -> Callable[[Callable[..., None]], click.Command]:
    """A command of this kind, as `click.command` makes it."""
    return click.command(cls=Command, examples=examples)
