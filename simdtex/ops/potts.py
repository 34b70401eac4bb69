# SPDX-License-Identifier: BSD-3-Clause
"""Iterated conditional modes of a Potts field."""

from __future__ import annotations

import numpy as np

from simdtex.machine.interface import Array, Launcher, Operation

WEIGHTS = 16
"""Units in 1 of the weight of votes."""


@Operation
def potts(machine: Launcher | None, sites: Array, evidence: Array, votes: Array, weight: int, labels: Array) -> Array:
    """Set sites to the class with the greatest evidence plus weight times votes, first of equals, in place.

    ``sites`` (S,) int32; ``evidence`` (classes, rows, cols) int32 and ``votes`` (classes, rows, cols) uint32, both in
    2**-18; ``weight`` in 1/16; ``labels`` (rows, cols) uint8. Cost: O(S classes).
    """
    classes = evidence.shape[0]
    if machine is None:
        energy = evidence.reshape(classes, -1)[:, sites]
        energy = energy + ((np.int32(weight) * votes.reshape(classes, -1)[:, sites].astype(np.int32)) >> 4)
        labels.reshape(-1)[sites] = energy.argmax(0)
        return labels
    machine.launch("potts", (sites.size,), sites, sites.size, evidence, votes, classes, labels.size, weight, labels)
    return labels
