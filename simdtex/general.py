# SPDX-License-Identifier: BSD-3-Clause
"""Commands of no feature: ``simdtex resume``, ``devices`` and ``demo``."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from contextlib import chdir
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from simdtex.cli.command import ENTER, FOLDER, command, note
from simdtex.cli.job import watching
from simdtex.cli.options import DEVICE, QUIET, output_option
from simdtex.jobs.tiles.command import WORKERS, resume_tiles

if TYPE_CHECKING:
    from simdtex.machine.devices import DeviceInfo


@command(
    ("resume state", "Continue the run of --checkpoint state."),
    ("resume more.zarr --workers 4", "Continue an output in tiles with four processes."),
)
@click.argument("path", metavar="FILE", type=ENTER)
@WORKERS
@DEVICE
@QUIET
def resume(path: Path, workers: int | str | None, device: str | None, quiet: bool) -> None:
    """Continue the run whose state is in FILE, and write the outputs of its command.

    FILE is the file of --checkpoint, or the .zarr store of --tiles.
    """
    from simdtex.checkpoint import read
    from simdtex.commands import COMMANDS, load

    if (path / "zarr.json").is_file() or (path / "work").is_dir():
        from simdtex.jobs.synthesis.command import write_tiled_page
        from simdtex.jobs.tiles.job import TileStore

        resume_tiles(TileStore(path, workers=workers, note=note, ended=write_tiled_page), device, quiet)
        return
    if workers is not None:
        raise ValueError("--workers requires the .zarr store of --tiles; leave it out")
    if not path.exists():
        raise ValueError(f"{path} does not exist: check the path (a finished run has no checkpoint)")
    if path.is_dir():
        raise ValueError(f"{path} is a folder; give the file of --checkpoint, or the store of --tiles")
    command: dict[str, Any] | None = read(path)[0]["command"]
    if command is None:
        raise ValueError(f"the run in {path} was started in Python; make the same call with checkpoint={str(path)!r}")
    again = load(command["name"]) if command["name"] in COMMANDS else None
    if again is None or all(param.name != "checkpoint" for param in again.params):
        raise ValueError(f"the checkpoint in {path} is of a command that cannot be resumed; run that again")
    if not os.path.isdir(command["folder"]):
        raise ValueError(f"{command['folder']}, the folder of the run in {path}, does not exist; restore it")
    values = {"checkpoint": path.resolve(), "device": device, "quiet": quiet}
    with chdir(command["folder"]), again.make_context(f"simdtex {again.name}", list(command["words"])) as context:
        context.params |= {name: value for name, value in values.items() if value}
        again.invoke(context)


@command(
    ("demo", "Make three textures, and a sheet of them, in the folder demo."),
)
@output_option("Write into this folder.", FOLDER, default="demo", show_default=True)
@click.option(
    "--size", default="256x256", show_default=True, metavar="WIDTHxHEIGHT", help="Make outputs of this size, in pixels."
)
@click.option("--seed", type=int, default=1, show_default=True, help="Use this seed.")
@DEVICE
def demo(output: Path, size: str, seed: int, device: str | None) -> None:
    """Synthesise brick, grass and gravel from pictures of scikit-image."""
    from simdtex.figures.sheet import contact_sheet
    from simdtex.io import image
    from simdtex.io.files import earlier_files
    from simdtex.io.image import EXAMPLES, example
    from simdtex.jobs.synthesis.job import synthesize
    from simdtex.machine import open_machine

    shape = image.parse_size(size)
    names = [f"{name}.png" for name in (*EXAMPLES, "sheet")]
    earlier = all((output / name).is_file() for name in names)
    earlier_files(output, "the pictures", lambda name: earlier and name in names)
    machine = open_machine(device)
    click.echo(f"device: {machine.name}")
    output.mkdir(exist_ok=True)
    pictures = []
    for name in EXAMPLES:
        sample = example(name)[:128, :128]
        began = time.perf_counter()
        with watching() as callback:
            made = synthesize(sample, shape, rng=seed, device=machine, callback=callback)
        seconds = time.perf_counter() - began
        image.write(output / f"{name}.png", made)
        pictures += [(f"{name}, the sample", sample), (f"{name}, {seconds:.1f} s", made)]
        click.echo(f"{output / name}.png: {shape[1]}x{shape[0]} from 128x128 in {seconds:.1f} s")
    image.write(output / "sheet.png", contact_sheet(pictures, columns=2))
    click.echo(f"sheet of all pictures: {output / 'sheet.png'}")


@command()
def devices() -> None:
    """List all OpenCL devices, whether they work, and the default device."""
    from simdtex.machine.devices import devices

    render(devices())


def render(listing: Sequence[DeviceInfo]) -> None:
    """Print a listing of probed devices as a table, and the default device, which is marked with "*"."""
    from simdtex.figures.tables import Table, print_table
    from simdtex.machine.devices import VARIABLE, DeviceError, choose

    wanted, default = os.environ.get(VARIABLE) or None, None
    try:
        default = choose(wanted, listing)
        sentence = f"Chosen by {VARIABLE if wanted else 'default'}: {default}"
    except DeviceError as error:
        sentence = str(error)
    rows = [
        {
            "": "*" if info is default else "",
            "index": str(info.index),
            "platform": info.platform,
            "device": info.name or "-",
            "kind": info.kind if info.name else "-",
            "OpenCL": info.version.removeprefix("OpenCL ").partition(" ")[0] or "-",
            "units": str(info.compute_units or "-"),
            "memory": f"{info.memory / 2**30:.1f} GiB" if info.memory else "-",
            "usable": ("yes (simulator)" if info.simulated else "yes") if info.usable else f"no: {info.reason}",
        }
        for info in listing
    ]
    print_table(Table("", rows))
    click.echo(sentence)
