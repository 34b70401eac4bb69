# SPDX-License-Identifier: BSD-3-Clause
"""``simdtex fill``: the holes of a picture."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

from simdtex.cli.inputs import (
    channels,
    check_profiles,
    check_source_map,
    note_lossy,
    planes,
    read_also,
    read_material,
    write_arranged,
)
from simdtex.cli.job import Task, job
from simdtex.cli.options import ALSO, SOURCE_MAP, given
from simdtex.cli.places import READ, WRITE
from simdtex.model.pictures import unknown_in


@job(
    ("fill photo.png -o whole.png --mask hole.png", "Fill the white parts of a mask."),
    ("fill cutout.png -o whole.png", "Fill the transparent parts of a picture."),
    (
        "fill photo.png -o grass.png --mask car.png --sample meadow.png",
        "Fill with another texture.",
    ),
)
@click.argument("picture", type=READ)
@click.option("-o", "--output", required=True, type=WRITE, help="Write this picture.")
@click.option(
    "--mask",
    type=READ,
    metavar="FILE",
    help="Fill the white parts of this mask, of the same size.  [the parts of PICTURE that are transparent or NaN; "
    "the output then has no alpha]",
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
@ALSO
@SOURCE_MAP
def fill(
    picture: Path,
    output: Path,
    mask: Path | None,
    samples: tuple[Path, ...],
    reach: int | None,
    also: tuple[str, ...],
    source_map: Path | None,
    **options: Any,
) -> Task:
    """Fill the holes of PICTURE with the texture around them.

    Pixels outside the holes do not change.
    """
    from simdtex import fill
    from simdtex.io import image

    whole = read_material([picture], categorical=options["categorical"])
    pixels, hole = _hole(whole.pixels[0], mask)
    texture = read_material(samples, categorical=options["categorical"]) if samples else None
    if texture:
        check_profiles([picture, samples[0]], [whole.metadata, texture.metadata])
    if texture and also:
        raise ValueError("--also cannot be used with --sample, since no pixel comes from the picture; leave --also out")
    others = read_also(also, whole)
    image.check_writable(output, pixels.dtype, channels(pixels))
    check_source_map(source_map, texture or whole, everywhere=not texture)
    note_lossy(output, pixels)
    sample = texture and texture.array
    axis = None if pixels.ndim == 2 else -1
    return Task(
        partial(fill, pixels, hole, sample=sample, reach=reach, channel_axis=axis, **given(options)),
        lambda made: f"{np.count_nonzero(hole)} of {hole.size} pixels filled",
        str(output),
        write_arranged(output, others, source_map, whole.metadata),
    )


def _hole(pixels: NDArray[Any], mask: Path | None) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Return the picture, and its hole: where the mask is white or, without one, it is transparent; or it is NaN."""
    from simdtex.io.image import read_mask, split_alpha

    if mask:
        hole = read_mask(mask, pixels.shape)
    else:
        pixels, hole = split_alpha(pixels)
    return pixels, hole | unknown_in(planes(pixels))
