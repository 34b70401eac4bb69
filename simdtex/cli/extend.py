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
from simdtex.cli.options import ALSO, BAND, MAP, OUTPUT, PREVIEW, SOURCE_MAP, given, option, report_option, size_option
from simdtex.cli.places import ENTER

SIDES = ("top", "bottom", "left", "right")
DIRECTIONS = ("both", "x", "y")
REPORTED = "its pictures, and how evenly it uses the picture"
"""What the page of a run shows."""


@job(
    ("extend photo.png -o wide.png --left 200 --right 200", "Add pixels on two sides."),
    ("extend photo.png -o larger.png --size 150% --seamless", "Add pixels at the right and below, and make it tile."),
    ("extend brick -o larger --right 512", "Extend all maps in the folder brick: albedo, normal, roughness..."),
    usual="output left right top bottom size seamless seed also preview dry_run device quiet",
    stages="every level and sweep",
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
    words=DIRECTIONS,
    help="Make the output tile: left and right (x), top and bottom (y), or both, like `simdtex tile`.  [both, if no "
    "direction is given]",
)
@BAND
@MAP
@ALSO
@SOURCE_MAP
@PREVIEW
@report_option(REPORTED)
def extend(size: str | None, seamless: str | None, **options: Any) -> Task:
    """Continue PICTURE beyond its edges, or make it seamless.

    PICTURE may be a folder with the maps of a material, as in `simdtex tile`.
    """
    if seamless is None and options["band"] is not None:
        raise ValueError("--band requires --seamless; leave it out, or give --seamless too")
    sides = {name: options.pop(name) for name in SIDES}
    if seamless is None and size is None and not any(sides.values()):
        raise ValueError("there is nothing to add; give --left, --right, --top, --bottom or --size, or --seamless")
    return continued("--seamless", seamless, sides, size, **options)


def continued(
    option: str,
    direction: str | None,
    sides: dict[str, int],
    size: str | None,
    *,
    picture: Path,
    output: Path,
    roles: tuple[str, ...],
    also: tuple[str, ...],
    source_map: Path | None,
    report: Path | None,
    preview: bool,
    **options: Any,
) -> Task:
    """Return the task that continues a picture, or a folder of maps; it tiles in the direction of an option."""
    from simdtex import extend

    if direction not in (None, *DIRECTIONS):
        raise ValueError(f"{option} {direction} is not a direction; give x, y or both")
    folder = folder_of([picture], output, roles)
    whole = read_material([folder.lead if folder else picture], Reading(palette=bool(options["categorical"])))
    pixels, (rows, cols) = whole.pixels[0], whole.sizes[0]
    if size is not None:
        sides = _sides(size, sides, (rows, cols))
    tiling: Any = direction if direction in ("x", "y") else direction is not None
    check_source_map(source_map, whole)
    metadata = whole.metadata
    if metadata and metadata.geo:
        metadata = metadata._replace(geo=metadata.geo.moved(sides["left"], sides["top"]))
    writers = arranged(folder or output, whole, also, source_map, metadata, kept=True, preview=preview)
    if report:
        from simdtex.report.page import check_folder
        from simdtex.report.synthesis import write_synthesis

        check_folder(report)
        writers.append(lambda made, run: write_synthesis(report, pixels, made, run, command_line(), continued=True))
    width, height = cols + sides["left"] + sides["right"], rows + sides["top"] + sides["bottom"]
    return Task(
        partial(extend, pixels, seamless=tiling, channel_axis=whole.channel_axis, **sides, **given(options)),
        f"{width}x{height} from {cols}x{rows}",
        str(folder or output),
        writers,
        whole.limits,
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
