# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex synth``: more of a texture."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import click

from simdtex.cli.inputs import last_iteration, output_shape, read_also, read_data, take_reading
from simdtex.cli.job import Task, job, write_page
from simdtex.cli.maps import Folder, arranged, read_lead
from simdtex.cli.options import (
    GUIDE,
    METHODS,
    PREVIEW,
    PROFILE,
    data_options,
    given,
    material_options,
    option,
    output_option,
    report_option,
    size_option,
    stages_option,
)
from simdtex.cli.places import ENTER
from simdtex.cli.tiles import check_tiles, synthesize_in_tiles, tiles_options


@job(
    ("synth gravel.png -o more.png", "Make a texture of twice the size that tiles."),
    ("synth brick -o more --size 2x", "Make more of a material: all maps in the folder brick, arranged alike."),
    ("synth gravel.png -o more.png --size 1024x512 --preview", "Set the size, and see 3x3 copies in more-3x3.png."),
    ("synth gravel.png -o more.zarr --size 32768x32768 --tiles 2048", "Make an output larger than the memory."),
    usual="output size seed method order also guide preview report dry_run device quiet",
)
@click.argument("samples", metavar="SAMPLE...", nargs=-1, required=True, type=ENTER)
@output_option("Write this picture, or a folder of maps; with --tiles a .zarr store.")
@size_option("that of --known or of the output guide, else twice the first sample")
@option(
    "--method",
    default="mrf",
    show_default=True,
    words=METHODS["synth"],
    help="Use Paget and Longstaff's method (mrf), De Bonet's (multires), or Heeger and Bergen's (pyramid).",
)
@data_options
@GUIDE
@material_options
@PREVIEW
@tiles_options
@stages_option("every level, sweep or iteration")
@report_option("its pictures, how evenly it uses the sample, and how much it copies")
@PROFILE
def synth(samples: tuple[Path, ...], output: Path, size: str | None, method: str, **options: Any) -> Task | None:
    """Synthesise a picture of any size with the texture of SAMPLE.

    The method mrf takes several samples of one type, and maps of them by --also MAP0,MAP1=OUT; unknown pixels may be
    NaN. SAMPLE may be a folder with the maps of a material, as in `simdtex tile`.
    """
    from simdtex.jobs.synthesis import synthesize

    context = click.get_current_context()
    check_tiles(context)
    how = take_reading(options)
    target, material = read_lead(samples, output, options, how)
    if method == "pyramid" and (options["source_map"] or options["also"] or isinstance(target, Folder)):
        remedy = "give one picture, and leave --source-map and --also out"
        raise ValueError(f"the method pyramid takes no pixel from the sample; {remedy}")
    pixels = material.pixels[0]
    data = read_data(material, options, how)
    known, guide = data["known"], data["guide"]
    shape = output_shape(size, pixels, known, guide and guide[1])
    if context.params["report"] and (material.several or known is not None or not material.known):
        raise ValueError("--report requires one sample without unknown pixels, and no --known; leave it out")
    if options["tiles"] is not None:
        others = read_also(options["also"], material, files=False)
        left_out = ("tiles", "workers", "also", "source_map", "preview")
        synthesize_in_tiles(context, material.array, (shape[0], shape[1]), others, data | given(options, left_out))
        return None
    like = material.metadata and material.metadata._replace(exif=None, geo=None)  # a new picture was taken nowhere
    foreign = "" if known is None else "the maps have no values for known pixels, which are not from the sample"
    writers = arranged(target, material, like, options, kept=known is not None, foreign=foreign)

    def more(made: Any, output: Any) -> None:
        statistics = output.statistics
        if method == "multires":
            counts = " ".join(f"{level['candidates']:.3g}" for level in statistics["levels"][1:])
            click.echo(f"candidates per level, coarse to fine: {counts}")
        elif method == "pyramid":
            click.echo(last_iteration(statistics))
        else:
            from simdtex.model.regularity import lattice_sentence

            if note := lattice_sentence(statistics["lattice"]):
                click.echo(note)
        if options["array"]:
            from simdtex.report.terminal import print_accounting

            print_accounting(statistics["accounting"])

    height, width = material.sizes[0]
    by = f"{len(samples)} samples" if material.several else f"{width}x{height}"
    return Task(
        partial(synthesize, material.array, shape, method=method, **data | given(options)),
        f"{shape[1]}x{shape[0]} from {by}",
        str(target),
        writers,
        material.limits,
        more,
        partial(write_page, pixels),
    )
