# SPDX-License-Identifier: BSD-3-Clause
"""What the commands share: numbers, checks, progress, and errors in one sentence."""

from __future__ import annotations

import functools
import shlex
import signal
import sys
import threading
import time
import warnings
from _thread import interrupt_main
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn

import click
from click.core import ParameterSource

from simdtex.cli.places import check_places

HARMED = ("simdtex.machine.runtimes", "weakref", "_weakrefset")
"""Modules, the search for runtimes and callbacks of what is collected, in which an exception does harm."""


class Ended(BaseException):
    """The process is asked to end, by the signal of this number."""


def plainly(command: Callable[..., None]) -> Callable[..., None]:
    """Check a command's files; turn bad input into one sentence and exit code 2, and signals into 128 and their number.

    What `afterwards` has kept is said at the end, with exit code 2 as well.
    """

    @functools.wraps(command)
    def wrapped(*args: Any, **kwargs: Any) -> None:
        try:
            with _interruptible(), _ending():
                check_places(click.get_current_context())
                command(*args, **kwargs)
        except (ValueError, TypeError, OSError) as error:
            settle(error)
        except MemoryError:
            click.echo("simdtex: the memory does not suffice for this; give a smaller size", err=True)
            sys.exit(2)
        except (KeyboardInterrupt, Ended) as signalled:
            give_up("stopped; nothing but stages may have been written", number_of(signalled))
        settle()

    return wrapped


def number_of(signalled: BaseException) -> int:
    """The number of the signal that raised this."""
    return int(signalled.args[0]) if isinstance(signalled, Ended) else signal.SIGINT


def give_up(sentence: str, number: int) -> NoReturn:
    """End because of the signal of this number, with a sentence that is the last one said, and with its exit code."""
    warnings.filterwarnings("ignore", "coroutine .* was never awaited")  # which Zarr had begun
    click.echo(f"simdtex: {sentence}", err=True)
    sys.exit(128 + number)


@contextmanager
def _interruptible() -> Iterator[None]:
    """Let Ctrl-C raise KeyboardInterrupt, since there is work that wants to be put in order, where that can be."""

    def stop(_: int, frame: FrameType | None) -> None:
        if not postponed(frame):
            raise KeyboardInterrupt

    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):  # others' concern, or ignored
        yield
        return
    signal.signal(signal.SIGINT, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def postponed(frame: FrameType | None) -> bool:
    """Have a Ctrl-C come again a little later, where an exception would do harm now.

    What is being imported may swallow it, tell its traceback or, as C++ does, abort. Where something is collected, it
    is ignored, and told all the same. The search for runtimes is over soon, and would leave its temporary folder.
    """
    while frame:
        name, path = frame.f_globals.get("__name__"), frame.f_code.co_filename
        if name in HARMED or path.startswith("<frozen importlib"):
            again = threading.Timer(0.02, interrupt_main)
            again.daemon = True
            again.start()
            return True
        frame = frame.f_back
    return False


def _sentence(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror:  # without its number
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    return str(error)


@contextmanager
def _ending() -> Iterator[None]:
    """Where the process is asked to end it cleans up, and does not leave half a file behind."""
    before: dict[int, Any] = {}
    since = 0.0

    def end(number: int, _: Any) -> None:
        nonlocal since
        earlier, since = since, time.monotonic()
        if since - earlier > 1:  # some programs ask twice at once
            raise Ended(number)

    if threading.current_thread() is threading.main_thread():
        for number in (getattr(signal, name, None) for name in ("SIGTERM", "SIGHUP")):
            if number is not None and signal.getsignal(number) == signal.SIG_DFL:
                before[number] = signal.signal(number, end)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def afterwards() -> Iterator[None]:
    """Keep what cannot be written until the end, so that the rest is written all the same; see `settle`."""
    try:
        yield
    except (ValueError, OSError) as error:
        context = click.get_current_context(silent=True)
        if context is None:
            raise
        context.meta.setdefault(__name__, []).append(error)


def settle(*errors: Exception) -> None:
    """Say in one sentence what went wrong and what `afterwards` has kept, if anything, and end with exit code 2."""
    context = click.get_current_context(silent=True)
    failures = [*errors, *(context.meta.pop(__name__, []) if context else [])]
    if failures:
        click.echo(f"simdtex: {'; '.join(_sentence(error) for error in failures)}", err=True)
        sys.exit(2)


def opened(device: str | None, profile: bool) -> Any:
    """What to hand on as the device: a machine that measures its kernels, where a profile is wanted."""
    if not profile:
        return device
    from simdtex.machine import open_machine

    machine = open_machine(device, profile=True)
    if machine.seconds is None:
        raise ValueError("--profile times the kernels of an OpenCL device and the reference has none; leave it out")
    return machine


def candidates_per_level(levels: list[dict[str, Any]]) -> str:
    """The mean candidates of each level that was sampled, the coarsest first."""
    return " ".join(f"{level['candidates']:.3g}" for level in levels[1:])


def last_iteration(statistics: dict[str, Any]) -> str:
    """Levels, iterations, and how far the last iteration had to move the subbands on average."""
    reports = statistics["iterations"]
    text = f"levels {statistics['options']['levels']}, iterations {len(reports)}"
    moved = [by for name, by in reports[-1]["distances"].items() if name != "pixels"] if reports else []
    if not moved:  # no iteration, or a constant sample
        return text
    return f"{text}, mean distance of the subbands in the last: {sum(moved) / len(moved):.3f} standard deviations"


def command_line(context: click.Context) -> str:
    """What was given to a command, so that a reader can give it again."""
    options, arguments = given_words(context, without=("checkpoint",))
    return shlex.join(["simdtex", str(context.command.name), *arguments, *options])


def given_words(context: click.Context, without: tuple[str, ...] = ()) -> tuple[list[str], list[str]]:
    """The options that were given to a command, with their values, and the arguments; some options left out."""
    options: list[str] = []
    arguments: list[str] = []
    for parameter in context.command.params:
        name = parameter.name or ""
        if context.get_parameter_source(name) is not ParameterSource.COMMANDLINE or name in without:
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


def output_shape(size: str | None, pixels: Any, *like: Any) -> tuple[int, int]:
    """Rows and columns of ``--size``, or by default those of the first picture of `like`, or twice the sample's."""
    from simdtex.io.image import parse_size

    if size is not None:
        return parse_size(size)
    for picture in like:
        if hasattr(picture, "shape"):  # a table has none
            return (picture.shape[0], picture.shape[1])
    return (2 * pixels.shape[0], 2 * pixels.shape[1])


@contextmanager
def progress_bar(quiet: bool) -> Iterator[Callable[[float, str, str], None]]:
    """A progress bar on a terminal; elsewhere a line whenever another job begins.

    Yields ``show(fraction, doing, job)``: the share of the whole that is done, what is being done now, and the job that
    this is part of, empty where there is only one.
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
    quiet: bool,
    stages: Path | None,
    limits: tuple[float, float],
) -> Iterator[Callable[[Any], None]]:
    """A callback that moves a progress bar and, where there is a folder for them, writes the stages.

    `limits` are black and white in their pictures.
    """
    writer = None
    if stages:
        from simdtex.report.stages import StageWriter

        context = click.get_current_context(silent=True)
        keeper = context.obj if context else None  # of the checkpoint, where there is one
        writer = StageWriter(stages, limits=limits, resumed=lambda: bool(keeper and keeper.resumed))
    try:
        with progress_bar(quiet) as show:

            def callback(progress: Any) -> None:
                nonlocal writer
                show(progress.fraction, progress.doing, "")
                if writer:
                    kept, writer = writer, None
                    with afterwards():  # the picture does not wait for its stages
                        kept(progress)
                        writer = kept

            yield callback
    finally:
        if writer:
            with afterwards():
                writer.finish()
