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

from simdtex.methods import mrf, multires, pyramid

Command = Callable[..., None]


def plainly(command: Callable[..., None]) -> Callable[..., None]:
    """Turn bad input into one sentence and exit code 2, and Ctrl-C into exit code 130."""

    @functools.wraps(command)
    def wrapped(*args: Any, **kwargs: Any) -> None:
        try:
            command(*args, **kwargs)
        except (ValueError, TypeError, OSError) as error:
            click.echo(f"simdtex: {error}", err=True)
            sys.exit(2)
        except MemoryError:
            click.echo("simdtex: the memory does not suffice for this; give a smaller size", err=True)
            sys.exit(2)
        except KeyboardInterrupt:
            click.echo("simdtex: stopped; nothing but stages may have been written", err=True)
            sys.exit(130)

    return wrapped


DEFAULTS, MULTIRES, PYRAMID = mrf.Options(), multires.Options(), pyramid.Options()

DEVICE = click.option(
    "--device",
    metavar="TEXT",
    help="Part of a device's name or platform, an index of `simdtex devices`, or `reference`. "
    "Default: SIMDTEX_DEVICE, else a GPU, else a CPU.",
)

SEED = click.option("--seed", type=int, help="Same seed, same picture on every device.  [a fresh one, printed]")
PROFILE = click.option("--profile", is_flag=True, help="Print what each kernel took, and what was left to the host.")
QUIET = click.option("-q", "--quiet", is_flag=True, help="No progress bar and no summary.")
LEVELS = click.option("--levels", type=int, help="Of the multigrid, or of the pyramid.  [as many as the sample feeds]")
BOUNDARY = click.option("--boundary", help=f"mrf, multires: torus (the result tiles) or open.  [{DEFAULTS.boundary}]")

_EDGES = {
    "mrf": f"auto, reflect or whole: candidates at the sample's edge.  [{DEFAULTS.edges}]",
    "pyramid": f"reflect or wrap: how the sample goes on beyond its edge.  [{PYRAMID.edges}]",
}
_ORIENTATIONS = {
    "multires": f"of edge and line filters.  [{MULTIRES.orientations}]",
    "pyramid": f"1, 2, 4 or 6, of the steerable pyramid.  [{PYRAMID.orientations}]",
}


def opened(device: str | None, profile: bool) -> Any:
    """What to hand on as the device: a machine that measures its kernels, where a profile is wanted."""
    if not profile:
        return device
    from simdtex.machine import open_machine

    machine = open_machine(device, profile=True)
    if machine.seconds is None:
        raise ValueError("--profile times the kernels of an OpenCL device and the reference has none; leave it out")
    return machine


def print_profile(statistics: dict[str, Any]) -> None:
    """Print the profile of a run, in lines of full length where no terminal breaks them."""
    from simdtex.report.profile import render

    render(statistics, Console(width=None if sys.stdout.isatty() else 200))


def stages_option(what: str) -> Callable[[Command], Command]:
    """``--stages``, which writes these pictures."""
    return click.option("--stages", type=click.Path(path_type=Path), metavar="DIR", help=f"Write {what} as pictures.")


def _shared(name: str, texts: dict[str, str], *methods: str, **kinds: Any) -> Callable[[Command], Command]:
    """An option that means something to each of these methods."""
    return click.option(name, help=" ".join(f"{method}: {texts[method]}" for method in methods), **kinds)


_MRF_OPTIONS = (
    click.option("--preset", help="mrf: default, or paper: the 1998 rules to the letter."),
    click.option(
        "--order", type=int, help=f"mrf: neighbours within sqrt(order): 8 has 24, 18 has 60.  [{DEFAULTS.order}]"
    ),
    click.option("--relaxation", help=f"mrf: icm (the mode) or gibbs (a draw).  [{DEFAULTS.relaxation}]"),
    click.option(
        "--bandwidth", type=float, help=f"mrf: of the Parzen kernel, in units of h_opt.  [{DEFAULTS.bandwidth}]"
    ),
    click.option(
        "--coherence", type=float, help="mrf: preference for continuing a neighbour's source.  [exact 1, coherent 0.2]"
    ),
    click.option("--xi", type=float, help=f"mrf: cooling, below 0; further down is faster.  [{DEFAULTS.xi}]"),
    click.option(
        "--free-sweeps",
        type=int,
        help=f"mrf: sweeps over all sites after a level's equilibrium.  [{DEFAULTS.free_sweeps}]",
    ),
    click.option("--pixel", help=f"mrf: source (pixels of the sample) or density (grey levels).  [{DEFAULTS.pixel}]"),
    click.option("--phases", help=f"mrf: decimated or all: candidates at coarse levels.  [{DEFAULTS.phases}]"),
    click.option("--coarsest", help=f"mrf: gibbs or same: how the coarsest level relaxes.  [{DEFAULTS.coarsest}]"),
    click.option(
        "--search", help=f"mrf: exact (all candidates), coherent (a few, much faster) or auto.  [{DEFAULTS.search}]"
    ),
    click.option(
        "--suggesting", type=int, help=f"mrf, coherent: nearest neighbours that suggest one.  [{DEFAULTS.suggesting}]"
    ),
    click.option("--similar", type=int, help=f"mrf, coherent: candidates like each of these.  [{DEFAULTS.similar}]"),
    click.option("--chance", type=int, help=f"mrf, coherent: candidates at random.  [{DEFAULTS.chance}]"),
    click.option(
        "--exhaustive", type=int, help=f"mrf, coherent: levels of so few candidates weigh all.  [{DEFAULTS.exhaustive}]"
    ),
)

_MULTIRES_OPTIONS = (
    click.option("--sigma", type=float, help=f"multires: of the filters, in pixels.  [{MULTIRES.sigma}]"),
    click.option("--filter-size", type=int, help=f"multires: rows of a filter, odd.  [{MULTIRES.filter_size}]"),
    click.option("--features", help=f"multires: of the luminance or of all channels.  [{MULTIRES.features}]"),
    click.option("--phase", help=f"multires: match or free: candidates among siblings.  [{MULTIRES.phase}]"),
)


_THRESHOLD_OPTIONS = (
    click.option(
        "--alpha", metavar="FLOAT|auto", help=f"multires: threshold; more is freer, auto finds one.  [{MULTIRES.alpha}]"
    ),
    click.option(
        "--beta", type=float, help=f"multires: stricter at high frequencies, alpha / k^beta.  [{MULTIRES.beta:g}]"
    ),
    click.option("--target", type=float, help=f"multires: mean candidates for --alpha auto.  [{MULTIRES.target}]"),
    click.option(
        "--thresholds",
        type=click.Path(path_type=Path),
        metavar="FILE",
        help="multires: a table of thresholds, a line of numbers for each level.",
    ),
)


def _pyramid_options(start: str, prefix: str = "") -> list[Callable[[Command], Command]]:
    """Those of ``pyramid`` that no other method has; `start` is ``"METAVAR: What to begin with"``."""
    metavar, begin = start.split(": ")

    def option(name: str, text: str, **kinds: Any) -> Callable[[Command], Command]:
        return click.option(name, help=prefix + text[0].lower() + text[1:] if prefix else text, **kinds)

    return [
        option("--pyramid", f"steerable or laplacian: whose histograms are matched.  [{PYRAMID.pyramid}]"),
        option("--iterations", f"Times that all are matched, 0 or more.  [{PYRAMID.iterations}]", type=int),
        option("--match", f"rank (exact) or lookup (the paper's tables).  [{PYRAMID.match}]"),
        option("--bins", f"Of these tables, 2 to 4096.  [{PYRAMID.bins}]", type=int),
        option("--color", f"decorrelate or channels: the colours that are matched.  [{PYRAMID.color}]"),
        option("--start", f"{begin} to begin with.  [noise]", type=click.Path(path_type=Path), metavar=metavar),
    ]


def _with(*options: Callable[[Command], Command]) -> Callable[[Command], Command]:
    def decorate(command: Command) -> Command:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


mrf_options = _with(*_MRF_OPTIONS, _shared("--edges", _EDGES, "mrf"), LEVELS, BOUNDARY)
"""The options of the method ``mrf`` that any command takes which runs it."""

multires_options = _with(
    _shared("--orientations", _ORIENTATIONS, "multires", type=int), *_MULTIRES_OPTIONS, LEVELS, BOUNDARY
)
"""Those of ``multires``, but for its thresholds."""

method_options = _with(
    LEVELS,
    BOUNDARY,
    _shared("--edges", _EDGES, "mrf", "pyramid"),
    _shared("--orientations", _ORIENTATIONS, "multires", "pyramid", type=int),
    *_MRF_OPTIONS,
    *_THRESHOLD_OPTIONS,
    *_MULTIRES_OPTIONS,
    *_pyramid_options("IMAGE: A picture", "pyramid: "),
)
"""Those of every method."""


def pyramid_options(start: str) -> Callable[[Command], Command]:
    """Those of a command that runs nothing but ``pyramid``; `start` is ``"METAVAR: What to begin with"``."""
    return _with(
        *_pyramid_options(start),
        click.option("--levels", type=int, help="Of the pyramids.  [as many as leave 8 pixels a side]"),
        click.option("--orientations", type=int, help=_ORIENTATIONS["pyramid"]),
        click.option("--edges", help=_EDGES["pyramid"]),
    )


def given(options: dict[str, Any]) -> dict[str, Any]:
    """The options that were given, alpha and a table of thresholds as numbers."""
    chosen = {name: value for name, value in options.items() if value is not None}
    if chosen.get("alpha", "auto") != "auto":
        try:
            chosen["alpha"] = float(chosen["alpha"])
        except ValueError:
            raise ValueError(f"--alpha {chosen['alpha']} is not a number; give one of at least 0, or auto") from None
    if "thresholds" in chosen:
        chosen["thresholds"] = _table(chosen["thresholds"])
    return chosen


def numbers(name: str, text: str) -> list[float]:
    """Numbers parted by commas. ``a,b,...,z`` goes on from b by the same steps, ``a,...,z`` by steps of a."""
    words = [word.strip() for word in text.split(",")]
    try:
        if "..." not in words:
            return [float(word) for word in words]
        gap = words.index("...")
        begin, (last,) = [float(word) for word in words[:gap]], [float(word) for word in words[gap + 1 :]]
        step = begin[-1] - begin[-2] if len(begin) > 1 else begin[0]
        if not step > 0 or not 0 <= (last - begin[-1]) / step <= 1000:
            raise ValueError
    except (ValueError, IndexError):
        raise ValueError(f"{name} {text} must be numbers parted by commas, as 0.1,0.2 or 0.05,0.10,...,0.30") from None
    steps = int((last - begin[-1]) / step + 1e-9)
    return [*begin, *(round(begin[-1] + i * step, 9) for i in range(1, steps + 1))]


def _table(path: Path) -> list[list[float]]:
    """Numbers parted by commas or blanks, a line for each level."""
    try:
        lines = path.read_text(encoding="utf-8").replace(",", " ").splitlines()
        return [[float(word) for word in line.split()] for line in lines if line.strip()]
    except (UnicodeDecodeError, ValueError):
        raise ValueError(f"{path} is not a table of numbers; give a line of them for each level") from None


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


def output_shape(size: str | None, pixels: Any, start: Any = None) -> tuple[int, int]:
    """Rows and columns of ``--size``, or by default those of a picture to begin with, or twice those of the sample."""
    from simdtex.io.image import parse_size

    if size:
        return parse_size(size)
    return (2 * pixels.shape[0], 2 * pixels.shape[1]) if start is None else (start.shape[0], start.shape[1])


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


@contextmanager
def watching(
    quiet: bool,
    stages: Path | None,
    limits: tuple[float, float],
) -> Iterator[Callable[[Any], None]]:
    """A callback that moves a progress bar and, where there is a folder for them, writes the stages.

    `limits` are black and white in their pictures.
    """
    from simdtex.report.stages import StageWriter

    writer = StageWriter(stages, limits=limits) if stages else None
    try:
        with progress_bar(quiet) as show:

            def callback(progress: Any) -> None:
                show(progress.fraction, progress.doing, "")
                if writer:
                    writer(progress)

            yield callback
    finally:
        if writer:
            writer.finish()
