# SPDX-License-Identifier: BSD-3-Clause
"""The LCPDF by counting exact matches: F(x, neighbours) of equations (4) and (5)."""

from __future__ import annotations

import numpy as np

from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.model.sample import BLOCK, Candidates
from simdtex.ops.lcpdf import Distances


@Operation
def histogram(machine: Launcher | None, distances: Distances, candidates: Candidates, greys: int) -> Array:
    """Return the number of candidates of each grey level that match a site exactly, (S, greys) uint32."""
    if machine is None:
        grey = candidates.pixels[0][candidates.positions[: candidates.size]].astype(np.int64)
        found = np.zeros((distances.sites, greys), np.uint32)
        p, s = np.nonzero(distances.distance == 0)
        np.add.at(found, (s, grey[p]), 1)
        return found
    counts = machine.empty((distances.sites, greys), np.uint32)
    blocks, padded = distances.nearest.shape
    machine.launch(
        "histogram",
        (distances.sites,),
        *(distances.distance, distances.nearest, blocks, distances.sites, padded),
        *(candidates.pixels, candidates.positions, greys, counts),
        defines={"BLOCK": BLOCK},
    )
    return counts
