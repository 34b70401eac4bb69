# SPDX-License-Identifier: BSD-3-Clause
"""Heat-bath relaxation of Ising spins: a draw from the conditional distribution of a site, by integers alone.

Spins are 0 (down) or 1 (up) in a (chains, H, W) uint8 array; if tiles read an older picture, that is below in a
(chains, 2 H, W) array (`simdtex.methods.mrf.snapshot`). Chains are independent copies of the lattice, with the same
number at each temperature, temperature after temperature. The random numbers of a chain are keyed by its index within
its temperature, so the chains of a temperature do not depend on the other temperatures.
"""

from __future__ import annotations

from math import prod
from typing import Any

import numpy as np

from simdtex import random
from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.model.lattice import Grid


def _model(offsets: Array, grid: Grid, chances: Array, seed: int) -> tuple[Any, ...]:
    return offsets, offsets.shape[0], grid.struct, chances, np.uint64(seed)


@Operation
def ising_relax(
    machine: Launcher | None,
    spins: Array,
    sites: Array,
    offsets: Array,
    grid: Grid,
    chances: Array,
    seed: int,
    turn: int,
) -> Array:
    """Return the new spins of the sites of a step, (chains, S) uint8.

    Cost: O(chains S N), 10 rounds of Philox each.
    """
    chains, temperatures = int(spins.shape[0]), int(chances.shape[0])
    seeds = chains // temperatures
    if machine is None:
        temperature, chain = divmod(np.arange(chains)[:, None], seeds)
        r = grid.neighbours(sites, offsets)
        there = r >= 0
        up = np.where(there, spins.reshape(chains, -1)[:, r], 0).sum(1, dtype=np.intp)
        bits = random.draw4(seed, 0, turn, grid.places(sites), random.DRAW, chain)[0]
        return (bits < chances[temperature, there.sum(0), up]).astype(np.uint8)
    relaxed = machine.empty((chains, sites.size), np.uint8)
    machine.launch(
        "ising_relax",
        (sites.size, seeds, temperatures),
        *(sites, sites.size, spins, prod(spins.shape[1:]), seeds),
        *(*_model(offsets, grid, chances, seed), np.uint32(turn), relaxed),
    )
    return relaxed


@Operation
def ising_commit(machine: Launcher | None, spins: Array, sites: Array, relaxed: Array) -> Array:
    """Write the new spins of a step, in place, and return all spins."""
    chains = int(spins.shape[0])  # at all temperatures
    if machine is None:
        spins.reshape(chains, -1)[:, sites] = relaxed
        return spins
    machine.launch(
        "ising_commit", (sites.size, chains, 1), sites, sites.size, relaxed, prod(spins.shape[1:]), chains, spins
    )
    return spins


@Operation
def ising_sequence(
    machine: Launcher | None, spins: Array, queue: Array, offsets: Array, grid: Grid, chances: Array, seed: int
) -> Array:
    """Relax one site after another, in place, and return all spins.

    ``queue`` (Q, 2) int32 is the site and the turn of each step, in order. The bits are those of Q times `ising_relax`
    and `ising_commit`, in one launch.
    """
    if machine is None:
        for site, turn in queue:
            relaxed = ising_relax.reference(spins, site[None], offsets, grid, chances, seed, int(turn))
            ising_commit.reference(spins, site[None], relaxed)
        return spins
    temperatures = chances.shape[0]
    seeds = spins.shape[0] // temperatures
    machine.launch(
        "ising_sequence",
        (seeds, temperatures),
        *(queue, queue.shape[0], spins, prod(spins.shape[1:]), seeds),
        *_model(offsets, grid, chances, seed),
    )
    return spins
