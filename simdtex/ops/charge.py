# SPDX-License-Identifier: BSD-3-Clause
"""Add the price of each candidate (`simdtex.ops.use`) to its distance, for distances that are kept."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.model.sample import BLOCK, Candidates
from simdtex.ops.lcpdf import Distances


def _reference(distances: Distances, candidates: Candidates, price: NDArray[np.float32]) -> Distances:
    return distances._replace(distance=distances.distance + price[: candidates.size, None])


def _launch(machine: Launcher, distances: Distances, candidates: Candidates, price: Array) -> Distances:
    blocks, padded = distances.nearest.shape
    machine.launch(
        machine.kernel("charge", "charge", BLOCK=BLOCK),
        (distances.sites, blocks),
        *(np.int32(distances.sites), np.int32(padded), np.int32(candidates.size), np.int32(blocks), price),
        *(distances.distance, distances.nearest),
    )
    return distances


charge = Operation("charge", _reference, _launch)
"""``charge(machine, distances, candidates, price)``: d_p + price_p, (n, P); ``price`` (n or more,) float32."""
