# SPDX-License-Identifier: BSD-3-Clause
"""Sets of sites, found on the machine: active sites, colours, and random sets without neighbours, equation (14).

Active sites, with a temperature above 0, are counted and listed without a copy to the host. The colour of a site is a
formula of its row and column, so that no two neighbours share a colour, except along the seam of a torus that cuts
through the pattern; a list holds the colours of those sites. So any window of a lattice is coloured without the rest of
it. A random maximal set of sites without neighbours takes the rounds of Luby (1986).
"""

from __future__ import annotations

from dataclasses import astuple, replace
from functools import lru_cache
from math import inf
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex import random
from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.model.lattice import (
    Grid,
    Sublattice,
    coloring_sublattice,
    gathered,
    neighbourhood_offsets,
)

CHUNK = 256
"""The most sites that a work-item counts."""


@Operation
def survey(machine: Launcher | None, grid: Grid, temperature: Array) -> tuple[int, int]:
    """Return the number of active sites, and the sum of their temperatures in 1/1024."""
    if machine is None:
        t = grid.latest(temperature)
        return int((t > 0).sum()), int(t.sum(dtype=np.int64))
    stretches = -(-grid.size // CHUNK)
    both = machine.empty((2, stretches), np.int32)
    machine.launch("active_survey", (stretches,), grid.struct, temperature, CHUNK, stretches, both)
    count, total = machine.get(both).sum(1, dtype=np.int64)
    return int(count), int(total)


def stretches(starts: NDArray[np.int64]) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Return the bounds of the stretches, of at most `CHUNK` sites, of groups, and the number of each group's first."""
    pieces = -(-np.diff(starts) // CHUNK)
    firsts = np.concatenate([[0], np.cumsum(pieces)])
    within = np.arange(firsts[-1]) - np.repeat(firsts[:-1], pieces)
    begins = np.repeat(starts[:-1], pieces) + within * CHUNK
    return np.concatenate([begins, starts[-1:]]).astype(np.int32), firsts


@Operation
def among(
    machine: Launcher | None, sites: Array, starts: Array, firsts: NDArray[np.int64], temperature: Array
) -> tuple[Array, NDArray[np.int64]]:
    """Return the active sites of a list in its order, and the bounds of its groups among them.

    ``sites`` (S,) int32 are their numbers, group after group; ``starts`` and ``firsts`` come from `stretches`.
    """
    if machine is None:
        active = temperature.ravel()[sites] > 0
        return sites[active], np.concatenate([[0], np.cumsum(active)])[starts[firsts]]
    stretches = starts.size - 1
    counts = machine.empty((stretches,), np.int32)
    machine.launch("active_count", (stretches,), sites, starts, stretches, temperature, counts)
    before = np.concatenate([[0], np.cumsum(machine.get(counts), dtype=np.int64)])
    if before[-1] < sites.size:
        kept = machine.empty((int(before[-1]),), np.int32)
        machine.launch(
            "active_keep",
            (stretches,),
            *(sites, starts, stretches, temperature, machine.put(before[:-1].astype(np.int32)), kept),
        )
        sites = kept
    return sites, before[firsts]


VAST = 2**17
"""Rows plus columns beyond which a pattern that fits is used, if any, without a greedy colouring of the seam.

It has a few more colours, but the greedy colouring takes minutes."""

NEIGHBOURS_AT_ONCE = 2**20
"""The most neighbours that are processed together."""


NOTHING: NDArray[Any] = np.zeros(0, np.int64)


class LatticeColoring(NamedTuple):
    """The colouring of a lattice.

    ``pattern``, the sublattice whose cosets are the colours; ``colors``, the number of used colours; ``seam`` (n,)
    int64, ascending, the numbers row cols + column of the sites with separate colours, and ``own`` (n,) int32, those
    colours; ``names`` (cosets,) int32, the number of each coset among the used colours, empty if all are used.
    """

    pattern: Sublattice
    colors: int
    seam: NDArray[np.int64] = NOTHING
    own: NDArray[np.int32] = NOTHING
    names: NDArray[np.int32] = NOTHING


@Operation
def coloring(machine: Launcher | None, grid: Grid, plan: LatticeColoring) -> Array:
    """Return the colours of a lattice, or of a window of it: an int32 array with the grid's shape, on the machine.

    A window's sites have their colours in the whole. Cost: O(sites log seam).
    """
    if machine is None:
        *layer, row, col = np.ix_(*grid.lines())
        coset = plan.pattern.coset(row, col, *layer)
        color = plan.names[coset] if plan.names.size else coset
        site = row * grid.whole.cols + col
        at = np.searchsorted(plan.seam, site)
        return np.where(np.append(plan.seam, -1)[at] == site, np.append(plan.own, 0)[at], color).astype(np.int32)
    colors, (names, seam, greedy) = (
        machine.empty(grid.shape, np.int32),
        map(machine.put, (plan.names, plan.seam, plan.own)),
    )
    table = names, names.size, seam, greedy, seam.size
    machine.launch("coloring_sites", (grid.size,), grid.struct, *astuple(plan.pattern), *table, colors)
    return colors


@Operation
def by_color(machine: Launcher | None, colors: Array, count: int) -> tuple[Array, NDArray[np.int64]]:
    """Return the sites (S,) int32 colour by colour, row by row within each, and the bounds of the colours among them.

    Raises ValueError if a colour is not one of 0 to ``count`` - 1. Cost: O(sites + count).
    """
    if machine is None:
        sites: Array = np.argsort(colors, None, kind="stable").astype(np.int32)
        starts = np.searchsorted(colors.ravel()[sites], np.arange(count + 1))
    else:
        length = max(CHUNK, 4 * count)  # so that counts take less memory than sites
        runs = -(-colors.size // length)
        shape, counts = (colors.size, length, runs, count), machine.empty((count, runs), np.int32)
        machine.launch("coloring_count", (runs,), colors, *shape, counts)
        before = np.append(0, np.cumsum(machine.get(counts), dtype=np.int64))
        sites, starts = machine.empty((colors.size,), np.int32), before[::runs]
        machine.launch("coloring_list", (runs,), colors, *shape, machine.put(before[:-1].astype(np.int32)), sites)
    if starts[0] or starts[-1] < colors.size:
        raise ValueError(f"a schedule has sites in groups that are not 0 to {count - 1}, as its `count` says")
    return sites, starts


@lru_cache(maxsize=32)
def lattice_plan(rows: int, cols: int, torus: bool, order: int, seed: int) -> LatticeColoring:
    """Return the colouring of a picture's whole lattice, for equation (14).

    It is the best lattice colouring of the plane if its size admits that without a seam. Otherwise it is either a
    lattice colouring with more colours that fits, or the best one with its clashes along the seam coloured greedily,
    whichever has fewer colours; a vast lattice has the former, if any. ``seed`` sets the priorities of the greedy
    rounds. Cost: a few tens of rounds along the seam.
    """
    best = coloring_sublattice(order)
    assert best is not None  # a square pattern always exists in the plane
    offsets = neighbourhood_offsets(order).astype(np.int64)
    seamless = coloring_sublattice(order, rows, cols, limit=max(best.index, len(offsets) + 1)) if torus else best
    seam, greedy = NOTHING, None
    vast = rows + cols > VAST and seamless is not None
    if seamless != best and not vast:
        seam = _clashing(rows, cols, offsets, best)
        priority = random.draw4(seed, 0, 0, seam, random.COLOR)[0].astype(np.int64)
        most = max(best.index, seamless.index - 1) if seamless else inf
        greedy = _greedy(rows, cols, offsets, best, seam, priority, most)
    if greedy is None:
        assert seamless is not None  # otherwise greedy colours have no limit
        best, seam, greedy = seamless, NOTHING, NOTHING
    used, radius = np.zeros(1 + max(best.index - 1, int(greedy.max(initial=0))), bool), int(offsets.max())
    used[greedy] = True
    if rows - radius >= best.a and cols - 2 * radius >= best.c:
        used[: best.index] = True  # away from the seam lies one site of each coset
    else:
        used[best.coset(*np.divmod(np.delete(np.arange(rows * cols), seam), cols))] = True
    names = (np.cumsum(used) - 1).astype(np.int32)
    return LatticeColoring(best, int(used.sum()), seam, names[greedy], names)


def _clashing(rows: int, cols: int, offsets: NDArray[np.int64], pattern: Sublattice) -> NDArray[np.int64]:
    """Return the later site of each pair of neighbours across the seam in one coset."""
    radius, first, col = int(offsets.max()), np.arange(rows)[:, None] * cols, np.arange(cols)
    site = np.union1d(first[-radius:] + col, first + col[(col < radius) | (col >= cols - radius)])
    clash = [np.zeros(0, bool)]
    for here in _pieces(site, len(offsets)):
        row, col = np.divmod(here, cols)
        k, m = row + offsets[:, :1], col + offsets[:, 1:]
        across = np.nonzero((k < 0) | (k >= rows) | (m < 0) | (m >= cols))
        k, m, color = k[across] % rows, m[across] % cols, pattern.coset(row, col)[across[1]]
        met = (k * cols + m < here[across[1]]) & (pattern.coset(k, m) == color)
        clash.append(np.bincount(across[1][met], minlength=here.size) > 0)
    return np.compress(np.concatenate(clash), site)


def _pieces(sites: NDArray[np.int64], neighbours: int) -> list[NDArray[np.int64]]:
    """Return sites in pieces that are small enough to process all their neighbours together."""
    return np.array_split(sites, 1 + sites.size * neighbours // NEIGHBOURS_AT_ONCE)


def _greedy(
    rows: int,
    cols: int,
    offsets: NDArray[np.int64],
    pattern: Sublattice,
    bare: NDArray[np.int64],
    priority: NDArray[np.int64],
    most: float,
) -> NDArray[np.int32] | None:
    """Return the parallel greedy colouring (Jones and Plassmann) of the sites of a torus without a colour.

    In each round every site whose priority is above those of all its uncoloured neighbours takes the lowest colour
    that no neighbour has. The result is None if some site needs the colour ``most`` or a higher one.
    """
    n = bare.size
    taken = np.zeros((n, max(pattern.index, len(offsets) + 1) + 1), bool)
    near = np.empty((len(offsets), n), np.int64)
    first = 0
    for here in _pieces(bare, len(offsets)):
        row, col = np.divmod(here, cols)
        k, m = (row + offsets[:, :1]) % rows, (col + offsets[:, 1:]) % cols
        r = k * cols + m
        at = np.minimum(np.searchsorted(bare, r), n - 1)
        other = bare[at] == r
        near[:, first : first + here.size] = np.where(other & (r != here), at, n)
        fixed = np.nonzero(~other)
        taken[first + fixed[1], pattern.coset(k[fixed], m[fixed])] = True
        first += here.size
    rank = np.empty(n, np.int64)
    rank[np.lexsort((bare, priority))] = np.arange(n)
    rank = np.append(rank, -1)  # the last, n in `near`, is that of no neighbour
    colors, left = np.full(n, -1, np.int32), np.arange(n)
    while left.size:
        now = left[(rank[near[:, left]] < rank[left]).all(0)]
        colors[now] = taken[now].argmin(1)
        if (colors[now] >= most).any():
            return None
        those = near[:, now]
        taken[those[those < n], np.broadcast_to(colors[now], those.shape)[those < n]] = True
        rank[now] = -1
        left = left[colors[left] < 0]
    return colors


UNDECIDED, IN, OUT = 0, 1, 2

ROUNDS = 4
"""Rounds between two checks for the end; further rounds change nothing."""


@Operation
def luby(
    machine: Launcher | None, grid: Grid, offsets: Array, active: Array, seed: int, level: int, count: int
) -> NDArray[np.uint8]:
    """Return the members of the set among ``active`` sites, (rows, cols) uint8, on the host: the greedy choice.

    Cost: O(rows cols N) per round, some 5 to 10 rounds.
    """
    grid, sites, begin = replace(grid, tile=None), grid.size, grid.key[0]
    if machine is None:
        draws = random.draw4(seed, level, count, begin + np.arange(sites), random.SCHEDULE)[0].astype(np.int64)
        host = np.where(active.ravel(), UNDECIDED, OUT).astype(np.uint8)
        while (undecided := np.flatnonzero(host == UNDECIDED).astype(np.int32)).size:
            r = grid.neighbours(undecided, offsets)
            near, drawn = gathered(host, r, OUT), gathered(draws, r, -1)
            above = (drawn > draws[undecided]) | ((drawn == draws[undecided]) & (r > undecided))
            beaten, rival = (near == IN).any(0), ((near == UNDECIDED) & above).any(0)
            host[undecided] = np.where(beaten, OUT, np.where(rival, UNDECIDED, IN))
        return np.asarray(host == IN, np.uint8).reshape(active.shape)
    priority = machine.empty((sites,), np.uint32)
    state, following = (machine.empty(grid.shape, np.uint8) for _ in range(2))
    machine.launch(
        "luby_priority",
        (sites,),
        *(sites, np.uint64(seed), np.uint32(level), np.uint32(count), np.uint64(begin), active, priority, state),
    )
    while True:
        for _ in range(ROUNDS):
            machine.launch(
                "luby_round",
                (sites,),
                *(grid.struct, offsets, offsets.shape[0], priority, state, following),
                defines=grid.defines,
            )
            state, following = following, state
        host = machine.get(state)
        if not (host == UNDECIDED).any():
            return np.asarray(host == IN, np.uint8)
