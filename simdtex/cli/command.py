# SPDX-License-Identifier: BSD-3-Clause
"""What all commands share: their help, with options in groups by purpose, their files, and how they end.

An error is one sentence and exit code 2, a signal one sentence and 128 plus its number. Every option or argument that
is a path says by its type what is done there, and `check_places` runs before a command does anything: no command
overwrites what it reads, and a new option needs nothing but its type.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
import warnings
from _thread import interrupt_main
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from traceback import walk_tb
from types import FrameType
from typing import Any, NamedTuple, NoReturn

import click

Examples = Sequence[tuple[str, str]]
"""Words after ``simdtex``, and what they do."""

JOB, DATA, OUTPUTS = FIRST = ("Job", "Data and guides", "Further outputs")
RUNS, DEVICE_GROUP = LAST = ("Large outputs and interrupted runs", "Device and messages")
"""The groups of options before and after those of the methods."""

FEW = 14
"""Options that are listed without groups, at most."""

OPTION_WORDS = {
    "--size": ("--scale", "--width", "--height", "--resolution", "--shape", "--out-size"),
    "--seed": ("--rng", "--random-seed", "--random-state", "--variations", "--variation"),
    "--number": ("--count", "--n", "--realisations", "--realizations", "--variations"),
    "--order": ("--patch-size", "--window", "--radius", "--neighbourhood", "--neighborhood", "--kernel"),
    "--device": ("--gpu", "--cpu", "--platform", "--cuda", "--opencl"),
    "--output": ("--out", "--output-file", "--outfile", "--dest"),
    "--mask": ("--hole", "--inpaint"),
    "--boundary": ("--tile", "--tileable", "--wrap"),
    "simdtex tile": ("--seamless", "--tile", "--tileable", "--tiling", "--wrap"),
    "simdtex fill": ("--inpaint", "--hole"),
}
"""Words of other programs for options, by our option or command."""


class Command(click.Command):
    """Command with ``examples``, and the names of its ``usual`` options, which ``--help`` lists; others, --help-all."""

    def __init__(self, *args: Any, examples: Examples = (), usual: str = "", **keywords: Any) -> None:
        super().__init__(*args, **keywords)
        self.examples, self.usual = examples, usual.split()
        if usual:
            flags = {"is_flag": True, "is_eager": True, "expose_value": False}
            self.params.append(click.Option(["--help-all"], callback=_help_all, help="Show all options.", **flags))

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse and keep the words of a command line; an option of another program names ours."""
        ctx.meta[WORDS] = list(args)
        try:
            return super().parse_args(ctx, args)
        except ValueError as error:
            settle(error)
            raise
        except click.NoSuchOption as error:
            flags = {flag for param in self.params for flag in param.opts}
            ours = [ours for ours, theirs in OPTION_WORDS.items() if error.option_name in theirs]
            if options := [option for option in ours if option in flags or not option.startswith("-")]:
                ctx.fail(f"No such option '{error.option_name}': use {' or '.join(options)}.")
            raise

    def format_help_text(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write what the command does, and the examples."""
        super().format_help_text(ctx, formatter)
        write_examples(self.examples, formatter)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the usual options, or all in groups if there are many."""
        entries = {_name(param): entries_of(param, ctx) for param in self.get_params(ctx)}
        if self.usual and not ctx.meta.get(ALL):
            records = [entries[name][0][1] for name in (*self.usual, "help")]
            with formatter.section("Usual options"):
                formatter.write_dl(records)
            formatter.write_paragraph()
            others = sum(map(bool, entries.values())) - len(records) - 1  # --help-all itself
            formatter.write_text(f"`{ctx.command_path} --help-all` lists the other {others} options too.")
            return
        groups: dict[str, list[tuple[str, str]]] = {title: [] for title in FIRST}
        for title, record in (entry for pairs in entries.values() for entry in pairs):
            groups.setdefault(title, []).append(record)
        groups = {title: groups[title] for title in sorted(groups, key=_rank)}
        if sum(map(len, groups.values())) <= FEW:
            groups = {"Options": [record for group in groups.values() for record in group]}
        for title, records in groups.items():
            if records:
                with formatter.section(title):
                    formatter.write_dl(records)


def _rank(title: str) -> tuple[int, str]:
    """Return the key by which titles are sorted: those of methods come after others, and `LAST` at the end."""
    return LAST.index(title) + 1 if title in LAST else 0, title.partition(":")[0] if title[:7] == "Method " else ""


ALL, WORDS = f"{__name__}.all", f"{__name__}.words"
"""Keys of a context's `meta`: whether all options are listed, and the words after the name of the command."""


def _help_all(ctx: click.Context, _: click.Parameter, wanted: bool) -> None:
    if wanted and not ctx.resilient_parsing:
        ctx.meta[ALL] = True
        click.echo(ctx.get_help())
        ctx.exit()


def _name(param: click.Parameter) -> str:
    return "help" if "--help" in param.opts else str(param.name)


def entries_of(param: click.Parameter, ctx: click.Context) -> list[tuple[str, tuple[str, str]]]:
    """Return the group, the names and the help of an option: one entry for each method that reads it differently."""
    record = param.get_help_record(ctx)
    if record is None or not isinstance(param, click.Option):
        return []
    methods: dict[str, str] = getattr(param, "methods", {})
    group = getattr(param, "group", DEVICE_GROUP if _name(param).startswith("help") else JOB)
    if methods and any(param.name == "method" for param in ctx.command.params):
        return [(f"Method {method}: {group.lower()}", (record[0], text)) for method, text in methods.items()]
    return [(group, record)]


def write_examples(examples: Examples, formatter: click.HelpFormatter) -> None:
    """Write examples, each with what it does above it."""
    for index, (words, what) in enumerate(examples):
        if not index:
            formatter.write_paragraph()
        formatter.indent()
        formatter.write_text(f"# {what}")
        formatter.write(f"{'':{formatter.current_indent}}simdtex {words}\n")  # one line, to be copied
        formatter.dedent()


def command(*examples: tuple[str, str], usual: str = "") -> Callable[[Callable[..., None]], click.Command]:
    """Return a decorator that makes a command of a function, whose errors are reported in one sentence."""

    def decorate(function: Callable[..., None]) -> click.Command:
        return click.command(cls=Command, examples=examples, usual=usual)(reporting()(function))

    return decorate


# How a command ends

UNINTERRUPTED = ("simdtex.machine.devices", "weakref", "_weakrefset", "h5netcdf.", "h5py.")
"""Beginnings of modules in which an exception does harm: see `postponed`."""

REPORTS = ("jinja2", "matplotlib")
"""The libraries of the extra ``reports``."""

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
    except ModuleNotFoundError as error:
        library = str(error.name).partition(".")[0]
        if library not in REPORTS:
            raise
        settle(ValueError(f"{library} is not installed; pip install 'simdtex[reports]'"))
    except MemoryError:
        note("there is not enough memory; give a smaller size")
        sys.exit(2)
    except KeyboardInterrupt as signalled:
        give_up(context, signalled.args[0] if signalled.args else signal.SIGINT, before)
    settle()


def give_up(context: click.Context, signum: int, before: dict[Path, Any]) -> NoReturn:
    """Say that the command was stopped, and how to go on or what was written, and exit with the code of a signal."""
    path: Path | None = context.meta.get(RESUME)
    written = ", ".join(str(path) for path, state in outputs(context).items() if before.get(path) != state)
    how = f"written so far: {written}" if written else "nothing was written"
    how = f"continue with: simdtex resume {path}" if path and path.exists() else how
    warnings.filterwarnings("ignore", "coroutine .* was never awaited")  # which Zarr had begun
    note(f"stopped; {how}")
    sys.exit(128 + signum)


@contextmanager
def catch_signals(context: click.Context) -> Iterator[None]:
    """Let a signal stop a run after its step if the context's `obj` is its checkpoint; else, twice, raise `Ended`."""
    caught: list[int] = []
    raised = 0.0

    def handle(signum: int, frame: FrameType | None) -> None:
        nonlocal raised
        if context.obj and context.obj.running and not caught:
            caught.append(signum)
            context.obj.stop()
            os.write(2, b"\nsimdtex: stopping after the current step; a second signal stops at once\n")
            return
        if postponed(frame, signum):
            return
        last, raised = raised, time.monotonic()
        if signum == signal.SIGINT or raised - last > 1:  # some programs send SIGTERM twice at once
            raise Ended(signum)

    before: dict[int, Any] = {}
    if threading.current_thread() is threading.main_thread():
        for name in ("SIGINT", "SIGTERM", "SIGHUP"):
            signum: int | None = getattr(signal, name, None)
            if signum is not None and signal.getsignal(signum) not in (signal.SIG_IGN, None):
                before[signum] = signal.signal(signum, handle)
    try:
        yield
    except KeyboardInterrupt as signalled:
        raise (signalled if signalled.args or not caught else Ended(caught[0])) from None
    finally:
        for signum, handler in before.items():
            signal.signal(signum, handler)


def postponed(frame: FrameType | None, signum: int = signal.SIGINT) -> bool:
    """Return whether an exception would do harm in a frame, and if so have the signal come again a little later."""
    # An import may swallow it, print its traceback or, in C++, abort; in a callback of a collected object it is ignored
    # but printed; the search for runtimes would leave its temporary folder; and an HDF5 file that is half open prints a
    # traceback when it is collected.
    while frame:
        name, path = str(frame.f_globals.get("__name__")), frame.f_code.co_filename
        if name.startswith(UNINTERRUPTED) or path.startswith("<frozen importlib") or frame.f_code.co_name == "__del__":
            again = threading.Timer(0.02, interrupt_main, (signum,))
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


# The files of a command


class PathType(click.Path):
    """A path with its role: a file to ``"read"`` or ``"write"``, a ``"folder"``, ``"either"``, or to ``"enter"``."""

    def __init__(self, role: str) -> None:
        super().__init__(path_type=Path)
        self.role = role

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path; fail if it is empty."""
        if not os.fspath(value):
            self.fail("the path is empty; give one, or leave the option out", param, ctx)
        return super().convert(value, param, ctx)


class Pair(click.types.StringParamType):
    """A text ``A=B`` or ``A0,A1=B``: a list of files that are read, and a path to ``"read"`` or to ``"write"``.

    Or, with ``named``, ``NAME=B`` or ``NAME=B0,B1``: a name, and a list of files that are read.
    """

    def __init__(self, role: str, named: bool = False) -> None:
        self.role, self.named = role, named

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return both sides; raise ValueError if one is missing, or if it is not clear where the left one ends."""
        if not isinstance(value, str) or not isinstance(param, click.Option):
            return value
        cuts = [(value[:at], value[at + 1 :]) for at, letter in enumerate(value) if letter == "="] or [(value, "")]
        fitting = [] if self.named else [cut for cut in cuts if all(map(os.path.exists, files(cut[0])))]
        if len(fitting) > 1:
            two = f"{fitting[0][0]} and {fitting[1][0]}"
            raise ValueError(f"{param.opts[-1]} {value} has two meanings, since {two} exist: rename one of them")
        left, right = (fitting or cuts)[0]
        if not (left and right):
            raise ValueError(f"{param.opts[-1]} {value!r} must be {param.metavar}")
        return (left, files(right)) if self.named else (files(left), Path(right))


def files(text: str) -> list[Path]:
    """Return the files that a text names: one, or several that are separated by commas."""
    return [Path(text)] if os.path.exists(text) else [Path(part.strip()) for part in text.split(",")]


READ, ENTER, WRITE, FOLDER, EITHER = (PathType(role) for role in ("read", "enter", "write", "folder", "either"))
READING = ("read", "enter")
READ_PAIR, WRITE_PAIR, READ_NAMED = Pair("read"), Pair("write"), Pair("read", named=True)


class Named(NamedTuple):
    """A path as it was given, and its role."""

    path: Path
    role: str


def check_places(context: click.Context) -> None:
    """Raise if a command would overwrite what it reads, or one of its outputs another."""
    named = list(_named(context))
    reads = [place for place in named if place.role in READING]
    writes = [place for place in named if place.role not in READING]
    for index, out in enumerate(writes):
        for read in reads:
            check_input(out, read)
        for other in writes[:index]:
            if _same(out.path, other.path):
                raise ValueError(f"{out.path} would be written twice; give each output a file of its own")
            for inner, outer in ((out, other), (other, out)):
                array = context.params.get("tiles") and inner.role == "write" and inner.path.parent == outer.path
                if outer.role != "write" and _within(inner.path, outer.path) and not array:
                    raise ValueError(
                        f"{inner.path} would be written into {outer.path}, the folder of another output; "
                        "give it another folder"
                    )


def outputs(context: click.Context) -> dict[Path, tuple[int, int]]:
    """Return the outputs of a command that exist, each with its inode and the time of its last change."""
    there = [place.path for place in _named(context) if place.role not in READING and os.path.exists(place.path)]
    return {path: (path.stat().st_ino, path.stat().st_mtime_ns) for path in there}


def check_input(out: Named, read: Named) -> None:
    """Raise if an output would overwrite or remove an input, or change a folder that is one."""
    if _same(out.path, read.path):
        raise ValueError(f"{out.path} is an input and would be overwritten; give the output another name")
    folder = out.role == "folder" or (out.role == "either" and out.path.is_dir())
    link = _real(read.path.parent) / read.path.name  # a link in the folder would be removed
    if folder and (_within(read.path, out.path) or link.is_relative_to(_real(out.path))):
        raise ValueError(f"{read.path} is an input and is in {out.path}, which would be replaced; give another folder")
    if read.role == "enter" and _within(out.path, read.path):
        raise ValueError(f"{out.path} would be written into {read.path}, which is an input; give another folder")


def _named(context: click.Context) -> Iterator[Named]:
    """Yield every path that a command was given, or has by default."""
    for parameter in context.command.params:
        kind, value = parameter.type, context.params.get(parameter.name or "")
        if parameter.name == "preview" and value:
            yield Named(preview_of(context.params["output"]), "write")
        several = parameter.multiple or parameter.nargs < 0
        for item in (value or ()) if several else [value]:
            if item is None:
                continue
            if isinstance(kind, PathType):
                yield Named(Path(item), kind.role)
            elif isinstance(kind, Pair):
                left, right = item
                yield from (Named(path, "read") for path in (right if kind.named else left))
                if not kind.named:
                    yield Named(right, kind.role)


def preview_of(output: Path) -> Path:
    """Return the file of ``--preview``, beside an output."""
    return output.with_name(f"{output.stem}-3x3.png")


def _real(path: Path) -> Path:
    """Return where a path leads by links; of links in a circle, the path itself, which its reader or writer refuses."""
    return Path(os.path.realpath(path))


def _same(a: Path, b: Path) -> bool:
    """Return whether two paths are one file, by name or as links."""
    return _real(a) == _real(b) or (a.exists() and b.exists() and a.samefile(b))


def _within(path: Path, folder: Path) -> bool:
    """Return whether a path is somewhere inside a folder."""
    return _real(path) != _real(folder) and _real(path).is_relative_to(_real(folder))
