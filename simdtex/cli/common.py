# SPDX-License-Identifier: BSD-3-Clause
"""What the commands share: options, progress, and errors in one sentence."""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn


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


DEVICE = click.option(
    "--device",
    metavar="TEXT",
    help="Part of a device's name or platform, an index of `simdtex devices`, or `reference`. "
    "Default: SIMDTEX_DEVICE, else a GPU, else a CPU.",
)


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
