# SPDX-License-Identifier: BSD-3-Clause
"""The least squared distance of a neighbourhood from the exemplars of each class."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher, Machine, Operation
from simdtex.ops.arithmetic import log32

TOGETHER = 4
"""The number of exemplars of a class is a multiple of this (kernels/exemplars.cl)."""

LOGS = 256
"""Units in 1 of the logarithm of a distance."""

PART = 2**14
"""The most sites that the twin compares together."""


class Exemplars(NamedTuple):
    """Neighbourhoods y that represent classes: ``doubled`` (M, K) float32 are -2 y, ``squares`` (M,) float32 |y|^2.

    ``starts`` (classes + 1,) int32 is the first exemplar of each class, and M.
    """

    doubled: Array
    squares: Array
    starts: Array

    def on(self, machine: Machine) -> Exemplars:
        """Return a copy of NumPy arrays on a machine."""
        return Exemplars(*map(machine.put, self))


def stacked(classes: list[NDArray[np.float32]]) -> Exemplars:
    """Return the exemplars of classes, each (n, K), in NumPy."""
    filled = [np.concatenate([one, np.repeat(one[-1:], -len(one) % TOGETHER, 0)]) for one in classes]
    y = np.concatenate(filled)
    starts = np.cumsum([0, *map(len, filled)]).astype(np.int32)
    return Exemplars(-2 * y, (y * y).sum(1), starts)


@Operation
def exemplars(machine: Launcher | None, features: Array, known: Exemplars) -> Array:
    """Return log(d^2 + 1) of the nearest exemplar of each class, (classes, S) uint16 in 1/256.

    ``features`` (K, S) float32 are integers, whose sums of products stay below 2^24. Cost: S M K multiply-adds.
    """
    count, classes = features.shape[1], known.starts.shape[0] - 1
    if machine is None:
        own = (features * features).sum(0)
        least = np.empty((classes, count), np.float32)
        for c, (begin, end) in enumerate(zip(known.starts, known.starts[1:], strict=False)):
            for s in range(0, count, PART):
                products = known.doubled[begin:end] @ features[:, s : s + PART]
                least[c, s : s + PART] = (products + known.squares[begin:end, None]).min(0)
        return np.rint(log32(least + own + np.float32(1)) * np.float32(LOGS)).astype(np.uint16)
    logs = machine.empty((classes, count), np.uint16)
    machine.launch(
        "exemplars",
        (-(-count // machine.vector),),
        *(features, count, *known, classes, logs),
        defines={"K": features.shape[0], "V": machine.vector},
    )
    return logs
