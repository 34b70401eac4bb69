# SPDX-License-Identifier: BSD-3-Clause
"""A processor array such as the MasPar MP-1: one instruction stream, one processing element (PE) per pixel.

Where a picture has more pixels than the array has PEs, each PE holds several, one in each virtual layer. A SIMD pass
works on one layer; PEs without a site to relax idle under the mask.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import NamedTuple

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
"""Rows and columns of the MP-1 in the sizes that it came in."""

LARGEST = 2**22
"""PEs of the largest array: a launch has as many work-items."""


class Place(NamedTuple):
    """Where pixels live: ``layer`` the virtual layer, ``pe`` the PE's number, row by row."""

    layer: NDArray[np.int64]
    pe: NDArray[np.int64]


@dataclass(frozen=True)
class ProcessorArray:
    """The array and how a picture lies on it.

    Parameters
    ----------
    rows, cols : int
        PEs, 1 or more each way.
    mapping : {"cut-and-stack", "hierarchical"}
        A picture larger than the array is cut into layers of the array's size, pixel (i, j) on PE (i mod rows,
        j mod cols); or each PE holds a block of ceil(height / rows) x ceil(width / cols) pixels side by side. All
        levels of the multigrid stay where their pixels are.
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
        """Virtual layers by rows and by columns, for the whole picture of a grid."""
        return -(-grid.height // self.rows), -(-grid.width // self.cols)

    def place(self, sites: NDArray[np.int32], grid: Grid) -> Place:
        """Layer and PE of pixel indices."""
        row, col = np.divmod(sites.astype(np.int64), grid.width)
        (high, i), (wide, j) = self._axis(row, grid.height, self.rows), self._axis(col, grid.width, self.cols)
        return Place(high * self.layers(grid)[1] + wide, i * self.cols + j)

    def _axis(self, at: NDArray[np.int64], length: int, pes: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """(layer, PE) of coordinates along one axis."""
        if self.mapping == "hierarchical":
            pe, layer = np.divmod(at, -(-length // pes))
        else:
            layer, pe = np.divmod(at, pes)
        return layer, pe

    def shifts(self, grid: Grid, offsets: NDArray[np.int32]) -> NDArray[np.int64]:
        """X-Net shifts that bring each PE one word from every neighbour of its site, per layer (layers,).

        A shift moves one word of every PE to one of the 8 adjacent PEs, around the edges of the array. A neighbour that
        is d rows and e columns of PEs away takes ``max(|d|, |e|)`` of them; where PEs of a layer need different ways
        for the same neighbour, at the seam of a picture that does not fill the array say, all go each way in turn.
        Neighbours that the same PE holds take none. The sites are those of the grid: on a coarser level neighbours are
        farther apart.
        """
        down = _moves(self, grid.height, grid.spacing, self.rows, grid.torus, offsets[:, 0])
        across = _moves(self, grid.width, grid.spacing, self.cols, grid.torus, offsets[:, 1])
        shifts = np.zeros(self.layers(grid), np.int64)
        for di, dj in offsets.tolist():
            u, v = down[di][:, None, :, None], across[dj][None, :, None, :]
            shifts += np.where((u >= 0) & (v >= 0), np.maximum(u, v), 0).sum((0, 1))
        return shifts.ravel()


def _moves(
    array: ProcessorArray, length: int, spacing: int, pes: int, torus: bool, offsets: NDArray[np.int32]
) -> dict[int, NDArray[np.int64]]:
    """Offset -> how many PEs away the neighbours along one axis lie, (ways, layers): each different way once, or -1."""
    count = -(-length // spacing)
    site = np.arange(count, dtype=np.int64)
    layer, pe = array._axis(site * spacing, length, pes)
    moves = {}
    for d in set(offsets.tolist()):
        to = site + d
        there = np.ones(count, bool) if torus else (to >= 0) & (to < count)
        way = array._axis(to % count * spacing, length, pes)[1] - pe
        way = (way + pes // 2) % pes - pes // 2  # the shorter way around
        different = set((layer[there] * (2 * pes) + way[there] + pes).tolist())  # np.unique would load numpy.ma for it
        pairs = np.stack(np.divmod(np.array(sorted(different), np.int64), 2 * pes))
        pairs[1] -= pes
        first = np.searchsorted(pairs[0], pairs[0])  # of the pairs of the same layer
        number = np.arange(pairs.shape[1]) - first
        moves[d] = np.full((number.max(initial=0) + 1, -(-length // pes)), -1, np.int64)
        moves[d][number, pairs[0]] = abs(pairs[1])
    return moves


def parse_array(text: str, mapping: str = MAPPINGS[0]) -> ProcessorArray:
    """Return the processor array that a text names.

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
