# SPDX-License-Identifier: BSD-3-Clause
"""A preference for candidates that continue the source of a neighbour; the 1998 paper has none."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.model.lattice import Grid
from simdtex.model.sample import BLOCK, Candidates
from simdtex.ops.lcpdf import Distances
from simdtex.ops.neighbourhood import Field


def sources(r: NDArray[np.int32], field: Field) -> NDArray[np.int32]:
    """Return the sources of neighbours (N, S); -1 without a neighbour, or for one that no relaxation has touched."""
    touched = (r >= 0) & (field.temperature.ravel()[r] < 1024)
    found: NDArray[np.int32] = np.where(touched, field.source.ravel()[r], np.int32(-1))
    return found


def continuing(candidates: Candidates, source: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the number of the candidate that continues the source of each neighbour, (N, S); -1 if there is none."""
    p = source - candidates.reach[: len(source), None]
    inside = (source >= 0) & (p >= 0) & (p < candidates.index_of.size)
    numbers: NDArray[np.int32] = np.where(inside, candidates.index_of[np.where(inside, p, 0)], -1)
    return numbers


@Operation
def coherence(
    machine: Launcher | None,
    distances: Distances,
    candidates: Candidates,
    sites: Array,
    field: Field,
    offsets: Array,
    grid: Grid,
    factor: np.float32,
) -> Distances:
    """Return distances, times ``factor`` for candidates that continue a neighbour's source. A device works in place."""
    if machine is None:
        p = continuing(candidates, sources(grid.neighbours(sites, offsets), field))
        k, s = np.nonzero(p >= 0)
        coherent = np.zeros(distances.distance.shape, bool)
        coherent[p[k, s], s] = True
        d = distances.distance
        return distances._replace(distance=np.where(coherent, d * factor, d))
    machine.launch(
        "coherence",
        (sites.size,),
        *(sites, sites.size, distances.distance.shape[1], field.source, field.temperature),
        *(offsets, offsets.shape[0], grid.struct, candidates.reach, candidates.index_of, candidates.plane, factor),
        *(distances.distance, distances.nearest),
        defines={"BLOCK": BLOCK},
    )
    return distances
