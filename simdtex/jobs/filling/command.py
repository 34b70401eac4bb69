# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex fill``, ``extend`` and ``tile``."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

from simdtex.cli.command import ENTER, READ
from simdtex.cli.inputs import (
    Material,
    Reading,
    arranged,
    check_profiles,
    planes,
    read_lead,
    read_material,
)
from simdtex.cli.job import Task, job, notes
from simdtex.cli.options import (
    DIRECTION,
    DIRECTIONS,
    LIGHT,
    OUTPUT,
    PREVIEW,
    given,
    material_options,
    option,
    report_option,
    size_option,
    stages_option,
    together,
)
from simdtex.jobs.synthesis.command import write_page
from simdtex.methods.mrf.options import Options
from simdtex.model.light import LIGHTS
from simdtex.model.pictures import unknown_in

SIDES = ("left", "right", "top", "bottom")

CONTINUED = together(
    option(
        "--band",
        type=int,
        help="Replace this many pixels along each edge that no pixels are added to, so that the output tiles.  [the "
        "size of the picture's parts, such as stones or bricks: between an eighth and a fifth of the shorter side]",
    ),
    LIGHT,
    material_options,
    PREVIEW,
    stages_option("every level and sweep"),
    report_option("its pictures, and how evenly it uses the picture"),
)
"""The options that `extend` and `tile` share."""


@job(
    ("extend photo.png -o wide.png --left 200 --right 200", "Add pixels on two sides."),
    ("extend photo.png -o larger.png --size 150% --seamless", "Add pixels at the right and below, and make it tile."),
    ("extend brick -o larger --right 512", "Extend all maps in the folder brick: albedo, normal, roughness..."),
    usual="output left right top bottom size seamless seed also preview dry_run device quiet",
    methods=[Options],
)
@click.argument("picture", type=ENTER)
@OUTPUT
@together(*(option(f"--{side}", type=int, help=f"Add this many pixels at the {side}.") for side in SIDES))
@size_option("that with the pixels of --left, --right, --top and --bottom", base="PICTURE")
@option(
    "--seamless",
    type=DIRECTION,
    words=DIRECTIONS,
    is_flag=False,
    flag_value="both",
    metavar="[x|y|both]",
    help="Make the output tile: left and right (x), top and bottom (y), or both, like `simdtex tile`.  "
    "[both, if no direction is given]",
)
@CONTINUED
def extend(size: str | None, seamless: Any, **options: Any) -> Task:
    """Continue PICTURE beyond its edges, or make it seamless.

    PICTURE may be a folder with the maps of a material, as in `simdtex tile`.
    """
    if seamless is None and options["band"] is not None:
        raise ValueError("--band requires --seamless; leave it out, or give --seamless too")
    sides: dict[str, Any] = {name: options.pop(name) or 0 for name in SIDES}
    return continued(seamless or False, sides, size, **options)


@job(
    ("tile photo.png -o tile.png", "Make a photo tile."),
    ("tile brick -o tiled --preview", "Make all maps of a material tile; tiled-3x3.png shows copies."),
    ("tile panorama.png -o round.png --direction x", "Join left and right only."),
    usual="output direction band seed also roles preview report dry_run device quiet",
    of="extend",
    methods=[Options],
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
@CONTINUED
def tile(direction: Any, **options: Any) -> Task:
    """Make PICTURE tile, or all maps of a material.

    A band along the edges is replaced; the rest does not change. PICTURE may be a folder with the maps of a material,
    whose names end in their kind, such as brick_albedo.png and brick_normal.png; the output is then a folder too. The
    albedo decides the arrangement. To let another map decide, give its path instead of the folder's.
    """
    return continued(direction, dict.fromkeys(SIDES, 0), None, **options)


def continued(
    seamless: Any, sides: dict[str, Any], size: str | None, *, picture: Path, output: Path, **options: Any
) -> Task:
    """Return the task that continues a picture, or a folder of maps; ``seamless`` as in `simdtex.extend`."""
    from simdtex.jobs.filling.job import extend

    target, whole = read_lead([picture], output, options, Reading(palette=bool(options["categorical"])))
    pixels, (rows, cols) = whole.pixels[0], whole.sizes[0]
    if size is not None:
        sides = _sides(size, sides, (rows, cols))
    metadata = whole.metadata
    if metadata and metadata.geo:
        metadata = metadata._replace(geo=metadata.geo.moved(sides["left"], sides["top"]))
    writers = arranged(target, whole, metadata, options)
    width, height = cols + sides["left"] + sides["right"], rows + sides["top"] + sides["bottom"]
    return Task(
        partial(extend, pixels, seamless=seamless, channel_axis=whole.channel_axis, **sides, **given(options)),
        f"{width}x{height} from {cols}x{rows}",
        str(target),
        writers,
        whole.limits,
        lambda made, output: notes(output),
        partial(write_page, pixels, continued=True),
    )


def _sides(text: str, sides: dict[str, int], shape: tuple[int, int]) -> dict[str, int]:
    """Return the number of pixels to add on each side for an output of a size."""
    from simdtex.io.image import parse_sides

    if any(sides.values()):
        raise ValueError("--size cannot be used with --left, --right, --top or --bottom; leave them out")
    size = parse_sides(text, "WIDTHxHEIGHT", shape[::-1])[::-1]
    more = [new - old for new, old in zip(size, shape, strict=True)]
    if min(more) < 0:
        raise ValueError(f"--size {text} is smaller than the picture of {shape[1]}x{shape[0]}; crop it first")
    return {"top": 0, "bottom": more[0], "left": 0, "right": more[1]}


@job(
    ("fill photo.png -o whole.png --mask hole.png", "Fill the white parts of a mask."),
    ("fill cutout.png -o whole.png", "Fill the transparent parts of a picture."),
    ("fill brick -o whole --grow 4", "Fill all maps in the folder brick where the albedo is transparent."),
    ("fill photo.png -o grass.png --mask car.png --sample meadow.png", "Fill with another texture."),
    usual="output mask invert grow feather samples reach seed also dry_run device quiet",
    methods=[Options],
)
@click.argument("picture", type=ENTER)
@OUTPUT
@option(
    "--mask",
    type=READ,
    metavar="FILE",
    help="Fill the white parts of this mask, of the same size.  [the parts of PICTURE that are not fully opaque, or "
    "NaN; the output then has no alpha]",
)
@option("--invert", is_flag=True, default=None, help="Fill all but the white parts of --mask.")
@option("--grow", type=int, help="Make the holes wider by this many pixels.")
@option("--feather", type=int, help="Blend the filled pixels with the picture up to this many pixels around the holes.")
@option(
    "--light",
    words=LIGHTS,
    group="Appearance",
    help="Take pixels in the light of their place, or in even light, which then gets that of the hole's place.  [even "
    "if the picture is smooth for the most part, such as a sky; keep with a reach or finish 0]",
)
@option(
    "--sample",
    "samples",
    multiple=True,
    type=READ,
    metavar="FILE",
    help="Fill with this texture, not with that around the hole; may be repeated.",
)
@option(
    "--reach",
    type=int,
    help="Fill a hole from the surroundings up to this far away, in pixels.  [128, or twice the hole's longer side]",
)
@material_options
def fill(
    picture: Path, output: Path, mask: Path | None, invert: bool | None, samples: tuple[Path, ...], **options: Any
) -> Task:
    """Fill the holes of PICTURE with the texture around them.

    Pixels outside the holes do not change, except with --grow and --feather. PICTURE may be a folder with the maps of a
    material, as in `simdtex tile`; the holes are those of the albedo, or of --mask.
    """
    from simdtex.jobs.filling.job import fill, widened

    how = Reading(palette=bool(options["categorical"]))
    target, whole = read_lead([picture], output, options, how)
    pixels, hole = _hole(whole, mask, invert)
    whole = whole._replace(pixels=[pixels])
    texture = read_material(samples, how._replace(ascending=whole.ascending)) if samples else None
    if texture:
        check_profiles([whole.paths[0], samples[0]], [whole.metadata, texture.metadata])
    foreign = "maps cannot be filled with --sample, since no pixel comes from the picture" if texture else ""
    writers = arranged(target, whole, whole.metadata, options, foreign=foreign)
    sample = texture and texture.array
    filled = np.count_nonzero(widened(hole, options["grow"] or 0, options["feather"] or 0))
    axis = None if pixels.ndim == 2 else -1
    return Task(
        partial(fill, pixels, hole, sample=sample, channel_axis=axis, **given(options)),
        f"{filled} of {hole.size} pixels filled",
        str(target),
        writers,
    )


def _hole(whole: Material, mask: Path | None, invert: bool | None) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Return the picture, and its hole: where the mask is white or, without one, it is not opaque; or it is NaN."""
    from simdtex.io.image import read_mask, split_alpha

    pixels, gone = np.ma.getdata(whole.pixels[0]), planes(np.ma.getmaskarray(whole.pixels[0])).any(-1)
    if mask:
        hole = read_mask(mask, pixels.shape, ascending=whole.ascending) != bool(invert)
    elif invert:
        raise ValueError("--invert requires --mask; leave it out")
    else:
        pixels, hole = split_alpha(pixels, opaque=True, plain=bool(whole.metadata and whole.metadata.plain))
    return pixels, hole | gone | unknown_in(planes(pixels))
