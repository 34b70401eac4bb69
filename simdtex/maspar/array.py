# SPDX-License-Identifier: BSD-3-Clause
"""A processor array such as the MasPar MP-1: one instruction stream, one processing element (PE) per pixel.

If a picture has more pixels than the array has PEs, each PE holds several, one in each virtual layer. A SIMD pass works
on one layer; PEs without a site to relax are masked.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from simdtex.model.lattice import Grid
from simdtex.options import one_of, shown

MAPPINGS = ("cut-and-stack", "hierarchical")

ARRAYS = {
    "maspar-mp1-1k": (32, 32),
    "maspar-mp1-2k": (32, 64),
    "maspar-mp1-4k": (64, 64),
    "maspar-mp1-8k": (64, 128),
    "maspar-mp1-16k": (128, 128),
}
"""Rows and columns of the models of the MP-1."""

LARGEST = 2**22
"""PEs of the largest array."""


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
        return -(-grid.height // self.rows), -(-grid.width // self.cols)

    def place(self, sites: NDArray[np.int32], grid: Grid) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the virtual layers of pixel indices, and the numbers of their PEs, row by row."""
        row, col = np.divmod(sites.astype(np.int64), grid.width)
        (high, i), (wide, j) = self._axis(row, grid.height, self.rows), self._axis(col, grid.width, self.cols)
        return high * self.layers(grid)[1] + wide, i * self.cols + j

    def _axis(self, at: NDArray[np.int64], length: int, pes: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return (layer, PE) of coordinates along one axis."""
        if self.mapping == "hierarchical":
            pe, layer = np.divmod(at, -(-length // pes))
        else:
            layer, pe = np.divmod(at, pes)
        return layer, pe

    def shifts(self, grid: Grid, offsets: NDArray[np.int32]) -> NDArray[np.int64]:
        """Return the X-Net shifts that bring each PE one word from every neighbour of its site, per layer (layers,).

        A shift moves one word of every PE to one of the 8 adjacent PEs, around the edges of the array. A neighbour that
        is d rows and e columns of PEs away takes ``max(|d|, |e|)`` of them; if PEs of a layer need different ways for
        the same neighbour, for example at the seam of a picture that does not fill the array, all go each way in turn.
        Neighbours on the same PE take none. The sites are those of the grid: on a coarser level neighbours are farther
        apart.
        """
        pairs = offsets.tolist()
        down = self._ways(grid, grid.height, self.rows, {i for i, _ in pairs})
        across = self._ways(grid, grid.width, self.cols, {j for _, j in pairs})

        @cache
        def total(rows: int, cols: int) -> int:
            return sum(max(u, v) for i, j in pairs for u in down[rows][i] for v in across[cols][j])

        rows, cols = ([ways.index(each) for each in ways] for ways in (down, across))  # most layers are equal
        return np.array([total(row, col) for row in rows for col in cols], np.int64)

    def _ways(self, grid: Grid, length: int, pes: int, offsets: set[int]) -> list[dict[int, tuple[int, ...]]]:
        """Return for each layer along an axis: offset -> distances to the neighbours' PEs, one for each way."""
        count = -(-length // grid.spacing)
        site = np.arange(count, dtype=np.int64)
        layer, pe = self._axis(site * grid.spacing, length, pes)
        found: list[dict[int, set[int]]] = [{d: set() for d in offsets} for _ in range(-(-length // pes))]
        for d in offsets:
            there = np.full(count, True) if grid.torus else (site + d >= 0) & (site + d < count)
            way = self._axis((site + d) % count * grid.spacing, length, pes)[1] - pe
            way = (way + pes // 2) % pes - pes // 2  # the shorter way around
            for number, one in set(zip(layer[there].tolist(), way[there].tolist(), strict=True)):
                found[number][d].add(one)
        return [{d: tuple(sorted(map(abs, ways))) for d, ways in each.items()} for each in found]


def parse_array(text: str, mapping: str = MAPPINGS[0]) -> ProcessorArray:
    """Return the processor array described by a text.

    Parameters
    ----------
    text : str
        ``"ROWSxCOLS"`` or a key of `ARRAYS`, either followed by ``":cut-and-stack"`` or ``":hierarchical"`` if wanted.
    mapping : str
        The mapping if the text names none.

    Raises
    ------
    ValueError
        The text names no array, or more than `LARGEST` PEs.
    """
    found = re.fullmatch(
        rf"(?:([1-9]\d{{0,4}})x([1-9]\d{{0,4}})|({'|'.join(ARRAYS)}))(?::(.*))?", text if isinstance(text, str) else ""
    )
    if not found:
        raise ValueError(
            f"unknown array {shown(text)}; give rows x columns such as 128x128, or one of: {', '.join(ARRAYS)}"
        )
    rows, cols = ARRAYS[found[3]] if found[3] else (int(found[1]), int(found[2]))
    if rows * cols > LARGEST:
        raise ValueError(f"an array of {text} PEs is beyond {LARGEST}; give a smaller one, say 128x128")
    return ProcessorArray(rows, cols, mapping if found[4] is None else found[4])
