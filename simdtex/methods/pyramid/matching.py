# SPDX-License-Identifier: BSD-3-Clause
"""Histogram matching of every segment, Heeger and Bergen's match-histogram, in integers: by rank and by lookup.

Segments are rows of a (segments, n) int32 array. Each of T targets is for segments // T consecutive segments. The order
of the values of a segment comes from a stable radix sort, with ties in a given order.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher, Operation

SCRATCH = 2**22
"""Number of values sorted together, unless one segment has more: 16 bytes each for keys and indices, twice."""

DIGITS = 256
"""Number of values of the 8 bits that a pass sorts by."""


def run_length(machine: Launcher, segments: int, n: int) -> int:
    """Return the number of consecutive values of a segment for a work-item; it changes no bit.

    There are enough work-items to fill the device, but a run takes more work than its table of counters.
    """
    on_gpu = machine.info.kind == "gpu"
    items, least = (2**13, 256) if on_gpu else (8 * max(1, machine.info.compute_units), 4096)
    runs = max(1, min(items // segments, n // least))
    return -(-n // runs)


def local(machine: Launcher) -> tuple[int]:
    """Return the work-items of a group if each takes a run; on a CPU 1, to distribute a few long runs."""
    return (64,) if machine.info.kind == "gpu" else (1,)


@Operation
def sort(machine: Launcher | None, values: Array, first: Array) -> Array:
    """Return the index in each segment of its k-th smallest value, (segments, n) int32.

    ``values`` is (segments, n) int32. Equal values come in the order of the permutation ``first`` (n,) int32.
    """
    segments, n = values.shape
    if machine is None:
        return first[np.argsort(values[:, first], axis=1, kind="stable")]
    order = machine.empty((segments, n), np.int32)
    most = min(segments, max(1, SCRATCH // max(n, DIGITS)))
    pairs, moved = (machine.empty((most, n, 2), np.uint32) for _ in range(2))
    length = run_length(machine, most, n)
    runs = -(-n // length)
    counts, totals = machine.empty((most, runs, DIGITS), np.uint32), machine.empty((most, DIGITS), np.uint32)
    group = local(machine)
    for begin in range(0, segments, most):
        pieces = min(most, segments - begin)
        shape, size = (pieces, n, runs, length), (pieces * runs,)
        machine.launch("sort_read", size, values, begin, first, *shape, pairs, local=group)
        for shift in range(0, 32, 8):
            machine.launch("sort_count", size, pairs, *shape, shift, counts, local=group)
            machine.launch("sort_scan", (pieces * DIGITS,), pieces, runs, counts, totals)
            moving = (pairs, *shape, shift, counts, totals, moved, shift == 24, order, begin)
            machine.launch("sort_scatter", size, *moving, local=group)
            pairs, moved = moved, pairs
    return order


FRACTION = 20
"""Number of bits of the fraction of a bin."""

BINS = 256
"""Number of bins of a histogram in the paper."""


def inverse_cdf(sorted_values: NDArray[np.int32], bins: int = BINS) -> NDArray[np.int32]:
    """Return the inverse of a target's cdf as a table (bins + 1,) int32.

    The target's values are sorted, smallest first. The table holds the least value at which the cdf reaches 0, 1 /
    bins, 2 / bins, ... 1, rounded to the nearest, halves up; the target's histogram has 2 to 4096 equal bins over its
    range, uniform within each.
    """
    low, high = int(sorted_values[0]), int(sorted_values[-1])
    width, m = high - low, len(sorted_values)
    index = _bins_of(sorted_values.astype(np.int64) - low, np.int64(width), bins)
    below = np.concatenate(([0], np.cumsum(np.bincount(index, minlength=bins))))
    table = [low]
    for i in range(1, bins + 1):
        rank = i * m  # in values / bins, so that it is an integer
        b = int(np.searchsorted(below[1:] * bins, rank))
        before, after = int(below[b]) * bins, int(below[b + 1]) * bins
        here, unit = b * (after - before) + rank - before, (after - before) * bins
        table.append(low + (2 * here * width + unit) // (2 * unit))
    return np.array(table, np.int32)


def _bins_of(above: NDArray[np.int64], width: NDArray[np.int64] | np.int64, bins: int) -> NDArray[np.int64]:
    """Return the bins of values ``above`` the least; the greatest value is at the end of the last bin."""
    index: NDArray[np.int64] = np.minimum(above * bins // np.maximum(width, 1), bins - 1)
    return index


@Operation
def match_ranks(machine: Launcher | None, order: Array, targets: Array) -> Array:
    """Return values with the histograms of the targets, (segments, n) int32.

    ``order`` (segments, n) comes from `sort`, ``targets`` (T, m) int32 are sorted. The value of rank k among n becomes
    the target's value of rank (2 k + 1) m // (2 n) among m.
    """
    (segments, n), m = order.shape, targets.shape[1]
    each = segments // targets.shape[0]
    if machine is None:
        rank = (2 * np.arange(n, dtype=np.int64) + 1) * m // (2 * n)
        matched = np.empty_like(order)
        np.put_along_axis(matched, order, targets[:, rank].repeat(each, 0), 1)
        return matched
    values = machine.empty(order.shape, np.int32)
    machine.launch("matching_ranks", (n, segments), order, segments, n, targets, each, m, values)
    return values


@Operation
def match_lookup(machine: Launcher | None, values: Array, tables: Array) -> Array:
    """Return values with the histograms of the targets, through tables (T, bins + 1) int32, each from `inverse_cdf`.

    A segment's cdf is that of as many equal bins over its own range, uniform within each. The place of a value in its
    bin, and then in the table, is rounded down to 2**-20 of a bin; the result is linear between entries, rounded to the
    nearest, halves up. A constant segment takes the middle of the table, the target's median. 2 to 4096 bins.
    """
    (segments, n), bins = values.shape, tables.shape[1] - 1
    each = segments // tables.shape[0]
    if machine is None:
        looked = [_looked_up(row, tables[segment // each], bins) for segment, row in enumerate(values.astype(np.int64))]
        return np.array(looked, np.int32)
    runs, shape = _runs(machine, segments, n, bins)
    ranges, spans = machine.empty((segments, runs, 2), np.int32), machine.empty((segments, 2), np.int32)
    counts, cdf = machine.empty((segments, runs, bins), np.uint32), machine.empty((segments, bins + 1), np.uint32)
    result = machine.empty(values.shape, np.int32)
    size, group = (segments * runs,), local(machine)
    machine.launch("matching_range", size, values, *shape, ranges, local=group)
    machine.launch("matching_span", (segments,), ranges, segments, runs, spans)
    machine.launch("matching_count", size, values, *shape, spans, bins, counts, local=group)
    machine.launch("matching_total", (bins, segments), counts, segments, runs, bins, cdf)
    machine.launch("matching_cdf", (segments,), segments, bins, cdf)
    machine.launch("matching_lookup", (n, segments), values, segments, n, spans, bins, cdf, tables, each, result)
    return result


def _looked_up(values: NDArray[np.int64], targets: NDArray[np.int32], bins: int) -> NDArray[np.int64]:
    table, n = targets.astype(np.int64), values.size
    above, width = values - values.min(), values.max() - values.min()
    place = np.full(n, bins << FRACTION - 1, np.int64)
    if width > 0:
        b = _bins_of(above, width, bins)
        below = np.concatenate(([0], np.cumsum(np.bincount(b, minlength=bins))))
        part = ((above * bins - b * width) << FRACTION) // width
        place = ((below[b] << FRACTION) + (below[b + 1] - below[b]) * part) * bins // n
    k = np.minimum(place >> FRACTION, bins - 1)
    rise = (table[k + 1] - table[k]) * (place - (k << FRACTION))
    return np.asarray(table[k] + ((rise + (1 << FRACTION - 1)) >> FRACTION))


@Operation
def distance(machine: Launcher | None, before: Array, after: Array) -> Array:
    """Return the sum of |before - after| over each segment, (segments,) int64.

    After `match_ranks` it is n times the Wasserstein-1 distance of the two histograms.
    """
    if machine is None:
        return abs(before.astype(np.int64) - after).sum(1)
    segments, n = before.shape
    runs, shape = _runs(machine, segments, n)
    sums, totals = machine.empty((segments, runs), np.int64), machine.empty((segments,), np.int64)
    machine.launch("matching_distance", (segments * runs,), before, after, *shape, sums, local=local(machine))
    machine.launch("matching_sum", (segments,), sums, segments, runs, totals)
    return totals


def _runs(machine: Launcher, segments: int, n: int, table: int = 0) -> tuple[int, tuple[int, ...]]:
    """Return the number of runs of a segment, each at least as long as its table, and the shape for kernels."""
    length = min(n, max(run_length(machine, segments, n), table))
    runs = -(-n // length)
    return runs, (segments, n, runs, length)


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
