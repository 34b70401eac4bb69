# SPDX-License-Identifier: BSD-3-Clause
"""The candidates of a pixel and a draw of one of them, De Bonet's equations (8) to (12).

The pixels of the levels above the sampled level are called nodes. Candidates are numbered in the order of the scan:
from the top down, parents before children, the children of a node row by row.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex import random
from simdtex.machine.interface import Array, Launcher, Operation

DISTANCES_AT_ONCE = 2**22
"""The most pixels times candidates that the twin processes together."""


class Structure(NamedTuple):
    """The parent structures of the sample's pyramid, equation (8), and the thresholds of their comparison.

    ``features`` (nodes, M) int32, of the levels from 1 on, level after level; ``threshold`` (levels, M) uint32, the
    largest difference that passes; ``lattice`` (levels, 4) int32: rows, columns, the first row of the level in
    ``features``, and the sum of 1 if its last row, and 2 if its last column, represents fewer pixels of the sample than
    all others.
    """

    features: Array
    threshold: Array
    lattice: Array


class Sampled(NamedTuple):
    """The output's pyramid so far, made of tiles laid out like the sample's.

    ``source`` (pixels,) int32, level after level: the pixel of the sample's level that each was copied from; ``counts``
    (pixels, 2) int32: the candidates of each, and the nodes that it was compared with; ``lattice`` (levels, 4) int32:
    rows, columns, the first pixel of the level in ``source`` and ``counts``, 0.
    """

    source: Array
    counts: Array
    lattice: Array


def _drawn(
    structure: Structure, sampled: Sampled, level: int, sites: NDArray[np.intp], match: bool, seed: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the choice (S,) and the counts (S, 2) of ``sites``."""
    tile = structure.lattice[level, :2]
    i, j = np.divmod(sites, sampled.lattice[level, 1])
    p, q = i % tile[0], j % tile[1]
    # Nodes in the order of the scan, and which of them have passed so far, (S, nodes).
    top = len(structure.lattice) - 1
    row, col = np.divmod(np.arange(structure.lattice[top, :2].prod()), structure.lattice[top, 1])
    passing = np.ones((sites.size, row.size), bool)
    compared = np.zeros(sites.size, np.intp)
    for k in range(top, level, -1):
        compared += passing.sum(1)
        rows, cols, start, ragged = structure.lattice[k]
        above = (i // tile[0] * rows + (p >> k - level), j // tile[1] * cols + (q >> k - level))
        place = sampled.source[sampled.lattice[k, 2] + above[0] * sampled.lattice[k, 1] + above[1]]
        u = structure.features[start + place].astype(np.int64)
        v = structure.features[start + row * cols + col].astype(np.int64)
        for m, threshold in enumerate(structure.threshold[k]):
            passing &= abs(u[:, None, m] - v[None, :, m]) <= threshold
        if k == level + 1 and match:
            passing &= _whole(row, p // 2, rows, ragged & 1) & _whole(col, q // 2, cols, ragged & 2)
        else:
            parent, row, col = _children(row, col, structure.lattice[k - 1])
            passing = passing[:, parent]
    count = np.cumsum(passing, 1)
    lo, hi, *_ = random.draw4(seed, level, 0, sites, random.DRAW, 0)
    wanted = random.below(lo, hi, count[:, -1])
    drawn = (count > wanted[:, None]).argmax(1)
    row, col = row[drawn], col[drawn]
    if match:
        row, col = 2 * row + p % 2, 2 * col + q % 2
    return row * tile[1] + col, np.stack([count[:, -1], compared], -1)


def _whole(node: NDArray[np.intp], parent: NDArray[np.intp], count: int, ragged: int) -> NDArray[np.bool_]:
    """Return whether nodes have as many pixels below them as the pixels' parents, (S, nodes), along one axis."""
    last = count - 1
    return np.asarray((node[None] != last) | (parent[:, None] == last) | (ragged == 0))


def _children(
    row: NDArray[np.intp], col: NDArray[np.intp], lattice: NDArray[np.int32]
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Return parent, row and column of the existing children of nodes, node by node, row by row."""
    child_row = (2 * row[:, None] + [0, 0, 1, 1]).ravel()
    child_col = (2 * col[:, None] + [0, 1, 0, 1]).ravel()
    there = (child_row < lattice[0]) & (child_col < lattice[1])
    return np.repeat(np.arange(row.size), 4)[there], child_row[there], child_col[there]


@Operation
def candidates(
    machine: Launcher | None,
    structure: Structure,
    sampled: Sampled,
    level: int,
    sites: range,
    match: bool,
    seed: int,
) -> Sampled:
    """Draw a candidate for each of the pixels ``sites``; ``sampled`` is changed in place and returned.

    Without ``match``, any child of a node that passes is a candidate. With ``match`` its row and column must also have
    the parity of the pixel's, and its parent must represent as many pixels of the sample as the pixel's parent, which
    may fail at the edge. Cost: at most nodes x M comparisons for four pixels, and about a sixteenth more for each pixel
    that is drawn from many candidates; 12 bytes of memory per pixel.
    """
    if machine is None:
        begin = int(sampled.lattice[level, 2])
        step = max(1, DISTANCES_AT_ONCE // (4 * int(structure.lattice[level + 1, :2].prod())))
        for first in range(sites.start, sites.stop, step):
            here = np.arange(first, min(sites.stop, first + step))
            choice, counts = _drawn(structure, sampled, level, here, match, seed)
            sampled.source[begin + here] = choice
            sampled.counts[begin + here] = counts
        return sampled
    levels, features = structure.threshold.shape
    items = -(-len(sites) // 4)  # one for four siblings; where these are fewer, an item takes several
    machine.launch(
        "candidates",
        (items,),
        *(np.uint64(seed), level, levels - 1, match),
        *(structure.lattice, structure.features, structure.threshold, sampled.lattice),
        *(sites.start, sites.stop, items, sampled.source, sampled.counts),
        defines={"FEATURES": features},
    )
    return sampled
