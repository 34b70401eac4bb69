# SPDX-License-Identifier: BSD-3-Clause
"""The candidates whose neighbourhoods in the sample are most like that of each candidate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher, Machine, Operation
from simdtex.model.sample import Candidates, Sample
from simdtex.ops import lcpdf
from simdtex.ops.lcpdf import Distances
from simdtex.ops.neighbourhood import Neighbourhoods


def _reference(distances: Distances, candidates: Candidates, first: int, found: NDArray[np.int32]) -> NDArray[np.int32]:
    d = distances.distance[:, : distances.sites].copy()
    d[np.arange(first, first + distances.sites), np.arange(distances.sites)] = np.inf
    found[first : first + distances.sites] = np.argsort(d, 0, kind="stable")[: found.shape[1]].T
    return found


def _launch(machine: Launcher, distances: Distances, candidates: Candidates, first: int, found: Array) -> Array:
    machine.launch(
        machine.kernel("similar", "similar"),
        (distances.sites,),
        *(distances.distance, np.int32(first), np.int32(distances.sites), np.int32(distances.distance.shape[1])),
        *(np.int32(candidates.size), np.int32(found.shape[1]), found),
    )
    return found


similar = Operation("similar", _reference, _launch)
"""``similar(machine, distances, candidates, first, found)``: rows ``first`` on of (n, K), nearest first."""


def most_similar(
    machine: Machine,
    sample: Sample,
    positions: NDArray[np.int32],
    reach: NDArray[np.int32],
    candidates: Candidates,
    k: int,
) -> Array:
    """The k candidates most similar to each, (n, k) int32; (1, 1) where k is 0.

    Parameters
    ----------
    machine : Machine
    sample : Sample
    positions : (n,) int32 array
        Of the candidates, on the host.
    reach : (N,) int32 array
        Pixel offset of each neighbour in the sample, on the host.
    candidates : Candidates
        The same on the machine.
    k : int
        Below n.

    Notes
    -----
    Cost: n^2 N C 2 fma.
    """
    if not k:
        return machine.put(np.zeros((1, 1), np.int32))
    found = machine.put(np.zeros((candidates.size, k), np.int32))
    step = machine.chunk(candidates.size, len(reach), sample.channels)
    for first in range(0, candidates.size, step):
        here = positions[first : first + step]
        padded = np.pad(here, (0, -len(here) % 16))  # whole vectors of sites
        x = np.moveaxis(sample.working[:, padded + reach[:, None]], 0, 1).astype(np.float32)
        near = Neighbourhoods(machine.put(np.ones((len(reach), padded.size), np.float32)), machine.put(x), padded.size)
        distances = lcpdf.distance(machine, near, candidates)._replace(sites=len(here))
        found = similar(machine, distances, candidates, first, found)
        machine.sync(2 * candidates.size * x.size)
    return found
