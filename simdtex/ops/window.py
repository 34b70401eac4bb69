# SPDX-License-Identifier: BSD-3-Clause
"""Sums over a Gaussian window around each site, over the sites with one label."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.ops.laplacian import within

TAPS = 2**9
"""The sum of a window's taps in one direction."""


def gaussian(sd: float) -> NDArray[np.uint32]:
    """Return the taps of a window, up to 3 standard deviations, as integers that add up to `TAPS`."""
    reach = max(1, int(3 * sd))
    place = np.arange(-reach, reach + 1)
    density = np.exp(-0.5 * (place / sd) ** 2)
    ends = np.rint(np.cumsum(density) / density.sum() * TAPS)  # cumulative, so that rounding errors do not add up
    half = np.diff(ends[reach:])  # the taps to the right
    middle = TAPS - 2 * half.sum()
    return np.concatenate([half[::-1], [middle], half]).astype(np.uint32)


@Operation
def window(machine: Launcher | None, labels: Array, owner: Array, taps: Array, values: Array | None = None) -> Array:
    """Return the sums over the window of each site, (planes, rows, cols) uint32 in 2**-18.

    ``labels`` (rows, cols) uint8; ``owner`` (planes,) int32 is the label that is summed in each plane; ``values``
    (planes, rows, cols) uint16, below 2**13, or None if each is 1; ``taps`` (2 reach + 1,) uint32 come from `gaussian`.
    Cost: two additions per tap for each site and plane.
    """
    rows, cols = labels.shape
    planes, reach = owner.shape[0], taps.shape[0] // 2
    if machine is None:
        here = (labels == owner[:, None, None]).astype(np.uint32) * (1 if values is None else values.astype(np.uint32))
        for axis, n in ((2, cols), (1, rows)):
            near = (here.take(within(np.arange(n) + t, n, False), axis) for t in range(-reach, reach + 1))
            here = np.sum([tap * part for tap, part in zip(taps, near, strict=True)], 0, dtype=np.uint32)
        return here
    counted = machine.empty((planes, rows, cols + 2 * reach), np.uint32)
    along, sums = (machine.empty((planes, rows, cols), np.uint32) for _ in range(2))
    defines = {"COUNT": 1} if values is None else {}
    machine.launch(
        "window_counted",
        (cols + 2 * reach, planes * rows),
        *(labels, rows, cols, owner, planes, labels if values is None else values, reach, counted),
        defines=defines,
    )
    for name, before, after in (("window_rows", counted, along), ("window_cols", along, sums)):
        machine.launch(name, (cols, planes * rows), before, rows, cols, planes, taps, reach, after, defines=defines)
    return sums
