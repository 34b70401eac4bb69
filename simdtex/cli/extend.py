# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex extend`` and ``tile``: a picture beyond its edges, or without a seam."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import click

from simdtex.cli.inputs import Reading
from simdtex.cli.job import Task, job, write_page
from simdtex.cli.maps import arranged, read_lead
from simdtex.cli.options import (
    BAND,
    DIRECTION,
    DIRECTIONS,
    OUTPUT,
    PREVIEW,
    given,
    material_options,
    option,
    size_option,
)
from simdtex.cli.places import ENTER

SIDES = ("top", "bottom", "left", "right")
REPORTED = "its pictures, and how evenly it uses the picture"
"""What the page of a run shows."""


@job(
    ("extend photo.png -o wide.png --left 200 --right 200", "Add pixels on two sides."),
    ("extend photo.png -o larger.png --size 150% --seamless", "Add pixels at the right and below, and make it tile."),
    ("extend brick -o larger --right 512", "Extend all maps in the folder brick: albedo, normal, roughness..."),
    usual="output left right top bottom size seamless seed also preview dry_run device quiet",
    stages="every level and sweep",
    report=REPORTED,
)
@click.argument("picture", type=ENTER)
@OUTPUT
@click.option("--left", type=int, default=0, help="Add this many pixels at the left.")
@click.option("--right", type=int, default=0, help="Add this many pixels at the right.")
@click.option("--top", type=int, default=0, help="Add this many pixels at the top.")
@click.option("--bottom", type=int, default=0, help="Add this many pixels at the bottom.")
@size_option("that with the pixels of --left, --right, --top and --bottom", base="PICTURE")
@option(
    "--seamless",
    is_flag=False,
    flag_value="both",
    metavar="[x|y|both]",
    type=DIRECTION,
    words=DIRECTIONS,
    help="Make the output tile: left and right (x), top and bottom (y), or both, like `simdtex tile`.  [both, if no "
    "direction is given]",
)
@BAND
@material_options
@PREVIEW
def extend(size: str | None, seamless: Any, **options: Any) -> Task:
    """Continue PICTURE beyond its edges, or make it seamless.

    PICTURE may be a folder with the maps of a material, as in `simdtex tile`.
    """
    if seamless is None and options["band"] is not None:
        raise ValueError("--band requires --seamless; leave it out, or give --seamless too")
    sides = {name: options.pop(name) for name in SIDES}
    return continued(seamless or False, sides, size, **options)


@job(
    ("tile photo.png -o tile.png", "Make a photo tile."),
    ("tile brick -o tiled --preview", "Make all maps of a material tile; tiled-3x3.png shows copies."),
    ("tile panorama.png -o round.png --direction x", "Join left and right only."),
    usual="output direction band seed also roles preview report dry_run device quiet",
    of="extend",
    stages="every level and sweep",
    report=REPORTED,
)
@click.argument("picture", type=ENTER)
@OUTPUT
@option(
    "--direction",
    type=DIRECTION,
    words=DIRECTIONS,
    default="both",
    show_default=True,
    help="Join left and right (x), top and bottom (y), or both.",
)
@BAND
@material_options
@PREVIEW
def tile(direction: Any, **options: Any) -> Task:
    """Make PICTURE tile, or all maps of a material.

    A band along the edges is replaced; the rest does not change. PICTURE may be a folder with the maps of a material,
    whose names end in their kind, such as brick_albedo.png and brick_normal.png; the output is then a folder too. The
    albedo decides the arrangement. To let another map decide, give its path instead of the folder's.
    """
    return continued(direction, dict.fromkeys(SIDES, 0), None, **options)


def continued(
    seamless: Any,
    sides: dict[str, int],
    size: str | None,
    *,
    picture: Path,
    output: Path,
    roles: tuple[Any, ...],
    **options: Any,
) -> Task:
    """Return the task that continues a picture, or a folder of maps; ``seamless`` as in `simdtex.extend`."""
    from simdtex import extend

    target, whole = read_lead([picture], output, roles, Reading(palette=bool(options["categorical"])))
    pixels, (rows, cols) = whole.pixels[0], whole.sizes[0]
    if size is not None:
        sides = _sides(size, sides, (rows, cols))
    metadata = whole.metadata
    if metadata and metadata.geo:
        metadata = metadata._replace(geo=metadata.geo.moved(sides["left"], sides["top"]))
    outputs = {name: options.pop(name) for name in ("also", "source_map", "preview")}
    writers = arranged(target, whole, metadata, **outputs)
    width, height = cols + sides["left"] + sides["right"], rows + sides["top"] + sides["bottom"]
    return Task(
        partial(extend, pixels, seamless=seamless, channel_axis=whole.channel_axis, **sides, **given(options)),
        f"{width}x{height} from {cols}x{rows}",
        str(target),
        writers,
        whole.limits,
        report=partial(write_page, pixels, continued=True),
    )


def _sides(text: str, sides: dict[str, int], shape: tuple[int, int]) -> dict[str, int]:
    """Return what is to be added on each side for an output of this size."""
    from simdtex.io.image import parse_sides

    if any(sides.values()):
        raise ValueError("--size cannot be used with --left, --right, --top or --bottom; leave them out")
    size = parse_sides(text, "WIDTHxHEIGHT", shape[::-1])[::-1]
    more = [new - old for new, old in zip(size, shape, strict=True)]
    if min(more) < 0:
        raise ValueError(
            f"--size {text} is smaller than the picture of {shape[1]}x{shape[0]}; give no less, or crop it first"
        )
    return {"top": 0, "bottom": more[0], "left": 0, "right": more[1]}
