# SPDX-License-Identifier: BSD-3-Clause
"""What the commands share: options, progress, and errors in one sentence."""

from __future__ import annotations

import functools
import shlex
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from simdtex.methods.mrf import Options


def plainly(command: Callable[..., None]) -> Callable[..., None]:
    """Turn bad input into one sentence and exit code 2, and Ctrl-C into exit code 130."""

    @functools.wraps(command)
    def wrapped(*args: Any, **kwargs: Any) -> None:
        try:
            command(*args, **kwargs)
        except (ValueError, TypeError, OSError) as error:
            click.echo(f"simdtex: {error}", err=True)
            sys.exit(2)
        except KeyboardInterrupt:
            click.echo("simdtex: stopped; nothing but stages may have been written", err=True)
            sys.exit(130)

    return wrapped


DEFAULTS = Options()

DEVICE = click.option(
    "--device",
    metavar="TEXT",
    help="Part of a device's name or platform, an index of `simdtex devices`, or `reference`. "
    "Default: SIMDTEX_DEVICE, else a GPU, else a CPU.",
)


_MRF_OPTIONS = (
    click.option("--preset", help="default, or paper: the 1998 rules to the letter."),
    click.option("--order", type=int, help=f"Neighbours within sqrt(order): 8 has 24, 18 has 60.  [{DEFAULTS.order}]"),
    click.option("--levels", type=int, help="Of the multigrid.  [as many as the sample feeds]"),
    click.option("--relaxation", help=f"icm (the mode) or gibbs (a draw).  [{DEFAULTS.relaxation}]"),
    click.option("--bandwidth", type=float, help=f"Of the Parzen kernel, in units of h_opt.  [{DEFAULTS.bandwidth}]"),
    click.option(
        "--coherence", type=float, help=f"Preference for continuing a neighbour's source.  [{DEFAULTS.coherence}]"
    ),
    click.option("--xi", type=float, help=f"Cooling, below 0; further down is faster.  [{DEFAULTS.xi}]"),
    click.option(
        "--free-sweeps", type=int, help=f"Sweeps over all sites after a level's equilibrium.  [{DEFAULTS.free_sweeps}]"
    ),
    click.option("--pixel", help=f"source (pixels of the sample) or density (grey levels).  [{DEFAULTS.pixel}]"),
    click.option("--phases", help=f"decimated or all: candidates at coarse levels.  [{DEFAULTS.phases}]"),
    click.option("--edges", help=f"auto, reflect or whole: candidates at the sample's edge.  [{DEFAULTS.edges}]"),
    click.option("--coarsest", help=f"gibbs or same: how the coarsest level relaxes.  [{DEFAULTS.coarsest}]"),
    click.option("--boundary", help=f"torus (the result tiles) or open.  [{DEFAULTS.boundary}]"),
)


def mrf_options(command: Callable[..., None]) -> Callable[..., None]:
    """The options of the method ``mrf`` that any command takes which runs it."""
    for option in reversed(_MRF_OPTIONS):
        command = option(command)
    return command


def command_line(context: click.Context) -> str:
    """What was given to a command, so that a reader can give it again."""
    words = ["simdtex", str(context.command.name)]
    for parameter in context.command.params:
        name = parameter.name or ""
        if context.get_parameter_source(name) is not ParameterSource.COMMANDLINE:
            continue
        given = context.params[name]
        for value in given if isinstance(given, tuple) else [given]:
            if isinstance(parameter, click.Option):
                words.append(parameter.opts[-1])
            if not (isinstance(parameter, click.Option) and parameter.is_flag):
                words.append(str(value))
    return shlex.join(words)


def check_distinct(outputs: list[Path], inputs: list[Path]) -> None:
    """Raise where an output would overwrite another or an input."""
    resolved = [path.resolve() for path in outputs]
    for path in outputs:
        if resolved.count(path.resolve()) > 1:
            raise ValueError(f"{path} would be written twice; give each output a file of its own")
        if path.resolve() in [other.resolve() for other in inputs]:
            raise ValueError(f"{path} is an input and would be overwritten; give the output another name")


@contextmanager
def progress_bar(quiet: bool) -> Iterator[Callable[[float, str, str], None]]:
    """A progress bar on a terminal; elsewhere a line whenever another job begins.

    Yields ``show(fraction, doing, job)``: the share of the whole that is done, what is being done now, and the job that
    this is part of, empty where there is only one.
    """
    console = Console(stderr=True, quiet=quiet)
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=quiet or not console.is_terminal) as bar:
        task = bar.add_task("starting", total=1.0)
        last = ""

        def show(fraction: float, doing: str, job: str = "") -> None:
            nonlocal last
            bar.update(task, completed=fraction, description=", ".join(part for part in (job, doing) if part))
            if job != last and not quiet and not console.is_terminal:
                click.echo(job, err=True)
            last = job

        yield show


def standing(progress: Any) -> str:
    """Where a run stands, for the progress bar."""
    return f"level {progress.level}, sweep {progress.sweep}, temperature {progress.temperature_left:.3f}"
