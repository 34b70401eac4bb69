# SPDX-License-Identifier: BSD-3-Clause
"""ICM over sample positions: each site's nearest candidate, found without storing distances.

The twin evaluates all candidates and takes the nearest. A device first evaluates the few candidates that continue a
neighbour's source, and then skips candidates that a bound excludes: ``docs/concepts/search.rst``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, lru_cache, partial
from math import prod
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher, Machine, Operation
from simdtex.model.lattice import Grid, parts_of
from simdtex.model.regularity import WAVES
from simdtex.model.sample import Candidates, Places, Sample
from simdtex.ops import coherence, lcpdf, neighbourhood
from simdtex.ops.charge import charge
from simdtex.ops.costs import Costs
from simdtex.ops.lcpdf import Relaxed
from simdtex.ops.leaves import FEATURES, Leaves, grow
from simdtex.ops.neighbourhood import Field

CHECK = 4
"""Neighbours between two checks of the bound; in a picture their number is a multiple of 4, in a volume of 2."""

TAIL = 1024
"""Values after a strip that may be read at the end of the candidates' rows, without an effect."""


class Strip(NamedTuple):
    """The pixels of a level's candidates and of their neighbours, row by row.

    ``pixels`` (C, size) float32, the last `TAIL` of them 0; candidate (i, j) of ``rows`` x ``cols``, in the order of
    the list, is pixel ``first`` + i ``pitch`` + j, and ``thick`` pixels further in the next layer, every ``high`` rows;
    ``reach`` (N,) int32, the pixel offset of each neighbour; ``offsets``, the offsets of the neighbourhood as bytes;
    ``leaves()``, the candidates by features, made at the first call.
    """

    pixels: Array
    first: int
    pitch: int
    rows: int
    cols: int
    high: int
    thick: int
    reach: Array
    offsets: bytes
    leaves: Callable[[], Leaves | None]


def strip_of(machine: Machine, sample: Sample, places: Places) -> Strip:
    """Return the strip of a level's candidates."""
    offsets, positions, spacing, step = places.offsets, places.everywhere, places.spacing, places.step
    line, col = (int(n) for n in divmod(positions[0], sample.cols))
    layer, row = divmod(line, sample.layer or sample.rows)
    planes = sample.working.reshape(len(sample.working), -1, sample.layer or sample.rows, sample.cols)
    planes = planes[:, layer % step :: step, row % step :: step, col % step :: step]
    thick, pitch = planes.shape[2] * planes.shape[3], planes.shape[3]
    pixels = np.pad(planes.reshape(len(planes), -1).astype(np.float32), ((0, 0), (0, TAIL)))
    reach = np.stack(parts_of(offsets), 1) @ np.array([thick, pitch, 1]) * (spacing // step)
    wide, lines = places.col.size, places.row.size
    first, reaches = layer // step * thick + row // step * pitch + col // step, machine.put(reach.astype(np.int32))
    shape = (first, pitch, lines, wide, lines // places.layers, thick)
    leaves = cache(partial(grow, machine, sample.working, positions, places.reach, sample.top))
    return Strip(machine.put(pixels), *shape, reaches, offsets.tobytes(), leaves)


def slack(terms: int) -> np.float32:
    """Return an upper bound of the ratio of a sum of ``terms`` squares to the same sum in another order.

    Each differs from the exact sum by a factor within (1 + 2**-24)**terms, so their ratio is below 1 + 4 terms 2**-24;
    the margin also covers the rounding of the product of bound and factor.
    """
    return np.float32(1 + (terms + 2) * 2.0**-22)


@lru_cache(maxsize=16)
def _spread(offsets: bytes) -> NDArray[np.int32]:
    """Return an order of neighbours in which each is far from earlier ones, since close ones differ alike."""
    place = np.stack(parts_of(np.frombuffer(offsets, np.int32).reshape(-1, 2).astype(np.int64)), 1)
    gap = np.full(len(place), np.iinfo(np.int64).max)
    order = []
    for _ in place:
        order.append(int(gap.argmax()))
        gap = np.minimum(gap, ((place - place[order[-1]]) ** 2).sum(1))
        gap[order] = -1
    return np.array(order, np.int32)


@Operation
def nearest(
    machine: Launcher | None,
    sites: Array,
    field: Field,
    offsets: Array,
    grid: Grid,
    candidates: Candidates,
    strip: Strip,
    discount: np.float32,
    costs: Costs,
) -> Relaxed:
    """Return the nearest candidate of each site, by its distance, discounted for coherence, plus all other costs.

    ``discount`` is 1 / (1 + coherence).
    """
    if machine is None:
        around = neighbourhood.neighbourhood.reference(sites, field, offsets, grid)
        distances = lcpdf.distance.reference(around, candidates)
        distances = coherence.coherence.reference(distances, candidates, sites, field, offsets, grid, discount)
        distances = charge.reference(distances, candidates, sites, costs)
        choice = candidates.positions[distances.distance.argmin(0)]
        return Relaxed(choice, candidates.pixels[:, choice].astype(np.uint16))
    count, neighbours, channels = sites.size, offsets.shape[0], field.values.shape[0]
    check = CHECK if neighbours % CHECK == 0 else 2
    defines = {"V": machine.vector, "C": channels, "STEP": machine.step, "CHECK": check} | costs.defines
    more = costs.arguments(machine, candidates)
    f, i, leaves = np.float32, np.int32, strip.leaves()
    near = machine.empty((count, neighbours * (1 + channels)), f)
    listed = machine.empty((count, neighbours * (2 + channels)), i)
    least, certain = machine.empty((count,), f), machine.empty((count,), f)
    used, where = machine.empty((count,), i), machine.empty((count,), i)
    features = machine.empty((count, FEATURES), f)
    axes = leaves.axes if leaves else machine.constant(np.zeros((neighbours * channels, FEATURES), f))
    machine.launch(
        "nearest_begin",
        (count,),
        *(sites, count, neighbours, *field, prod(field.values.shape[1:]), offsets, grid.struct, candidates.index_of),
        *(candidates.plane, candidates.pixels, candidates.positions, candidates.reach, strip.reach),
        *(machine.constant(_spread(strip.offsets)), discount, *more, axes, f(leaves.middle if leaves else 0)),
        *(near, listed, used, features, least, where, certain),
        defines=defines,
    )
    split = machine.split(count, -(-strip.cols // (machine.vector * machine.step)) * strip.rows)
    row = split if leaves else 0  # the leaves' results come first
    parts = row + split
    found, at, work, wanted = (machine.empty((parts, count), t) for t in (f, i, np.uint64, i))
    if leaves:
        machine.launch(
            "nearest_leaves",
            (count * split,),
            *(sites, count, neighbours, near, features, least, where, certain),
            *(leaves.box, leaves.rows, leaves.order, leaves.number, f(leaves.blur)),
            *(candidates.pixels, candidates.plane, candidates.positions, candidates.reach, *more, split),
            *(found, at, work, wanted),
            defines=defines,
        )
    shape = (strip.first, strip.pitch, strip.rows, strip.cols, strip.high, strip.thick)
    machine.launch(
        "nearest_scan",
        (count * split,),
        *(sites, count, neighbours, listed, used, near, least, where),
        *(strip.pixels, strip.pixels.shape[1], *shape, strip.reach, *more),
        *(slack(neighbours * channels + WAVES), split, leaves is None, wanted, row, found, at, work),
        defines=defines,
    )
    tally = machine.fma_counters(count, 2 * count * candidates.size * neighbours * channels)
    out = Relaxed(machine.empty((count,), np.int32), machine.empty((channels, count), np.uint16))
    machine.launch(
        "nearest_end",
        (count,),
        *(count, least, where, parts, found, at, work),
        *(candidates.pixels, candidates.plane, candidates.positions, tally, *out),
        defines=defines,
    )
    return out
