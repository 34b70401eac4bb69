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


@functools.cache
def _defaults() -> dict[str, Any]:
    """Each method's options as they are by default, by the method's name."""
    from simdtex.methods import mrf, multires, pyramid

    return {"mrf": mrf.Options(), "multires": multires.Options(), "pyramid": pyramid.Options()}


class Option(click.Option):
    """An option whose help names defaults, as ``{mrf.order}``: the methods load only where it is shown."""

    def get_help_record(self, ctx: click.Context) -> tuple[str, str] | None:
        """The names of the option, and its help."""
        self.help = self.help and self.help.format(**_defaults())
        return super().get_help_record(ctx)


option = functools.partial(click.option, cls=Option)

DEVICE = option(
    "--device",
    metavar="TEXT",
    help="Part of a device's name or platform, an index of `simdtex devices`, or `reference`. "
    "Default: SIMDTEX_DEVICE, else a GPU, else a CPU.",
)

SEED = option("--seed", type=int, help="Same seed, same picture on every device.  [a fresh one, printed]")
PROFILE = option("--profile", is_flag=True, help="Print what each kernel took, and what was left to the host.")
QUIET = option("-q", "--quiet", is_flag=True, help="No progress bar and no summary.")
LEVELS = option("--levels", type=int, help="Of the multigrid, or of the pyramid.  [as many as the sample feeds]")
BOUNDARY = option("--boundary", help="mrf, multires: torus (the result tiles) or open.  [{mrf.boundary}]")

_EDGES = {
    "multires": "mend (make the sample wrap around) or keep.  [{multires.edges}]",
    "mrf": "auto, reflect or whole: candidates at the sample's edge.  [{mrf.edges}]",
    "pyramid": "reflect or wrap: how the sample goes on beyond its edge.  [{pyramid.edges}]",
}
_ORIENTATIONS = {
    "multires": "of edge and line filters.  [{multires.orientations}]",
    "pyramid": "1, 2, 4 or 6, of the steerable pyramid.  [{pyramid.orientations}]",
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
    from rich.console import Console

    from simdtex.report.profile import render

    render(statistics, Console(width=None if sys.stdout.isatty() else 200))


def stages_option(what: str) -> Callable[[Command], Command]:
    """``--stages``, which writes these pictures."""
    return option("--stages", type=click.Path(path_type=Path), metavar="DIR", help=f"Write {what} as pictures.")


def _shared(name: str, texts: dict[str, str], *methods: str, **kinds: Any) -> Callable[[Command], Command]:
    """An option that means something to each of these methods."""
    return option(name, help=" ".join(f"{method}: {texts[method]}" for method in methods), **kinds)


_MRF_OPTIONS = (
    option("--preset", help="mrf: default, or paper: the 1998 rules to the letter."),
    option("--order", type=int, help="mrf: neighbours within sqrt(order): 8 has 24, 18 has 60.  [{mrf.order}]"),
    option("--relaxation", help="mrf: icm (the mode) or gibbs (a draw).  [{mrf.relaxation}]"),
    option("--bandwidth", type=float, help="mrf: of the Parzen kernel, in units of h_opt.  [{mrf.bandwidth}]"),
    option("--coherence", type=float, help="mrf: preference for continuing a neighbour's source.  [{mrf.coherence}]"),
    option("--balance", type=float, help="mrf: price of using parts of the sample more than others.  [{mrf.balance}]"),
    option("--structure", type=float, help="mrf: weight of the distance to the sample's edges.  [{mrf.structure}]"),
    option("--novelty", type=float, help="mrf: price of keeping the sample's layout.  [{mrf.novelty}]"),
    option("--overview", type=int, help="mrf: candidates at the coarsest level, at least.  [{mrf.overview}]"),
    option("--finish", type=float, help="mrf: pixels over which seams melt; 0: none.  [1.5; of categories 0]"),
    option("--xi", type=float, help="mrf: cooling, below 0; further down is faster.  [{mrf.xi}]"),
    option(
        "--free-sweeps",
        type=int,
        help="mrf: sweeps over all sites after a level's equilibrium.  [{mrf.free_sweeps}]",
    ),
    option("--pixel", help="mrf: source (pixels of the sample) or density (grey levels).  [{mrf.pixel}]"),
    option("--phases", help="mrf: decimated or all: candidates at coarse levels.  [{mrf.phases}]"),
    option("--coarsest", help="mrf: gibbs or same: how the coarsest level relaxes.  [{mrf.coarsest}]"),
    option("--search", help="mrf: exact (all candidates), coherent (a few, much faster) or auto.  [{mrf.search}]"),
    option("--suggesting", type=int, help="mrf, coherent: nearest neighbours that suggest one.  [{mrf.suggesting}]"),
    option("--similar", type=int, help="mrf, coherent: candidates like each of these.  [{mrf.similar}]"),
    option("--chance", type=int, help="mrf, coherent: candidates at random.  [{mrf.chance}]"),
    option("--exhaustive", type=int, help="mrf, coherent: levels of so few candidates weigh all.  [{mrf.exhaustive}]"),
)

_MULTIRES_OPTIONS = (
    option("--sigma", type=float, help="multires: of the filters, in pixels.  [{multires.sigma}]"),
    option("--filter-size", type=int, help="multires: rows of a filter, odd.  [{multires.filter_size}]"),
    option("--features", help="multires: of the luminance or of all channels.  [{multires.features}]"),
    option("--phase", help="multires: match or free: candidates among siblings.  [{multires.phase}]"),
    option("--joins", help="multires: blend or cut: where pieces meet.  [{multires.joins}]"),
)


_THRESHOLD_OPTIONS = (
    option(
        "--alpha", metavar="FLOAT|auto", help="multires: threshold; more is freer, auto finds one.  [{multires.alpha}]"
    ),
    option("--beta", type=float, help="multires: stricter at high frequencies, alpha / k^beta.  [{multires.beta:g}]"),
    option("--strain", type=float, help="multires: of joins, at most, for --alpha auto.  [{multires.strain}]"),
    option("--target", type=float, help="multires: mean candidates for --alpha auto, in place of --strain."),
    option(
        "--thresholds",
        type=click.Path(path_type=Path),
        metavar="FILE",
        help="multires: a table of thresholds, a line of numbers for each level.",
    ),
)


def _pyramid_options(start: str, prefix: str = "") -> list[Callable[[Command], Command]]:
    """Those of ``pyramid`` that no other method has; `start` is ``"METAVAR: What to begin with"``."""
    metavar, begin = start.split(": ")

    def named(name: str, text: str, **kinds: Any) -> Callable[[Command], Command]:
        return option(name, help=prefix + text[0].lower() + text[1:] if prefix else text, **kinds)

    return [
        named("--pyramid", "steerable or laplacian: whose histograms are matched.  [{pyramid.pyramid}]"),
        named("--iterations", "Times that all are matched, 0 or more.  [{pyramid.iterations}]", type=int),
        named("--match", "rank (exact) or lookup (the paper's tables).  [{pyramid.match}]"),
        named("--bins", "Of these tables, 2 to 4096.  [{pyramid.bins}]", type=int),
        named("--color", "decorrelate or channels: the colours that are matched.  [{pyramid.color}]"),
        named("--start", f"{begin} to begin with.  [noise]", type=click.Path(path_type=Path), metavar=metavar),
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
    _shared("--orientations", _ORIENTATIONS, "multires", type=int),
    *_MULTIRES_OPTIONS,
    _shared("--edges", _EDGES, "multires"),
    LEVELS,
    BOUNDARY,
)
"""Those of ``multires``, but for its thresholds."""

method_options = _with(
    LEVELS,
    BOUNDARY,
    _shared("--edges", _EDGES, "mrf", "multires", "pyramid"),
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
        option("--levels", type=int, help="Of the pyramids.  [as many as leave 8 pixels a side]"),
        option("--orientations", type=int, help=_ORIENTATIONS["pyramid"]),
        option("--edges", help=_EDGES["pyramid"]),
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

        writer = StageWriter(stages, limits=limits)
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
