# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex maspar``: more of a texture, on the processor array of 1998."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from simdtex.cli.inputs import channels, output_shape, read_material
from simdtex.cli.job import Task, command_line, job
from simdtex.cli.options import SEED, given, option, output_option, paper_options, report_option, size_option
from simdtex.cli.places import READ, WRITE
from simdtex.maspar import EXECUTED


@job(
    ("maspar gravel.png -o more.png --order 8 --size 64x64", "Make a small texture as in 1998; it takes seconds."),
    ("maspar gravel.png -o more.png --array 4k --mapping hierarchical", "Use a smaller array, with blocks on each PE."),
    ("maspar gravel.png -o more.png --order 8 --size 64 --report page", "See the PEs at work, for several schedules."),
    of=None,
)
@click.argument("sample", type=READ)
@output_option("Write this picture.", WRITE)
@size_option("twice the sample")
@option(
    "--array",
    default="16k",
    show_default=True,
    metavar="PES",
    words=("1k", "2k", "4k", "8k", "16k"),
    help="Use the array of this many PEs, or ROWSxCOLS.",
)
@option(
    "--mapping",
    default="cut-and-stack",
    show_default=True,
    words=("cut-and-stack", "hierarchical"),
    help="Arrange a picture larger than the array in layers of its size (cut-and-stack), or in a block on each PE.",
)
@option(
    "--memory",
    default="64K",
    show_default=True,
    words=("16K", "64K"),
    help="Give each PE this memory; what does not fit is refused.",
)
@paper_options(*EXECUTED)
@option(
    "--film",
    default="coloring,checkerboard,synchronous,raster",
    show_default=True,
    metavar="A,B,...",
    help="Show the PEs that these schedules activate, with --report.",
)
@report_option("the seconds of 1998, the PEs at work, and a film of schedules")
@SEED
def maspar(sample: Path, output: Path, size: str | None, film: str, **options: Any) -> Task:
    """Synthesise a picture by Algorithm 1 on an emulated MasPar MP-1, and print its times of 1998.

    The output has the bytes of `simdtex synth --preset paper`. From a sample of 128x128, 64x64 pixels with order 8 take
    seconds, and 128x128 with order 18 a minute or two.
    """
    from simdtex.io import image
    from simdtex.jobs.array import synthesize
    from simdtex.report.array import section_table, write_array
    from simdtex.report.tables import print_table
    from simdtex.schedules import get

    names = [get(name.strip()).name for name in film.split(",")]
    material = read_material([sample])
    shape: Any = output_shape(size, material.pixels[0])
    image.check_writable(output, material.pixels[0].dtype, channels(material.pixels[0]))
    like = material.metadata and material.metadata._replace(exif=None, geo=None)

    def make(checkpoint: None, **call: Any) -> Any:
        return synthesize(material.array, shape, channel_axis=material.channel_axis, **given(options), **call)

    def report(folder: Path, made: Any, run: Any) -> None:
        write_array(folder, material.pixels[0], made, run, names, command_line())

    height, width = material.sizes[0]
    return Task(
        make,
        f"{shape[1]}x{shape[0]} from {width}x{height}",
        str(output),
        [lambda made, run: image.write(output, made, like)],
        more=lambda made, run: print_table(section_table(run)),
        report=report,
    )
