# SPDX-License-Identifier: BSD-3-Clause
"""A replay of a run of Algorithm 1: its field after any set of sites that relax together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex import schedules
from simdtex.machine import Machine
from simdtex.machine.reference import Reference
from simdtex.methods.mrf.algorithm import run_steps
from simdtex.methods.mrf.explain import Moment, explained, largest_order, site_number, with_order, with_trust
from simdtex.methods.mrf.level import Lattices, MrfState
from simdtex.methods.mrf.neighbourhood import Field
from simdtex.methods.mrf.plan import MrfPlan
from simdtex.methods.mrf.record import picture, sources, temperatures
from simdtex.model.explanation import Explanation
from simdtex.options import Brief

KEPT = 2**28
"""The most bytes of the states that a replay keeps; all other states are recomputed."""


class Sweep(NamedTuple):
    """A sweep of a run.

    Attributes
    ----------
    level : int
        0 is the finest.
    sweep : int
        The number of the sweep on its level, from 1.
    sets : int
        The number of sets of sites, which relax one after another.
    sites : int
        The number of sites that relax.
    temperature : float
        Mean temperature of the level before the sweep, 0 to 1.
    """

    level: int
    sweep: int
    sets: int
    sites: int
    temperature: float


@dataclass(frozen=True, eq=False, repr=False)
class Instant(Brief):
    """The field of a run between two sets of sites.

    Attributes
    ----------
    level : int
        0 is the finest.
    image : (rows, cols[, channels]) array
        The level's picture, in the sample's type.
    source : (rows, cols, 2 or 3) int32 array
        Source map, as in `simdtex.Output.source`.
    temperature : (rows, cols) float64 array
        Temperatures, 0 to 1.
    relaxed : (rows, cols) uint8 array
        2 for the sites of the last set, 1 for sites that have relaxed earlier in the sweep, 0 for all others.
    """

    level: int
    image: NDArray[Any]
    source: NDArray[np.int32]
    temperature: NDArray[np.float64]
    relaxed: NDArray[np.uint8]


class Replay:
    """A replay of a run of the method ``mrf``: its field after any set of sites that relax together.

    `simdtex.replay` returns one. Sweeps are numbered from 0 over all levels, the coarsest level first.

    Notes
    -----
    The run is executed once, up to the last sweep that a call needs. The host keeps a copy of the state before each
    sweep: 6 bytes per site, and 2 for each of its channels, 256 MiB at most. `at` and the explanations start from the
    nearest earlier state.
    """

    origin: tuple[int, int] = (0, 0)
    """The first row and column of the lattice in the output, pixels."""

    def __init__(self, plan: MrfPlan, machine: Machine, seed: int, kept: int = KEPT) -> None:
        self._run, self._twin = plan.on(machine, seed), Lattices(plan, Reference(), seed)
        self._sweeps: list[Sweep] = []
        self._states: dict[int, dict[str, Any]] = {}  # before a sweep
        self._room = kept
        self._state = self._sweeping(self._run.begin())

    def __repr__(self) -> str:
        return f"<Replay of {self._run.levels} levels, {len(self._sweeps)} sweeps run so far>"

    @property
    def sweeps(self) -> list[Sweep]:
        """All sweeps of the run, in order."""
        while self._record():
            pass
        return self._sweeps

    def at(self, sweep: int, sets: int | None = None) -> Instant:
        """Return the field after the first ``sets`` sets of a sweep, None: all. Negative sweeps count from the end."""
        sweep = range(len(self.sweeps))[sweep]
        field, chosen = self._play(sweep, sets)
        level = self._sweeps[sweep].level
        run, grid = self._twin.of(level), self._twin.grid(level)
        relaxed = np.zeros(grid.shape, np.uint8)
        groups = [info.sites[begin:end] for info in chosen for begin, end in info.ranges]
        for mark, sites in [*((1, sites) for sites in groups), *((2, sites) for sites in groups[-1:])]:
            relaxed.flat[sites] = mark
        maps = picture(run, grid, field), sources(run, grid, field), temperatures(run, grid, field)
        return Instant(level, *maps, relaxed)

    def explain(
        self,
        site: tuple[int, ...],
        level: int = 0,
        sweep: int | None = None,
        *,
        order: int | None = None,
        trust: float = 0,
    ) -> Explanation:
        """Return an explanation of the value that a site of a level took in a sweep of the level.

        ``sweep`` counts from 1; None is the last sweep in which the site relaxes. ``order`` and ``trust`` ask what the
        site would take with a neighbourhood of that order, which requires an exact search, and with temperatures of the
        other sites that are 1 - ``trust`` times theirs: with 1, as if all neighbours were certain. Raises ValueError if
        the site does not relax there, or the level's sample does not hold the order.
        """
        if not 0 <= level < self._run.levels:
            levels = f"0 to {self._run.levels - 1}"
            raise ValueError(f"level is {level} and the levels of this run are {levels}; give one of these")
        pixel = site_number(self._run, level, site)
        while self._state.level >= level and (level, sweep) not in [s[:2] for s in self._sweeps] and self._record():
            pass
        for n, kept in reversed(list(enumerate(self._sweeps))):
            if kept.level == level and sweep in (None, kept.sweep) and (moment := self._moment(n, pixel)):
                return self._explained(moment, site, order, trust)
        where = f"site {site} does not relax at level {level}" + (f", sweep {sweep}" if sweep else "")
        raise ValueError(f"{where}: it keeps its value; give another site, sweep or level")

    def explain_pixel(self, row: int, col: int, sweep: int = -1, sets: int | None = None, **other: Any) -> Explanation:
        """Return an explanation of the value of an output pixel after the first ``sets`` sets of a sweep, None: all.

        It explains the last relaxation until then: on the sweep's level or, if the pixel has kept its value since, on a
        level above. Raises ValueError if there was none: the value is known, or was drawn at random at the start.
        ``other`` are ``order`` and ``trust`` of `explain`.
        """
        sweep = range(len(self.sweeps))[sweep]
        limits: dict[int, int | None] = {sweep: sets}
        row, col = (n >> self._sweeps[sweep].level for n in (row, col))
        for level in range(self._sweeps[sweep].level, self._run.levels):
            pixel = site_number(self._run, level, (row, col))
            for n in range(sweep, -1, -1):
                if self._sweeps[n].level == level and (moment := self._moment(n, pixel, limits.get(n))):
                    return self._explained(moment, (row, col), **other)
            if (row % 2 or col % 2) and not self._twin.of(level).coarser:  # no site of the level above
                break
            row, col = row // 2, col // 2
        raise ValueError("this pixel has not relaxed yet: its value is given, or drawn at random from the sample")

    def together(self, now: Instant) -> NDArray[np.bool_]:
        """Return whether each site of the last set of an instant has a neighbour in that set."""
        sites = np.flatnonzero(now.relaxed == 2).astype(np.int32)
        neighbours = self._twin.grid(now.level).neighbours(sites, self._twin.offsets)
        return np.asarray(np.isin(neighbours, sites).any(0))

    def largest_order(self, level: int) -> int:
        """Return the largest order with which a site of a level is explained; 0 if its search is not exact."""
        return largest_order(self._twin, level)

    def _explained(
        self, moment: Moment, site: tuple[int, ...], order: int | None = None, trust: float = 0
    ) -> Explanation:
        """Return an explanation of a moment, with another order or more trust."""
        twin, moment = self._twin, with_trust(moment, site_number(self._twin, moment.level, site), trust)
        if order not in (None, twin.of(moment.level).options.neighbourhood):
            twin, moment = with_order(twin, moment, order)
        return explained(twin, moment, site)

    def _record(self) -> bool:
        """Run the next sweep, and keep the state before it; return False if the run has ended."""
        run, state = self._run, self._state
        if run.ended(state):
            return False
        grid, saved = run.grid(state.level), run.save(state)
        size = sum(array.nbytes for array in saved.values() if isinstance(array, np.ndarray))
        if not self._sweeps or size <= self._room:
            self._states[len(self._sweeps)] = saved
            self._room -= size
        after, info = run.step(state)
        ranges = np.concatenate([chosen.ranges for chosen in info.chosen])
        sites, left = int((ranges[:, 1] - ranges[:, 0]).sum()), state.temperature_sum / (1024 * grid.size)
        self._sweeps.append(Sweep(state.level, info.sweep, len(ranges), sites, left))
        self._state = self._sweeping(after)
        return True

    def _sweeping(self, state: MrfState) -> MrfState:
        """Return the state before the next sweep, which may be of a finer level; the last state if there is none."""
        while self._run.at_equilibrium(state) and not self._run.ended(state):
            state, _ = self._run.step(state)
        return state

    def _before(self, sweep: int) -> MrfState:
        """Return the state before a sweep, on the machine."""
        first = max(n for n in self._states if n <= sweep)
        state = self._run.load(self._states[first])
        for _ in range(first, sweep):
            state = self._sweeping(self._run.step(state)[0])
        return state

    def _play(self, sweep: int, sets: int | None) -> tuple[Field, list[schedules.Info]]:
        """Return the field after ``sets`` sets of a sweep, None: all, and the choices of the schedule, on the host."""
        state, get = self._before(sweep), self._run.machine.get
        most = self._sweeps[sweep].sets if sets is None else max(0, sets)
        field, _, chosen = run_steps(self._run.level(state.level), state, sets=most)
        here = [c if isinstance(c.sites, np.ndarray) else c._replace(sites=get(c.sites)) for c in chosen]
        return Field(*map(get, field)), here

    def _moment(self, sweep: int, pixel: int, sets: int | None = None) -> Moment | None:
        """Return the last moment at which a site relaxes in the first ``sets`` sets of a sweep; None without any."""
        last, done = None, 0
        for info in self._play(sweep, sets)[1]:
            for place in np.flatnonzero(info.sites == pixel):
                for group in np.flatnonzero((info.ranges[:, 0] <= place) & (place < info.ranges[:, 1])):
                    last = done + int(group), info.turn
            done += len(info.ranges)
        if last is None:
            return None
        before, turn = last
        field, level = self._play(sweep, before)[0], self._sweeps[sweep]
        penalty = self._states[sweep]["penalty"] if sweep in self._states else self._before(sweep).penalty
        return Moment(level.level, level.sweep, field, penalty, turn)
