# SPDX-License-Identifier: BSD-3-Clause
"""The options of the methods on the command line, made from their tables; and those that several commands share."""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

import click
from click.shell_completion import CompletionItem

from simdtex.cli.command import (
    DATA,
    DEVICE_GROUP,
    EITHER,
    FOLDER,
    JOB,
    OUTPUTS,
    READ,
    READ_NAMED,
    READ_PAIR,
    RUNS,
    WRITE,
    WRITE_PAIR,
)
from simdtex.model import light
from simdtex.options import PRESET, UNSET, Choice, Number, Numbers, Option, Other, Whole, has_presets, is_flag, table

Command = Callable[..., Any]


class CommandOption(click.Option):
    """An option in a ``group`` of the help, whose ``words`` the shell completes, with a help for each method."""

    def __init__(
        self,
        *names: Any,
        group: str = JOB,
        words: Iterable[str] = (),
        method: str = "",
        methods: dict[str, str] | None = None,
        **keywords: Any,
    ) -> None:
        super().__init__(*names, **keywords)
        self.group, self.words = group, list(dict.fromkeys(words))
        self.methods = methods or ({method: str(self.help)} if method else {})

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Return the words that begin so; else what the type completes."""
        items = [CompletionItem(word) for word in self.words if word.startswith(incomplete)]
        return items or super().shell_complete(ctx, incomplete)

    def make_metavar(self, ctx: click.Context) -> str:
        """Return the words, if they are few."""
        words = "|".join(self.words)
        return words if self.metavar is None and 0 < len(words) < 30 else super().make_metavar(ctx)


class Parsed(click.types.StringParamType):
    """A text that ``parse`` takes apart; if it raises, an error says that the text must be of a ``form``."""

    def __init__(self, parse: Callable[[str], Any], form: str) -> None:
        self.parse, self.form = parse, form

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return what the text means."""
        try:
            return self.parse(value) if isinstance(value, str) else value
        except (ValueError, KeyError):
            name = param.opts[-1] if param else ""
            raise ValueError(f"{name} {value} must be {self.form}") from None


def pairs(text: str, apart: str = ",") -> list[tuple[str, str]]:
    """Return the pairs of ``A=B,C=D``; ``apart`` is the pattern of what separates them."""
    cut = (part.partition("=") for part in re.split(apart, text) if part)
    parts = [(left.strip(), right.strip()) for left, _, right in cut]
    if not all(map(all, parts)):
        raise ValueError(text)
    return parts


NUMBERS = Parsed(lambda text: tuple(map(float, text.split(","))), "numbers separated by commas, such as 0.1,0.2")
COLUMNS = Parsed(functools.partial(pairs, apart=r",(?=\s*(?:x|y|z|value)\s*=)"), "AXIS=NAME,...")
CATEGORIES = Parsed(lambda text: {name: float(value) for name, value in pairs(text)}, "NAME=NUMBER,...")
DIRECTIONS = {"both": True, "x": "x", "y": "y"}
DIRECTION = Parsed(DIRECTIONS.__getitem__, "x, y or both")

option = functools.partial(click.option, cls=CommandOption)


def together(*options: Callable[[Command], Command]) -> Callable[[Command], Command]:
    """Return a decorator that adds options in this order."""

    def decorate(command: Command) -> Command:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


def job_options(job: str, *methods: Any) -> Callable[[Command], Command]:
    """Return a decorator that adds to a command all options that it shows of its methods, classes of options."""
    tables = {method.__module__.split(".")[2]: table(method) for method in methods}
    named: dict[str, dict[str, Option]] = {"preset": {"": PRESET}} if any(map(has_presets, tables.values())) else {}
    for method, options in tables.items():
        for name, option in options.items():
            if job in option.shown:
                named.setdefault(name, {})[method if len(tables) > 1 else ""] = option
    return together(*(_option(job, name, methods) for name, methods in named.items()))


def paper_options(method: Any, *names: str) -> Callable[[Command], Command]:
    """Return a decorator that adds to a command options of a class of options, whose defaults are the paper's."""
    declared = table(method)
    paper = {name: declared[name].default if declared[name].paper is UNSET else declared[name].paper for name in names}
    return together(*(_option("", name, {"": replace(declared[name], default=paper[name])}) for name in names))


def _option(job: str, name: str, methods: Mapping[str, Option]) -> Callable[[Command], Command]:
    """Return the command line's option of a name; `methods` are its declarations, by method if there are several."""
    first = next(iter(methods.values()))
    kind, flag = first.kind, f"--{name.replace('_', '-')}"
    kinds: dict[Any, Any] = {Whole: int, Number: float, Numbers: NUMBERS}
    helps = {method: _help(job, option) for method, option in methods.items() if method}
    how: dict[str, Any] = {"group": first.group or JOB, "help": _help(job, first), "methods": helps}
    how["metavar"] = "N,N,..." if isinstance(kind, Numbers) else None
    flags = [f"{flag}/--no-{flag[2:]}" if is_flag(kind) and first.default is None else flag]
    type_: Any = kinds.get(type(kind), str)
    words = [word for entry in methods.values() if isinstance(entry.kind, (Choice, Other)) for word in entry.kind.valid]
    if is_flag(kind):
        return option(*flags, is_flag=True, **{**how, "default": None})
    return option(*flags, type=type_, words=words, **how)


def _help(job: str, option: Option) -> str:
    """Return the help of an option, with its default in the job."""
    default = option.default_of(job)
    if default is None:
        shown = option.none.replace("`", "")
    elif default is False:
        shown = ""
    else:
        shown = f"{default:g}" if isinstance(default, float) else str(default)
    if f"{job} values" in option.jobs:
        shown += f"; without --categorical {option.jobs[f'{job} values']}"
    return f"{option.help}.  [{shown}]" if shown else f"{option.help}."


def given(options: dict[str, Any], without: tuple[str, ...] = ()) -> dict[str, Any]:
    """Return the options that were given; some left out."""
    return {name: value for name, value in options.items() if value is not None and name not in without}


def output_option(help: str, type: Any = EITHER, **how: Any) -> Callable[[Command], Command]:
    """Return ``--output``, which is required unless it has a default."""
    return option("-o", "--output", required="default" not in how, type=type, help=help, **how)


OUTPUT = output_option("Write this picture, or a folder of maps.")
SEED = option(
    "--seed",
    type=int,
    help="Use this seed: the same seed gives the same output on every device.  [a random one, printed]",
)
DEVICE = option(
    "--device",
    group=DEVICE_GROUP,
    help="Run on this device: a part of its name or platform, its index in `simdtex devices`, or `reference`.  "
    "[SIMDTEX_DEVICE, else a GPU, else a CPU]",
)
CHECKPOINT = option(
    "--checkpoint",
    type=WRITE,
    metavar="FILE",
    group=RUNS,
    help="Keep the state of the run in this file; `simdtex resume FILE` continues it.",
)
PROFILE = option(
    "--profile",
    is_flag=True,
    group=DEVICE_GROUP,
    help="Print the time of each kernel, and of the host.",
)
DRY_RUN = option(
    "--dry-run",
    is_flag=True,
    group=RUNS,
    help="Print the size, the levels, the memory and the expected time of the run, and write nothing.",
)
PREVIEW = option(
    "--preview",
    is_flag=True,
    group=OUTPUTS,
    help="Write 3x3 copies of the output, edge to edge, beside it: OUT-3x3.png.",
)
QUIET = option("-q", "--quiet", is_flag=True, group=DEVICE_GROUP, help="Show no progress and no summary.")
data_option = functools.partial(option, group=DATA, method="mrf")
SAMPLE_MASK = data_option(
    "--sample-mask",
    multiple=True,
    type=READ,
    metavar="FILE",
    help="Take pixels only from the white parts of this mask, of the sample's size; give one for each sample.",
)
KNOWN_OPTIONS = together(
    data_option(
        "--known",
        type=READ,
        metavar="FILE",
        help="Keep these conditioning data: a table of x, y and values (.csv, .tsv, .txt, .dat), a point set of "
        "Geo-EAS, or a picture or a grid whose unknown pixels are transparent or NaN.",
    ),
    data_option(
        "--columns",
        type=COLUMNS,
        metavar="x=NAME,...",
        help="Take these columns of tables as x, y, z and value, by name, which may have commas, or by number, as "
        "x=1,value=4; the variable of a grid is value.  [columns with names of axes, as X, Northing, lon; all others "
        "are values]",
    ),
    data_option(
        "--categories",
        type=CATEGORIES,
        metavar="NAME=NUMBER,...",
        help="Take these numbers for the texts in the table of --known, as sand=1,shale=0.",
    ),
    data_option(
        "--missing",
        multiple=True,
        type=float,
        metavar="VALUE",
        help="Take this number in tables and grids as unknown, too; may be repeated.  [codes such as -999, outside of "
        "the values of the sample]",
    ),
)
"""Known values of the output, and how their file is read, see `simdtex.cli.inputs.take_reading`."""

GUIDE = data_option(
    "--guide",
    type=READ_PAIR,
    metavar="SAMPLE-GUIDE=OUTPUT-GUIDE",
    help="Take each pixel from places where SAMPLE-GUIDE is like OUTPUT-GUIDE at the pixel: two pictures of labels or "
    "numbers. Give GUIDE0,GUIDE1=OUTPUT-GUIDE for several samples.",
)


LIGHT = _option("", "light", {"": light.LIGHT})
MAP = option(
    "--map",
    "roles",
    group=DATA,
    multiple=True,
    type=READ_NAMED,
    metavar="ROLE=FILE",
    help="Use FILE of the folder as its map of this role (albedo, normal...), whatever its name; may be repeated.",
)
material_options = together(
    MAP,
    option(
        "--also",
        group=OUTPUTS,
        multiple=True,
        type=WRITE_PAIR,
        metavar="MAP=OUT",
        help="Arrange another map of the material (normal, height) like the output; may be repeated.",
    ),
    option(
        "--source-map",
        group=OUTPUTS,
        type=WRITE,
        metavar="FILE",
        help="Write the position in the sample of each pixel: .npz, .npy or .png.",
    ),
)
"""The maps of a material, and where the pixels are from."""


def report_option(what: str) -> Callable[[Command], Command]:
    """Return ``--report``, which writes a page with this on it."""
    return option("--report", type=FOLDER, metavar="DIR", group=OUTPUTS, help=f"Write a page about the run: {what}.")


def size_option(default: str, of: str = "an output", base: str = "the sample") -> Callable[[Command], Command]:
    """Return ``--size``, with its default in words."""
    help = f"Make {of} of this size: 640x480 pixels, 512 for a square, or 2x or 150% of {base}.  [{default}]"
    return option("--size", metavar="WIDTHxHEIGHT", help=help)


def stages_option(what: str) -> Callable[[Command], Command]:
    """Return ``--stages``, which writes these pictures."""
    return option("--stages", type=FOLDER, metavar="DIR", group=OUTPUTS, help=f"Write {what} as pictures.")
