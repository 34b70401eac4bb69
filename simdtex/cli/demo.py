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

SOFTWARE = "simdtex demo"
"""What the files say that this command makes: it replaces no others."""


@command(
    ("demo", "Make three textures, and a sheet of them, in the folder demo."),
)
@click.option("-o", "--output", default="demo", show_default=True, type=FOLDER, help="Write into this folder.")
@click.option(
    "--size", default="256x256", show_default=True, metavar="WIDTHxHEIGHT", help="Make outputs of this size, in pixels."
)
@click.option("--seed", type=int, default=1, show_default=True, help="Use this seed.")
@DEVICE
def demo(output: Path, size: str, seed: int, device: str | None) -> None:
    """Synthesise brick, grass and gravel from pictures of scikit-image."""
    import PIL.Image
    from PIL.ExifTags import Base

    from simdtex.io import image
    from simdtex.io.examples import EXAMPLES, example
    from simdtex.machine import open_machine
    from simdtex.report.sheet import contact_sheet
    from simdtex.synthesis import synthesize

    shape = image.parse_size(size)
    if output.exists() and not output.is_dir():
        raise ValueError(f"{output} is a file; give --output a folder")
    for path in (output / f"{name}.png" for name in (*EXAMPLES, "sheet")):
        if path.exists() and not _made_here(path):
            raise ValueError(f"{path} was not made by this command; give another folder")
    exif = PIL.Image.Exif()
    exif[Base.Software] = SOFTWARE
    own = image.Metadata(exif=exif.tobytes())
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
        image.write(output / f"{name}.png", made, own)
        pictures += [(f"{name}, the sample", sample), (f"{name}, {seconds:.1f} s", made)]
        click.echo(f"{output / name}.png: {shape[1]}x{shape[0]} from 128x128 in {seconds:.1f} s")
    image.write(output / "sheet.png", contact_sheet(pictures, columns=2), own)
    click.echo(f"sheet of all pictures: {output / 'sheet.png'}")


def _made_here(path: Path) -> bool:
    """Return whether a file is a picture that this command has made."""
    import PIL.Image
    from PIL.ExifTags import Base

    try:
        with PIL.Image.open(path, formats=["PNG"]) as picture:
            return picture.getexif().get(Base.Software) == SOFTWARE
    except (OSError, SyntaxError):
        return False
