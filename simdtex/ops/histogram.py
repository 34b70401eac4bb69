# SPDX-License-Identifier: BSD-3-Clause
"""The LCPDF by counting exact matches: F(x, neighbours) of equations (4) and (5)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.model.sample import BLOCK, Candidates
from simdtex.ops.lcpdf import Distances


def _reference(distances: Distances, candidates: Candidates, levels: int) -> NDArray[np.uint32]:
    grey = candidates.pixels[0][candidates.positions[: candidates.size]].astype(np.int64)
    counts = np.zeros((distances.sites, levels), np.uint32)
    p, s = np.nonzero(distances.distance == 0)
    np.add.at(counts, (s, grey[p]), 1)
    return counts


def _launch(machine: Launcher, distances: Distances, candidates: Candidates, levels: int) -> Array:
    counts = machine.empty((distances.sites, levels), np.uint32)
    blocks, padded = distances.nearest.shape
    machine.launch(
        machine.kernel("histogram", "histogram", BLOCK=BLOCK),
        (distances.sites,),
        *(distances.distance, distances.nearest, np.int32(blocks), np.int32(distances.sites)),
        *(np.int32(padded), candidates.pixels, candidates.positions, np.int32(levels), counts),
    )
    return counts


histogram = Operation("histogram", _reference, _launch)
