# SPDX-License-Identifier: BSD-3-Clause
"""Which patches of a picture stand in it again."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from simdtex.experiments.quality.nearest import nearest
from simdtex.experiments.quality.pictures import Planes, as_pair, halved, in_deviations

REPEATED_PATCH = 32  # side of the patches, pixels of the full size
APART = 16  # least displacement of a repeat in one direction, pixels of the full size
ALIKE = 0.35  # standard deviations of the sample at half its size
GRID = 8  # from patch to patch, pixels of the full size
PATCHES = 1024  # looked up at most where no step is given


class Repeats(NamedTuple):
    """How much of the output, and of the sample, stands in it again, see `repeats`."""

    share: float
    own: float


def repeats(sample: ArrayLike, output: ArrayLike, *, step: int | None = None) -> Repeats:
    r"""Share of the 32 x 32 patches of the output that stand elsewhere in the output once more.

    The output is reduced to half its size by means of 2 x 2 blocks, where patches :math:`a_x`
    have 16 x 16 pixels. A patch is repeated if

    .. math::

       \min_y \frac{1}{\sigma} \sqrt{\frac{1}{256 c} \sum_i (a_{x,i} - a_{y,i})^2} < 0.35

    over all places :math:`y` of the half size that are at least half a patch from :math:`x` in
    rows or in columns. Here :math:`\sigma` is the standard deviation of the sample at half its
    size, so fine grain, which is lost there, makes nothing alike. The picture is not continued
    around its border: a repeat across it is not seen.

    Parameters
    ----------
    sample, output : array_like, (rows, cols) or (rows, cols, channels)
        At least 48 x 48 pixels each, with the same number of channels.
    step : int, optional
        From patch to patch in both directions, pixels, an even number. By default 8, or as much
        as leaves about 1024 patches.

    Returns
    -------
    share : float
        Of the output's patches, 0 to 1.
    own : float
        The same of the sample's own patches in the sample: about 0 for most materials, and large
        for a regular one such as bricks, where repeats are right. A small sample has fewer places
        where a patch could stand again, so `own` is rather too low than too high.

    Notes
    -----
    Exact for the patches of the grid, by comparing with all. Cost: about 16 G operations in single
    precision for 256 x 256 pixels in colour, growing as their number squared up to 1024 patches and
    in proportion to it beyond.
    """
    if step is not None and (step < 2 or step % 2):
        raise ValueError(f"step is {step}: give an even number of pixels, 2 or more")
    first, second = as_pair(sample, output, REPEATED_PATCH + APART)
    small, large = (halved(planes) for planes in in_deviations(first, first, second))
    own, made = (_share(planes, step) for planes in in_deviations(small, small, large))
    return Repeats(share=made, own=own)


def _share(planes: Planes, step: int | None) -> float:
    side = REPEATED_PATCH // 2
    rows, cols = (length - side + 1 for length in planes.shape[:2])
    spacing = (step or GRID) // 2
    while step is None and -(-rows // spacing) * -(-cols // spacing) > PATCHES:
        spacing += 1
    asked = np.add.outer(np.arange(0, rows, spacing) * cols, np.arange(0, cols, spacing)).ravel()
    found = nearest(planes, asked, planes, side, apart=APART // 2)
    return float((found.distance < ALIKE).mean())
