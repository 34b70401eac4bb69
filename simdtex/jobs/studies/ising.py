# SPDX-License-Identifier: BSD-3-Clause
"""The Ising model on a torus by heat-bath relaxation under any schedule.

The conditional distributions are known exactly, so any deviation of a result is due to the schedule.

The exact energy of the Ising model on a torus, J = k_B = 1, no field, is that of B. Kaufman, Phys. Rev. 76, 1232
(1949), in the form of A. E. Ferdinand and M. E. Fisher, Phys. Rev. 185, 832 (1969).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import log, pi, prod, sqrt, tanh
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from simdtex import random, schedules
from simdtex.jobs.studies.operations import ising_commit, ising_relax, ising_sequence
from simdtex.machine import Machine, memory, open_machine
from simdtex.maspar.algorithm import heat_bath_chances
from simdtex.methods.mrf.snapshot import snapshot
from simdtex.model.lattice import Grid, neighbourhood_offsets
from simdtex.options import one_of, real, whole
from simdtex.run import Callback, Progress

CRITICAL = 2 / log(1 + sqrt(2))
"""T_c = 2 / ln(1 + sqrt(2)) = 2.269..., in units of J / k_B."""

HOTTEST = 1e6
"""Above this temperature 1 / T is lost in sums of order 1."""

COLDEST = 0.05
"""Below this temperature the energy is -2 to the last bit: the weight of the first excitation is exp(-8 / T)."""


def torus_energy(temperature: float, rows: int, cols: int) -> float:
    """Return the energy per spin of a torus of 2 x 2 sites or more; on a side of 2, neighbours have two bonds.

    It is -(1/N) d ln Z / dK, with Kaufman's partition function, a sum of four products over the columns, in logarithms
    so that no size overflows. The derivative is the imaginary part of ln Z at a complex K, exact to the last bits.
    """
    real("temperature", temperature, 0, HOTTEST, above=True)
    if temperature < COLDEST:
        return -2.0
    coupling = 1 / temperature
    step = 1e-30
    k = complex(coupling, step)
    s = np.sinh(2 * k)
    # cosh g_l - 1 = cosh(2K)^2 / sinh(2K) - cos(l pi / cols) - 1, without cancellation near T_c
    excess = (s - 1) ** 2 / s + 2 * np.sin(np.arange(1, 2 * cols) * pi / cols / 2) ** 2
    gamma = np.log1p(excess + np.sqrt(excess * (excess + 2)))
    zero = 2 * k + np.log(np.tanh(k))  # g_0 has a sign, that of T_c - T
    sign = -1.0 if zero.real < 0 else 1.0
    logs = []
    for half in (rows / 2 * gamma[::2], rows / 2 * np.append(sign * zero, gamma[1::2])):
        logs.append((half + np.log1p(np.exp(-2 * half))).sum())  # the product of 2 cosh
        logs.append((half + np.log(-np.expm1(-2 * half))).sum())  # the product of 2 sinh
    shifted = np.array(logs) - max(log.real for log in logs)
    total = (np.exp(shifted) * (1, 1, 1, sign)).sum()
    return float(-(total.imag / total.real / step / (rows * cols) + 1 / tanh(2 * coupling)))


RELAXATIONS_AT_ONCE = 2**22
"""The most relaxations in one launch, which bounds its time."""

HOST, MEASURED = 24, 40
"""Bytes on the host for each spin, and for each chain and sweep (benchmarks/memory.py)."""

QUEUE = 2**16
"""The most steps in one launch of `ising_sequence`, since one work-item executes all of them."""


@dataclass(frozen=True)
class Experiment:
    """The settings of the experiment that all schedules share.

    ``temperatures`` run together and independently, each with ``seeds`` chains, which share the schedule's choices.
    ``sweeps`` are measured, after ``burn_in`` others. ``start`` is "up", which below T_c is close to equilibrium, or
    "random", which may freeze into stripes there.
    """

    size: tuple[int, int]
    temperatures: Sequence[float]
    seeds: int = 16
    sweeps: int = 1000
    burn_in: int = 500
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
        one_of("start", self.start, ("up", "random"))
        spins = prod(self.size) * self.seeds * len(self.temperatures)
        if 2 * spins >= 2**31:
            raise ValueError(f"{spins} spins are too many; give a smaller size or fewer seeds, below 2**30 in all")


@dataclass(frozen=True)
class Chains:
    """Markov chains of the Ising model: T temperatures, R chains at each, n sweeps after the burn-in.

    ``energy`` (T, R, n) is that per spin after each sweep; ``even`` and ``odd`` are the mean spins of the sublattices
    whose row + column is even and odd; ``spins`` (T, R, H, W) uint8 those at the end.
    """

    schedule: str
    independent: bool
    temperatures: NDArray[np.float64]
    energy: NDArray[np.float64]
    even: NDArray[np.float64]
    odd: NDArray[np.float64]
    spins: NDArray[np.uint8]

    @property
    def magnetisation(self) -> NDArray[np.float64]:
        """The mean spin, (T, R, n)."""
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
    callback: Callback | None = None,
) -> Chains:
    """Relax Ising spins by a schedule, and return measurements after every sweep; the bits are those of every machine.

    Each step draws the spins of its sites from their conditional distributions, P(up) = 1 / (1 + exp(-2 S / T)) for
    neighbours that sum to S. Cost: sweeps x sites x chains draws, and reading back the spins after every sweep that is
    measured. Memory: up to 3 bytes per spin on the device, some 20 on the host, and 24 there per chain and sweep.
    """
    size, sweeps, burn_in = experiment.size, experiment.sweeps, experiment.burn_in
    chains = experiment.seeds * len(experiment.temperatures)
    memory.require(machine, 3 * prod(size) * chains, HOST * prod(size) * chains + MEASURED * sweeps * chains)
    run = _Run(machine, experiment, schedules.get(schedule), seed)
    measured = np.empty((sweeps, 3, chains))
    for sweep in range(burn_in + sweeps):
        run.sweep()
        if sweep >= burn_in:
            measured[sweep - burn_in] = _measure(run.look())
        if callback:
            done, of = sweep + 1, burn_in + sweeps
            callback(Progress(fraction=done / of, doing=f"sweep {done} of {of}", image=run.look))
    energy, even, odd = np.moveaxis(measured.reshape(sweeps, 3, -1, experiment.seeds), 0, -1)
    return Chains(
        schedule=run.schedule.name,
        independent=run.schedule.independent(run.grid, run.setting.offsets),
        temperatures=np.array(experiment.temperatures, np.float64),
        energy=energy,
        even=even,
        odd=odd,
        spins=run.look().reshape(-1, experiment.seeds, *size),
    )


class _Run:
    """The spins of all chains on the machine, and the state of the schedule."""

    def __init__(self, machine: Machine, experiment: Experiment, schedule: schedules.Schedule, seed: int) -> None:
        self.machine, self.schedule, self.seed = machine, schedule, seed
        self.grid, offsets = Grid(experiment.size), neighbourhood_offsets(1)
        self.setting = schedules.Setting(machine, self.grid, offsets, 1, seed, 0)
        self.everywhere = schedules.Masked(self.grid)
        self.offsets = machine.put(offsets)
        self.chances = machine.put(heat_bath_chances(experiment.temperatures, len(offsets)))
        first = np.ones((experiment.seeds, *experiment.size), np.uint8)
        if experiment.start == "random":
            of = np.arange(self.grid.size), random.START, np.arange(experiment.seeds)[:, None]
            first = (random.draw4(seed, 0, 0, *of)[0] >> np.uint32(31)).astype(np.uint8).reshape(first.shape)
        self.spins = machine.put(np.tile(first, (len(experiment.temperatures), 1, 1)))
        self.chains = int(self.spins.shape[0])
        self.state = schedule.init(self.setting)
        self.single: list[tuple[int, int]] = []  # postponed steps of one site each

    def look(self) -> NDArray[np.uint8]:
        """Return the spins, (chains, H, W)."""
        spins: NDArray[np.uint8] = self.grid.latest(self.machine.get(self.spins))
        return spins

    def sweep(self) -> None:
        """Relax by the schedule until the end of a sweep."""
        if self.schedule.tile:  # tiles see one another as they were before the sweep
            self.spins = snapshot(self.machine, self.spins, self.grid.rows)
        for state, chosen in schedules.decisions(self.schedule, self.setting, self.state, self.everywhere):
            self.state = state
            for info in chosen.apart(self.machine):
                if info.sites.size == 1 and not self.schedule.tile:
                    self.single.append((int(info.sites[0]), info.turn))
                elif info.sites.size:
                    self._relax_single()
                    self._relax(info)
        self._relax_single()

    def _relax(self, info: schedules.Info) -> None:
        """Relax the sites of a step; all old values are read before the first new one is written."""
        grid, most = replace(self.grid, tile=self.schedule.tile), max(1, RELAXATIONS_AT_ONCE // self.chains)
        relaxed = []
        for k in range(0, info.sites.size, most):
            sites = self.machine.put(info.sites[k : k + most])
            drawn = ising_relax(self.machine, self.spins, sites, self.offsets, grid, self.chances, self.seed, info.turn)
            relaxed.append((sites, drawn))
            self._sync(sites.size)
        for sites, drawn in relaxed:
            self.spins = ising_commit(self.machine, self.spins, sites, drawn)

    def _relax_single(self) -> None:
        """Execute the postponed steps."""
        most = min(QUEUE, max(1, 4 * RELAXATIONS_AT_ONCE // self.chains))
        for k in range(0, len(self.single), most):
            part = self.machine.put(np.array(self.single[k : k + most], np.uint32).view(np.int32))
            self.spins = ising_sequence(
                self.machine, self.spins, part, self.offsets, self.grid, self.chances, self.seed
            )
            self._sync(len(self.single[k : k + most]))
        self.single.clear()

    def _sync(self, sites: int) -> None:
        self.machine.sync(100 * sites * self.chains)  # a draw is about as much work as 100 fma


def _measure(spins: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Return the energy, and the mean spins of the even and the odd sublattice, (3, chains)."""
    now = 2 * spins.astype(np.int8) - 1
    parity = np.indices(now.shape[1:]).sum(0) % 2
    field = sum(np.roll(now, by, axis) for axis in (1, 2) for by in (1, -1))
    energy = -(now * field).mean((1, 2), dtype=np.float64) / 2
    return np.stack([energy, *(now[:, parity == odd].mean(1, dtype=np.float64) for odd in (0, 1))])


LEVEL = 0.001
"""Probability that at least one result of a table of correct results differs."""


ENOUGH = 8
"""Chains that a verdict needs: of fewer, a deviation must be twice as many errors as of many to count."""


@dataclass(frozen=True)
class Finding:
    """The result of a schedule at one temperature, from as many ``chains``.

    ``error`` is one standard error of the means of the chains, which is valid for any autocorrelation of their sweeps;
    ``sigmas`` the deviation from the energy of this torus, ``exact``, in errors. ``magnetisation`` is the mean of the
    absolute mean spin, and ``neighbours`` the correlation of neighbouring spins beyond that of their sublattices'
    magnetisations, <s_r s_s> - <m_even m_odd>.
    """

    schedule: str
    independent: bool
    temperature: float
    energy: float
    error: float
    exact: float
    sigmas: float
    magnetisation: float
    neighbours: float
    differs: bool
    chains: int

    @property
    def verdict(self) -> str:
        """Whether the energy agrees, in words; of fewer than `ENOUGH` chains nothing is said."""
        if self.chains < ENOUGH:
            return f"none, {self.chains} of {ENOUGH} chains"
        return f"differs by {abs(self.sigmas):.0f} sigma" if self.differs else "agrees"


def findings(runs: Sequence[Chains]) -> list[Finding]:
    """Return a comparison of runs of two chains or more with the exact energy: for each temperature, every run.

    A deviation counts if Student's t with R - 1 degrees of freedom gives it a probability below `LEVEL` divided by the
    number of comparisons (Bonferroni).
    """
    first = runs[0]
    count = len(first.temperatures) * len(runs)
    least = float(stats.t.isf(LEVEL / count / 2, first.energy.shape[1] - 1))
    return [_finding(run, t, least) for t in range(len(first.temperatures)) for run in runs]


def _finding(run: Chains, t: int, least: float) -> Finding:
    rows, cols = run.spins.shape[-2:]
    temperature, means = float(run.temperatures[t]), run.energy[t].mean(1)
    one_spin = 8 / (rows * cols * run.energy[t].size)  # turned once: frozen chains have no spread
    error = max(float(means.std(ddof=1)) / sqrt(len(means)), one_spin)
    energy, exact = float(means.mean()), torus_energy(temperature, rows, cols)
    sigmas = (energy - exact) / error
    return Finding(
        schedule=run.schedule,
        independent=run.independent,
        temperature=temperature,
        energy=energy,
        error=error,
        exact=exact,
        sigmas=sigmas,
        magnetisation=float(np.abs(run.magnetisation[t]).mean()),
        neighbours=float(-energy / 2 - (run.even[t] * run.odd[t]).mean()),
        differs=abs(sigmas) > least,
        chains=len(means),
    )


TEMPERATURES = (2.0, 2.3, 2.6)
"""The temperatures of `of_schedules`, below, near and above the critical one."""

SIZE = (24, 24)
"""Rows and columns of the lattice of `of_schedules`."""

PICTURE_SWEEPS = 50
"""Sweeps of a picture, from a random start: enough for domains to grow, too few for one to win."""


class Spins(NamedTuple):
    """The Ising model under several schedules: the findings, and a chain of each schedule from a random start."""

    findings: list[Finding]
    pictures: list[Chains]


def of_schedules(chosen: Sequence[schedules.Schedule], device: str | None, seed: int, callback: Callback) -> Spins:
    """Return the Ising model under each schedule: 32 chains at each of `TEMPERATURES`, on a lattice of `SIZE`."""
    machine = open_machine(device)
    experiment = Experiment(SIZE, TEMPERATURES, seeds=32, sweeps=300, burn_in=600)
    once = Experiment(SIZE, TEMPERATURES[:1], 1, PICTURE_SWEEPS, 0, start="random")
    runs, pictures = [], []
    for place, schedule in enumerate(chosen):

        def part(progress: Progress, place: int = place, name: str = schedule.name) -> None:
            callback(progress.within(place, len(chosen), f"Ising spins by {name}"))

        runs.append(ising(machine, experiment, schedule, seed=seed, callback=part))
        pictures.append(ising(machine, once, schedule, seed=seed))
    return Spins(findings(runs), pictures)
