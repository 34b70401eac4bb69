# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex tile``: a picture, or a material, without a seam."""

from __future__ import annotations

from typing import Any

import click

from simdtex.cli.extend import REPORTED, SIDES, continued
from simdtex.cli.job import Task, job
from simdtex.cli.options import ALSO, BAND, DIRECTION, DIRECTIONS, MAP, OUTPUT, PREVIEW, SOURCE_MAP, option
from simdtex.cli.places import ENTER


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
@MAP
@ALSO
@SOURCE_MAP
@PREVIEW
def tile(direction: Any, **options: Any) -> Task:
    """Make PICTURE tile, or all maps of a material.

    A band along the edges is replaced; the rest does not change. PICTURE may be a folder with the maps of a material,
    whose names end in their kind, such as brick_albedo.png and brick_normal.png; the output is then a folder too. The
    albedo decides the arrangement. To let another map decide, give its path instead of the folder's.
    """
    return continued(direction, dict.fromkeys(SIDES, 0), None, **options)
