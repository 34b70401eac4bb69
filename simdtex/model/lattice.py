# SPDX-License-Identifier: BSD-3-Clause
"""Lattices, neighbourhoods and boundaries: equations (3), (10) and (11)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import isqrt, prod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.options import whole

MOST_ORDER = 4096
"""The largest order of a neighbourhood: 64 pixels to each side, 12852 neighbours."""


LAYER = 2**16
"""Rows that represent a layer in an offset: (layers * LAYER + rows, columns)."""


def neighbourhood_offsets(order: int, axes: int = 2) -> NDArray[np.int32]:
    """Return the offsets r - s of the neighbourhood of an order, equation (3): (N, 2) int32, row and column.

    The neighbours are the sites within the distance sqrt(order), 1 to `MOST_ORDER`, in canonical order: by distance,
    then layer, then row, then column. Order 1 has 4, order 8 has 24, order 18 has 60. With 3 ``axes`` the neighbourhood
    is a ball, and the row of an offset includes its layers in units of `LAYER`: order 1 has 6, order 8 has 92.
    """
    whole("order", order, 1, MOST_ORDER)
    radius = isqrt(order)
    side = slice(-radius, radius + 1)
    layer, row, col = np.mgrid[side if axes > 2 else slice(0, 1), side, side].reshape(3, -1)
    squared = layer * layer + row * row + col * col
    inside = (squared > 0) & (squared <= order)
    layer, row, col, squared = layer[inside], row[inside], col[inside], squared[inside]
    canonical = np.lexsort((col, row, layer, squared))
    return np.stack([layer * LAYER + row, col], 1)[canonical].astype(np.int32)


def parts_of(offsets: NDArray[np.integer[Any]]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Return layers, rows and columns of offsets (N, 2), each (N,)."""
    layer = (offsets[:, 0] + LAYER // 2) // LAYER
    return layer, offsets[:, 0] - layer * LAYER, offsets[:, 1]


LATTICE = np.dtype(
    [
        (name, np.int32)
        for name in (
            *("rows", "cols", "spacing", "width", "around_rows", "around_cols", "tile_rows", "tile_cols", "elsewhere"),
            *("top", "left", "whole_rows", "whole_cols", "step", "whole_width", "layers", "high", "height"),
        )
    ],
    align=True,
)
"""The struct ``Lattice`` of kernels/common/lattice.h."""


class Part(NamedTuple):
    """The position of a window in the whole lattice.

    ``top``, ``left``, the row and column of its first site in the whole lattice; ``rows``, ``cols``, the size of the
    whole lattice; ``step``, 2**level, the spacing of sites in pixels of the whole picture; ``width``, the columns of
    that picture.
    """

    top: int
    left: int
    rows: int
    cols: int
    step: int
    width: int


@dataclass(frozen=True)
class Grid:
    """The lattice of one level in a picture, equation (10), with sites (spacing i, spacing j); or a window of it.

    It may also be the lattice of a volume, whose layers lie one below another: open, without windows and tiles.

    Parameters
    ----------
    height, width : int
        Size of the picture that holds the lattice, or of a layer of the volume, in pixels.
    spacing : int
        Pixels of that picture from site to site: 2**level, or 1 in a window.
    torus : bool
        Whether rows and columns of the whole wrap around.
    tile : (int, int), optional
        Rows and columns of tiles, in sites of the grid. Neighbours in another tile are then read from an older
        picture, `plane` pixels further on in the buffer (`simdtex.ops.snapshot`).
    part : Part, optional
        The position in the whole of a window that `window` has made.
    layers : int
        Layers of pixels of a volume; 1: a picture.

    Notes
    -----
    The place of a site in the whole is the key of its random numbers, and its address in a buffer is not. So a window
    relaxes like the same sites of the whole, as far as it holds their neighbourhoods.
    """

    height: int
    width: int
    spacing: int = 1
    torus: bool = True
    tile: tuple[int, int] | None = None
    part: Part | None = None
    layers: int = 1

    @classmethod
    def of(cls, shape: tuple[int, ...], spacing: int = 1, torus: bool = True) -> Grid:
        """Return the lattice of a whole picture (rows, cols) or volume (layers, rows, cols)."""
        return cls(shape[-2], shape[-1], spacing, torus, layers=shape[0] if len(shape) > 2 else 1)

    @property
    def pixels(self) -> tuple[int, ...]:
        """The shape of the picture, or of the volume."""
        return (self.height, self.width) if self.layers == 1 else (self.layers, self.height, self.width)

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of the grid: (rows, cols), or (layers, rows, cols) of a volume."""
        return tuple(-(-side // self.spacing) for side in self.pixels)

    @property
    def size(self) -> int:
        """Number of sites."""
        return prod(self.shape)

    @property
    def rows(self) -> int:
        """Number of rows of the grid, or of each of its layers."""
        return -(-self.height // self.spacing)

    @property
    def cols(self) -> int:
        """Number of columns of the grid."""
        return -(-self.width // self.spacing)

    @property
    def plane(self) -> int:
        """Number of pixels of the picture that holds the grid, or of the volume."""
        return prod(self.pixels)

    @property
    def within(self) -> Part:
        """The position of the grid in the whole lattice; the whole is at (0, 0)."""
        return self.part or Part(0, 0, self.rows, self.cols, self.spacing, self.width)

    @property
    def step(self) -> int:
        """Pixels of the whole picture, and of the sample, from site to site: 2**level."""
        return self.within.step

    @property
    def around(self) -> tuple[bool, bool]:
        """Whether rows wrap around, and whether columns do: on a torus, if the grid is as large as the whole."""
        whole = self.within
        return self.torus and self.rows == whole.rows, self.torus and self.cols == whole.cols

    @cached_property
    def struct(self) -> np.void:
        """The grid as a kernel argument, of the type `LATTICE`."""
        whole, numbers, deep = self.within, np.zeros((), LATTICE), self.size // (self.rows * self.cols)
        for name, value in {
            **{"layers": deep, "high": self.rows, "height": self.height},
            **{"rows": deep * self.rows, "cols": self.cols, "spacing": self.spacing, "width": self.width},
            **{"around_rows": self.around[0], "around_cols": self.around[1], "elsewhere": self.plane},
            **dict(zip(("tile_rows", "tile_cols"), self.tile or (0, 0), strict=True)),
            **{"top": whole.top, "left": whole.left, "whole_rows": whole.rows, "whole_cols": whole.cols},
            **{"step": whole.step, "whole_width": whole.width},
        }.items():
            numbers[name] = value
        struct: np.void = numbers[()]  # type: ignore[assignment]
        return struct

    def window(self, top: int, left: int, rows: int, cols: int) -> Grid:
        """Return a window of this lattice in a picture of its own, with one pixel for each site.

        ``top`` and ``left`` are row and column of its first site; on a torus they may have any value, and the window
        continues across the seam. Raises ValueError if it is larger than the whole or, on an open lattice, reaches
        beyond it.
        """
        whole = self.within
        if not (0 < rows <= whole.rows and 0 < cols <= whole.cols):
            raise ValueError(f"a window of {rows}x{cols} sites does not fit a lattice of {whole.rows}x{whole.cols}")
        top, left = whole.top + top, whole.left + left
        if self.torus:
            top, left = top % whole.rows, left % whole.cols
        elif not (0 <= top <= whole.rows - rows and 0 <= left <= whole.cols - cols):
            raise ValueError("a window of an open lattice must lie in it")
        return Grid(rows, cols, 1, self.torus, None, whole._replace(top=top, left=left))

    @property
    def whole(self) -> Grid:
        """The whole lattice of this window, with one pixel for each site; the grid itself if it is no window."""
        return self.window(-self.within.top, -self.within.left, *self.within[2:4]) if self.part else self

    @property
    def flat(self) -> Grid:
        """The same sites as a separate lattice, numbered 0 .. rows * cols - 1."""
        return Grid.of(self.shape, 1, self.torus)

    @property
    def above(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """First row and rows, and first column and columns, of the sites that the level above shares with this grid."""
        (top, rows), (left, cols) = (
            (-(-first // 2), (first + size + 1) // 2 - -(-first // 2))
            for first, size in ((self.within.top, self.rows), (self.within.left, self.cols))
        )
        return (top, rows), (left, cols)

    def cut(self, whole: NDArray[Any]) -> NDArray[Any]:
        """Return the window's part of an array (..., rows, cols) over the whole lattice."""
        row = (self.within.top + np.arange(self.rows)) % self.within.rows
        col = (self.within.left + np.arange(self.cols)) % self.within.cols
        return whole[..., row[:, None], col[None, :]]

    def sites(self) -> NDArray[np.int32]:
        """Return the pixel index of every site, (size,), row by row."""
        row = np.arange(self.rows, dtype=np.int32)[:, None] * np.int32(self.width)
        col = np.arange(self.cols, dtype=np.int32)[None, :]
        layer = np.arange(self.size // (self.rows * self.cols), dtype=np.int32)[:, None, None]
        sites: NDArray[np.int32] = layer * np.int32(self.height * self.width) + row + col
        return (sites * np.int32(self.spacing)).ravel()

    def pixel_of(self, place: Sequence[NDArray[Any]]) -> NDArray[np.int64]:
        """Return the pixel indices of sites by their row and column, or layer, row and column, each (n,)."""
        return np.ravel_multi_index(tuple(line * self.spacing for line in place), self.pixels).astype(np.int64)

    def places(self, sites: NDArray[np.integer[Any]]) -> NDArray[np.int64]:
        """Return the pixel indices of sites of this grid in the whole picture: the keys of random numbers."""
        if self.layers > 1:
            return sites.astype(np.int64)
        whole = self.within
        row, col = np.divmod(sites.astype(np.int64), self.width)
        row = (whole.top + row // self.spacing) % whole.rows
        col = (whole.left + col // self.spacing) % whole.cols
        places: NDArray[np.int64] = (row * whole.width + col) * whole.step
        return places

    def view(self, picture: NDArray[Any]) -> NDArray[Any]:
        """Return a view of the sites of this grid in a picture (..., H, W), without older pictures below it.

        For a volume, a view of (..., D, H, W).
        """
        if self.layers > 1:
            return picture[..., :: self.spacing, :: self.spacing, :: self.spacing]
        return picture[..., : self.height : self.spacing, :: self.spacing]

    def neighbours(self, sites: NDArray[np.int32], offsets: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return each neighbour's pixel index, (N, S); -1 outside an open lattice or a window, and for the site itself.

        If there are tiles, `plane` is added to the index of a neighbour in another tile.
        """
        if self.layers > 1:
            return self._among_layers(sites, offsets)
        row = sites // self.width // self.spacing
        col = sites % self.width // self.spacing
        k = row[None, :] + offsets[:, 0, None]
        m = col[None, :] + offsets[:, 1, None]
        around_rows, around_cols = self.around
        k = k % self.rows if around_rows else k
        m = m % self.cols if around_cols else m
        inside = (k >= 0) & (k < self.rows) & (m >= 0) & (m < self.cols)
        itself = (k == row) & (m == col)
        pixel = (k * self.width + m) * self.spacing
        if self.tile:
            high, wide = self.tile
            apart = (k // high != row // high) | (m // wide != col // wide)
            pixel = pixel + apart * self.plane
        return np.where(inside & ~itself, pixel, -1).astype(np.int32)

    def _among_layers(self, sites: NDArray[np.int32], offsets: NDArray[np.int32]) -> NDArray[np.int32]:
        pixel = np.stack(np.unravel_index(sites, self.pixels))[:, None, :]
        there = pixel // self.spacing + np.stack(parts_of(offsets))[:, :, None]
        inside = ((there >= 0) & (there < np.array(self.shape)[:, None, None])).all(0)
        layer, row, col = there * self.spacing
        return np.where(inside, (layer * self.height + row) * self.width + col, -1).astype(np.int32)


@dataclass(frozen=True)
class Sublattice:
    """The sites n (a, 0) + m (b, c), (row, column); the a * c cosets are the colours of a lattice colouring."""

    a: int
    b: int
    c: int

    @property
    def index(self) -> int:
        """Number of cosets."""
        return self.a * self.c

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
    layer, row, col = parts_of(neighbourhood_offsets(order, 3).astype(np.int64))
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
                found = Sublattice(index // c, b, c)
                fitting = rows is None or cols is None or found.fits(rows, cols)
                if fitting and found.shortest() > order:
                    return found
    return None


def sums_around(values: NDArray[Any], reach: int) -> NDArray[np.int64]:
    """Return the sum of integers over 2 reach + 1 places along each axis around each place, clipped to the array."""
    found: NDArray[np.int64] = values.astype(np.int64)
    for axis, n in enumerate(values.shape):
        running = np.zeros((*found.shape[:axis], n + 1, *found.shape[axis + 1 :]), np.int64)
        found.cumsum(axis, out=running[(slice(None),) * axis + (slice(1, None),)])
        at = np.arange(n)
        found = running.take(np.minimum(at + reach + 1, n), axis) - running.take(np.maximum(at - reach, 0), axis)
    return found
