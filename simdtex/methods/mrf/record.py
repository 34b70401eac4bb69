# SPDX-License-Identifier: BSD-3-Clause
"""What watches a run of Algorithm 1: progress, counts, stages, and what the run would cost on a processor array."""

from __future__ import annotations

import time
from functools import partial
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.maspar.accounting import Account
from simdtex.maspar.array import parse_array
from simdtex.methods.mrf.level import Info, Lattices, Level, Part, State
from simdtex.model.lattice import Grid
from simdtex.model.use import effective_use
from simdtex.ops import active
from simdtex.ops.neighbourhood import Field
from simdtex.ops.relax import Listed, most_listed
from simdtex.run import Callback, Output, Relaxing, Stage


class Meter:
    """Counts the work of a run, level by level, and estimates how far the run has come.

    Parameters
    ----------
    expected : dict
        Level -> expected work of its cooling and of its free sweeps, in relaxations times candidates.
    """

    def __init__(self, expected: dict[int, tuple[float, float]]) -> None:
        self.reports: list[dict[str, Any]] = []
        self._expected = expected
        self._ended = self._fraction = self._cooled = 0.0
        self._sweep_share = self._first_left = 0.0
        self._free = self._weighed = 0
        self._cooling = True
        self._level_began = time.perf_counter()

    def save(self) -> dict[str, Any]:
        """Return all counts, with the seconds of the level so far in place of its beginning."""
        saved = {name: value for name, value in vars(self).items() if name != "_expected"}
        return saved | {"_level_began": time.perf_counter() - self._level_began}

    def load(self, saved: dict[str, Any]) -> None:
        """Go on from what `save` returned."""
        vars(self).update(saved | {"_level_began": time.perf_counter() - saved["_level_began"]})

    def begin(self, level: int, grid: Grid, candidates: int, weighed: int | None = None) -> None:
        """Begin a level; a relaxation weighs about `weighed` of its candidates, or all."""
        self._weighed = candidates if weighed is None else weighed
        self._level_began = time.perf_counter()
        self._cooled = self._sweep_share = self._first_left = 0.0
        self._free = 0
        sizes = {"level": level, "rows": grid.rows, "cols": grid.cols, "candidates": candidates}
        counts = {"sweeps": 0, "steps": 0, "relaxations": 0}
        self.reports.append({**sizes, **counts, "equilibrium": dict(counts), "fma": 0, "seconds": 0.0})

    def sweep(self, phase: str, left: float) -> int:
        """Begin a sweep at this mean temperature; return its number within the level, from 1.

        The share of the level's cooling that is done is about 1 - sqrt(t / t_0).
        """
        self._cooling = phase == "relax"
        self._count("sweeps", 1)
        self._first_left = self._first_left or left
        cooled = 1 - sqrt(left / self._first_left) if left else 1.0
        like_the_last = cooled - self._cooled or 0.1
        self._sweep_share, self._cooled = min(like_the_last, 1 - cooled), cooled
        return int(self.reports[-1]["sweeps"])

    def step(self, steps: int = 1) -> int:
        """Begin one step, or several that go together; return the last one's number within the level, from 1."""
        self._count("steps", steps)
        return int(self.reports[-1]["steps"])

    def add(self, relaxations: int, fma: int, share: float) -> None:
        """Count relaxed sites, with which `share` of the sweep is done."""
        report = self.reports[-1]
        self._count("relaxations", relaxations)
        report["fma"] += fma
        cooling, free = self._expected[report["level"]]
        done = (self._cooled + self._sweep_share * share) * cooling
        if self._cooled == 1:
            self._free += relaxations * self._weighed
            done = cooling + min(self._free, free)
        total = sum(sum(work) for work in self._expected.values())
        self._fraction = max(self._fraction, min(1.0, (self._ended + done) / total))

    def end(self, skipped: int, weighed: tuple[int, int] | None = None) -> None:
        """End the level: so many fma were skipped, or so many candidates weighed at so many fma."""
        report = self.reports[-1]
        report["weighed"] = float(report["candidates"])
        if weighed is not None:
            report["weighed"] = weighed[0] / max(1, report["relaxations"])  # of none, if all of the level is known
            report["fma"] += weighed[0] * weighed[1]
        report["skipped"] = skipped
        report["seconds"] = time.perf_counter() - self._level_began
        self._ended += sum(self._expected[report["level"]])

    def _count(self, what: str, number: int) -> None:
        report = self.reports[-1]
        report[what] += number
        if self._cooling:
            report["equilibrium"][what] += number

    @property
    def fraction(self) -> float:
        """Share of the expected work that is done, 0 to 1; never falls."""
        return self._fraction


class Record:
    """Sees every part and every end of a sweep, and changes nothing.

    Parameters
    ----------
    run : Lattices
    callback : callable, optional
        Called with a `simdtex.run.Relaxing` after every part of a sweep.

    Attributes
    ----------
    stages : list of Stage
        Each level's picture at its end.
    meter : Meter
    account : Account
    launches : int
        Kernels that the machine had launched before the run.
    """

    def __init__(self, run: Lattices, callback: Callback | None) -> None:
        options = run.options
        self.stages: list[Stage] = []
        self.meter = Meter(expected_work(run))
        array = parse_array(options.array or "maspar-mp1-16k")
        self.account = Account(array, packed=options.array is None)
        self.launches = run.machine.launches
        self._run, self._callback = run, callback
        self._number: int | None = None  # of the level that has begun
        self._slots, self._listed = 0, False  # candidates that a relaxation weighs; whether they are listed
        self._done = 0  # sites of the present sweep that are relaxed
        self._ended = True  # the next part begins a sweep
        self._skipped = self._weighed = 0

    def part(self, level: Level, state: State, part: Part) -> None:
        """Count a part of a sweep, and report it to the callback."""
        if level.number != self._number:
            self._begin(level)
        free, sites = not state.active, level.grid.rows * level.grid.cols
        left = state.heat / (1024 * sites)
        phase = "free" if free else "relax"
        if self._ended:
            self.meter.sweep(phase, left)
            self._done = 0
        self._ended = part.last
        self._done += part.sites
        step = self.meter.step(part.steps)
        fma = 0 if isinstance(level.proposal, Listed) else level.work * part.sites
        self.meter.add(part.sites, fma, min(1.0, self._done / max(1, state.active or sites)))
        if self._callback:
            read = (self._run, level.grid, part.field)
            self._callback(
                Relaxing(
                    level=level.number,
                    levels=self._run.levels,
                    fraction=self.meter.fraction,
                    image=partial(picture, *read),
                    sweep=state.cooling + state.free + 1,
                    step=step,
                    phase=phase,
                    temperature_left=left,
                    end_of_sweep=part.last,
                    temperature=partial(temperatures, *read),
                    source=partial(sources, *read),
                )
            )

    def step(self, state: State, info: Info) -> None:
        """Count what a sweep would cost on an array; at a level's end, keep its picture."""
        machine = self._run.machine
        for chosen in info.chosen:
            if self.account.packed:
                self.account.packed_steps(np.diff(chosen.ranges)[:, 0])
            else:
                for step in chosen.apart(machine):
                    self.account.step(step.sites)
        if info.ended:
            level = self._run.level(info.level)
            before, self._weighed = self._weighed, self._total()
            self.stages.append(Stage(level.number, picture(self._run, level.grid, state.field)))
            weighed = (self._weighed - before, level.work // level.proposal.slots) if self._listed else None
            self.meter.end(machine.spared - self._skipped, weighed)

    def _total(self) -> int:
        """Return how many candidates all sites have weighed so far, if the level weighs listed ones."""
        if self._number is None or not self._listed:
            return self._weighed
        return active.total(self._run.machine, self._run.grid(self._number), self._run.weighed)

    def _begin(self, level: Level) -> None:
        self._number, self._skipped = level.number, level.machine.spared
        self._slots, self._listed = level.proposal.slots, isinstance(level.proposal, Listed)
        self.meter.begin(level.number, level.grid, level.proposal.candidates.size, self._slots)
        self.account.begin(*self._costs(level.number))

    def _costs(self, number: int) -> tuple[Grid, NDArray[np.int32], int, int, int]:
        """Return what the account needs to know of a level."""
        channels, coherence = self._run.sample.channels, bool(self._run.options.coherence)
        words = channels + 1 + coherence  # of a neighbour: pixel, temperature, source
        return self._run.grid(number), self._run.offsets, self._slots, channels, words

    def save(self) -> dict[str, Any]:
        """Return all that was seen, as plain arrays and numbers."""
        return {
            "stages": [(stage.level, stage.image) for stage in self.stages],
            **{"meter": self.meter.save(), "account": self.account.total},
            **{"number": self._number, "slots": self._slots, "listed": self._listed},
            **{"weighed": self._total() - self._weighed, "skipped": self._run.machine.spared - self._skipped},
        }

    def load(self, saved: dict[str, Any]) -> None:
        """Go on from what `save` returned."""
        self.stages[:] = [Stage(*stage) for stage in saved["stages"]]
        self.meter.load(saved["meter"])
        self._number, self._slots, self._listed = saved["number"], saved["slots"], saved["listed"]
        self._skipped, self._weighed = self._run.machine.spared - saved["skipped"], -saved["weighed"]
        if self._number is not None:
            self.account.begin(*self._costs(self._number))
        self.account.total.update(saved["account"])


def output(run: Lattices, state: State, source: NDArray[np.int32], record: Record) -> Output:
    """Return the source map, temperatures, stages and statistics of a run that has ended."""
    place, heat = run.sample.place(source), run.grid(0).view(run.machine.get(state.temperature))
    launches = run.machine.launches - record.launches
    statistics = {
        "options": vars(run.options) | {"levels": run.levels, "schedule": run.plan.schedule.name},
        "accounting": record.account.report() | {"launches": launches},
        "levels": record.meter.reports,
        "use": None,
    }
    taken = place[..., 0] >= 0
    if place.shape[-1] == 2 and taken.any():
        statistics["use"] = effective_use(place[taken][None], run.sample.pictures.pixels[0].shape).as_dict()
    given = run.plan.given
    if given and given.place is not None:
        place = np.where(given.whole[..., None], given.place, place)
    return Output(place, heat / 1024, record.stages, statistics)


def picture(run: Lattices, grid: Grid, field: Field) -> NDArray[Any]:
    """Read back the picture of a level, in the sample's type."""
    values, source = run.machine.get(field.values), run.machine.get(field.source)
    found = run.sample.picture(grid.view(values), grid.view(source))
    return run.plan.given.shown(found, grid) if run.plan.given else found


def temperatures(run: Lattices, grid: Grid, field: Field) -> NDArray[np.float64]:
    """Read back the temperatures of a level, 0 to 1."""
    found: NDArray[np.float64] = np.ascontiguousarray(grid.view(run.machine.get(field.temperature))) / np.float64(1024)
    return found


def sources(run: Lattices, grid: Grid, field: Field) -> NDArray[np.int32]:
    """Read back where in the sample each site of a level is from, (rows, cols, 2 or 3)."""
    return run.sample.place(grid.view(run.machine.get(field.source)))


def expected_work(run: Lattices) -> dict[int, tuple[float, float]]:
    """Return the relaxations times candidates that cooling and free sweeps of each level should take.

    As measured at xi = -1, the coarsest level takes about 0.6 |N| sweeps, and the others relax each of their new sites
    about 6 times.
    """
    work = {}
    for number in range(run.levels):
        grid, options = run.grid(number), run.options
        coarsest = number == run.levels - 1
        sweeps = min(1024, 1 - 0.6 * len(run.offsets) / options.xi) if coarsest else 6 * 0.75
        candidates = run.sample.positions(*run.where(number)).size
        if not run.exhaustive(number):
            candidates = min(candidates, most_listed(len(run.offsets), options.chance))
        sites = grid.rows * grid.cols * candidates
        work[number] = (sites * sweeps, float(sites * options.free_sweeps))
    return work
