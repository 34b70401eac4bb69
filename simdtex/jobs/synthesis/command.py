# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex synth``: textures of any size, also in tiles."""

from __future__ import annotations

import os
from functools import partial
from pathlib import Path
from typing import Any

import click

from simdtex.cli.command import ENTER, RESUME, note
from simdtex.cli.inputs import (
    Folder,
    arranged,
    last_iteration,
    output_shape,
    read_also,
    read_guides,
    read_known,
    read_lead,
    read_masks,
    take_reading,
)
from simdtex.cli.job import Task, command_line, job, notes
from simdtex.cli.options import (
    GUIDE,
    KNOWN_OPTIONS,
    LIGHT,
    PREVIEW,
    PROFILE,
    SAMPLE_MASK,
    given,
    material_options,
    option,
    output_option,
    report_option,
    size_option,
    stages_option,
)
from simdtex.jobs.tiles.command import TILES, check_tiles, make_in_tiles
from simdtex.methods.mrf import options as mrf
from simdtex.methods.multires import options as multires
from simdtex.methods.pyramid import options as pyramid


@job(
    ("synth gravel.png -o more.png", "Make a texture of twice the size that tiles."),
    ("synth brick -o more --size 2x", "Make more of a material: all maps in the folder brick, arranged alike."),
    ("synth gravel.png -o more.png --size 1024x512 --preview", "Set the size, and see 3x3 copies in more-3x3.png."),
    ("synth gravel.png -o more.zarr --size 32768x32768 --tiles 2048", "Make an output larger than the memory."),
    usual="output size seed method order also guide preview report dry_run device quiet",
    methods=[mrf.Options, multires.Options, pyramid.Options],
)
@click.argument("samples", metavar="SAMPLE...", nargs=-1, required=True, type=ENTER)
@output_option("Write this picture, or a folder of maps; with --tiles a .zarr store.")
@size_option("that of --known or of the output guide, else twice the first sample")
@option(
    "--method",
    words=("mrf", "multires", "pyramid"),
    default="mrf",
    help="Use Paget and Longstaff's method (mrf), De Bonet's (multires), or Heeger and Bergen's (pyramid).  [mrf]",
)
@SAMPLE_MASK
@KNOWN_OPTIONS
@GUIDE
@LIGHT
@material_options
@PREVIEW
@TILES
@stages_option("every level, sweep or iteration")
@report_option("its pictures, how evenly it uses the sample, and how much it copies")
@PROFILE
def synth(samples: tuple[Path, ...], output: Path, size: str | None, method: str, **options: Any) -> Task | None:
    """Synthesise a picture of any size with the texture of SAMPLE.

    The method mrf takes several samples of one type, and maps of them by --also MAP0,MAP1=OUT; unknown pixels may be
    NaN. SAMPLE may be a folder with the maps of a material, as in `simdtex tile`. Categories with --known have the
    defaults of `simdtex simulate`: the output tiles with --boundary torus alone.
    """
    from simdtex.io.decode import NOTHING
    from simdtex.io.hard_data import HardData, sites_of
    from simdtex.jobs.synthesis.job import plan_synthesis, synthesize
    from simdtex.jobs.tiles.job import TileStore

    context = click.get_current_context()
    check_tiles(context.params)
    how = take_reading(options)
    target, material = read_lead(samples, output, options, how)
    if method == "pyramid" and (options["source_map"] or options["also"] or isinstance(target, Folder)):
        remedy = "give one picture, and leave --source-map and --also out"
        raise ValueError(f"the method pyramid takes no pixel from the sample; {remedy}")
    pixels, how = material.pixels[0], how._replace(ascending=material.ascending)
    mask = read_masks(options.pop("sample_mask"), material, how)
    known, place = read_known(options.pop("known"), material, how)  # a new picture was taken nowhere else
    guide, options["labels"] = read_guides(options.pop("guide"), material, how, options["labels"])
    rows, cols = output_shape(size, pixels, known, guide and guide[1])
    if isinstance(known, HardData) and not known.from_top:
        sites_of(known, (rows, cols), skip=False)  # raises before y counts from the top
        known = known.upside_down(rows)
    report = context.params["report"]
    if report and (material.several or known is not None or not material.known):
        raise ValueError("--report requires one sample without unknown pixels, and no --known; leave it out")
    data = {"method": method, "mask": mask, "known": known, "guide": guide, "channel_axis": material.channel_axis}
    side, workers = options.pop("tiles"), options.pop("workers")
    if side is not None:
        maps = {one.out.name: one.maps.array for one in read_also(options["also"], material, files=False)}
        kept = report and {"report": os.path.realpath(report), "line": command_line()}
        store = TileStore(output, side, workers, bool(options["source_map"]), maps, note, write_tiled_page, kept)
        chosen = given(options, ("also", "source_map", "preview"))
        make_in_tiles(store, plan_synthesis(material.array, (rows, cols), **data, **chosen))
        return None
    like = (material.metadata or NOTHING).at(place and NOTHING._replace(geo=place))._replace(exif=None)
    foreign = "" if known is None else "the maps have no values for known pixels, which are not from the sample"
    writers = arranged(target, material, like, options, kept=known is not None, foreign=foreign)

    def more(made: Any, output: Any) -> None:
        statistics = output.statistics
        if method == "multires":
            counts = " ".join(f"{level['candidates']:.3g}" for level in statistics["levels"][1:])
            click.echo(f"candidates per level, coarse to fine: {counts}")
        elif method == "pyramid":
            click.echo(last_iteration(statistics))
        notes(output)
        if options["array"]:
            from simdtex.figures.tables import print_accounting

            print_accounting(statistics["accounting"])

    height, width = material.sizes[0]
    by = f"{len(samples)} samples" if material.several else f"{width}x{height}"
    return Task(
        partial(synthesize, material.array, (rows, cols), **data, **given(options)),
        f"{cols}x{rows} from {by}",
        str(target),
        writers,
        material.limits,
        more,
        partial(write_page, pixels),
    )


def write_page(sample: Any, folder: Path, made: Any, output: Any, **how: Any) -> None:
    """Write the page of a texture and its sample, and the command line."""
    from simdtex.jobs.synthesis.report import write_synthesis

    write_synthesis(folder, sample, made, output, command_line(), **how)


def write_tiled_page(samples: list[Any], image: Any, output: Any, command: dict[str, str] | None) -> None:
    """Write the page of an output in tiles that is complete, if the command that began it has ``--report``."""
    if command is None:
        return
    from simdtex.figures.page import check_folder
    from simdtex.jobs.synthesis.report import write_synthesis

    try:
        check_folder(command["report"])
    except ValueError as error:
        store = click.get_current_context().meta[RESUME]
        raise ValueError(f"{error}; then go on with: simdtex resume {store}") from None
    write_synthesis(command["report"], samples[0], image, output, command["line"])
