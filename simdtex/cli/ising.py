# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex ising``: which schedules sample the right distribution."""

from __future__ import annotations

import shlex
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from simdtex.cli.common import DEVICE, plainly

SCHEDULES = (
    "coloring,coloring-fixed,luby,checkerboard,raster,random-scan,"
    "synchronous,random-subset,random-subset:0.25,block:8x8"
)
TEMPERATURES = (2.0, 2.3, 2.6)
PICTURE_SWEEPS = 50
"""From a random start: enough for domains to grow, too few for one to win."""


@click.command()
@click.option("--schedules", "names", default=SCHEDULES, metavar="A,B,...", help="Which to try.  [all kinds there are]")
@click.option(
    "--temperature",
    "temperatures",
    type=float,
    multiple=True,
    default=TEMPERATURES,
    metavar="T",
    help="In units of J / k_B, T_c is 2.269; may be repeated.  [2.0, 2.3 and 2.6]",
)
@click.option("--size", default="24", show_default=True, metavar="WIDTHxHEIGHT", help="Of the lattice, a torus.")
@click.option("--seeds", default=32, show_default=True, help="Independent chains at each temperature, 2 or more.")
@click.option("--sweeps", default=300, show_default=True, help="Sweeps to measure, 2 or more.")
@click.option("--burn-in", default=600, show_default=True, help="Sweeps before them.")
@click.option("--start", default="up", show_default=True, help="up (all spins) or random.")
@click.option("--seed", default=1, show_default=True, help="Same seed, same numbers on every device.")
@DEVICE
@click.option("-o", "--output", type=click.Path(path_type=Path), metavar="FOLDER", help="Write a report there.")
@click.option("-q", "--quiet", is_flag=True, help="No progress and no table.")
@plainly
def ising(
    names: str,
    temperatures: tuple[float, ...],
    size: str,
    seeds: int,
    sweeps: int,
    burn_in: int,
    start: str,
    seed: int,
    device: str | None,
    output: Path | None,
    quiet: bool,
) -> None:
    """Relax Ising spins by each schedule and compare with the exact energy and magnetisation."""
    from simdtex import image
    from simdtex import schedules as known
    from simdtex.estimates import findings
    from simdtex.machine import open_machine
    from simdtex.methods.ising import check, ising
    from simdtex.options import whole
    from simdtex.random import as_seed
    from simdtex.report import ising as report
    from simdtex.report.page import check_folder

    if output:
        check_folder(output)
    chosen = _distinct([known.get(name.strip()) for name in names.split(",")])
    temperatures = tuple(dict.fromkeys(temperatures))
    shape = image.parse_size(size)
    whole("--seeds", seeds, 2)  # there is no error bar over one
    whole("--sweeps", sweeps, 2)
    as_seed(seed)
    options: dict[str, Any] = {"seeds": seeds, "sweeps": sweeps, "burn_in": burn_in, "start": start}
    check(shape, temperatures, **options)
    machine = open_machine(device)

    began = time.perf_counter()
    runs, pictures = [], []
    with _progress(quiet, len(chosen)) as show:
        for place, schedule in enumerate(chosen):
            told = show(place, schedule.name)
            runs.append(ising(machine, shape, temperatures, schedule, seed=seed, callback=told, **options))
            if output:
                lowest = [min(temperatures)]
                once: dict[str, Any] = {"seeds": 1, "sweeps": PICTURE_SWEEPS, "burn_in": 0, "start": "random"}
                pictures.append(ising(machine, shape, lowest, schedule, seed=seed, **once))
    found = findings(runs)
    if not quiet:
        console = Console(width=None if sys.stdout.isatty() else 160)
        for table in report.terminal_tables(found, console.width):
            console.print(table)
        for sentence in report.conclusion(found):
            click.echo(sentence)
    if output:
        settings = {"device": machine.name, "rows": shape[0], "columns": shape[1], "seed": seed, **options}
        settings |= {"boundary": "torus", "temperatures": temperatures}
        command = shlex.join(["simdtex", *sys.argv[1:]])
        report.write_ising(output, found, runs, pictures, settings, command)
    if not quiet:
        where = f"{output / 'index.html'}: " if output else ""
        click.echo(f"{where}{time.perf_counter() - began:.0f} s on {machine.name}")


def _distinct(chosen: list[Any]) -> list[Any]:
    """The schedules, each once."""
    return list({schedule.name: schedule for schedule in chosen}.values())


@contextmanager
def _progress(quiet: bool, count: int) -> Iterator[Callable[[int, str], Callable[[float], None] | None]]:
    """A bar over all schedules where there is a terminal, else a line for each."""
    if quiet:
        yield lambda place, name: None
        return
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("starting", total=1.0)

        def show(place: int, name: str) -> Callable[[float], None]:
            what = f"schedule {place + 1} of {count}: {name}"
            if not console.is_terminal:
                click.echo(what, err=True)
            return lambda share: bar.update(task, completed=(place + share) / count, description=what)

        yield show
