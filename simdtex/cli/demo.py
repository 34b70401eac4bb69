# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex demo``: the first thing to run."""

from __future__ import annotations

import time
from pathlib import Path

import click

from simdtex.cli.command import command
from simdtex.cli.job import progress_bar
from simdtex.cli.options import DEVICE
from simdtex.cli.places import FOLDER


@command(
    ("demo", "Three textures, and a sheet of them, in the folder demo."),
)
@click.option("-o", "--output", default="demo", show_default=True, type=FOLDER, help="Write into this folder.")
@click.option(
    "--size", default="256x256", show_default=True, metavar="WIDTHxHEIGHT", help="Make outputs of this size, in pixels."
)
@click.option("--seed", type=int, default=1, show_default=True, help="Make the pictures from this seed.")
@DEVICE
def demo(output: Path, size: str, seed: int, device: str | None) -> None:
    """Synthesise brick, grass and gravel from scikit-image's own pictures."""
    from simdtex.io import image
    from simdtex.io.examples import EXAMPLES, example
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
    for name in EXAMPLES:
        sample = example(name)[:128, :128]
        began = time.perf_counter()
        with progress_bar(quiet=False) as show:
            made = synthesize(sample, shape, rng=seed, device=machine, callback=lambda p: show(p.fraction, p.doing, ""))
        seconds = time.perf_counter() - began
        image.write(output / f"{name}.png", made)
        pictures += [(f"{name}, the sample", sample), (f"{name}, {seconds:.1f} s", made)]
        click.echo(f"{output / name}.png: {shape[1]}x{shape[0]} from 128x128 in {seconds:.1f} s")
    contact_sheet(pictures, output / "sheet.png", columns=2)
    click.echo(f"all of them: {output / 'sheet.png'}")
