# SPDX-License-Identifier: BSD-3-Clause
"""The command line: ``simdtex synth``, ``simdtex devices``, ``simdtex demo``."""

from __future__ import annotations

import functools
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from simdtex import __version__
from simdtex.methods.mrf import Options

DEFAULTS = Options()


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


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="simdtex")
def main() -> None:
    """More of a texture from a sample of it, by parallel relaxation on any OpenCL device."""


DEVICE = click.option(
    "--device",
    metavar="TEXT",
    help="Part of a device's name or platform, an index of `simdtex devices`, or `reference`. "
    "Default: SIMDTEX_DEVICE, else a GPU, else a CPU.",
)


@main.command()
@click.argument("sample", type=click.Path(path_type=Path))
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path), help="Picture to write.")
@click.option("--size", metavar="WIDTHxHEIGHT", help="Of the output, in pixels. Default: twice the sample.")
@click.option("--method", default="mrf", show_default=True, help="mrf: Paget and Longstaff 1998.")
@click.option("--preset", help="default, or paper: the 1998 rules to the letter.")
@click.option("--order", type=int, help=f"Neighbours within sqrt(order): 8 has 24, 18 has 60.  [{DEFAULTS.order}]")
@click.option("--levels", type=int, help="Of the multigrid.  [as many as the sample feeds]")
@click.option("--relaxation", help=f"icm (the mode) or gibbs (a draw).  [{DEFAULTS.relaxation}]")
@click.option("--bandwidth", type=float, help=f"Of the Parzen kernel, in units of h_opt.  [{DEFAULTS.bandwidth}]")
@click.option(
    "--coherence", type=float, help=f"Preference for continuing a neighbour's source.  [{DEFAULTS.coherence}]"
)
@click.option("--xi", type=float, help=f"Cooling, below 0; further down is faster.  [{DEFAULTS.xi}]")
@click.option(
    "--free-sweeps", type=int, help=f"Sweeps over all sites after a level's equilibrium.  [{DEFAULTS.free_sweeps}]"
)
@click.option("--pixel", help=f"source (pixels of the sample) or density (grey levels).  [{DEFAULTS.pixel}]")
@click.option("--phases", help=f"decimated or all: candidates at coarse levels.  [{DEFAULTS.phases}]")
@click.option("--edges", help=f"auto, reflect or whole: candidates at the sample's edge.  [{DEFAULTS.edges}]")
@click.option("--coarsest", help=f"gibbs or same: how the coarsest level relaxes.  [{DEFAULTS.coarsest}]")
@click.option("--schedule", help=f"Which sites relax together: coloring.  [{DEFAULTS.schedule}]")
@click.option("--boundary", help=f"torus (the result tiles) or open.  [{DEFAULTS.boundary}]")
@click.option("--seed", type=int, help="Same seed, same picture on every device.  [a fresh one, printed]")
@DEVICE
@click.option("--stages", type=click.Path(path_type=Path), metavar="DIR", help="Write every level and sweep.")
@click.option("--source-map", type=click.Path(path_type=Path), metavar="FILE", help="Write it: .npz, .npy, .png.")
@click.option(
    "--also",
    multiple=True,
    metavar="MAP=OUT",
    help="Carry the arrangement over to another map of the material (normal, height); may be repeated.",
)
@click.option("-q", "--quiet", is_flag=True, help="No progress bar and no summary.")
@plainly
def synth(
    sample: Path,
    output: Path,
    size: str | None,
    method: str,
    seed: int | None,
    device: str | None,
    stages: Path | None,
    source_map: Path | None,
    also: tuple[str, ...],
    quiet: bool,
    **options: Any,
) -> None:
    """Make more of the texture SAMPLE."""
    from simdtex import image
    from simdtex import source_map as maps
    from simdtex.report.stages import StageWriter
    from simdtex.synthesis import synthesize

    picture = image.read(sample)
    pixels = picture.pixels
    height, width = pixels.shape[:2]
    shape = image.parse_size(size) if size else (2 * height, 2 * width)
    channels = 1 if picture.channel_axis is None else pixels.shape[-1]
    image.check_writable(output, pixels.dtype, channels)
    if source_map:
        image.check_writable(source_map, suffixes=maps.SOURCE_SUFFIXES)
    others = [_other_map(text, (height, width)) for text in also]
    outputs = [output, *([source_map] if source_map else []), *(path for _, path in others)]
    _check_distinct(outputs, [sample, *(Path(text.partition("=")[0]) for text in also)])
    writer = StageWriter(stages, limits=(float(pixels.min()), float(pixels.max()))) if stages else None

    began = time.perf_counter()
    try:
        with _progress(quiet) as show:

            def callback(progress: Any) -> None:
                show(progress)
                if writer:
                    writer(progress)

            made, run = synthesize(
                pixels,
                shape,
                method=method,
                channel_axis=picture.channel_axis,
                rng=seed,
                device=device,
                callback=callback,
                full_output=True,
                **{name: value for name, value in options.items() if value is not None},
            )
    finally:
        if writer:
            writer.finish()
    carried = [(maps.apply_source_map(run.source, other, (height, width)), path) for other, path in others]
    image.write(output, made)
    for array, path in carried:
        image.write(path, array)
    if source_map:
        maps.save_source_map(source_map, run.source)
    if not quiet:
        click.echo(
            f"{output}: {shape[1]}x{shape[0]} from {width}x{height} in {time.perf_counter() - began:.1f} s "
            f"on {run.statistics['device']}, seed {run.statistics['seed']}"
        )


@main.command()
@plainly
def devices() -> None:
    """List every OpenCL device, whether it works, and which one would be chosen."""
    from simdtex.device import render

    render(Console(width=None if sys.stdout.isatty() else 200))


@main.command()
@click.option(
    "-o", "--output", default="demo", show_default=True, type=click.Path(path_type=Path), help="Folder to write."
)
@click.option("--size", default="256x256", show_default=True, metavar="WIDTHxHEIGHT", help="Of each output.")
@click.option("--seed", type=int, default=1, show_default=True)
@DEVICE
@plainly
def demo(output: Path, size: str, seed: int, device: str | None) -> None:
    """Synthesise brick, grass and gravel from scikit-image's own pictures."""
    from skimage import data

    from simdtex import image
    from simdtex.machine import open_machine
    from simdtex.report.sheet import contact_sheet
    from simdtex.synthesis import synthesize

    shape = image.parse_size(size)
    if output.exists() and not output.is_dir():
        raise ValueError(f"{output} is a file; give --output a folder")
    machine = open_machine(device)
    click.echo(f"device: {machine.name}")
    output.mkdir(parents=True, exist_ok=True)
    pictures = []
    for name in ("brick", "grass", "gravel"):
        sample = getattr(data, name)()[:128, :128]
        began = time.perf_counter()
        with _progress(quiet=False) as show:
            made = synthesize(sample, shape, rng=seed, device=machine, callback=show)
        seconds = time.perf_counter() - began
        image.write(output / f"{name}.png", made)
        pictures += [(f"{name}, the sample", sample), (f"{name}, {seconds:.1f} s", made)]
        click.echo(f"{output / name}.png: {shape[1]}x{shape[0]} from 128x128 in {seconds:.1f} s")
    contact_sheet(pictures, output / "sheet.png", columns=2)
    click.echo(f"all of them: {output / 'sheet.png'}")


def _other_map(text: str, sample: tuple[int, int]) -> tuple[Any, Path]:
    """Read the map of ``--also MAP=OUT`` and check that it can be carried over and written."""
    from simdtex import image

    name, equals, out = text.partition("=")
    if not (name and equals and out):
        raise ValueError(f"--also {text} must be MAP=OUT, the map's file and the file to write")
    other = image.read(name)
    pixels = other.pixels
    if pixels.shape[:2] != sample:
        raise ValueError(
            f"{name} is {pixels.shape[1]}x{pixels.shape[0]} and the sample {sample[1]}x{sample[0]}; "
            "give --also a map of the sample's size"
        )
    image.check_writable(out, pixels.dtype, 1 if other.channel_axis is None else pixels.shape[-1])
    return pixels, Path(out)


def _check_distinct(outputs: list[Path], inputs: list[Path]) -> None:
    """Raise where an output would overwrite another or an input."""
    resolved = [path.resolve() for path in outputs]
    for path in outputs:
        if resolved.count(path.resolve()) > 1:
            raise ValueError(f"{path} would be written twice; give each output a file of its own")
        if path.resolve() in [other.resolve() for other in inputs]:
            raise ValueError(f"{path} is an input and would be overwritten; give the output another name")


@contextmanager
def _progress(quiet: bool) -> Iterator[Callable[[Any], None]]:
    """A progress bar, where there is a terminal, with level, sweep, temperature left and time left."""
    if quiet:
        yield lambda progress: None
        return
    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("starting", total=1.0)

        def show(progress: Any) -> None:
            bar.update(
                task,
                completed=progress.fraction,
                description=f"level {progress.level}, sweep {progress.sweep}, "
                f"temperature {progress.temperature_left:.3f}",
            )

        yield show
