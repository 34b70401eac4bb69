# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex demo``: three textures, and a sheet of them."""

from __future__ import annotations

import time
from pathlib import Path

import click

from simdtex.cli.command import command
from simdtex.cli.job import watching
from simdtex.cli.options import DEVICE, output_option
from simdtex.cli.places import FOLDER


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
    from simdtex.io import image
    from simdtex.io.atomic import earlier_files
    from simdtex.io.examples import EXAMPLES, example
    from simdtex.machine import open_machine
    from simdtex.report.sheet import contact_sheet
    from simdtex.synthesis import synthesize

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
