# SPDX-License-Identifier: BSD-3-Clause
"""The candidates whose neighbourhoods in the sample are most like that of each candidate: k-coherence (Tong 2002).

A level with few candidates compares each with all. A finer one looks where the level above found some: those that are
like p lie about as far from p as those that are like p's parent lie from that, and those like the candidates around p
from these (PatchMatch, Barnes 2009). Every candidate looks in parallel, so the table is the same on every machine.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex import random
from simdtex.machine.interface import Array, Launcher, Machine, Operation
from simdtex.model.sample import Candidates, Sample
from simdtex.ops.square import Square

FEW = 1024
"""Candidates of which each is compared with all."""

APART = 1
"""Rows and columns of candidates within which two are too much the same."""

ROUNDS, ROUNDS_FROM_NOWHERE = 2, 6
"""How often a table is made from another: from that of the level above, and from one at random."""


class Lattice(NamedTuple):
    """Where the candidates of a level lie.

    ``rows``, ``cols`` lines of the sample, pixels; ``step`` pixels from one to the next; ``positions`` (n,) pixel index
    of each, on the host; ``number`` (rows cols,) of the candidate at each crossing, -1 where there is none.
    """

    rows: NDArray[np.int32]
    cols: NDArray[np.int32]
    step: int
    positions: NDArray[np.int32]
    number: NDArray[np.int32]


def lattice_of(sample: Sample, offsets: NDArray[np.int32], spacing: int, phases: str, edges: str) -> Lattice:
    """Where the candidates of a level lie: see `simdtex.model.sample.Sample.positions`."""
    where = (offsets, spacing, phases, edges)
    lines, positions, allowed = sample.lines(*where), sample.positions(*where), sample.allowed(*where)
    number = np.arange(lines[0].size * lines[1].size, dtype=np.int32)
    if allowed is not None:
        number = np.where(allowed, np.cumsum(allowed) - 1, -1).astype(np.int32)
    return Lattice(*lines, spacing if phases == "decimated" else 1, positions, number)


class Table(NamedTuple):
    """``numbers`` (n, K) int32 array of the machine; ``lattice`` of the candidates."""

    numbers: Array
    lattice: Lattice


def _reference(
    offsets: NDArray[np.int32],
    candidates: Candidates,
    square: Square,
    step: int,
    kin: NDArray[np.int32],
    moves: NDArray[np.int32],
    everyone: bool,
) -> NDArray[np.int32]:
    n, k, pixels, pitch = candidates.size, moves.shape[1], candidates.index_of.size, candidates.cols
    positions = candidates.positions[:n].astype(np.int64)

    def looked_at(p: NDArray[np.int64]) -> NDArray[np.int64]:
        """Numbers of the candidates that each of p is compared with."""
        if everyone:
            return np.repeat(np.pad(np.arange(n), (0, max(0, k - n)), constant_values=-1)[:, None], p.size, 1)
        proposed = []
        for a in (-1, 0, 1):
            for b in (-1, 0, 1):
                kind = _at(candidates.index_of, positions[p] + a * step * pitch + b * step, pixels)
                kind = np.where(kind >= 0, kin[kind], -1)
                q = np.where(kind >= 0, positions[p] + moves[kind].T, -1)
                proposed.append(_at(candidates.index_of, q, pixels))
        return np.concatenate(proposed)

    def best(p: NDArray[np.int64]) -> NDArray[np.int64]:
        numbers, here = looked_at(p), positions[p]
        q = positions[np.maximum(numbers, 0)]
        near = (abs(q // pitch - here // pitch) <= APART * step) & (abs(q % pitch - here % pitch) <= APART * step)
        numbers = np.sort(np.where(near, -1, numbers), 0)
        numbers[1:][numbers[1:] == numbers[:-1]] = -1
        at = square.at[p] + (offsets @ np.array([square.down, 1]))[:, None]
        x = np.moveaxis(square.levels[:, at], 0, 1).astype(np.float32)
        d = square.distance(numbers, x, np.ones((len(at), 1, p.size), np.float32), offsets)
        found = np.take_along_axis(numbers, np.lexsort((numbers, d), axis=0)[:k], 0)
        return np.where(found < 0, p, found).T

    most = max(1, 2**20 // (n if everyone else 9 * k))
    pieces = [best(np.arange(first, min(n, first + most))) for first in range(0, n, most)]
    return np.concatenate(pieces).astype(np.int32)


def _at(index_of: NDArray[np.int32], pixel: NDArray[np.integer], pixels: int) -> NDArray[np.int64]:
    inside = (pixel >= 0) & (pixel < pixels)
    return np.where(inside, index_of[np.where(inside, pixel, 0)], -1).astype(np.int64)


def _launch(
    machine: Launcher,
    offsets: NDArray[np.int32],
    candidates: Candidates,
    square: Square,
    step: int,
    kin: NDArray[np.int32],
    moves: NDArray[np.int32],
    everyone: bool,
) -> Array:
    n, k, i = candidates.size, moves.shape[1], np.int32
    found = machine.empty((n, k), np.int32)
    radius, channels = square.disc.shape[0] // 2, square.levels.shape[0]
    machine.launch(
        machine.kernel("similar", "similar", C=channels, V=machine.vector, RADIUS=radius, K=k),
        (n,),
        *(i(n), i(candidates.index_of.size), i(candidates.cols), i(step), i(APART), i(everyone)),
        *(candidates.positions, candidates.index_of, square.at, square.levels, i(square.levels.shape[1])),
        *(i(square.down), square.disc, machine.put(kin), machine.put(moves), found),
    )
    return found


similar = Operation("similar", _reference, _launch)
"""``similar(machine, offsets, candidates, square, step, kin, moves, everyone)``: (n, K) int32, nearest first.

``kin`` (n,) int32 row of each candidate in ``moves`` (.., K) int32, in pixels of the sample: see kernels/similar.cl.
Where there are too few, the candidate itself. ``offsets``, ``kin`` and ``moves`` are on the host.
Cost: 9 K n distances of equation (12), or n^2 with ``everyone``.
"""


def most_similar(
    machine: Machine,
    offsets: NDArray[np.int32],
    candidates: Candidates,
    square: Square,
    lattice: Lattice,
    k: int,
    above: Table | None = None,
) -> Table:
    """The k candidates most similar to each.

    Parameters
    ----------
    machine : Machine
    offsets : (N, 2) int32 array
        The neighbourhood, on the host.
    candidates : Candidates
    square : Square
    lattice : Lattice
        Where they lie.
    k : int
        1 or more.
    above : Table, optional
        That of the level above.

    Returns
    -------
    Table
        An approximation where there are more than `FEW` candidates.
    """
    size, step = candidates.size, lattice.step
    own = np.arange(size, dtype=np.int32)
    if size <= FEW:
        nobody = np.zeros((1, k), np.int32)
        return Table(similar(machine, offsets, candidates, square, step, own, nobody, True), lattice)
    if above is None:
        words = np.stack([random.draw4(0, 0, 0, own.astype(np.int64), random.SEARCH, n) for n in range(-(-k // 4))])
        numbers = (words.reshape(-1, size)[:k].T.astype(np.uint64) * np.uint64(size)) >> np.uint64(32)
        kin, moves, rounds = own, _moves(numbers.astype(np.int64), lattice), ROUNDS_FROM_NOWHERE
    else:
        coarse = above.lattice
        row, col = (
            np.maximum(np.searchsorted(there, here, "right") - 1, 0)
            for there, here in ((coarse.rows, lattice.rows), (coarse.cols, lattice.cols))
        )
        crossing = (row[:, None] * coarse.cols.size + col[None, :]).ravel()[lattice.number >= 0]
        kin = np.maximum(coarse.number[crossing], 0)
        moves, rounds = _moves(machine.get(above.numbers), coarse), ROUNDS
    for n in range(rounds):
        found = similar(machine, offsets, candidates, square, step, kin, moves, False)
        if n < rounds - 1:
            kin, moves = own, _moves(machine.get(found), lattice)
    return Table(found, lattice)


def _moves(numbers: NDArray[np.integer], lattice: Lattice) -> NDArray[np.int32]:
    """How many pixels each of the similar lies from its own candidate."""
    moves: NDArray[np.int32] = (lattice.positions[numbers] - lattice.positions[:, None]).astype(np.int32)
    return moves
