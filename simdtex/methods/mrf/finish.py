# SPDX-License-Identifier: BSD-3-Clause
"""The finish: each pixel becomes the weighted mean of its neighbours' sources, continued to it, which blends seams.

x_s = sum_r w_r Y[p_r + (s - r)] / sum_r w_r, w_r = exp(-|r - s|^2 / 2 sd^2): the average over overlapping pieces of
Kwatra et al. (2005). Where all sources continue one another, x_s is Y[p_s] itself. For a given neighbour whose source
does not reach s, the term is Y[p_s] plus the error of the source of s at that neighbour: x_r - Y[p_s + (r - s)].
"""

from __future__ import annotations

from functools import cache
from math import ceil, exp, prod

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.methods.mrf.neighbourhood import Field
from simdtex.model.lattice import Grid, gathered
from simdtex.model.sample import Sample


@cache
def gaussian_offsets(sd: float) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return offsets (N, 2), including the site itself, and weights (N,) in 1/1024 of a Gaussian cut off at 2.5 sd."""
    radius = ceil(2.5 * sd)
    row, col = np.mgrid[-radius : radius + 1, -radius : radius + 1].reshape(2, -1)
    squared = row * row + col * col
    inside = squared <= 6.25 * sd * sd
    weights = [round(1024 * exp(-n / (2 * sd * sd))) for n in squared[inside].tolist()]
    return np.stack([row, col], 1)[inside].astype(np.int32), np.array(weights, np.int32)


@Operation
def finish(
    machine: Launcher | None,
    field: Field,
    known: Array,
    grid: Grid,
    planes: Array,
    sample: Sample,
    sd: float,
    rows: range,
) -> NDArray[np.int16]:
    """Return the difference of pixels from their sources, (channels, count), on the host.

    It has the sites of ``rows`` of the grid, in working levels for 8-bit samples and in 1/8 of a working level for all
    others. ``field``, ``known`` (H, W) uint8, 1 if a value is given, and ``planes``, those of the sample, are arrays of
    the machine. Cost: N channels gathers per site.
    """
    offsets, weights = gaussian_offsets(sd)
    first, count = rows.start * grid.cols, len(rows) * grid.cols
    if machine is None:
        sites = np.arange(first, first + count, dtype=np.int32)
        source = field.source.ravel()
        shown, usable = sample.working[: sample.shown].astype(np.int64), sample.inside.ravel()
        values = field.values[: sample.shown].reshape(sample.shown, -1).astype(np.int64)
        centre = gathered(shown, source[sites], 0)

        def within(pixel: NDArray[np.int32], offset: NDArray[np.int32]) -> NDArray[np.int64]:
            row, col = (np.stack(np.divmod(pixel, np.int32(sample.cols))) + offset[:, None]).astype(np.int64)
            at = np.stack([row, col]) - sample.margin
            there = (pixel >= 0) & (at >= 0).all(0) & (at[0] < sample.height) & (at[1] < sample.width)
            index = np.where(there, row * sample.cols + col, -1)
            return np.where(gathered(usable, index, False), index, -1)

        total, sums = np.zeros(sites.size, np.int64), np.zeros(centre.shape, np.int64)
        for offset, weight in zip(offsets, weights.tolist(), strict=True):
            r = grid.neighbours(sites, offset[None])[0] if offset.any() else sites
            p = within(gathered(source, r, -1), -offset)
            q = np.where((p < 0) & (gathered(known.ravel(), r, 0) > 0), within(source[sites], offset), -1)
            there = (source[sites] >= 0) & ((p >= 0) | (q >= 0))
            by = np.where(p < 0, gathered(values, r, 0) - gathered(shown, q, 0), gathered(shown, p, 0) - centre)
            total += weight * there
            sums += weight * np.where(there, by, 0)
        return ((2 * sample.fine * sums + total) // np.maximum(2 * total, 1)).astype(np.int16)
    out = machine.empty((sample.shown, count), np.int16)
    machine.launch(
        "finish",
        (count,),
        *(grid.struct, first, count, field.source, machine.constant(offsets), machine.constant(weights)),
        *(len(offsets), planes, planes.shape[1], sample.cols, sample.margin),
        *(sample.height, sample.width, machine.put(sample.inside.view(np.uint8)), known, field.values),
        *(prod(field.source.shape), sample.fine, out),
        defines={"C": sample.shown},
    )
    finished: NDArray[np.int16] = machine.get(out)
    return finished
