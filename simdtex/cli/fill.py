# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex fill``: the holes of a picture."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

from simdtex.cli.inputs import Reading, check_profiles, planes, read_material
from simdtex.cli.job import Task, job
from simdtex.cli.maps import arranged, read_lead
from simdtex.cli.options import OUTPUT, given, material_options
from simdtex.cli.places import ENTER, READ
from simdtex.model.pictures import unknown_in


@job(
    ("fill photo.png -o whole.png --mask hole.png", "Fill the white parts of a mask."),
    ("fill cutout.png -o whole.png", "Fill the transparent parts of a picture."),
    ("fill brick -o whole --grow 4", "Fill all maps in the folder brick where the albedo is transparent."),
    ("fill photo.png -o grass.png --mask car.png --sample meadow.png", "Fill with another texture."),
    usual="output mask invert grow feather samples reach seed also dry_run device quiet",
)
@click.argument("picture", type=ENTER)
@OUTPUT
@click.option(
    "--mask",
    type=READ,
    metavar="FILE",
    help="Fill the white parts of this mask, of the same size.  [the parts of PICTURE that are not fully opaque, or "
    "NaN; the output then has no alpha]",
)
@click.option("--invert", is_flag=True, help="Fill all but the white parts of --mask.")
@click.option("--grow", type=int, default=0, help="Make the holes wider by this many pixels.")
@click.option(
    "--feather",
    type=int,
    default=0,
    help="Blend the filled pixels with the picture up to this many pixels around the holes.",
)
@click.option(
    "--sample",
    "samples",
    multiple=True,
    type=READ,
    metavar="FILE",
    help="Fill with this texture, not with that around the hole; may be repeated.",
)
@click.option(
    "--reach",
    type=int,
    help="Fill a hole from the surroundings up to this far away, in pixels.  [128, or twice the hole's longer side]",
)
@material_options
def fill(
    picture: Path,
    output: Path,
    mask: Path | None,
    invert: bool,
    samples: tuple[Path, ...],
    roles: tuple[Any, ...],
    also: tuple[Any, ...],
    source_map: Path | None,
    **options: Any,
) -> Task:
    """Fill the holes of PICTURE with the texture around them.

    Pixels outside the holes do not change, except with --grow and --feather. PICTURE may be a folder with the maps of a
    material, as in `simdtex tile`; the holes are those of the albedo, or of --mask.
    """
    from simdtex import fill
    from simdtex.jobs.filling import widened

    how = Reading(palette=bool(options["categorical"]))
    target, whole = read_lead([picture], output, roles, how)
    pixels, hole = _hole(whole.pixels[0], mask, invert)
    whole = whole._replace(pixels=[pixels])
    texture = read_material(samples, how) if samples else None
    if texture:
        check_profiles([whole.paths[0], samples[0]], [whole.metadata, texture.metadata])
    foreign = "maps cannot be filled with --sample, since no pixel comes from the picture" if texture else ""
    writers = arranged(target, whole, whole.metadata, also=also, source_map=source_map, foreign=foreign)
    sample = texture and texture.array
    filled = np.count_nonzero(widened(hole, options["grow"], options["feather"]))
    axis = None if pixels.ndim == 2 else -1
    return Task(
        partial(fill, pixels, hole, sample=sample, channel_axis=axis, **given(options)),
        f"{filled} of {hole.size} pixels filled",
        str(target),
        writers,
    )


def _hole(pixels: NDArray[Any], mask: Path | None, invert: bool) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Return the picture, and its hole: where the mask is white or, without one, it is not opaque; or it is NaN."""
    from simdtex.io.image import read_mask, split_alpha

    pixels, gone = np.ma.getdata(pixels), planes(np.ma.getmaskarray(pixels)).any(-1)
    if mask:
        hole = read_mask(mask, pixels.shape) != invert
    elif invert:
        raise ValueError("--invert requires --mask; leave it out")
    else:
        pixels, hole = split_alpha(pixels, opaque=True)
    return pixels, hole | gone | unknown_in(planes(pixels))
