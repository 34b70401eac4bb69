# SPDX-License-Identifier: BSD-3-Clause
"""The local conditional probability density function at single sites, equations (4) to (8)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Machine
from simdtex.model.lattice import Grid
from simdtex.model.sample import Sample
from simdtex.ops import lcpdf
from simdtex.ops.histogram import histogram
from simdtex.ops.neighbourhood import Field, neighbourhood

AT_ONCE = 4096
"""Sites whose tables are made in one go."""


def lcpdf_at(
    machine: Machine,
    field: Field,
    sample: Sample,
    sites: NDArray[np.int32],
    offsets: NDArray[np.int32],
    grid: Grid,
    bandwidth: float,
    estimator: str,
) -> NDArray[np.float64]:
    """Return P(x_s | x_r, r in N_s) of some sites, (S, greys) float64; every row adds up to 1.

    ``field`` holds the image in working grey levels and its temperatures, nothing is read of its sources; the sample
    has one channel; ``sites`` are pixel indices, and ``bandwidth`` is h in units of h_opt, equation (8). ``estimator``
    is ``"parzen"``, equations (6) to (8), or ``"histogram"``, counts of exact matches, (4) and (5). Raises ValueError
    if no neighbourhood of the sample matches that of a site.
    """
    greys = sample.top + 1
    candidates = sample.candidates(machine, sample.places(offsets, 1))
    h = bandwidth * lcpdf.optimal_bandwidth(sample.variance, candidates.size, len(offsets) + 1)
    window = lcpdf.window(h, sample.top)
    device_offsets = machine.put(offsets)
    rows = [np.zeros((0, greys))]
    step = min(machine.chunk(candidates.size, len(offsets), 1), AT_ONCE)
    for first in range(0, len(sites), step):
        here = machine.put(sites[first : first + step])
        near = neighbourhood(machine, here, field, device_offsets, grid)
        distances = lcpdf.distance(machine, near, candidates)
        if estimator == "parzen":
            density = machine.get(lcpdf.density(machine, distances, candidates, window)).astype(np.float64)
            rows.append(density / np.cumsum(density, 1)[:, -1:])
        else:
            counts = machine.get(histogram(machine, distances, candidates, greys))
            rows.append(_shares(counts, sites[first : first + step], grid))
    return np.concatenate(rows)


def _shares(counts: NDArray[np.uint32], sites: NDArray[np.int32], grid: Grid) -> NDArray[np.float64]:
    total = counts.sum(1, keepdims=True)
    if not total.all():
        row, col = divmod(int(sites[(total[:, 0] == 0).argmax()]), grid.width)
        raise ValueError(
            f"no neighbourhood of the sample equals that of site ({row}, {col}); "
            'use fewer grey levels, a smaller order, or estimator="parzen"'
        )
    shares: NDArray[np.float64] = counts / total
    return shares
