# SPDX-License-Identifier: BSD-3-Clause
"""The one body of the commands that make a texture: run, report progress, write, and say what was written."""

from __future__ import annotations

import functools
import os
import secrets
import shlex
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from simdtex.cli.command import RESUME, WORDS, afterwards, command, note, settle
from simdtex.cli.options import CHECKPOINT, DEVICE, DRY_RUN, QUIET, SEED, job_options, together

if TYPE_CHECKING:
    from simdtex.checkpoint import Checkpoint
    from simdtex.run import Progress


OBSERVED = 1.0
"""Seconds of a run after which its duration is estimated."""

SMOOTH, ROUGH = 0.5, 10.0
"""The most seconds between two callbacks without the compilation of a kernel, and how long others are disregarded."""

LONG = 60.0
"""Seconds beyond which the expected duration of a run is said."""

EVERY = 2.0
"""The fewest seconds between two lines of progress without a terminal, each of which says another per cent."""


class Task(NamedTuple):
    """What a command does once its input is read and checked."""

    make: Callable[..., Any]  # a public function with its own arguments; returns what it made and a `simdtex.Output`
    summary: str  # what is made of what
    names: str  # the files that are written, in words
    outputs: list[Callable[[Any, Any], object]]  # each writes one file or folder; if one fails, the others are written
    limits: tuple[float, float] = (0.0, 1.0)  # black and white in the pictures of stages
    more: Callable[[Any, Any], None] | None = None  # prints further lines after the summary
    report: Callable[[Path, Any, Any], object] | None = None  # writes the page of --report into a folder


def job(
    *examples: tuple[str, str], usual: str = "", of: str = "", methods: Sequence[Any] = (), seeded: bool = True
) -> Callable[[Callable[..., Task | None]], click.Command]:
    """Return a decorator that makes a command of a function that plans it: from the command's options to its `Task`.

    Its options are those of the function, of its ``methods``, with the defaults of the job ``of``, and shared ones.
    """

    def decorate(plan: Callable[..., Task | None]) -> click.Command:
        @functools.wraps(plan)
        def planned(
            device: str | None,
            quiet: bool,
            dry_run: bool,
            seed: int | None = None,
            checkpoint: Path | None = None,
            stages: Path | None = None,
            report: Path | None = None,
            profile: bool = False,
            **values: Any,
        ) -> None:
            if report:
                from simdtex.figures.page import check_folder

                check_folder(report)
            task = plan(**values)
            if task is None:
                return
            if dry_run:
                click.echo(f"{task.names}: {task.summary}, {expected(device, task.make)}; nothing was written")
                return
            began = time.perf_counter()
            kept = _checkpoint(checkpoint)
            if seed is None and not (kept and kept.path.exists()):  # else the seed of the checkpoint
                seed = short_seed()
            with watching(quiet, stages, task.limits, kept) as callback:
                keywords = {"rng": seed, "device": _device(device, profile), "callback": callback, "checkpoint": kept}
                made, output = task.make(full_output=True, **keywords)
            if report and task.report:
                task.outputs.append(partial(task.report, report))
            for write in task.outputs:
                with afterwards():
                    write(made, output)
            settle()
            if kept:
                kept.remove()
            statistics = output.statistics
            if not quiet:
                seconds = f"in {time.perf_counter() - began:.1f} s on {statistics['device']}"
                drawn = f", seed {statistics['seed']}" if "seed" in statistics else ""
                click.echo(f"{task.names}: {task.summary} {seconds}{drawn}")
                if order := chosen_order(values, statistics):
                    click.echo(f"The neighbourhood has order {order}, the largest that fits the sample.")
                if task.more:
                    task.more(made, output)
            if profile:
                from simdtex.figures.tables import print_profile

                print_profile(statistics)

        params = planned.__dict__.pop("__click_params__", [])
        own_options = job_options(of or plan.__name__, *methods)
        drawn = (SEED, own_options, CHECKPOINT) if seeded else (own_options,)
        function: Any = together(*drawn, DEVICE, DRY_RUN, QUIET)(planned)
        function.__click_params__ += params
        return command(*examples, usual=usual)(function)

    return decorate


def chosen_order(values: dict[str, Any], statistics: dict[str, Any]) -> int | None:
    """Return the order of a run of ``mrf`` if it is smaller than the default, since the sample is small."""
    if values.get("order") or "lattice" not in statistics:
        return None
    from simdtex.methods.mrf.options import ORDERS

    order: int = statistics["options"]["order"]
    return None if order in ORDERS.values() else order


def short_seed() -> int:
    """Return a random seed below a million, which is short to give again."""
    return secrets.randbelow(10**6)


class Forecast:
    """The expected duration of a run, from the shares that its callbacks report."""

    def __init__(self) -> None:
        self.began = time.perf_counter()
        self.last: tuple[float, float] | None = None
        self.smooth, self.all = [0.0, 0.0], [0.0, 0.0]  # seconds, and the share that was done in them

    def seconds(self, fraction: float) -> float | None:
        """Return the expected seconds from the beginning to the end; None before `OBSERVED` seconds."""
        now = time.perf_counter() - self.began
        if self.last is not None:  # before the first callback, and between distant ones, kernels are compiled
            took, done = now - self.last[0], fraction - self.last[1]
            for sums in (self.all, self.smooth) if took <= SMOOTH else (self.all,):
                sums[0], sums[1] = sums[0] + took, sums[1] + done
        self.last = now, fraction
        for (took, share), least in ((self.smooth, OBSERVED), (self.all, ROUGH)):
            if took >= least and share > 0:
                return now + took / share * (1 - fraction)
        return None


class Enough(Exception):
    """A run has been observed for long enough to estimate its duration."""


def observed(make: Callable[..., Any], device: str | None) -> tuple[float, int]:
    """Return the expected seconds of a run, of which the first part is run, and its levels."""
    from simdtex.machine import memory

    forecast, seconds, levels = Forecast(), None, 1
    memory.required.clear()

    def observe(progress: Progress) -> None:
        nonlocal seconds, levels
        seconds, levels = forecast.seconds(progress.fraction), progress.levels
        if seconds is not None:
            raise Enough

    with suppress(Enough):
        make(full_output=True, rng=1, device=device, callback=observe, checkpoint=None)
    return time.perf_counter() - forecast.began if seconds is None else seconds, levels


def expected(device: str | None, *makes: Callable[..., Any]) -> str:
    """Return the levels and the memory of the last of several runs, and the expected time of all, in words."""
    from simdtex.figures.tables import duration_text
    from simdtex.machine import memory, open_machine

    times, levels = zip(*(observed(make, device) for make in makes), strict=True)
    machine = open_machine(device)
    host, on_device = (
        sum(size for (where, _), size in memory.required.items() if where == here) / 2**20
        for here in ("host", "device")
    )
    parts = [f"{levels[-1]} levels"] * (levels[-1] > 1) + [f"{host:.0f} MiB of memory"]
    parts += [] if memory.shared(machine) else [f"{on_device:.0f} MiB on the device"]
    return ", ".join([*parts, f"about {duration_text(sum(times))} on {machine.name}"])


def _device(device: str | None, profile: bool) -> Any:
    """Return the device, opened so that it times its kernels if a profile is wanted."""
    if not profile:
        return device
    from simdtex.machine import open_machine

    machine = open_machine(device, profile=True)
    if machine.seconds is None:
        raise ValueError("--profile times the kernels of an OpenCL device and the reference has none; leave it out")
    return machine


def _checkpoint(path: Path | None) -> Checkpoint | None:
    """Return the checkpoint of the command, which describes the command line for ``simdtex resume``."""
    if path is None:
        return None
    from simdtex.checkpoint import Checkpoint

    context = click.get_current_context()
    line = {"name": context.command.name, "words": context.meta[WORDS], "folder": os.getcwd()}
    context.meta[RESUME] = path
    kept = Checkpoint(path, command=line, note=note)
    context.obj = kept
    return kept


def command_line() -> str:
    """Return the command line of the running command, so that a reader can give it again."""
    context = click.get_current_context()
    words = shlex.join(["simdtex", str(context.command.name), *context.meta[WORDS]])
    return os.fsencode(words).decode(errors="backslashreplace")  # the name of a file may be no text


def notes(output: Any) -> None:
    """Print the sentences on the sample of a run, if there are any."""
    from simdtex.model.light import sample_sentences

    if sentences := sample_sentences(output.statistics):
        click.echo(sentences)


@contextmanager
def progress_bar(quiet: bool) -> Iterator[Callable[[Progress], None]]:
    """Yield the callback that moves a progress bar on a terminal, or prints lines, and says how long a run may last."""
    if quiet:
        yield lambda progress: None
        return
    forecast, last, said, next_line, per_cent = Forecast(), None, False, time.perf_counter() + EVERY, "0%"

    def tell(progress: Progress) -> None:
        nonlocal last, said, next_line, per_cent
        if (job := progress.details.get("job")) != last and not bar:
            click.echo(job, err=True)
        last, seconds = job, forecast.seconds(progress.fraction)
        if seconds is None:
            return
        if seconds > LONG and not said:
            said = True
            echo(f"simdtex: this is expected to last {duration(seconds)}")
        now = time.perf_counter()
        if now >= next_line and per_cent != (reached := f"{progress.fraction:.0%}") and not bar:
            next_line, per_cent, past = now + EVERY, reached, now - forecast.began
            line = f"{reached}, {progress.doing}; after {past:.0f} s {duration(seconds - past)} left"
            click.echo(line, err=True)

    def duration(seconds: float) -> str:
        from simdtex.figures.tables import duration_text

        return f"about {duration_text(seconds)}"

    bar = sys.stderr.isatty()
    echo: Callable[[str], Any] = partial(click.echo, err=True)
    if not bar:
        yield tell
        return
    from rich import progress as bars  # only where a bar is drawn: it takes long to load
    from rich.console import Console

    columns = (bars.TextColumn("{task.description}"), bars.BarColumn(), bars.TaskProgressColumn())
    with bars.Progress(*columns, bars.TimeRemainingColumn(), console=Console(stderr=True), transient=True) as shown:
        task, echo = shown.add_task("starting", total=1.0), shown.console.print

        def show(progress: Progress) -> None:
            parts = [*filter(None, [progress.details.get("job")]), progress.doing]
            shown.update(task, completed=progress.fraction, description=", ".join(parts))
            tell(progress)

        yield show


@contextmanager
def watching(
    quiet: bool = False,
    stages: Path | None = None,
    limits: tuple[float, float] = (0.0, 1.0),
    checkpoint: Checkpoint | None = None,
) -> Iterator[Callable[[Progress], None]]:
    """Yield a callback that moves a progress bar and writes the stages into a folder, if there is one for them."""
    writer = None
    if stages:
        from simdtex.figures.sheet import StageWriter

        writer = StageWriter(stages, limits=limits, resumed=lambda: bool(checkpoint and checkpoint.resumed))
    with progress_bar(quiet) as show:

        def callback(progress: Progress) -> None:
            nonlocal writer
            show(progress)
            if writer:
                working, writer = writer, None
                with afterwards():  # the picture does not wait for its stages
                    working(progress)
                    writer = working

        yield callback
