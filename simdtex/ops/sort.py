# SPDX-License-Identifier: BSD-3-Clause
"""The order of the values of every segment: a stable radix sort, with ties in a given order."""

from __future__ import annotations

import numpy as np

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
