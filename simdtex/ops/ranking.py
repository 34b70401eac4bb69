# SPDX-License-Identifier: BSD-3-Clause
"""Histogram matching by rank: `sort`, `match_ranks` and `distance` in one operation."""

from __future__ import annotations

import numpy as np

from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.ops.matching import distance, match_ranks
from simdtex.ops.sort import SCRATCH, local, sort

COUNTERS = 3 * 2**11
"""Counters of a segment, for 11 bits in each of three passes."""

SHORT, LONG = 2**15, 2**22
"""The most values of a segment that one work-item sorts, if segments are few and if they are many."""


def alone(machine: Launcher, segments: int, n: int) -> bool:
    """Return whether one work-item sorts a whole segment; it changes no bit.

    It saves a dozen launches. A long segment is divided on a GPU, or if cores would be idle.
    """
    if machine.info.kind == "gpu":
        return False
    return n <= (LONG if 2 * segments >= machine.info.compute_units else SHORT)


@Operation
def ranking(machine: Launcher | None, values: Array, first: Array, targets: Array) -> tuple[Array, Array]:
    """Return values (segments, n) int32 with the histograms of the targets, and the distances they have moved.

    ``values`` (segments, n) int32, equal ones in the order of the permutation ``first`` (n,) int32; ``targets`` (T, m)
    int32 are sorted. The second result, (segments,) int64, is the sum of |before - after| over each segment. Cost: two
    to four passes over the values, and 16 bytes of scratch for each of 2**22 values together.
    """
    if machine is None:
        matched = match_ranks.reference(sort.reference(values, first), targets)
        return matched, distance.reference(values, matched)
    segments, n = values.shape
    if not alone(machine, segments, n):
        matched = match_ranks(machine, sort(machine, values, first), targets)
        return matched, distance(machine, values, matched)
    each, m = segments // targets.shape[0], targets.shape[1]
    most = min(segments, max(1, SCRATCH // max(n, COUNTERS // 2)))
    pairs, counts = machine.empty((2, most, n, 2), np.uint32), machine.empty((most, COUNTERS), np.uint32)
    matched, moved = machine.empty((segments, n), np.int32), machine.empty((segments,), np.int64)
    for begin in range(0, segments, most):
        pieces = min(most, segments - begin)
        machine.launch(
            "ranking",
            (pieces,),
            *(values, begin, first, pieces, n),
            *(targets, each, m, pairs, counts, matched, moved),
            local=local(machine),
        )
    return matched, moved
