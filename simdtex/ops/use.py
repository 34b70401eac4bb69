# SPDX-License-Identifier: BSD-3-Clause
"""A price on use: the sample's sites are to be used equally often, and one that is used more costs more."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Launcher, Operation
from simdtex.model.lattice import Grid
from simdtex.model.sample import Candidates
from simdtex.ops.neighbourhood import Field

CAP = 4.0
"""Excess of use over the fair share above which the price grows no more."""


def _reference(field: Field, grid: Grid, candidates: Candidates) -> NDArray[np.int32]:
    known = grid.view(field.temperature) < 1024
    number = candidates.index_of[grid.view(field.source)[known]]
    return np.bincount(number[number >= 0], minlength=candidates.size).astype(np.int32)


def _launch(machine: Launcher, field: Field, grid: Grid, candidates: Candidates) -> NDArray[np.int32]:
    counts = machine.put(np.zeros(candidates.size, np.int32))
    sites = grid.rows * grid.cols
    machine.launch(
        machine.kernel("use", "use"),
        (sites,),
        *(grid.struct, np.int32(sites), field.source, field.temperature, candidates.index_of, counts),
    )
    found: NDArray[np.int32] = machine.get(counts)
    return found


use = Operation("use", _reference, _launch)
"""``use(machine, field, grid, candidates)``: how many known sites (t < 1) each candidate is the source of, on the host.

(n,) int32. Whole numbers, so the order in which sites are counted does not matter, and counts of tiles add up.
"""


def price(
    counts: NDArray[np.integer],
    shape: tuple[int, int],
    radius: int,
    rate: float,
    before: NDArray[np.float32] | None = None,
) -> NDArray[np.float32]:
    """What each candidate costs during the next sweep, beside its distance.

    Parameters
    ----------
    counts : (n,) array of integers
        From `use`.
    shape : (int, int)
        Rows and columns of candidates, n of them.
    radius : int
        Of a neighbourhood, in candidates.
    rate : float
        lambda N C sigma^2, the sample's variance times neighbours and channels; 0: no candidate costs anything.
    before : (n or more,) float32 array, optional
        The price during the last sweep.

    Returns
    -------
    (n,) float32 array
        lambda N C sigma^2 min(4, max(0, u - 1)), u the use of the square around a candidate over its fair share; the
        mean of that and of `before`, so that prices settle.

    Notes
    -----
    Prices are the potentials of a transport problem: to give all output sites the nearest candidates while each
    candidate serves as many sites as any other is semi-discrete optimal transport, and its dual raises the price of
    what is asked for too often. Cost: some ten passes over the candidates, on the host.
    """
    size, total = shape[0] * shape[1], int(counts.sum())
    if not (rate and total):
        found = np.zeros(size, np.float32)
    else:
        around, members = (_blurred(a.reshape(shape), radius) for a in (counts, np.ones(size, np.int64)))
        excess = around.astype(np.float64) * size / (members * np.float64(total)) - 1
        found = (rate * np.clip(excess, 0, CAP)).astype(np.float32).ravel()
    return found if before is None else (found + before[:size]) / np.float32(2)


def _blurred(counts: NDArray[np.integer], radius: int) -> NDArray[np.int64]:
    """The sum over the square of this radius around each, as far as it lies within."""
    sums = np.pad(counts.astype(np.int64), ((1, 0), (1, 0))).cumsum(0).cumsum(1)
    rows, cols = (np.arange(n) for n in counts.shape)
    (top, bottom), (left, right) = (
        (np.maximum(at - radius, 0), np.minimum(at + radius + 1, n))
        for at, n in zip((rows, cols), counts.shape, strict=True)
    )
    a, b, c, d = (sums[r][:, q] for r, q in ((bottom, right), (top, right), (bottom, left), (top, left)))
    found: NDArray[np.int64] = a - b - c + d
    return found
