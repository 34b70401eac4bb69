# SPDX-License-Identifier: BSD-3-Clause
"""The Ising model by heat-bath relaxation under any schedule: what a schedule samples, against what is known exactly.

The conditional distributions are as simple as can be, so whatever is wrong with a result is the schedule's doing.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex import random, schedules
from simdtex.machine import Machine, memory
from simdtex.machine.interface import Array
from simdtex.model.lattice import Grid, neighbourhood_offsets
from simdtex.ops.ising import heat_bath_chances, ising_commit, ising_relax, ising_sequence
from simdtex.ops.snapshot import snapshot
from simdtex.options import one_of, real, whole

AT_ONCE = 2**22
"""Relaxations in one launch at most, so that none is long."""

HOST, MEASURED = 24, 40
"""Bytes on the host for each spin, and for each chain and sweep (benchmarks/memory.py)."""

QUEUE = 2**16
"""Steps in one launch of `ising_sequence` at most: one work-item does them all."""


@dataclass(frozen=True)
class Experiment:
    """What is simulated and measured, whatever the schedule.

    Attributes
    ----------
    size : (int, int)
        Rows and columns, 2 or more.
    temperatures : sequence of float
        Above 0, in units of J / k_B. All run side by side; none changes another's result.
    seeds : int
        R, independent chains at each temperature; they share the schedule's choices.
    sweeps, burn_in : int
        Sweeps that are measured, 1 or more, and sweeps before them.
    boundary : {"torus", "open"}
    start : {"up", "random"}
        All spins up, which below T_c is close to equilibrium, or each by the toss of a coin, which may freeze into
        stripes there.

    Raises
    ------
    ValueError, TypeError
        A value is out of range; the sentence names the remedy.
    """

    size: tuple[int, int]
    temperatures: Sequence[float]
    seeds: int = 16
    sweeps: int = 1000
    burn_in: int = 500
    boundary: str = "torus"
    start: str = "up"

    def __post_init__(self) -> None:
        """Check every value."""
        for side in self.size:
            whole("a side of the lattice", side, 2)
        if not len(self.temperatures):
            raise ValueError("there is no temperature; give one at least, say 2.0")
        for temperature in self.temperatures:
            real("temperature", temperature, 0, above=True)
        whole("seeds", self.seeds, 1)
        whole("sweeps", self.sweeps, 1)
        whole("burn_in", self.burn_in, 0)
        one_of("boundary", self.boundary, ("torus", "open"))
        one_of("start", self.start, ("up", "random"))
        spins = prod(self.size) * self.seeds * len(self.temperatures)
        if 2 * spins >= 2**31:
            raise ValueError(f"{spins} spins are too many; give a smaller size or fewer seeds, below 2**30 in all")


@dataclass(frozen=True)
class Chains:
    """Markov chains of the Ising model: T temperatures, R chains at each, n sweeps after the burn-in.

    Attributes
    ----------
    schedule : str
    independent : bool
        Whether the schedule keeps equation (14) on this lattice.
    temperatures : (T,) float64 array
        In units of J / k_B.
    boundary : str
    energy : (T, R, n) float64 array
        Energy per spin after each sweep, in units of J.
    lagged : (T, R, n) float64 array
        The same with one spin of each bond taken before the sweep and the other after it.
    even, odd : (T, R, n) float64 array
        Mean spin of the sublattices whose row + column is even and odd.
    spins : (T, R, H, W) uint8 array
        In the end, 0 down and 1 up.
    steps, relaxations, launches : int
        Of the schedule; sites of all those steps, in one chain; kernels enqueued.
    seconds : float
    """

    schedule: str
    independent: bool
    temperatures: NDArray[np.float64]
    boundary: str
    energy: NDArray[np.float64]
    lagged: NDArray[np.float64]
    even: NDArray[np.float64]
    odd: NDArray[np.float64]
    spins: NDArray[np.uint8]
    steps: int
    relaxations: int
    launches: int
    seconds: float

    @property
    def magnetisation(self) -> NDArray[np.float64]:
        """(T, R, n) mean spin."""
        height, width = self.spins.shape[-2:]
        even = (height * width + 1) // 2
        whole: NDArray[np.float64] = (self.even * even + self.odd * (height * width - even)) / (height * width)
        return whole


def ising(
    machine: Machine,
    experiment: Experiment,
    schedule: str | schedules.Schedule,
    *,
    seed: int = 1,
    callback: Callable[[float], Any] | None = None,
) -> Chains:
    """Relax Ising spins by a schedule, and measure after every sweep.

    Parameters
    ----------
    machine : Machine
    experiment : Experiment
    schedule : str or simdtex.schedules.Schedule
    seed : int
        0 to 2**64 - 1; keys every random number.
    callback : callable, optional
        Called with the share of the work that is done after every sweep.

    Notes
    -----
    Each step draws the spins of its sites from their conditional distributions, P(up) = 1 / (1 + exp(-2 S / T)) for
    neighbours that sum to S. The energy is -(1/N) times the sum over bonds of the product of their spins. The same bits
    on every machine.

    Cost: sweeps x sites x chains draws, and reading back the spins after every sweep that is measured. Steps of one
    site that follow one another cost one launch together. Memory: up to 3 bytes per spin on the device, some 20 on the
    host, and 32 there per chain and sweep.
    """
    size, temperatures, seeds = experiment.size, experiment.temperatures, experiment.seeds
    sweeps, burn_in = experiment.sweeps, experiment.burn_in
    chains = seeds * len(temperatures)
    memory.require(machine, 3 * prod(size) * chains, HOST * prod(size) * chains + MEASURED * sweeps * chains)
    began, launches = time.perf_counter(), machine.launches
    schedule = schedules.get(schedule)
    grid, offsets = Grid(*size, torus=experiment.boundary == "torus"), neighbourhood_offsets(1)
    count = len(temperatures)
    chances = heat_bath_chances(temperatures, len(offsets))
    setting = schedules.Setting(machine, grid, offsets, 1, seed, 0)
    run = _Run(setting, machine.put(offsets), machine.put(chances), schedule)
    spins = machine.put(np.tile(_first(experiment, seed), (count, 1, 1)))
    state = schedule.init(setting)

    measured = np.empty((sweeps, 4, count * seeds))
    now = machine.get(spins)[:, : grid.height]
    for sweep in range(burn_in + sweeps):
        spins, state = run.sweep(spins, state)
        k = sweep - burn_in
        if k >= -1:
            before, now = now, machine.get(spins)[:, : grid.height]
        if k >= 0:
            measured[k] = _measure(before, now, grid)
        if callback:
            callback((sweep + 1) / (burn_in + sweeps))
    energy, lagged, even, odd = np.moveaxis(measured.reshape(sweeps, 4, count, seeds), 0, -1)
    return Chains(
        schedule=schedule.name,
        independent=schedule.independent(grid, offsets),
        temperatures=np.array(temperatures, np.float64),
        boundary=experiment.boundary,
        energy=energy,
        lagged=lagged,
        even=even,
        odd=odd,
        spins=now.reshape(count, seeds, *size),
        steps=run.steps,
        relaxations=run.relaxations,
        launches=machine.launches - launches,
        seconds=time.perf_counter() - began,
    )


@dataclass
class _Run:
    """What stays the same throughout a run, and what it has done so far."""

    setting: schedules.Setting
    offsets: Array
    chances: Array
    schedule: schedules.Schedule
    steps: int = 0
    relaxations: int = 0

    def __post_init__(self) -> None:
        self.machine, self.grid, self.seed = self.setting.machine, self.setting.grid, self.setting.seed
        self.everywhere = schedules.Masked(self.grid)

    def sweep(self, spins: Array, state: Any) -> tuple[Array, Any]:
        """A sweep of the schedule."""
        queue: list[tuple[int, int]] = []
        if self.schedule.tile:  # what tiles see of one another until the sweep ends
            spins = snapshot(self.machine, spins, self.grid.height)
        while True:
            state, chosen = self.schedule.step(self.setting, state, self.everywhere)
            for info in chosen.apart(self.machine):
                self.steps += 1
                self.relaxations += info.sites.size
                if info.sites.size == 1 and not self.schedule.tile:
                    queue.append((int(info.sites[0]), info.turn))
                elif info.sites.size:
                    spins = self._step(self._flush(spins, queue), info)
            if chosen.last:
                return self._flush(spins, queue), state

    def _step(self, spins: Array, info: schedules.Info) -> Array:
        """Relax the sites of a step, every old value read before the first new one is written."""
        machine, grid = self.machine, replace(self.grid, tile=self.schedule.tile)
        most = max(1, AT_ONCE // spins.shape[0])
        relaxed = []
        for k in range(0, info.sites.size, most):
            sites = machine.put(info.sites[k : k + most])
            drawn = ising_relax(machine, spins, sites, self.offsets, grid, self.chances, self.seed, info.turn)
            relaxed.append((sites, drawn))
            self._sync(sites.size, spins)
        for sites, drawn in relaxed:
            spins = ising_commit(machine, spins, sites, drawn)
        return spins

    def _flush(self, spins: Array, queue: list[tuple[int, int]]) -> Array:
        """Do the steps of one site each that have been put off; the queue is empty then."""
        most = min(QUEUE, max(1, 4 * AT_ONCE // spins.shape[0]))
        for k in range(0, len(queue), most):
            part = np.array(queue[k : k + most], np.uint32).view(np.int32)
            put = self.machine.put(part)
            spins = ising_sequence(self.machine, spins, put, self.offsets, self.grid, self.chances, self.seed)
            self._sync(len(part), spins)
        queue.clear()
        return spins

    def _sync(self, sites: int, spins: Array) -> None:
        self.machine.sync(100 * sites * int(spins.shape[0]))  # a draw is about as much work as 100 fma


def _first(experiment: Experiment, seed: int) -> NDArray[np.uint8]:
    """Return the spins before the first sweep, (seeds, H, W)."""
    size, seeds = experiment.size, experiment.seeds
    if experiment.start == "up":
        return np.ones((seeds, *size), np.uint8)
    bits = random.draw4(seed, 0, 0, np.arange(prod(size)), random.START, np.arange(seeds)[:, None])[0]
    return (bits >> np.uint32(31)).astype(np.uint8).reshape(seeds, *size)


def _measure(before: NDArray[np.uint8], now: NDArray[np.uint8], grid: Grid) -> NDArray[np.float64]:
    """(4, chains): energy, energy across the sweep, and the mean spins of the even and the odd sublattice."""
    old, new = (2 * spins.astype(np.int8) - 1 for spins in (before, now))
    sites = grid.rows * grid.cols
    parity = np.indices((grid.rows, grid.cols)).sum(0) % 2
    total = new.sum((1, 2), dtype=np.int64)
    odd = new[:, parity == 1].sum(1, dtype=np.int64)
    energies = [-(new * _field(spins, grid.torus)).sum((1, 2), dtype=np.int64) / (2 * sites) for spins in (new, old)]
    return np.stack([*energies, (total - odd) / ((sites + 1) // 2), odd / (sites // 2)])


def _field(spins: NDArray[np.int8], torus: bool) -> NDArray[np.int8]:
    """Return the sum of each site's neighbours."""
    around = np.pad(spins, ((0, 0), (1, 1), (1, 1)), mode="wrap" if torus else "constant")
    return around[:, :-2, 1:-1] + around[:, 2:, 1:-1] + around[:, 1:-1, :-2] + around[:, 1:-1, 2:]
