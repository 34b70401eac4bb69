# SPDX-License-Identifier: BSD-3-Clause
"""The penalty of each candidate and its place on a lattice, added to distances that are kept."""

from __future__ import annotations

import numpy as np

from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.model.sample import BLOCK, Candidates
from simdtex.ops import phases
from simdtex.ops.lcpdf import Distances
from simdtex.ops.phases import Phased


@Operation
def charge(
    machine: Launcher | None,
    distances: Distances,
    candidates: Candidates,
    penalty: Array,
    sites: Array,
    phased: Phased | None = None,
) -> Distances:
    """Return d_p + penalty_p + what p is apart in phase, (n, P); a device changes the distances in place.

    ``penalty`` (n or more,) float32 of `simdtex.ops.use`.
    """
    if machine is None:
        d = distances.distance + penalty[: candidates.size, None]
        return distances._replace(
            distance=d + phased.apart(np.arange(candidates.size)[:, None], sites) if phased else d
        )
    blocks, padded = distances.nearest.shape
    machine.launch(
        machine.kernel("charge", "charge", BLOCK=BLOCK, **phases.defines(phased)),
        (distances.sites, blocks),
        *(sites, np.int32(distances.sites), np.int32(padded), np.int32(candidates.size), np.int32(blocks), penalty),
        *(*phases.arguments(machine, phased), distances.distance, distances.nearest),
    )
    return distances
