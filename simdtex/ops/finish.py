# SPDX-License-Identifier: BSD-3-Clause
"""The finish: each pixel becomes the weighted mean of what its neighbours' sources say of it, so that seams melt.

x_s = sum_r w_r Y[p_r + (s - r)] / sum_r w_r, w_r = exp(-|r - s|^2 / 2 sd^2): the average over overlapping pieces of
Kwatra et al. (2005). Where all continue one another it is Y[p_s] itself. A neighbour whose value is given, and whose
source says nothing of s, says by how much the source of s misses it: Y[p_s] + (x_r - Y[p_s + (r - s)]).
"""

from __future__ import annotations

from math import ceil, exp, prod

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.model.lattice import Grid
from simdtex.model.sample import Sample
from simdtex.ops.neighbourhood import Field


def around(sd: float) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Offsets (N, 2), the site itself among them, and weights (N,) in 1/1024 of a Gaussian, cut off at 2.5 sd."""
    radius = ceil(2.5 * sd)
    row, col = np.mgrid[-radius : radius + 1, -radius : radius + 1].reshape(2, -1)
    squared = row * row + col * col
    inside = squared <= 6.25 * sd * sd
    weights = [round(1024 * exp(-n / (2 * sd * sd))) for n in squared[inside].tolist()]
    return np.stack([row, col], 1)[inside].astype(np.int32), np.array(weights, np.int32)


def _reference(
    field: Field,
    given: NDArray[np.uint8],
    grid: Grid,
    planes: NDArray[np.float32],
    sample: Sample,
    offsets: NDArray[np.int32],
    weights: NDArray[np.int32],
    first: int,
    count: int,
) -> NDArray[np.int16]:
    sites, source = grid.sites()[first : first + count], field.source.ravel()
    shown, usable = sample.working[: sample.shown].astype(np.int64), sample.inside.ravel()
    values = field.values[: sample.shown].reshape(sample.shown, -1).astype(np.int64)
    place, nowhere = np.maximum(source[sites], 0), source[sites] < 0
    own = shown[:, place]

    def within(pixel: NDArray[np.int32], offset: NDArray[np.int32]) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
        row, col = (np.stack(np.divmod(pixel, np.int32(sample.cols))) + offset[:, None]).astype(np.int64)
        at = np.stack([row, col]) - sample.margin
        there = (at >= 0).all(0) & (at[0] < sample.height) & (at[1] < sample.width)
        pixels = np.where(there, row * sample.cols + col, 0)
        return there & usable[pixels], pixels

    total, sums = np.zeros(count, np.int64), np.zeros(own.shape, np.int64)
    for offset, weight in zip(offsets, weights.tolist(), strict=True):
        r = grid.neighbours(sites, offset[None])[0] if offset.any() else sites
        told, p = within(source[r], -offset)
        told &= (r >= 0) & (source[r] >= 0)
        missed, q = within(place, offset)
        missed &= (r >= 0) & ~told & (given.ravel()[r] > 0)
        by = np.where(told, shown[:, p] - own, np.where(missed, values[:, r] - shown[:, q], 0))
        total += weight * (told | missed)
        sums += weight * by
    by = ((2 * sample.fine * sums + total) // np.maximum(2 * total, 1)).astype(np.int16)
    return np.where(nowhere, np.int16(0), by)


def _launch(
    machine: Launcher,
    field: Field,
    given: Array,
    grid: Grid,
    planes: Array,
    sample: Sample,
    offsets: NDArray[np.int32],
    weights: NDArray[np.int32],
    first: int,
    count: int,
) -> NDArray[np.int16]:
    out, i = machine.empty((sample.shown, count), np.int16), np.int32
    machine.launch(
        machine.kernel("finish", "finish", C=sample.shown),
        (count,),
        *(grid.struct, i(first), i(count), field.source, machine.constant(offsets), machine.constant(weights)),
        *(i(len(offsets)), planes, i(planes.shape[1]), i(sample.cols), i(sample.margin)),
        *(i(sample.height), i(sample.width), machine.put(sample.inside.view(np.uint8)), given, field.values),
        *(i(prod(field.source.shape)), i(sample.fine), out),
    )
    found: NDArray[np.int16] = machine.get(out)
    return found


finish = Operation("finish", _reference, _launch)
"""``finish(machine, field, given, grid, planes, sample, offsets, weights, first, count)``: (channels, count) int16.

On the host: by how much the pixels of the sites from ``first`` on differ from their sources, in working levels of 8-bit
samples, and in 1/8 of a working level of others. The ``field``, ``given`` (H, W) uint8, 1 where a value is given, and
``planes``, the sample's, are of the machine.
Cost: N channels gathers a site.
"""
