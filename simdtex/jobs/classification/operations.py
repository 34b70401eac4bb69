# SPDX-License-Identifier: BSD-3-Clause
"""The distances of a classifier: whole neighbourhoods, exemplars, sums over windows, and a Potts field."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher, Machine, Operation
from simdtex.methods.mrf.arithmetic import exp32, fma32, log32
from simdtex.methods.pyramid.laplacian import within

SIXTEENTHS = 16
"""Units of a level's values in 1 of the scale 0..255."""


@Operation
def features(machine: Launcher | None, levels: Array, sites: Array, offsets: Array, contrast: bool) -> Array:
    """Return the neighbourhoods of sites, (B * N, S) float32 of integers, by default values of 0..255: O(S B N)."""
    bands, rows, cols = levels.shape  # in sixteenths, mirrored beyond the border
    count = offsets.shape[0]
    unit = np.float32(1) / np.float32(SIXTEENTHS * count)
    if machine is None:
        axes = zip(np.divmod(sites.astype(np.intp), cols), offsets.T, (rows, cols), strict=True)
        row, col = (within(axis[:, None] + near, n, False) for axis, near, n in axes)
        values = np.moveaxis(levels[:, row, col], 1, 2).astype(np.int64)  # (B, N, S)
        if not contrast:
            return ((values + 8) >> 4).astype(np.float32).reshape(bands * count, -1)
        z = values * count - values.sum(1, keepdims=True)
        square = (z * z).sum((0, 1)).astype(np.float32) * (unit * unit)
        inverse = exp32(np.float32(-0.5) * log32(np.maximum(square, np.float32(1))))
        gain = np.float32(40) * log32(fma32(square * inverse, np.float32(0.2), np.float32(1))) * inverse * unit
        return np.rint(z.reshape(bands * count, -1).astype(np.float32) * gain)
    out = machine.empty((bands * count, sites.size), np.float32)
    machine.launch(
        "features_contrast" if contrast else "features_raw",
        (sites.size,),
        *(levels, bands, rows, cols, sites, sites.size, offsets, count),
        *((unit, out) if contrast else (out,)),
    )
    return out


EXEMPLAR_MULTIPLE = 4
"""The number of exemplars of a class is a multiple of this (kernels/classification/exemplars.cl)."""

LOGS = 256
"""Units in 1 of the logarithm of a distance."""

PART = 2**14
"""The most sites that the twin compares together."""


class Exemplars(NamedTuple):
    """Neighbourhoods y of classes: ``doubled`` (M, K) are -2 y, ``squares`` (M,) |y|^2, and ``starts`` of classes."""

    doubled: Array
    squares: Array
    starts: Array

    def on(self, machine: Machine) -> Exemplars:
        """Return a copy of NumPy arrays on a machine."""
        return Exemplars(*map(machine.put, self))


def stacked(classes: list[NDArray[np.float32]]) -> Exemplars:
    """Return the exemplars of classes, each (n, K), in NumPy."""
    filled = [np.concatenate([rows, np.repeat(rows[-1:], -len(rows) % EXEMPLAR_MULTIPLE, 0)]) for rows in classes]
    y = np.concatenate(filled)
    starts = np.cumsum([0, *map(len, filled)]).astype(np.int32)
    return Exemplars(-2 * y, (y * y).sum(1), starts)


@Operation
def exemplars(machine: Launcher | None, features: Array, known: Exemplars) -> Array:
    """Return log(d^2 + 1) of the nearest exemplar of each class, (classes, S) uint16 in 1/256: O(S M K)."""
    count, classes = features.shape[1], known.starts.shape[0] - 1
    if machine is None:
        norms = (features * features).sum(0)
        least = np.empty((classes, count), np.float32)
        for c, (begin, end) in enumerate(zip(known.starts, known.starts[1:], strict=False)):
            for s in range(0, count, PART):
                products = known.doubled[begin:end] @ features[:, s : s + PART]
                least[c, s : s + PART] = (products + known.squares[begin:end, None]).min(0)
        return np.rint(log32(least + norms + np.float32(1)) * np.float32(LOGS)).astype(np.uint16)
    logs = machine.empty((classes, count), np.uint16)
    machine.launch(
        "exemplars",
        (-(-count // machine.vector),),
        *(features, count, *known, classes, logs),
        defines={"K": features.shape[0], "V": machine.vector},
    )
    return logs


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
    """Return sums over the windows of sites, (planes, rows, cols) uint32 in 2**-18, each plane of one label's sites."""
    rows, cols = labels.shape  # values are below 2**13
    planes, reach = owner.shape[0], taps.shape[0] // 2
    if machine is None:
        here = (labels == owner[:, None, None]).astype(np.uint32) * (1 if values is None else values.astype(np.uint32))
        for axis, n in ((2, cols), (1, rows)):
            near = (here.take(within(np.arange(n) + t, n, False), axis) for t in range(-reach, reach + 1))
            here = np.sum([tap * part for tap, part in zip(taps, near, strict=True)], 0, dtype=np.uint32)
        return here
    counted = machine.empty((planes, rows, cols + 2 * reach), np.uint32)
    along, sums = (machine.empty((planes, rows, cols), np.uint32) for _ in range(2))
    machine.launch(
        "window_counted",
        (cols + 2 * reach, planes * rows),
        *(labels, rows, cols, owner, planes, labels if values is None else values, reach, counted),
        defines={"COUNT": 1} if values is None else {},
    )
    wide = {"V": machine.vector}
    size = -(-cols // machine.vector), planes * rows
    for name, before, after in (("window_rows", counted, along), ("window_cols", along, sums)):
        machine.launch(name, size, before, rows, cols, planes, taps, reach, after, defines=wide)
    return sums


WEIGHTS = 16
"""Units in 1 of the weight of votes."""


@Operation
def potts(machine: Launcher | None, sites: Array, evidence: Array, votes: Array, weight: int, labels: Array) -> Array:
    """Set sites to the class with the greatest evidence plus weight times votes, first of equals, in place."""
    classes = evidence.shape[0]
    if machine is None:
        energy = evidence.reshape(classes, -1)[:, sites]
        energy = energy + ((np.int32(weight) * votes.reshape(classes, -1)[:, sites].astype(np.int32)) >> 4)
        labels.reshape(-1)[sites] = energy.argmax(0)
        return labels
    machine.launch("potts", (sites.size,), sites, sites.size, evidence, votes, classes, labels.size, weight, labels)
    return labels
