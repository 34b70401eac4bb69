# SPDX-License-Identifier: BSD-3-Clause
"""Masks, known values and guides: what ``synth``, ``simulate`` and ``estimate`` read beside the samples."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.cli.inputs import (
    Material,
    Reading,
    channels,
    planes,
    read_known,
    read_masks,
    read_pair,
    read_pixels,
    without_alpha,
)
from simdtex.model.pictures import unknown_in


def read_data(samples: Material, options: dict[str, Any], how: Reading) -> dict[str, Any]:
    """Return the mask, the known values and the guide that options name, as `simdtex.synthesize` takes them.

    These options are taken out; ``labels`` is set if the guides decide it.
    """
    from simdtex.io.grids import kind_of

    if samples.deep and (options["sample_mask"] or options["guide"]):
        raise ValueError("--sample-mask and --guide take no volumes; use simdtex.simulate in Python")
    if how.deep and kind_of(samples.paths[0]) == "raster" and (options["sample_mask"] or options.get("guide")):
        raise ValueError(
            f"{samples.paths[0]} is a raster, whose rows are counted from the south, and --sample-mask and --guide are "
            "pictures; set no-data in the raster, or use simdtex.simulate in Python"
        )
    masks = read_masks(options.pop("sample_mask"), samples)
    file, guide = options.pop("known"), options.pop("guide", None)
    found: dict[str, Any] = {
        "channel_axis": samples.channel_axis,
        "mask": masks and (masks if samples.several else masks[0]),
        "known": read_known(file, samples, how) if file else None,
        "guide": None,
    }
    if guide is not None:
        found["guide"], options["labels"] = read_guides(guide, samples, options["labels"])
    return found


def read_guides(text: str, samples: Material, labels: bool | None) -> tuple[tuple[Any, NDArray[Any]], bool | None]:
    """Return the guide of ``SAMPLE-GUIDE=OUTPUT-GUIDE``, and whether it is of labels; None: as it looks.

    The guides of several samples are parted by commas.

    Colours of 8 bits are labels if ``labels`` is true or, if it is None, the samples' guides have few of them, in
    palettes up to 64; they become whole numbers. Where the guide of the output is transparent or NaN, the output is
    free: it has NaN there.
    """
    from simdtex.io.image import coloured
    from simdtex.methods.mrf.options import CATEGORIES, few
    from simdtex.methods.mrf.plan import LABELS

    paths, out = read_pair("--guide", "SAMPLE-GUIDE=OUTPUT-GUIDE", text, samples)
    found = [read_pixels(path, Reading(palette=True)) for path in (*paths, out)]
    pictures, lies = tuple(one.pixels for one in found), found[-1].lies
    palettes = [one.metadata and one.metadata.palette for one in found]
    if all(palettes) or len({*palettes} - {None}) > 1 or max(map(channels, pictures)) > 2:
        pictures = tuple(map(coloured, pictures, palettes))  # the order of colours may differ
    *own, wanted = pictures
    wanted, free = without_alpha(wanted, channels(wanted if lies else own[0]))  # a grid has no alpha
    free = free | unknown_in(planes(wanted))
    are_few = few([one.reshape(*one.shape[:2], -1) for one in own], LABELS if all(palettes) else CATEGORIES)
    colours = all(one.dtype == np.uint8 and channels(one) == channels(wanted) > 1 for one in (*own, wanted))
    if labels is not False and colours and (labels or are_few):
        known = np.unique(np.concatenate([one.reshape(-1, channels(one)) for one in own]), axis=0)
        strange = [colour for colour in np.unique(wanted[~free], axis=0) if not (known == colour).all(-1).any()]
        if strange:
            more = f" and {len(strange) - 1} more" if len(strange) > 1 else ""
            raise ValueError(
                f"{out} has the colour {tuple(strange[0].tolist())}{more}, which {', '.join(map(str, paths))} "
                f"{'does' if len(paths) == 1 else 'do'} not have; paint with the colours of the labels, without soft "
                "edges, or give --no-labels"
            )
        own, wanted, labels = [_numbers(one, known) for one in own], _numbers(wanted, known), True
    elif labels is None and free.any():  # in floats, that they are whole numbers would no longer be seen
        labels = all(one.dtype.kind in "iu" for one in (*own, wanted)) and are_few
    if free.any():
        wanted = wanted.astype(np.float64)
        wanted[free] = np.nan
    return (own if samples.several else own[0], wanted), labels


def _numbers(pixels: NDArray[Any], known: NDArray[Any]) -> NDArray[Any]:
    """Return the number of each pixel's colour, (rows, cols)."""
    found = np.zeros(pixels.shape[:2], np.int64)
    for number, colour in enumerate(known):
        found[(pixels == colour).all(-1)] = number
    return found
