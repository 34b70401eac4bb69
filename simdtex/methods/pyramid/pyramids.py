# SPDX-License-Identifier: BSD-3-Clause
"""Image pyramids, which split pictures into subbands of frequencies and orientations (Heeger and Bergen, 3.1).

The Laplacian pyramid is that of Burt and Adelson; the steerable pyramid has the spatial filters of Simoncelli and
co-workers. Everything is in integers, so that a pyramid has the same bits on every device.
"""

from __future__ import annotations

from itertools import pairwise
from math import prod

import numpy as np

from simdtex.machine import Machine
from simdtex.machine.interface import Array
from simdtex.methods.pyramid.laplacian import fold, laplacian_band, laplacian_collapse, laplacian_reduce, unfold
from simdtex.methods.pyramid.steerable import filters, steerable_join, steerable_split

BINOMIAL = np.outer([1, 4, 6, 4, 1], [1, 4, 6, 4, 1]).astype(np.float32) / 256
"""The filter of the Laplacian pyramid."""


class Transform:
    """A kind of pyramid on a machine: ``make`` is Make-Pyramid, ``collapse`` is Collapse-Pyramid.

    Parameters
    ----------
    machine : Machine
    kind : {"steerable", "laplacian"}
    levels : int
        Number of band-pass levels, 0 or more, without the residues.
    orientations : int
        Number of orientations of the steerable pyramid: 1, 2, 4 or 6.
    torus : bool
        Whether pictures wrap around, or continue as their mirror image.
    """

    def __init__(self, machine: Machine, kind: str, levels: int, orientations: int, torus: bool) -> None:
        self._machine, self._steerable, self._levels, self._torus = machine, kind == "steerable", levels, torus
        if self._steerable:
            taps = filters(orientations)
            self._high, self._low = machine.put(taps.high[None]), machine.put(taps.low[None])
            self._bands = machine.put(taps.bands)
            self._down = machine.put(taps.down[None])
            self._up = {gain: machine.put(np.float32(gain) * taps.down[None]) for gain in (1, 2, 4)}
        else:
            self._sources: dict[tuple[int, ...], Array] = {}
            self._binomial = {gain: machine.put(np.float32(gain) * BINOMIAL[None]) for gain in (-4, -2, -1, 1, 2, 4)}
            self._itself = machine.put(np.ones((1, 1, 1), np.float32))

    @property
    def names(self) -> list[str]:
        """The names of the subbands, in the order of `make`."""
        levels = [f"level {level}" for level in range(self._levels)]
        return [*(["high"] if self._steerable else []), *levels, "low"]

    def make(self, picture: Array) -> list[Array]:
        """Return the subbands of a picture.

        Parameters
        ----------
        picture : (planes, rows, cols) int32 array of the machine
            Each plane is transformed separately.

        Returns
        -------
        list of (bands, planes, rows, cols) int32 arrays of the machine
            Steerable: the high-pass residue H0, the oriented bands B_i of every level, finest first, the low-pass
            residue. Laplacian: b^0, b^1, ... and the low-pass residue. A level has half the rows and columns of the
            one below, rounded up. On a torus an odd number is kept, in the order of
            `simdtex.methods.pyramid.laplacian`, so that there is no seam.
        """
        if not self._steerable:
            return self._make_laplacian(picture)
        high = steerable_split(self._machine, picture, self._high, self._torus, 1)
        low = steerable_split(self._machine, picture, self._low, self._torus, 1)
        subbands = [high]
        for _ in range(self._levels):
            below = low.reshape(low.shape[1:])
            subbands.append(steerable_split(self._machine, below, self._bands, self._torus, 1))
            low = self._next(below)
        return [*subbands, low]

    def collapse(self, subbands: list[Array]) -> Array:
        """Return the picture (planes, rows, cols) that is the sum of the subbands."""
        if not self._steerable:
            return self._collapse_laplacian(subbands)
        high, *bands, low = subbands
        for band in reversed(bands):
            terms = [(band, self._bands, 1), self._previous(low, band.shape[2:])]
            low = steerable_join(self._machine, terms, band.shape[2:], self._torus)
            low = low.reshape((1, *low.shape))
        return steerable_join(self._machine, [(high, self._high, 1), (low, self._low, 1)], high.shape[2:], self._torus)

    def _folds(self, shape: tuple[int, ...]) -> bool:
        """Return whether every second pixel of a picture would not be evenly spaced around it."""
        return self._torus and any(n % 2 for n in shape)

    def _next(self, low: Array) -> Array:
        """Return 2down(L1 low), (1, planes, ...)."""
        if not self._folds(low.shape[1:]):
            return steerable_split(self._machine, low, self._down, self._torus, 2)
        blurred = steerable_split(self._machine, low, self._down, self._torus, 1)
        coarse = fold(self._machine, blurred.reshape(low.shape))
        return coarse.reshape((1, *coarse.shape))

    def _previous(self, low: Array, shape: tuple[int, int]) -> tuple[Array, Array, int]:
        """Return the term L1 2up(low) of the level below, which has the rows and columns ``shape``."""
        if not self._folds(shape):
            return low, self._up[4], 2
        gain, spread = self._spread(low.reshape(low.shape[1:]), shape)
        return spread, self._up[gain], 1

    def _spread(self, coarse: Array, shape: tuple[int, ...]) -> tuple[int, Array]:
        """Return the factor that zeros between pixels cost, and the level with zeros at the size of the one below."""
        spread = unfold(self._machine, coarse, shape)
        return prod(1 if n % 2 else 2 for n in shape), spread.reshape((1, *spread.shape))

    def _make_laplacian(self, picture: Array) -> list[Array]:
        gaussian = [picture]
        while len(gaussian) <= self._levels:
            gaussian.append(self._reduce(gaussian[-1]))
        bands = [self._band(fine, coarse) for fine, coarse in pairwise(gaussian)]
        return [band.reshape((1, *band.shape)) for band in [*bands, gaussian[-1]]]

    def _reduce(self, fine: Array) -> Array:
        if not self._folds(fine.shape[1:]):
            return laplacian_reduce(self._machine, fine, self._torus)
        blurred = steerable_split(self._machine, fine, self._binomial[1], self._torus, 1)
        return fold(self._machine, blurred.reshape(fine.shape))

    def _band(self, fine: Array, coarse: Array) -> Array:
        if not self._folds(fine.shape[1:]):
            return laplacian_band(self._machine, fine, coarse, self._torus)
        return self._plus_expanded(fine, coarse, -1)

    def _plus_expanded(self, fine: Array, coarse: Array, sign: int) -> Array:
        """Return a picture plus, or minus, the level above it expanded, on a torus with an odd side."""
        gain, spread = self._spread(coarse, fine.shape[1:])
        terms = [(fine.reshape((1, *fine.shape)), self._itself, 1), (spread, self._binomial[sign * gain], 1)]
        return steerable_join(self._machine, terms, fine.shape[1:], self._torus)

    def _collapse_laplacian(self, subbands: list[Array]) -> Array:
        *bands, picture = (band.reshape(band.shape[1:]) for band in subbands)
        for band in reversed(bands):
            shape = band.shape[1:]
            if self._folds(shape):
                picture = self._plus_expanded(band, picture, 1)
                continue
            if shape not in self._sources:
                self._sources[shape] = self._machine.put(np.arange(prod(shape), dtype=np.int32).reshape(shape))
            picture = laplacian_collapse(self._machine, band, self._sources[shape], picture, self._torus)
        return picture


def most_levels(*sides: int) -> int:
    """Return the most levels of pictures with these sides: until the shortest is a single pixel."""
    return min(sides).bit_length() - 1
