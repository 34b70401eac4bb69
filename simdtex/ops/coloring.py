# SPDX-License-Identifier: BSD-3-Clause
"""Colouring of a lattice so that no two neighbours share a colour: sets of i.i.d. sites, equation (14)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex import random
from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.model.lattice import Grid, Sublattice, coloring_sublattice

UNCOLORED = -1

ROUNDS = 8
"""Greedy rounds between two looks at the colours; one too many changes nothing."""


def _lattice_reference(grid: Grid, offsets: NDArray[np.int32], pattern: Sublattice) -> NDArray[np.int32]:
    site = np.arange(grid.rows * grid.cols, dtype=np.int32)
    row, col = np.divmod(site, grid.cols)
    own = (row - col // pattern.c * pattern.b) % pattern.a * pattern.c + col % pattern.c
    r = grid.flat.neighbours(site, offsets)
    clash = ((r >= 0) & (r < site) & (own[r] == own)).any(0)
    colors: NDArray[np.int32] = np.where(clash, UNCOLORED, own).astype(np.int32)
    return colors.reshape(grid.rows, grid.cols)


def _lattice_launch(machine: Launcher, grid: Grid, offsets: Array, pattern: Sublattice) -> Array:
    colors = machine.empty((grid.rows, grid.cols), np.int32)
    basis = (np.int32(pattern.a), np.int32(pattern.b), np.int32(pattern.c))
    machine.launch(
        machine.kernel("coloring", "coloring_lattice"),
        (colors.size,),
        *(grid.flat.struct, offsets, np.int32(offsets.shape[0]), *basis, colors),
    )
    return colors


lattice_coloring = Operation("lattice_coloring", _lattice_reference, _lattice_launch)


def _greedy_reference(
    grid: Grid,
    offsets: NDArray[np.int32],
    bare: NDArray[np.int32],
    colors: NDArray[np.int32],
    seed: int,
    rounds: int = 1,
) -> NDArray[np.int32]:
    for _ in range(rounds):
        colors = _greedy_round(grid, offsets, colors, seed)
    return colors


def _greedy_round(grid: Grid, offsets: NDArray[np.int32], colors: NDArray[np.int32], seed: int) -> NDArray[np.int32]:
    flat = colors.ravel()
    bare = np.flatnonzero(flat == UNCOLORED).astype(np.int32)
    r = grid.flat.neighbours(bare, offsets)
    priority = random.draw4(seed, 0, 0, np.arange(flat.size), random.COLOR)[0].astype(np.int64)
    own, other = priority[bare], priority[r]
    rival = (r >= 0) & (flat[r] == UNCOLORED) & ((other > own) | ((other == own) & (r > bare)))
    new = flat.copy()
    for s in np.flatnonzero(~rival.any(0)):
        taken = set(flat[r[:, s][r[:, s] >= 0]].tolist())
        new[bare[s]] = next(color for color in range(len(taken) + 1) if color not in taken)
    return new.reshape(colors.shape)


def _greedy_launch(
    machine: Launcher, grid: Grid, offsets: Array, bare: Array, colors: Array, seed: int, rounds: int = 1
) -> Array:
    one, other = (machine.part(colors.reshape(-1), 0, colors.size).reshape(colors.shape) for _ in range(2))
    kernel = machine.kernel("coloring", "coloring_greedy")
    arguments = (grid.flat.struct, bare, np.int32(bare.size), offsets, np.int32(offsets.shape[0]), np.uint64(seed))
    machine.launch_rounds(kernel, bare.size, rounds, *arguments, one, other)
    return other if rounds % 2 else one


greedy_coloring = Operation("greedy_coloring", _greedy_reference, _greedy_launch)
"""``greedy_coloring(machine, grid, offsets, bare, colors, seed, rounds)``: ``bare`` (S,) int32 lists the sites of
``colors`` (rows, cols) that have none."""


def coloring(machine: Any, grid: Grid, offsets: NDArray[np.int32], order: int, seed: int = 0) -> Any:
    """Colour a level's lattice.

    The best lattice colouring of the plane where the size of the lattice takes it without a seam. Else either a
    lattice colouring with more colours that fits, or the best one with its clashes along the seam coloured
    greedily, whichever has fewer colours.

    Parameters
    ----------
    machine : Machine
    grid : Grid
    offsets : (N, 2) int32 array
        The neighbourhood.
    order : int
        Its order.
    seed : int
        Of the priorities of the greedy rounds.

    Returns
    -------
    (rows, cols) int32 array
        0 .. colours - 1. Cost: O(rows cols N) per round; a few tens of rounds at a seam.
    """
    device_offsets = machine.put(offsets)
    best = coloring_sublattice(order)
    assert best is not None  # a square pattern always exists in the plane
    colors = lattice_coloring(machine, grid, device_offsets, best)
    result = machine.get(colors)
    while (bare := np.flatnonzero(result.ravel() == UNCOLORED).astype(np.int32)).size:
        colors = greedy_coloring(machine, grid, device_offsets, machine.put(bare), colors, seed, ROUNDS)
        result = machine.get(colors)
    used = np.bincount(result.ravel()) > 0
    if grid.torus and used.sum() > best.index:
        seamless = coloring_sublattice(order, grid.rows, grid.cols, limit=int(used.sum()))
        if seamless:
            result = machine.get(lattice_coloring(machine, grid, device_offsets, seamless))
            used = np.bincount(result.ravel()) > 0
    return (np.cumsum(used) - 1).astype(np.int32)[result]
