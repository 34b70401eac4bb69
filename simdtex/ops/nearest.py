# SPDX-License-Identifier: BSD-3-Clause
"""ICM over sample positions: each site's nearest candidate, found without keeping a distance.

The twin weighs everything and takes the least. A device first weighs the few candidates that continue a neighbour's
source, and then drops whatever is proved to lie beyond the best so far: ``docs/concepts/skipping.rst``.
"""

from __future__ import annotations

from functools import lru_cache
from math import prod
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from simdtex.lattice import Grid
from simdtex.ops import coherence, lcpdf, neighbourhood
from simdtex.ops.lcpdf import Relaxed
from simdtex.ops.neighbourhood import Field
from simdtex.ops.operation import Array, Operation
from simdtex.sample import BLOCK, Candidates

if TYPE_CHECKING:
    from simdtex.machine.opencl import OpenCL

CHECK = 4
"""Neighbours between two looks at the bound; every neighbourhood has a multiple of 4."""


def slack(terms: int) -> np.float32:
    """The factor by which a sum of so many squares may exceed the same sum in another order, generously.

    Either differs from the exact sum by a factor within (1 + 2**-24)**terms, so they differ by less than
    1 + 4 terms 2**-24; rounding the product of bound and factor is within the rest.
    """
    return np.float32(1 + (terms + 2) * 2.0**-22)


@lru_cache(maxsize=16)
def _spread(offsets: bytes) -> NDArray[np.int32]:
    """An order of neighbours in which each is as far as can be from those before: close ones say much the same."""
    place = np.frombuffer(offsets, np.int32).reshape(-1, 2).astype(np.int64)
    gap = np.full(len(place), np.iinfo(np.int64).max)
    order = []
    for _ in place:
        order.append(int(gap.argmax()))
        gap = np.minimum(gap, ((place - place[order[-1]]) ** 2).sum(1))
        gap[order] = -1
    return np.array(order, np.int32)


def _reference(
    sites: NDArray[np.int32],
    field: Field,
    offsets: NDArray[np.int32],
    grid: Grid,
    candidates: Candidates,
    favour: np.float32,
) -> Relaxed:
    near = neighbourhood.neighbourhood.reference(sites, field, offsets, grid)
    distances = lcpdf.distance.reference(near, candidates)
    distances = coherence.coherence.reference(distances, candidates, sites, field, offsets, grid, favour)
    return lcpdf.best.reference(distances, candidates)


def _launch(
    machine: OpenCL, sites: Array, field: Field, offsets: Array, grid: Grid, candidates: Candidates, favour: np.float32
) -> Relaxed:
    count, neighbours, channels = sites.size, offsets.shape[0], field.values.shape[0]
    strip, plane = candidates.strip, np.int32(candidates.rows * candidates.cols)
    defines = {"V": machine.vector, "C": channels, "N": neighbours, "STEP": machine.step, "CHECK": CHECK}
    near = machine.empty((count, neighbours * (1 + channels)), np.float32)
    terms = machine.empty((count, neighbours * (2 + channels)), np.float32)
    used, where = machine.empty((count,), np.int32), machine.empty((count,), np.int32)
    least = machine.empty((count,), np.float32)
    machine.launch_sites(
        ("nearest", "nearest_begin"),
        (count,),
        *(sites, np.int32(count), *field, np.int32(prod(field.values.shape[1:])), offsets, *grid.args),
        *(candidates.index_of, np.int32(candidates.rows), np.int32(candidates.cols)),
        *(candidates.pixels, candidates.positions, candidates.reach, strip.reach),
        *(machine.constant(_spread(strip.offsets)), favour, near, terms, used, least, where),
        defines=defines,
    )
    tally = machine.tally.slots(count)
    if machine.skip:
        split = machine.split(count, -(-strip.cols // (machine.vector * machine.step)) * strip.rows)
        pitch = count
        found, at, work = (machine.empty((split, count), t) for t in (np.float32, np.int32, np.uint32))
        shape = (strip.first, strip.pitch, strip.rows, strip.cols)
        machine.launch_sites(
            ("nearest", "nearest_scan"),
            (count * split,),
            *(np.int32(count), terms, used, near, least, where),
            *(strip.pixels, np.int32(strip.pixels.shape[1]), *(np.int32(n) for n in shape), strip.reach),
            *(slack(neighbours * channels), np.int32(split), found, at, work),
            defines=defines,
        )
        machine.tally.expect(2 * count * candidates.size * neighbours * channels)
    else:
        blocks = candidates.positions.size // BLOCK
        around = neighbourhood.neighbourhood(machine, sites, field, offsets, grid)
        pitch = around.weighted.shape[2]
        split = machine.split(pitch // machine.vector, blocks)
        found, at = machine.empty((split, pitch), np.float32), machine.empty((split, pitch), np.int32)
        work = where
        machine.launch_sites(
            ("nearest", "nearest_plain"),
            (pitch // machine.vector, split),
            *(around.confidence, around.weighted, np.int32(pitch)),
            *(candidates.pixels, plane, candidates.positions, np.int32(candidates.size)),
            *(candidates.reach, np.int32(blocks), np.int32(split), found, at),
            local=machine.tile,
            defines=defines,
        )
    out = Relaxed(machine.empty((count,), np.int32), machine.empty((channels, count), np.uint16))
    machine.launch_sites(
        ("nearest", "nearest_end"),
        (count,),
        *(np.int32(count), np.int32(pitch), least, where, np.int32(split), found, at),
        *(np.int32(machine.skip), work, candidates.pixels, plane, candidates.positions, tally, *out),
        defines=defines,
    )
    return out


nearest = Operation("nearest", _reference, _launch)
