# SPDX-License-Identifier: BSD-3-Clause
"""The costs of each candidate, added to stored distances."""

from __future__ import annotations

import numpy as np

from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.model.sample import BLOCK, Candidates
from simdtex.ops.costs import Costs
from simdtex.ops.lcpdf import Distances


@Operation
def charge(
    machine: Launcher | None, distances: Distances, candidates: Candidates, sites: Array, costs: Costs
) -> Distances:
    """Return d_p with the costs of p, (n, P). A device changes the distances in place."""
    if machine is None:
        numbers = np.arange(candidates.size)[:, None]
        return distances._replace(distance=costs.added(distances.distance, numbers, sites, candidates))
    blocks, padded = distances.nearest.shape
    machine.launch(
        "charge",
        (distances.sites, blocks),
        *(sites, distances.sites, padded, candidates.size, blocks),
        *(*costs.arguments(machine, candidates), distances.distance, distances.nearest),
        defines={"BLOCK": BLOCK} | costs.defines,
    )
    return distances
