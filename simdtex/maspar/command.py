# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex maspar``: the processor array of 1998."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from simdtex.cli.command import READ, WRITE
from simdtex.cli.inputs import check_output, output_shape, read_material
from simdtex.cli.job import Task, command_line, job
from simdtex.cli.options import (
    SEED,
    given,
    option,
    output_option,
    paper_options,
    report_option,
    size_option,
)
from simdtex.maspar.array import EXECUTED
from simdtex.methods.mrf.options import Options
from simdtex.model.array import ARRAYS, MAPPINGS, PREFIX


@job(
    ("maspar gravel.png -o more.png --order 8 --size 64x64", "Make a small texture as in 1998."),
    ("maspar gravel.png -o more.png --array 4k --mapping hierarchical", "Use a smaller array, with blocks on each PE."),
    ("maspar gravel.png -o more.png --order 8 --size 64 --report page", "See the PEs at work, for several schedules."),
    usual="output size order levels relaxation array film report seed quiet",
    seeded=False,
)
@click.argument("sample", type=READ)
@output_option("Write this picture.", WRITE)
@size_option("128x128")
@option(
    "--array",
    default="16k",
    show_default=True,
    metavar="PES",
    words=[name.removeprefix(PREFIX) for name in ARRAYS],
    help="Use the array of this many PEs, or ROWSxCOLS.",
)
@option(
    "--mapping",
    default=MAPPINGS[0],
    show_default=True,
    words=MAPPINGS,
    help="Arrange a picture larger than the array in layers of its size (cut-and-stack), or in a block on each PE.",
)
@option(
    "--memory",
    default="64K",
    show_default=True,
    words=("16K", "64K"),
    help="Give each PE this memory; what does not fit is refused.",
)
@paper_options(Options, *EXECUTED)
@option(
    "--film",
    default="coloring,checkerboard,synchronous,raster",
    show_default=True,
    metavar="A,B,...",
    help="Show the PEs that these schedules activate and the pictures that they make, with --report.",
)
@report_option("the seconds of 1998, the PEs at work, and a film of schedules")
@SEED
def maspar(sample: Path, output: Path, size: str | None, film: str, **options: Any) -> Task:
    """Synthesise a picture by Algorithm 1 on an emulated MasPar MP-1, and print its times of 1998.

    The output has the bytes of `simdtex synth --preset paper`. 128x128 pixels, one for each PE, take about 90 s
    of a core from a sample of 138x138 in colour; the time grows with the pixels of both and with the order.
    """
    from simdtex.figures.tables import print_table
    from simdtex.io import image
    from simdtex.maspar.job import synthesize
    from simdtex.maspar.report import develop, section_table, write_array
    from simdtex.schedules import get

    names = [get(name.strip()).name for name in film.split(",")]
    material = read_material([sample])
    shape: Any = output_shape("128x128" if size is None else size, material.pixels[0])
    like = material.metadata and material.metadata.at()._replace(exif=None)
    check_output(output, material.pixels[0], like)

    used: dict[str, Any] = {"channel_axis": material.channel_axis}

    def make(checkpoint: None, **call: Any) -> Any:
        used["device"] = call["device"]
        return synthesize(material.array, shape, channel_axis=material.channel_axis, **given(options), **call)

    def report(folder: Path, made: Any, run: Any) -> None:
        settings = {name: value for name, value in given(options).items() if name in EXECUTED}
        settings |= used | {"rng": run.statistics["seed"]}
        pictures = {name: develop(material.array, shape, name, **settings) for name in names}
        write_array(folder, material.pixels[0], made, run, pictures, command_line())

    height, width = material.sizes[0]
    return Task(
        make,
        f"{shape[1]}x{shape[0]} from {width}x{height}",
        str(output),
        [lambda made, run: image.write(output, made, like)],
        more=lambda made, run: print_table(section_table(run)),
        report=report,
    )
