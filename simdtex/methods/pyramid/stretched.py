# SPDX-License-Identifier: BSD-3-Clause
"""The sample in integers that do not depend on its contrast, for pyramids."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.model.sample import moved
from simdtex.model.scale import stretch

TOP = 2**20
"""The largest pixel. Sums of a pyramid of up to 30 levels then fit 32 bits (kernels/pyramid/laplacian.cl)."""

BLOCK = 2**18
"""Number of values that are converted to pixels together."""

LUMA = (13933, 46871, 4732)
"""Shares of red, green and blue in the luminance, in 2**-16: 0.2126, 0.7152, 0.0722 (ITU-R BT.709)."""


class Stretched:
    """A sample stretched over 0..2**20, which removes the effect of contrast and of an added constant.

    Parameters
    ----------
    pixels : (rows, cols, channels) array
        As given by the user; any real type, finite.

    Attributes
    ----------
    planes : (channels, rows, cols) int32 array
        All channels on one scale.
    unit : float
        1 on the stretched scale in the pixels' own unit.
    """

    def __init__(self, pixels: NDArray[Any]) -> None:
        self.pixels = pixels
        planes, self.unit = stretch(np.moveaxis(pixels, -1, 0), TOP)
        self.planes = np.ascontiguousarray(planes, np.int32)

    @property
    def luminance(self) -> NDArray[np.int32]:
        """The luminance of red, green and blue if there are three channels, else their mean, (1, rows, cols)."""
        planes = self.planes.astype(np.int64)
        if len(planes) == 3:
            total = np.tensordot(np.array(LUMA), planes, 1)
            return np.asarray((total + 2**15) >> 16, np.int32)[None]
        return np.asarray((2 * planes.sum(0) + len(planes)) // (2 * len(planes)), np.int32)[None]

    def picture(self, values: NDArray[np.int32], source: NDArray[np.int32] | None = None) -> NDArray[Any]:
        """Return the picture of stretched values, projected onto legal pixels of the sample's type.

        Parameters
        ----------
        values : (channels, rows, cols) int32 array
            Values on the stretched scale; they may lie beyond it.
        source : (rows, cols) int32 array, optional
            Index of the sample pixel that each was taken from. Where the value is unchanged, the result is that pixel,
            to the bit, whatever its type.

        Returns
        -------
        (rows, cols, channels) array
        """
        _, rows, cols = values.shape
        made = np.empty((rows, cols, len(values)), self.pixels.dtype)
        step = max(1, BLOCK // (cols * len(values)))
        for first in range(0, rows, step):  # double precision, for some rows at a time
            part = slice(first, first + step)
            made[part] = self._picture(values[:, part], None if source is None else source[part])
        return made

    def _picture(self, values: NDArray[np.int32], source: NDArray[np.int32] | None) -> NDArray[Any]:
        pixels: NDArray[Any] = self.pixels.min()
        by = np.moveaxis(values, 0, -1).astype(np.float64)
        if source is not None:
            pixels = self.pixels.reshape(-1, self.pixels.shape[-1])[source]
            by -= np.moveaxis(self.planes.reshape(len(self.planes), -1)[:, source], 0, -1)
        return moved(pixels, by, self.unit, self.pixels)
