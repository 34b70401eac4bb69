# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex extend``: a picture beyond its edges, or without a seam."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import click

from simdtex.cli.inputs import Reading, check_source_map, read_material
from simdtex.cli.job import Task, command_line, job
from simdtex.cli.maps import arranged, folder_of
from simdtex.cli.options import ALSO, MAP, SOURCE_MAP, given, option, report_option
from simdtex.cli.places import EITHER, ENTER

SIDES = ("top", "bottom", "left", "right")


@job(
    ("extend photo.png -o tile.png --seamless", "Make a photo tile."),
    ("extend photo.png -o wide.png --left 200 --right 200", "Add pixels on two sides."),
    ("extend brick -o tiled --seamless", "Make all maps in the folder brick tile: albedo, normal, roughness..."),
    stages="every level and sweep",
)
@click.argument("picture", type=ENTER)
@click.option("-o", "--output", required=True, type=EITHER, help="Write this picture, or a folder of maps.")
@click.option("--left", type=int, default=0, help="Add this many pixels at the left.")
@click.option("--right", type=int, default=0, help="Add this many pixels at the right.")
@click.option("--top", type=int, default=0, help="Add this many pixels at the top.")
@click.option("--bottom", type=int, default=0, help="Add this many pixels at the bottom.")
@click.option(
    "--size",
    metavar="WIDTHxHEIGHT",
    help="Make an output of this size, in pixels: add pixels at the right and at the bottom.",
)
@option(
    "--seamless",
    is_flag=False,
    flag_value="both",
    metavar="[x|y|both]",
    words=("both", "x", "y"),
    help="Make the output tile: left and right (x), top and bottom (y), or both. If no pixels are added in a "
    "direction, a band along the edges is replaced.  [both, if no direction is given]",
)
@click.option(
    "--band",
    type=int,
    help="Replace this many pixels along each edge, with --seamless.  [an eighth of the shorter side, 8 to 64]",
)
@MAP
@ALSO
@SOURCE_MAP
@report_option("its pictures, and how evenly it uses the picture")
def extend(
    picture: Path,
    output: Path,
    size: str | None,
    seamless: str | None,
    roles: tuple[str, ...],
    also: tuple[str, ...],
    source_map: Path | None,
    report: Path | None,
    **options: Any,
) -> Task:
    """Continue PICTURE beyond its edges, or make it seamless.

    PICTURE may be a folder with the maps of a material, whose names end in their kind, such as brick_albedo.png and
    brick_normal.png; the output is then a folder too. The albedo decides the arrangement. To let another map decide,
    give its path instead of the folder's.
    """
    from simdtex import extend

    folder = folder_of([picture], output, roles)
    whole = read_material([folder.lead if folder else picture], Reading(palette=bool(options["categorical"])))
    pixels, (rows, cols) = whole.pixels[0], whole.sizes[0]
    sides = {name: options.pop(name) for name in SIDES}
    if size is not None:
        sides = _sides(size, sides, (rows, cols))
    if seamless not in (None, "x", "y", "both"):
        raise ValueError(f"--seamless {seamless} is not a direction; give x, y or both")
    tiling: bool | str = seamless if seamless in ("x", "y") else bool(seamless)
    if not (tiling or any(sides.values())):
        raise ValueError("there is nothing to add; give --left, --right, --top, --bottom or --size, or --seamless")
    if options["band"] is not None and not tiling:
        raise ValueError("--band requires --seamless; leave it out, or give --seamless too")
    check_source_map(source_map, whole)
    metadata = whole.metadata
    if metadata and metadata.geo:
        metadata = metadata._replace(geo=metadata.geo.moved(sides["left"], sides["top"]))
    writers = arranged(folder or output, whole, also, source_map, metadata, kept=True)
    if report:
        from simdtex.report.page import check_folder
        from simdtex.report.synthesis import write_synthesis

        check_folder(report)
        writers.append(lambda made, run: write_synthesis(report, pixels, made, run, command_line(), continued=True))
    return Task(
        partial(extend, pixels, seamless=tiling, channel_axis=whole.channel_axis, **sides, **given(options)),
        lambda made: f"{made.shape[1]}x{made.shape[0]} from {cols}x{rows}",
        str(folder or output),
        writers,
        whole.limits,
    )


def _sides(text: str, sides: dict[str, int], shape: tuple[int, int]) -> dict[str, int]:
    """Return what is to be added on each side for an output of this size."""
    from simdtex.io.image import parse_size

    if any(sides.values()):
        raise ValueError("--size cannot be used with --left, --right, --top or --bottom; leave them out")
    more = [new - old for new, old in zip(parse_size(text), shape, strict=True)]
    if min(more) < 0:
        raise ValueError(
            f"--size {text} is smaller than the picture of {shape[1]}x{shape[0]}; give no less, or crop it first"
        )
    return {"top": 0, "bottom": more[0], "left": 0, "right": more[1]}
