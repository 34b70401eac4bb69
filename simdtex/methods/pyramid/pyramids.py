# SPDX-License-Identifier: BSD-3-Clause
"""Image pyramids: pictures as subbands of several frequencies, and orientations, and back (Heeger and Bergen, 3.1).

The Laplacian pyramid is that of Burt and Adelson; the steerable pyramid has the spatial filters of Simoncelli and
co-workers. Everything is in integers, so that a pyramid has the same bits on every device.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import prod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex.io.image import check_sample
from simdtex.machine import Machine, open_machine
from simdtex.machine.interface import Array
from simdtex.methods.pyramid.options import check_kind
from simdtex.model.stretched import Stretched
from simdtex.ops.fold import fold, folded, unfold
from simdtex.ops.laplacian import laplacian_band, laplacian_collapse, laplacian_reduce
from simdtex.ops.steerable import steerable_join, steerable_split
from simdtex.ops.steerable_filters import filters
from simdtex.options import one_of, whole

__all__ = ["Pyramid", "Transform", "decompose"]

BINOMIAL = np.outer([1, 4, 6, 4, 1], [1, 4, 6, 4, 1]).astype(np.float32) / 256
"""Of the Laplacian pyramid."""


class Transform:
    """A kind of pyramid on a machine: ``make`` is Make-Pyramid, ``collapse`` is Collapse-Pyramid.

    Parameters
    ----------
    machine : Machine
    kind : {"steerable", "laplacian"}
    levels : int
        Band-pass levels, 0 or more, beside the residues.
    orientations : int
        Of the steerable pyramid: 1, 2, 4 or 6.
    torus : bool
        Whether pictures wrap around, or continue as in a mirror.
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
        """Of the subbands, in the order of `make`."""
        levels = [f"level {level}" for level in range(self._levels)]
        return [*(["high"] if self._steerable else []), *levels, "low"]

    def make(self, picture: Array) -> list[Array]:
        """Return the subbands of a picture.

        Parameters
        ----------
        picture : (planes, rows, cols) int32 array of the machine
            Every plane on its own.

        Returns
        -------
        list of (bands, planes, rows, cols) int32 arrays of the machine
            Steerable: the high-pass residue H0, the oriented bands B_i of every level, finest first, the low-pass
            residue. Laplacian: b^0, b^1, ... and the low-pass residue. A level has half the rows and columns of the
            one below, rounded up; but on a torus as many where they are odd, in the order of `simdtex.ops.fold`, so
            that there is no seam.
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
        """Return the picture (planes, rows, cols) that subbands add up to."""
        if not self._steerable:
            return self._collapse_laplacian(subbands)
        high, *bands, low = subbands
        for own in reversed(bands):
            terms = [(own, self._bands, 1), self._previous(low, own.shape[2:])]
            low = steerable_join(self._machine, terms, own.shape[2:], self._torus)
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
        """Return the term of the level below, of these rows and columns, that is L1 2up(low)."""
        if not self._folds(shape):
            return low, self._up[4], 2
        gain, spread = self._spread(low.reshape(low.shape[1:]), shape)
        return spread, self._up[gain], 1

    def _spread(self, coarse: Array, shape: tuple[int, ...]) -> tuple[int, Array]:
        """Return a level at its places on the one below, (1, planes, ...), and what the zeros between take away."""
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


@dataclass(frozen=True)
class Pyramid:
    """A picture as subbands.

    Attributes
    ----------
    subbands : list of (bands, channels, rows, cols) float64 arrays
        In the picture's unit. Steerable: the high-pass residue, the oriented bands of every level, finest first, the
        low-pass residue; orientation i as in `simdtex.ops.steerable_filters.filters`. Laplacian: a band for every level
        and the low-pass residue. A low-pass picture has the mean of what it was made from, at every level. A level has
        half the rows and columns of the one below, rounded up; on a torus as many where they are odd.
    kind, orientations, boundary
        As given to `decompose`.
    offset : float
        What is to be added to the low-pass residue to have the picture's own zero.
    unit : float
        The subbands are whole multiples of it.
    """

    subbands: list[NDArray[np.float64]]
    kind: str
    orientations: int
    boundary: str
    offset: float
    unit: float

    def collapse(self, *, device: str | Machine | None = None) -> NDArray[np.float64]:
        """Return the picture (rows, cols, channels) that the subbands add up to.

        Subbands may have been changed, but for their shapes. An unchanged Laplacian pyramid gives back the picture to
        half a unit, and another for every level with an odd side on a torus; the steerable filters lose some
        thousandths of its standard deviation, and some hundredths in a mirror, near the edges.
        """
        machine = open_machine(device)
        levels = len(self.subbands) - (2 if self.kind == "steerable" else 1)
        whole_numbers = [_whole(band / self.unit) for band in self.subbands]
        if self.boundary == "torus":
            orders = _orders(self.subbands[0].shape[2:], levels, self.kind)
            whole_numbers = [band[..., r[:, None], c] for band, (r, c) in zip(whole_numbers, orders, strict=True)]
        transform = Transform(machine, self.kind, levels, self.orientations, self.boundary == "torus")
        picture = machine.get(transform.collapse([machine.put(band) for band in whole_numbers]))
        return np.ascontiguousarray(np.moveaxis(picture * self.unit + self.offset, 0, -1))


def decompose(
    image: ArrayLike,
    *,
    kind: str = "steerable",
    levels: int = 4,
    orientations: int = 4,
    boundary: str = "open",
    channel_axis: int | None = None,
    device: str | Machine | None = None,
) -> Pyramid:
    """Return the pyramid of a picture.

    Parameters
    ----------
    image : (rows, cols) or, with `channel_axis`, (rows, cols, channels) array
        Any real type, finite.
    kind : {"steerable", "laplacian"}
    levels : int
        Band-pass levels, 0 or more.
    orientations : int
        Of the steerable pyramid: 1, 2, 4 or 6.
    boundary : {"open", "torus"}
        Whether the picture continues as in a mirror, or wraps around.
    channel_axis : int, optional
        The axis that holds channels.
    device : str, optional
        As in `simdtex.synthesize`.

    Returns
    -------
    Pyramid

    Raises
    ------
    ValueError, TypeError
        What is wrong and what would be right, in one sentence.

    Notes
    -----
    Values are rounded to 2**-20 of the picture's range at every level. Cost of the steerable pyramid with 4
    orientations: some 840 multiply-adds a pixel.

    Examples
    --------
    >>> from skimage import data
    >>> from simdtex.methods.pyramid.pyramids import decompose
    >>> pyramid = decompose(data.brick()[:64, :64], levels=2)
    >>> [band.shape for band in pyramid.subbands]
    [(1, 1, 64, 64), (4, 1, 64, 64), (4, 1, 32, 32), (1, 1, 16, 16)]
    """
    whole("levels", levels, 0)
    check_kind(kind, levels, orientations)
    one_of("boundary", boundary, ("open", "torus"))
    pixels = check_sample(image, channel_axis)
    if levels > most_levels(*pixels.shape[:2]):
        raise ValueError(f"levels={levels} is too many for this picture; give at most {most_levels(*pixels.shape[:2])}")
    machine = open_machine(device)
    picture = Stretched(pixels)
    transform = Transform(machine, kind, levels, orientations, boundary == "torus")
    subbands: list[Any] = [machine.get(band) for band in transform.make(machine.put(picture.planes))]
    if boundary == "torus":
        orders = _orders(pixels.shape[:2], levels, kind)
        natural = [(np.argsort(rows)[:, None], np.argsort(cols)) for rows, cols in orders]
        subbands = [band[..., rows, cols] for band, (rows, cols) in zip(subbands, natural, strict=True)]
    offset = float(pixels.min())
    return Pyramid([band * picture.unit for band in subbands], kind, orientations, boundary, offset, picture.unit)


def _whole(values: NDArray[np.float64]) -> NDArray[np.int32]:
    if not (np.abs(values) < 2**26).all():  # sums of some of them fit 32 bits
        raise ValueError("a subband has a value that is NaN, infinite or beyond 64 times the picture's range")
    return np.asarray(np.rint(values), np.int32)


def _orders(shape: tuple[int, ...], levels: int, kind: str) -> list[tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Return the ranks of the rows and columns of every subband among those of the picture, on a torus."""
    places = [np.arange(n) for n in shape]
    found = []
    for _ in range(levels + 1):
        rows, cols = (np.argsort(np.argsort(place)) for place in places)
        found.append((rows, cols))
        places = [place[folded(place.size)] for place in places]
    return [found[0], *found] if kind == "steerable" else found
