# SPDX-License-Identifier: BSD-3-Clause
"""How far candidates are from a site on the lattice of a regular sample: one more term of their cost.

Candidate and site are as far apart in phase at every neighbour as at the site itself, so it is enough to look there.
"""

from __future__ import annotations

from math import prod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher
from simdtex.ops.arithmetic import fma32


class Phased(NamedTuple):
    """Cosines and sines of phases (`simdtex.model.regularity`): kernels/common/phases.h.

    ``candidates`` (waves, n rounded up to blocks) float32 by number; ``sites`` (waves, H, W) uint16; ``certain`` the
    factor of their differences, whose square is the number of neighbours that they count for; ``free`` how much of the
    cost is not counted, so that all candidates within half a step of a phase are alike.
    """

    candidates: Array
    sites: Array
    certain: np.float32
    free: np.float32

    def apart(self, numbers: NDArray[np.integer], sites: NDArray[np.int32]) -> NDArray[np.float32]:
        """Return what the candidates of these numbers, (slots, S or 1), cost at sites (S,), in NumPy: (slots, S)."""
        d = np.zeros((len(numbers), sites.size), np.float32)
        for y, x in zip(self.candidates, self.sites.reshape(len(self.sites), -1), strict=True):
            e = (x[sites].astype(np.float32) - y[np.maximum(numbers, 0)]) * self.certain
            d = fma32(e, e, d)
        return np.maximum(d - self.free, np.float32(0))


def defines(phased: Phased | None) -> dict[str, int]:
    """Return the -D constants of kernels."""
    return {"WAVES": len(phased.candidates)} if phased else {}


def arguments(machine: Launcher, phased: Phased | None) -> tuple[Any, ...]:
    """Return the arguments ``PHASES`` of kernels."""
    if phased is None:
        nothing = machine.constant(np.zeros((1, 1), np.float32)), machine.constant(np.zeros((1, 1), np.uint16))
        phased = Phased(*nothing, np.float32(0), np.float32(0))
    listed, area = phased.candidates.shape[1], prod(phased.sites.shape[1:])
    return phased.candidates, np.int32(listed), phased.sites, np.int32(area), phased.certain, phased.free
