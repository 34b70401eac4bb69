# SPDX-License-Identifier: BSD-3-Clause
"""A processor array such as the MasPar MP-1: one instruction stream, one processing element (PE) per pixel.

If a picture has more pixels than the array has PEs, each PE holds several, one in each virtual layer. A SIMD pass works
on one layer; PEs without a site to relax are masked.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import prod

import numpy as np
from numpy.typing import NDArray

from simdtex.model.array import MAPPINGS
from simdtex.model.lattice import Grid
from simdtex.options import one_of

EXECUTED = (
    *("order", "levels", "overview", "boundary", "edges", "phases", "bandwidth", "xi", "relaxation", "pixel"),
    *("free_sweeps", "free_sites"),
)
"""The options that `synthesize` executes; all others have the paper's values."""

DIRECTIONS = tuple((i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j)
"""The directions of the X-Net, (rows, columns)."""


@dataclass(frozen=True)
class ProcessorArray:
    """An array, and the mapping of pictures onto it.

    Parameters
    ----------
    rows, cols : int
        Numbers of PEs, 1 or more.
    mapping : {"cut-and-stack", "hierarchical"}
        A picture larger than the array is cut into layers of the array's size, pixel (i, j) on PE (i mod rows,
        j mod cols); or each PE holds a block of ceil(height / rows) x ceil(width / cols) pixels side by side. All
        levels of the multigrid stay on the PEs of their pixels.
    """

    rows: int
    cols: int
    mapping: str = "cut-and-stack"

    def __post_init__(self) -> None:
        """Check the mapping."""
        one_of("mapping", self.mapping, MAPPINGS)

    @property
    def size(self) -> int:
        """Number of PEs."""
        return self.rows * self.cols

    def layers(self, grid: Grid) -> tuple[int, int]:
        """Return the virtual layers by rows and by columns, for the whole picture of a grid."""
        height, width = grid.pixels
        return -(-height // self.rows), -(-width // self.cols)

    def place(self, sites: NDArray[np.integer], grid: Grid) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the virtual layers of sites, and the numbers of their PEs, row by row."""
        height, width = grid.pixels
        row, col = np.divmod(grid.places(sites), width)
        (high, i), (wide, j) = self._axis(row, height, self.rows), self._axis(col, width, self.cols)
        return high * self.layers(grid)[1] + wide, i * self.cols + j

    def _axis(self, at: NDArray[np.int64], length: int, pes: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return (layer, PE) of coordinates along one axis."""
        if self.mapping == "hierarchical":
            pe, layer = np.divmod(at, -(-length // pes))
        else:
            layer, pe = np.divmod(at, pes)
        return layer, pe

    def moves(self, grid: Grid, down: int, right: int) -> list[int]:
        """Return, for each layer, the X-Net shifts that bring each PE a word from ``down`` and ``right`` pixels away.

        A shift moves one word of every PE to one of the 8 adjacent PEs, around the edges of the array. Words that stay
        on their PE take none.
        """
        if self.mapping != "hierarchical":
            return [max(abs(down), abs(right))] * prod(self.layers(grid))
        (high, wide) = self.layers(grid)
        return [max(abs((n + down) // high), abs((m + right) // wide)) for n in range(high) for m in range(wide)]

    def shifts(self, grid: Grid, offsets: NDArray[np.int32]) -> int:
        """Return the X-Net shifts that bring the sites of all layers one word from every neighbour, along a `path`."""
        s = grid.step
        return sum(sum(self.moves(grid, down * s, right * s)) for down, right, _ in path(offsets))


class PixelLayout:
    """The places of the pixels of a picture (rows, cols) on an array.

    ``padded`` is the picture padded to whole layers, ``pixel`` (layers, PEs, 2) are row and column of each PE's pixel
    in it, and ``address`` (rows, cols) is layer * PEs + PE.
    """

    def __init__(self, array: ProcessorArray, shape: tuple[int, int]) -> None:
        self.array, self.grid = array, Grid.of(shape)
        self.high, self.wide = array.layers(self.grid)
        self.padded = Grid((array.rows * self.high, array.cols * self.wide))

    @cached_property
    def address(self) -> NDArray[np.int64]:
        """The address of each pixel."""
        layer, pe = self.array.place(np.arange(self.padded.size), self.padded)
        return (layer * self.array.size + pe).reshape(self.padded.shape)

    @cached_property
    def pixel(self) -> NDArray[np.int64]:
        """The pixel at each address."""
        place = np.argsort(self.address, axis=None)
        return np.stack(np.divmod(place, self.padded.cols), 1).reshape(-1, self.array.size, 2)


def path(offsets: NDArray[np.int32]) -> list[tuple[int, int, int | None]]:
    """Return moves of one site (rows, columns) that lead from (0, 0) through all offsets, and each offset's number.

    The path goes to the offset with the fewest free ones around it. Where it is enclosed, it goes to the nearest offset
    by way of others, whose numbers are then None. Order 8 takes 24 moves, and order 18 takes 60.
    """
    free = {(i, j): index for index, (i, j) in enumerate(offsets.tolist())}
    at, moves = (0, 0), []

    def around(i: int, j: int) -> list[tuple[int, int]]:
        return [(i + di, j + dj) for di, dj in DIRECTIONS if (i + di, j + dj) in free]

    while free:
        there = min(around(*at), key=lambda o: (len(around(*o)), -(o[0] ** 2) - o[1] ** 2, o), default=None)
        if there is None:
            there = min(free, key=lambda o: (max(abs(o[0] - at[0]), abs(o[1] - at[1])), o))
        while at != there:
            step = tuple(int(np.sign(b - a)) for a, b in zip(at, there, strict=True))
            at = (at[0] + step[0], at[1] + step[1])
            moves.append((step[0], step[1], free.pop(there) if at == there else None))
    return moves
