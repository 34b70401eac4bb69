# SPDX-License-Identifier: BSD-3-Clause
"""Heat-bath relaxation of Ising spins: a draw from the conditional distribution of a site, by integers alone.

Spins are 0 (down) or 1 (up) in a (chains, H, W) uint8 array; where tiles read an older picture, it stands below in a
(chains, 2 H, W) array (`simdtex.ops.snapshot`). Chains are copies of the lattice that know nothing of one another: the
same number of them at each temperature, temperature after temperature. A chain's random numbers are keyed by its place
among those of its temperature, so what happens at one temperature does not depend on which others there are.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex import random
from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.model.lattice import Grid


def heat_bath_chances(temperatures: Sequence[float], neighbours: int) -> NDArray[np.uint32]:
    """The probabilities of up, in integers of 2**-32.

    Parameters
    ----------
    temperatures : sequence of float
        Above 0, in units of J / k_B.
    neighbours : int
        N, of a site within the lattice.

    Returns
    -------
    (temperatures, N + 1, N + 1) uint32 array
        P(up) = 1 / (1 + exp(-2 S / T)), rounded, for a site with n neighbours on the lattice of which u are up,
        S = 2 u - n. Probabilities that round to 1 are 1 - 2**-32.
    """
    from scipy.special import expit

    members, up = np.indices((neighbours + 1, neighbours + 1))
    field = 2.0 * (2 * up - members)
    with np.errstate(over="ignore"):  # a temperature of next to nothing: the probabilities are 0, 1/2 and 1
        chance = expit(field / np.asarray(temperatures, np.float64)[:, None, None])
    whole: NDArray[np.uint32] = np.minimum(np.rint(chance * 2.0**32), 2.0**32 - 1).astype(np.uint32)
    return whole


def _relax(
    spins: NDArray[np.uint8],
    sites: NDArray[np.int32],
    offsets: NDArray[np.int32],
    grid: Grid,
    chances: NDArray[np.uint32],
    seed: int,
    turn: int,
) -> NDArray[np.uint8]:
    temperature, chain = divmod(np.arange(len(spins))[:, None], len(spins) // len(chances))
    r = grid.neighbours(sites, offsets)
    there = r >= 0
    up = np.where(there, spins.reshape(len(spins), -1)[:, r], 0).sum(1, dtype=np.intp)
    bits = random.draw4(seed, 0, turn, grid.places(sites), random.DRAW, chain)[0]
    relaxed: NDArray[np.uint8] = (bits < chances[temperature, there.sum(0), up]).astype(np.uint8)
    return relaxed


def _commit(spins: NDArray[np.uint8], sites: NDArray[np.int32], relaxed: NDArray[np.uint8]) -> NDArray[np.uint8]:
    spins.reshape(len(spins), -1)[:, sites] = relaxed
    return spins


def _sequence(
    spins: NDArray[np.uint8],
    queue: NDArray[np.int32],
    offsets: NDArray[np.int32],
    grid: Grid,
    chances: NDArray[np.uint32],
    seed: int,
) -> NDArray[np.uint8]:
    for site, turn in queue:
        _commit(spins, site[None], _relax(spins, site[None], offsets, grid, chances, seed, int(turn)))
    return spins


def _model(offsets: Array, grid: Grid, chances: Array, seed: int) -> tuple[Any, ...]:
    return offsets, np.int32(offsets.shape[0]), grid.struct, chances, np.uint64(seed)


def _launch_relax(
    machine: Launcher, spins: Array, sites: Array, offsets: Array, grid: Grid, chances: Array, seed: int, turn: int
) -> Array:
    chains, temperatures = int(spins.shape[0]), int(chances.shape[0])
    relaxed = machine.empty((chains, sites.size), np.uint8)
    seeds = chains // temperatures
    machine.launch(
        machine.kernel("ising", "ising_relax"),
        (sites.size, seeds, temperatures),
        *(sites, np.int32(sites.size), spins, np.int32(prod(spins.shape[1:])), np.int32(seeds)),
        *(*_model(offsets, grid, chances, seed), np.uint32(turn), relaxed),
    )
    return relaxed


def _launch_commit(machine: Launcher, spins: Array, sites: Array, relaxed: Array) -> Array:
    chains = int(spins.shape[0])  # which temperature is whose does not matter here
    machine.launch(
        machine.kernel("ising", "ising_commit"),
        (sites.size, chains, 1),
        *(sites, np.int32(sites.size), relaxed, np.int32(prod(spins.shape[1:])), np.int32(chains), spins),
    )
    return spins


def _launch_sequence(
    machine: Launcher, spins: Array, queue: Array, offsets: Array, grid: Grid, chances: Array, seed: int
) -> Array:
    temperatures = chances.shape[0]
    seeds = spins.shape[0] // temperatures
    machine.launch(
        machine.kernel("ising", "ising_sequence"),
        (seeds, temperatures),
        *(queue, np.int32(queue.shape[0]), spins, np.int32(prod(spins.shape[1:])), np.int32(seeds)),
        *_model(offsets, grid, chances, seed),
    )
    return spins


ising_relax = Operation("ising", _relax, _launch_relax)
"""``ising_relax(machine, spins, sites, offsets, grid, chances, seed, turn)``: what the sites of a step become.

Old values are read. Returns (chains, S) uint8. Cost: O(chains S N), 10 rounds of Philox each.
"""

ising_commit = Operation("ising", _commit, _launch_commit)
"""``ising_commit(machine, spins, sites, relaxed)``: the end of a step, in place."""

ising_sequence = Operation("ising", _sequence, _launch_sequence)
"""``ising_sequence(machine, spins, queue, offsets, grid, chances, seed)``: steps of one site each, in place.

``queue`` (Q, 2) int32 is the site and the turn of each step, in order. The same bits as Q times `ising_relax` and
`ising_commit`, in one launch.
"""
