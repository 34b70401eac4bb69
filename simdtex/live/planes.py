# SPDX-License-Identifier: BSD-3-Clause
"""What a page can look at: a picture, where its pixels are from, and how often those of the sample are taken."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.io.image import to_display
from simdtex.live.looking import Plane
from simdtex.model.colours import heat, source_colours, use_colours


def picture(pixels: NDArray[Any], sample: NDArray[Any], shape: tuple[int, int] | None = None) -> Plane:
    """A picture, (rows, cols[, channels]), with black and white where the sample has them.

    ``shape`` are the rows and columns that it stands for, where it is of a coarse level.
    """
    limits = None if sample.dtype == np.uint8 else (float(sample.min()), float(sample.max()))
    return Plane(shape or (pixels.shape[0], pixels.shape[1]), pixels, partial(to_display, limits=limits))


def arrangement(source: NDArray[np.int32], sample: NDArray[Any], shape: tuple[int, int] | None = None) -> Plane:
    """A source map, in a colour for each place of the sample."""
    colours = partial(source_colours, sample_shape=sample.shape)
    return Plane(shape or (source.shape[0], source.shape[1]), source[..., :2], colours)


def use(source: NDArray[np.int32], sample: NDArray[Any]) -> Plane:
    """The sample, in colours of how often its pixels are taken."""
    return Plane((sample.shape[0], sample.shape[1]), use_colours(source[..., :2], sample.shape), np.asarray)


def temperature(values: NDArray[Any], shape: tuple[int, int] | None = None) -> Plane:
    """Temperatures, 0 to 1."""
    return Plane(shape or (values.shape[0], values.shape[1]), values, heat)
