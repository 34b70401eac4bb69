# SPDX-License-Identifier: BSD-3-Clause
"""The penalty of each candidate (`simdtex.ops.use`), added to distances that are kept."""

from __future__ import annotations

import numpy as np

from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.model.sample import BLOCK, Candidates
from simdtex.ops.lcpdf import Distances


@Operation
def charge(machine: Launcher | None, distances: Distances, candidates: Candidates, penalty: Array) -> Distances:
    """Return d_p + penalty_p, (n, P); ``penalty`` (n or more,) float32. A device changes the distances in place."""
    if machine is None:
        return distances._replace(distance=distances.distance + penalty[: candidates.size, None])
    blocks, padded = distances.nearest.shape
    machine.launch(
        machine.kernel("charge", "charge", BLOCK=BLOCK),
        (distances.sites, blocks),
        *(np.int32(distances.sites), np.int32(padded), np.int32(candidates.size), np.int32(blocks), penalty),
        *(distances.distance, distances.nearest),
    )
    return distances
