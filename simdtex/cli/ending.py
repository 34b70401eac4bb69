# SPDX-License-Identifier: BSD-3-Clause
"""How a command ends: an error is one sentence and exit code 2, a signal one sentence and 128 plus its number."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
import warnings
from _thread import interrupt_main
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from traceback import walk_tb
from types import FrameType
from typing import Any, NoReturn

import click

from simdtex.cli.places import check_places, outputs

UNINTERRUPTED = ("simdtex.machine.devices", "weakref", "_weakrefset", "h5netcdf.", "h5py.")
"""Beginnings of modules in which an exception does harm: see `postponed`."""

RESUME, FAILURES = f"{__name__}.resume", f"{__name__}.failures"
"""Keys of a context's `meta`: the path that ``simdtex resume`` takes, and errors that wait for the end."""


class Ended(KeyboardInterrupt):
    """The process was asked to end, by the signal of this number."""


@contextmanager
def reporting() -> Iterator[None]:
    """Check the paths of the running command, and report errors and signals in one sentence."""
    context = click.get_current_context()
    before = outputs(context)
    try:
        with catch_signals(context), noting():
            check_places(context)
            yield
    except (ValueError, TypeError, OSError) as error:
        if isinstance(error, BrokenPipeError) and _printing(error):
            raise  # the reader has read enough; click ends the process without a word
        settle(error)
    except MemoryError:
        note("there is not enough memory; give a smaller size")
        sys.exit(2)
    except KeyboardInterrupt as signalled:
        give_up(context, signalled.args[0] if signalled.args else signal.SIGINT, before)
    settle()


def give_up(context: click.Context, number: int, before: dict[Path, Any]) -> NoReturn:
    """Say that the command was stopped, and how to go on or what was written, and exit with the code of a signal."""
    path: Path | None = context.meta.get(RESUME)
    written = ", ".join(str(one) for one, state in outputs(context).items() if before.get(one) != state)
    how = f"written so far: {written}" if written else "nothing was written"
    how = f"continue with: simdtex resume {path}" if path and path.exists() else how
    warnings.filterwarnings("ignore", "coroutine .* was never awaited")  # which Zarr had begun
    note(f"stopped; {how}")
    sys.exit(128 + number)


@contextmanager
def catch_signals(context: click.Context) -> Iterator[None]:
    """Let SIGINT, SIGTERM and SIGHUP stop a run after its present step if it has a checkpoint, else raise `Ended`.

    A second signal stops it at once. The checkpoint is the context's `obj`.
    """
    caught: list[int] = []
    raised = 0.0

    def handle(number: int, frame: FrameType | None) -> None:
        nonlocal raised
        if context.obj and context.obj.running and not caught:
            caught.append(number)
            context.obj.stop()
            os.write(2, b"\nsimdtex: stopping after the current step; a second signal stops at once\n")
            return
        if number == signal.SIGINT and postponed(frame):
            return
        last, raised = raised, time.monotonic()
        if number == signal.SIGINT or raised - last > 1:  # some programs send SIGTERM twice at once
            raise Ended(number)

    before: dict[int, Any] = {}
    if threading.current_thread() is threading.main_thread():
        for name in ("SIGINT", "SIGTERM", "SIGHUP"):
            number: int | None = getattr(signal, name, None)
            if number is not None and signal.getsignal(number) not in (signal.SIG_IGN, None):
                before[number] = signal.signal(number, handle)
    try:
        yield
    except KeyboardInterrupt as signalled:
        raise (signalled if signalled.args or not caught else Ended(caught[0])) from None
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def postponed(frame: FrameType | None) -> bool:
    """Return whether an exception would do harm in a frame, and if so have SIGINT come again a little later.

    An import may swallow it, print its traceback or, in C++, abort; in a callback of a collected object it is ignored
    but printed; the search for runtimes would leave its temporary folder; and an HDF5 file that is half open prints a
    traceback when it is collected.
    """
    while frame:
        name, path = str(frame.f_globals.get("__name__")), frame.f_code.co_filename
        if name.startswith(UNINTERRUPTED) or path.startswith("<frozen importlib"):
            again = threading.Timer(0.02, interrupt_main)
            again.daemon = True
            again.start()
            return True
        frame = frame.f_back
    return False


@contextmanager
def afterwards() -> Iterator[None]:
    """Keep an error until the end of the command, so that its other outputs are written; see `settle`."""
    try:
        yield
    except (ValueError, OSError) as error:
        click.get_current_context().meta.setdefault(FAILURES, []).append(error)


def note(sentence: str) -> None:
    """Print a sentence on standard error."""
    click.echo(f"simdtex: {sentence}", err=True)


@contextmanager
def noting() -> Iterator[None]:
    """Print warnings as notes, those about the data each time."""
    from simdtex.options import DataWarning  # which loads NumPy

    with warnings.catch_warnings():
        warnings.simplefilter("always", DataWarning)
        warnings.showwarning = lambda message, *_, **__: note(str(message))
        yield


def settle(*errors: Exception) -> None:
    """Exit with code 2 and one sentence if there are errors, or `afterwards` has kept some."""
    context = click.get_current_context(silent=True)
    failures = [*errors, *(context.meta.pop(FAILURES, []) if context else [])]
    if failures:
        note("; ".join(_sentence(error) for error in failures))
        sys.exit(2)


def _printing(error: BaseException) -> bool:
    """Return whether an error was raised by a library that prints."""
    frames = (frame for frame, _ in walk_tb(error.__traceback__))
    return any(frame.f_globals.get("__name__") in ("click.utils", "rich.console") for frame in frames)


def _sentence(error: Exception) -> str:
    if not (isinstance(error, OSError) and error.strerror):
        return str(error)
    if error.filename:  # without the number of the error
        return f"{error.filename}: {error.strerror}"
    if _printing(error):
        return f"standard output could not be written ({error.strerror}): redirect it"
    try:
        os.getcwd()
    except OSError:
        return "the current folder no longer exists: change to another one"
    return error.strerror
