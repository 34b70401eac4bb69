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


class Played(NamedTuple):
    """A part of a sweep: the field after it, and the decisions of the schedule, with their sites on the host."""

    field: Field
    decided: list[schedules.Info]


class Replay:
    """A replay of a run of the method ``mrf``: its field after any set of sites that relax together.

    `simdtex.replay` returns one. Sweeps are numbered from 0 over all levels, the coarsest level first.

    Notes
    -----
    The run is executed once, up to the last sweep that a call needs. The host keeps a copy of the state before each
    sweep: 6 bytes per site, and 2 for each of its channels, 256 MiB at most. `at` and the explanations start from the
    nearest earlier state.
    """

    origin = (0, 0)
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
        played = self._play(sweep, sets)
        level = self._sweeps[sweep].level
        run, grid = self._twin.of(level), self._twin.grid(level)
        field = Field(*map(self._run.machine.get, played.field))
        done = np.zeros(grid.shape, np.uint8)
        chosen = [info.sites[begin:end] for info in played.decided for begin, end in info.ranges]
        for each in chosen:
            done.flat[each] = 1
        if chosen:
            done.flat[chosen[-1]] = 2
        seen = picture(run, grid, field), sources(run, grid, field), temperatures(run, grid, field)
        return Instant(level, *seen, done)

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

        ``sweep`` counts from 1; None is the last sweep in which the site relaxes. Raises ValueError if there is no such
        site or level, or if the site does not relax there.

        With ``order``, the explanation describes what the site would take with a neighbourhood of that order, and with
        ``trust``, 0 to 1, what it would take if the other sites' temperatures were 1 - ``trust`` times theirs: with 1,
        as if all neighbours were certain. The field, the seed and all else stay as in the run. Raises ValueError if the
        search at the level is not exact, or the level's sample does not hold the order (`largest_order`).
        """
        if not 0 <= level < self._run.levels:
            raise ValueError(
                f"level is {level} and the levels of this run are 0 to {self._run.levels - 1}; give one of these"
            )
        pixel = site_number(self._run, level, site)
        asked = (level, sweep)
        while self._state.level >= level and all(one[:2] != asked for one in self._sweeps) and self._record():
            pass
        for n, one in reversed(list(enumerate(self._sweeps))):
            if one.level == level and sweep in (None, one.sweep) and (moment := self._moment(n, pixel)):
                return self._explained(moment, site, order, trust)
        where = f"level {level}" + (f", sweep {sweep}" if sweep else "")
        raise ValueError(
            f"site {site} does not relax at {where}: it keeps its value; give another site, sweep or level"
        )

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
        number, grid = len(self._sweeps), run.grid(state.level)
        saved = run.save(state)
        size = sum(one.nbytes for one in saved.values() if isinstance(one, np.ndarray))
        if not number or size <= self._room:
            self._states[number] = saved
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

    def _before(self, number: int) -> MrfState:
        """Return the state before a sweep, on the machine."""
        first = max(n for n in self._states if n <= number)
        state = self._run.load(self._states[first])
        for _ in range(first, number):
            state = self._sweeping(self._run.step(state)[0])
        return state

    def _play(self, number: int, sets: int | None) -> Played:
        """Run the first ``sets`` sets of a sweep, None: all; return the field and the decisions of the schedule."""
        state = self._before(number)
        most = self._sweeps[number].sets if sets is None else max(0, sets)
        field, _, decided = run_steps(self._run.level(state.level), state, sets=most)
        here = (one.sites if isinstance(one.sites, np.ndarray) else self._run.machine.get(one.sites) for one in decided)
        return Played(field, [one._replace(sites=sites) for one, sites in zip(decided, here, strict=True)])

    def _moment(self, number: int, pixel: int, sets: int | None = None) -> Moment | None:
        """Return the last moment at which a site relaxes in the first ``sets`` sets of a sweep; None without any."""
        found, done = None, 0
        for info in self._play(number, sets).decided:
            for place in np.flatnonzero(info.sites == pixel):
                for number_of_set in np.flatnonzero((info.ranges[:, 0] <= place) & (place < info.ranges[:, 1])):
                    found = done + int(number_of_set), info.turn
            done += len(info.ranges)
        if found is None:
            return None
        before, turn = found
        field = Field(*map(self._run.machine.get, self._play(number, before).field))
        sweep = self._sweeps[number]
        penalty = self._states[number]["penalty"] if number in self._states else self._before(number).penalty
        return Moment(sweep.level, sweep.sweep, field, penalty, turn)
