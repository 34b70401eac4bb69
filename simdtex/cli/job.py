# SPDX-License-Identifier: BSD-3-Clause
"""The one body of the commands that make a texture: run, report progress, write, and say what was written."""

from __future__ import annotations

import functools
import os
import shlex
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click
from click.core import ParameterSource

from simdtex.cli.command import command
from simdtex.cli.ending import RESUME, afterwards, note, settle
from simdtex.cli.options import CHECKPOINT, DEVICE, PROFILE, QUIET, SEED, job_options, stages_option

if TYPE_CHECKING:
    from simdtex.checkpoint import Checkpoint


class Task(NamedTuple):
    """What a command does once its input is read and checked.

    ``make`` is a public function with its own arguments, which returns what it made and a `simdtex.run.Output`.
    ``summary(made)`` says what was made of what, and ``names`` are the files that are written, in words. ``outputs``
    are functions ``write(made, output)``, each of one file or folder; if one fails, the others are written all the
    same. ``limits`` are black and white in the pictures of stages, and ``more(statistics)`` prints further lines after
    the summary.
    """

    make: Callable[..., Any]
    summary: Callable[[Any], str]
    names: str
    outputs: Sequence[Callable[[Any, Any], object]]
    limits: tuple[float, float] = (0.0, 1.0)
    more: Callable[[dict[str, Any]], None] | None = None


def job(
    *examples: tuple[str, str], stages: str = "", profile: bool = False
) -> Callable[[Callable[..., Task | None]], click.Command]:
    """Return a decorator that makes a command of a function that plans it: from the command's options to its `Task`.

    The command has the options of its methods, ``--seed``, ``--device``, ``--checkpoint`` and ``--quiet`` beside those
    of the function, and ``--stages`` and ``--profile`` if it is said what stages are, and that kernels are timed.
    """

    def decorate(plan: Callable[..., Task | None]) -> click.Command:
        @functools.wraps(plan)
        def planned(
            seed: int | None,
            device: str | None,
            checkpoint: Path | None,
            quiet: bool,
            stages: Path | None = None,
            profile: bool = False,
            **own: Any,
        ) -> None:
            task = plan(**own)
            if task is None:
                return
            began = time.perf_counter()
            kept = _checkpoint(checkpoint)
            with watching(quiet, stages, task.limits, kept) as callback:
                given = {"rng": seed, "device": _device(device, profile), "callback": callback, "checkpoint": kept}
                made, output = task.make(full_output=True, **given)
            for write in task.outputs:
                with afterwards():
                    write(made, output)
            settle()
            if kept:
                kept.remove()
            statistics = output.statistics
            if not quiet:
                seconds = f"in {time.perf_counter() - began:.1f} s on {statistics['device']}, seed {statistics['seed']}"
                click.echo(f"{task.names}: {task.summary(made)} {seconds}")
                if task.more:
                    task.more(statistics)
            if profile:
                from simdtex.report.terminal import print_profile

                print_profile(statistics)

        own = planned.__dict__.pop("__click_params__", [])
        shared: list[Callable[..., Any]] = [SEED, DEVICE, job_options(plan.__name__), CHECKPOINT, QUIET]
        shared += [stages_option(stages)] * bool(stages) + [PROFILE] * profile
        function: Any = planned
        for add in reversed(shared):
            function = add(function)
        function.__click_params__ += own
        return command(*examples)(function)

    return decorate


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
    options, arguments = given_words(context)
    line = {"name": context.command.name, "options": options, "arguments": arguments, "folder": os.getcwd()}
    context.meta[RESUME] = path
    kept = Checkpoint(path, command=line, note=note)
    context.obj = kept
    return kept


def command_line() -> str:
    """Return the command line of the running command, so that a reader can give it again."""
    context = click.get_current_context()
    options, arguments = given_words(context)
    words = shlex.join(["simdtex", str(context.command.name), *arguments, *options])
    return os.fsencode(words).decode(errors="backslashreplace")  # the name of a file may be no text


def given_words(context: click.Context) -> tuple[list[str], list[str]]:
    """Return the options that were given to a command, but ``--checkpoint``, with their values, and the arguments."""
    options: list[str] = []
    arguments: list[str] = []
    for parameter in context.command.params:
        name = parameter.name or ""
        if context.get_parameter_source(name) is not ParameterSource.COMMANDLINE or name == "checkpoint":
            continue
        given = context.params[name]
        for value in given if isinstance(given, tuple) else [given]:
            if not isinstance(parameter, click.Option):
                arguments.append(str(value))
            elif parameter.is_flag:
                options.append((parameter.opts if value else parameter.secondary_opts)[-1])
            else:
                options += [parameter.opts[-1], str(value)]
    return options, arguments


@contextmanager
def progress_bar(quiet: bool) -> Iterator[Callable[..., None]]:
    """Show a progress bar on a terminal; elsewhere print a line whenever another job begins.

    Yields ``show(fraction, doing, job="")``: the share of the whole that is done, what is being done, and the job that
    this is part of if there are several.
    """
    if quiet or not sys.stderr.isatty():
        last = ""

        def tell(fraction: float, doing: str, job: str = "") -> None:
            nonlocal last
            if job != last and not quiet:
                click.echo(job, err=True)
            last = job

        yield tell
        return
    from rich.console import Console  # only where a bar is drawn: it takes long to load
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting", total=1.0)

        def show(fraction: float, doing: str, job: str = "") -> None:
            bar.update(task, completed=fraction, description=", ".join(part for part in (job, doing) if part))

        yield show


@contextmanager
def watching(
    quiet: bool, stages: Path | None, limits: tuple[float, float], checkpoint: Checkpoint | None
) -> Iterator[Callable[[Any], None]]:
    """Yield a callback that moves a progress bar and writes the stages into a folder, if there is one for them."""
    writer = None
    if stages:
        from simdtex.report.stages import StageWriter

        writer = StageWriter(stages, limits=limits, resumed=lambda: bool(checkpoint and checkpoint.resumed))
    with progress_bar(quiet) as show:

        def callback(progress: Any) -> None:
            nonlocal writer
            show(progress.fraction, progress.doing)
            if writer:
                working, writer = writer, None
                with afterwards():  # the picture does not wait for its stages
                    working(progress)
                    writer = working

        yield callback
