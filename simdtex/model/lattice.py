# SPDX-License-Identifier: BSD-3-Clause
"""Lattices, neighbourhoods and boundaries: equations (3), (10) and (11)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import chain
from math import isqrt, prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.options import whole

MOST_ORDER = 4096
"""The largest order of a neighbourhood: 64 pixels to each side, 12852 neighbours."""


def neighbourhood_offsets(order: int, axes: int = 2) -> NDArray[np.int32]:
    """Return the offsets r - s of the neighbourhood of an order, equation (3): (N, axes) int32, in sites.

    The neighbours are the sites within the distance sqrt(order) in canonical order: by distance, then layer, then row,
    then column. Order 8 has 24; with 3 ``axes``, layer, row and column, 92.
    """
    whole("order", order, 1, MOST_ORDER)
    radius = isqrt(order)
    place = np.indices((2 * radius + 1,) * axes).reshape(axes, -1).T - radius
    squared = (place**2).sum(1)
    inside = (squared > 0) & (squared <= order)
    offsets: NDArray[np.int32] = place[inside][np.argsort(squared[inside], kind="stable")].astype(np.int32)
    return offsets


def in_three_axes(offsets: NDArray[Any]) -> NDArray[Any]:
    """Return offsets (N, 2 or 3) as layers, rows and columns, (N, 3)."""
    return np.pad(offsets, ((0, 0), (3 - offsets.shape[1], 0)))


AXES = ("layers", "rows", "cols")

LATTICE = np.dtype(
    [
        (name, np.int32)
        for name in (
            *(*AXES, "around_layers", "around_rows", "around_cols", "front", "top", "left"),
            *("whole_layers", "whole_rows", "whole_cols", "step", "picture_rows", "picture_cols"),
            *("tile_rows", "tile_cols", "elsewhere"),
        )
    ]
    + [("begin", np.uint64)],
    align=True,
)
"""The struct ``Lattice`` of kernels/common/lattice.h."""


@dataclass(frozen=True)
class Grid:
    """The lattice of one level, equation (10), or a window of it: an array of sites with a shape and an origin.

    Sites have numbers in C order. The place of a site in the whole is the key of its random numbers, and its number in
    a window is not: a window relaxes like the same sites of the whole, as far as it holds their neighbourhoods.

    With a ``tile``, neighbours in another tile are read from an older picture, which lies below the picture in the same
    array (`simdtex.methods.mrf.snapshot`).
    """

    shape: tuple[int, ...]  # [layers,] rows and columns of sites
    torus: bool = True  # whether all axes of the whole lattice wrap around
    step: int = 1  # pixels from site to site: 2**level
    picture: tuple[int, ...] | None = None  # the shape of the whole in pixels; None: one for each site
    origin: tuple[int, ...] | None = None  # of a window, its first site in the whole lattice
    tile: tuple[int, int] | None = None  # rows and columns
    key: tuple[int, int, int] = (0, 0, 1)  # the first pixel in a larger output, its columns, pixels along a pixel

    @classmethod
    def of(cls, picture: tuple[int, ...], step: int = 1, torus: bool = True) -> Grid:
        """Return the lattice of a whole picture (rows, cols) or volume (layers, rows, cols), in pixels."""
        return cls(tuple(-(-side // step) for side in picture), torus, step, tuple(picture))

    @property
    def pixels(self) -> tuple[int, ...]:
        """The shape of the whole picture or volume, in pixels."""
        return self.picture or self.shape

    @property
    def size(self) -> int:
        """Number of sites."""
        return prod(self.shape)

    @property
    def rows(self) -> int:
        """Number of rows, of each layer in a volume."""
        return self.shape[-2]

    @property
    def cols(self) -> int:
        """Number of columns."""
        return self.shape[-1]

    @property
    def layered(self) -> bool:
        """Whether the sites are those of a volume."""
        return len(self.shape) > 2

    @property
    def first(self) -> tuple[int, ...]:
        """The place of the first site in the whole lattice."""
        return self.origin or (0,) * len(self.shape)

    @property
    def whole(self) -> Grid:
        """The whole lattice of this window, without tiles; an equal grid if this is the whole."""
        return Grid.of(self.pixels, self.step, self.torus)

    @property
    def around(self) -> tuple[bool, ...]:
        """Whether each axis wraps around: on a torus, if the grid is as long as the whole."""
        return tuple(self.torus and n == whole for n, whole in zip(self.shape, self.whole.shape, strict=True))

    @property
    def defines(self) -> dict[str, int]:
        """-D constants of kernels."""
        return {"AXES": 3} if self.layered else {}

    @cached_property
    def struct(self) -> np.void:
        """The grid as a kernel argument, of the type `LATTICE`."""
        numbers = np.zeros((), LATTICE)
        ones, none = (1,) * (3 - len(self.shape)), (0,) * (3 - len(self.shape))
        axes = (*ones, *self.shape), (*none, *self.around), (*none, *self.first), (*ones, *self.whole.shape)
        (*_, rows, cols), (begin, across, size) = self.pixels, self.key
        others = (self.step * size, rows, across or cols, *(self.tile or (0, 0)), self.size, begin)
        numbers[()] = (*chain(*axes), *others)
        struct: np.void = numbers[()]  # type: ignore[assignment]
        return struct

    def window(self, top: int, left: int, rows: int, cols: int) -> Grid:
        """Return a window of this lattice of a picture; on a torus it may continue across the seam."""
        sides, first = self.whole.shape, np.add(self.first, (top, left))
        if not (0 < rows <= sides[0] and 0 < cols <= sides[1]):
            raise ValueError(f"a window of {rows}x{cols} sites does not fit a lattice of {sides[0]}x{sides[1]}")
        if self.torus:
            first %= sides
        elif (first < 0).any() or (np.add(first, (rows, cols)) > sides).any():
            raise ValueError("a window of an open lattice must lie in it")
        origin = (int(first[0]), int(first[1]))
        return replace(self, shape=(rows, cols), picture=self.pixels, origin=origin, tile=None)

    @property
    def above(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """First row and rows, and first column and columns, of the sites of the level above in or before this grid."""
        lines = zip(self.first, self.shape, strict=True)
        (top, rows), (left, cols) = ((first // 2, (first + size + 1) // 2 - first // 2) for first, size in lines)
        return (top, rows), (left, cols)

    def lines(self) -> list[NDArray[np.int64]]:
        """Return the layers, rows and columns of the whole lattice in which the sites lie, as far as there are any."""
        return [
            (first + np.arange(n)) % whole
            for first, n, whole in zip(self.first, self.shape, self.whole.shape, strict=True)
        ]

    def cut(self, whole: NDArray[Any]) -> NDArray[Any]:
        """Return the window's part of an array (..., rows, cols) over the whole lattice."""
        there: tuple[Any, ...] = (..., *np.ix_(*self.lines()))
        return whole[there] if self.origin else whole

    def near_edge(self, radius: int) -> NDArray[np.int32]:
        """Return how far, in sites, the neighbourhood of each site, of this radius, reaches beyond an open lattice."""
        beyond = np.zeros(self.shape, np.int32)
        if not self.torus:
            for near, n in zip(np.ix_(*self.lines()), self.whole.shape, strict=True):
                beyond = np.maximum(beyond, radius - np.minimum(near, n - 1 - near)).astype(np.int32)
        return beyond

    def places(self, sites: NDArray[np.integer[Any]]) -> NDArray[np.int64]:
        """Return the pixel indices of sites of this grid in the whole output: the keys of random numbers."""
        lines = self.lines()
        place = [line[at] * self.step for line, at in zip(lines, np.unravel_index(sites, self.shape), strict=True)]
        (*high, cols), (begin, across, size) = self.pixels, self.key
        return begin + size * np.ravel_multi_index(tuple(place), (*high, across or cols))

    def decimated(self, picture: NDArray[Any]) -> NDArray[Any]:
        """Return the pixels of the whole picture (..., H, W), or volume, at the sites of the whole lattice."""
        there: Any = (..., *(slice(None, None, self.step),) * len(self.shape))
        return np.asarray(picture[there])

    def latest(self, array: NDArray[Any]) -> NDArray[Any]:
        """Return an array over sites (..., rows, cols) without the older picture below it, if there is one."""
        return array[..., : self.rows, :]

    def neighbours(self, sites: NDArray[np.int32], offsets: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return each neighbour's number, (N, S), plus `size` in another tile; -1 for none, and for the site itself."""
        itself = np.stack(np.unravel_index(sites, self.shape))[:, None]
        there = itself + offsets.T[:, :, None]
        sides = np.array(self.shape)[:, None, None]
        there = np.where(np.array(self.around)[:, None, None], there % sides, there)
        inside = ((there >= 0) & (there < sides)).all(0) & (there != itself).any(0)
        index = np.ravel_multi_index(tuple(np.where(inside, there, 0)), self.shape)
        if self.tile:
            tile = np.array(self.tile)[:, None, None]
            index = index + (there // tile != itself // tile).any(0) * self.size
        return np.where(inside, index, -1).astype(np.int32)


@dataclass(frozen=True)
class Sublattice:
    """The sites n (a, 0) + m (b, c), (row, column); the a * c cosets are the colours of a lattice colouring.

    In layer k and row i of a volume, the row that counts here is ``layers`` k + ``rows`` i.
    """

    a: int
    b: int
    c: int
    layers: int = 0
    rows: int = 1

    @property
    def index(self) -> int:
        """Number of cosets."""
        return self.a * self.c

    def coset(self, row: Any, col: Any, layer: Any = 0) -> Any:
        """Return the numbers of the cosets of sites, 0 to a * c - 1; rows and columns are arrays, or plural."""
        turned = row * self.rows - col // self.c * self.b + layer * self.layers
        return turned % self.a * self.c + col % self.c

    def shortest(self) -> int:
        """Return the squared length of the shortest vector."""
        reach = isqrt(2 * self.a * self.c) + 1
        best = self.a * self.a
        for m in range(1, reach // self.c + 2):
            row = (m * self.b) % self.a
            row = min(row, self.a - row)
            best = min(best, row * row + (m * self.c) ** 2)
        return best

    def fits(self, rows: int, cols: int) -> bool:
        """Return whether a torus of this size holds the pattern without a seam."""
        return rows % self.a == 0 and cols % self.c == 0 and (cols // self.c * self.b) % self.a == 0


@lru_cache(maxsize=64)
def coloring_of_layers(order: int) -> tuple[int, int, int]:
    """Return (m, a, b) with the fewest colours m for which (a layer + b row + column) mod m differs among neighbours.

    The neighbourhood of ``order`` in three dimensions is a ball. Order 8 needs 21 colours.
    """
    layer, row, col = neighbourhood_offsets(order, 3).astype(np.int64).T
    for m in range(2, 8 * (isqrt(order) + 1) ** 3):
        a, b = np.mgrid[:m, :m].reshape(2, -1, 1)
        apart = ((a * layer + b * row + col) % m != 0).all(1)
        if apart.any():
            best = int(apart.argmax())
            return m, int(a[best, 0]), int(b[best, 0])
    raise AssertionError("m = (isqrt(order) + 1) ** 3 has such a pattern")


@lru_cache(maxsize=64)
def coloring_sublattice(
    order: int, rows: int | None = None, cols: int | None = None, limit: int | None = None
) -> Sublattice | None:
    """Return the sublattice with the fewest cosets whose shortest vector is longer than sqrt(``order``).

    ``rows`` and ``cols`` are the size of a torus that the pattern must fit; without them, the result is the best of the
    plane. ``limit`` is the most cosets to try; a square pattern needs at most the default, (isqrt(order) + 1)**2.
    Index 2 for order 1, 4 for 2, 9 for 8, 20 for 18; None if no torus of this size has one.
    """
    for index in range(1, (limit or (isqrt(order) + 1) ** 2) + 1):
        for c in range(1, index + 1):
            if index % c or (cols is not None and cols % c):
                continue
            for b in range(index // c):
                lattice = Sublattice(index // c, b, c)
                fitting = rows is None or cols is None or lattice.fits(rows, cols)
                if fitting and lattice.shortest() > order:
                    return lattice
    return None


def gathered(array: NDArray[Any], index: NDArray[np.integer[Any]], none: float) -> NDArray[Any]:
    """Return ``array[..., index]``, and ``none`` where the index is negative: there is nothing to read."""
    there = index >= 0
    taken = np.full((*array.shape[:-1], *index.shape), none, array.dtype)
    taken[..., there] = array[..., index[there]]
    return taken


def sums_around(values: NDArray[Any], reach: int) -> NDArray[np.int64]:
    """Return the sum of integers over 2 reach + 1 places along each axis around each place, clipped to the array."""
    total: NDArray[np.int64] = values.astype(np.int64)
    for axis, n in enumerate(values.shape):
        running = np.zeros((*total.shape[:axis], n + 1, *total.shape[axis + 1 :]), np.int64)
        total.cumsum(axis, out=running[(slice(None),) * axis + (slice(1, None),)])
        at = np.arange(n)
        total = running.take(np.minimum(at + reach + 1, n), axis) - running.take(np.maximum(at - reach, 0), axis)
    return total
