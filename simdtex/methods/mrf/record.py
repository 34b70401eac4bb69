# SPDX-License-Identifier: BSD-3-Clause
"""The observer of a run of Algorithm 1: progress, counts, and stages."""

from __future__ import annotations

import time
from functools import partial
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.reference import Reference
from simdtex.methods.mrf.explain import Moment, explained
from simdtex.methods.mrf.level import Lattices, Level, MrfState, Part, SweepInfo
from simdtex.methods.mrf.neighbourhood import Field
from simdtex.methods.mrf.relax import CandidateList, most_listed
from simdtex.model.explanation import Explanation
from simdtex.model.lattice import Grid
from simdtex.model.source_map import effective_use
from simdtex.run import Callback, Observer, OutputWithSource, Progress, Stage

STEP, LISTED = 200_000, 16
"""What a step costs beside its candidates, and a listed candidate, in candidates of an exhaustive search (PoCL)."""


class MrfRecord(Observer):
    """The observer of a run: it reports every part of a sweep, and keeps counts and the stage of every level."""

    def __init__(self, run: Lattices, callback: Callback | None) -> None:
        super().__init__(run, callback)
        self._expected = expected_work(run)
        self._fraction = 0.0
        self._first_left = 0.0  # of the current level
        self._listed = False  # whether the candidates of a relaxation are listed
        self._done = 0  # relaxed sites of the current sweep
        self._ended = True  # the next part begins a sweep
        self._skipped = self._evaluations = 0  # the latter of the level before the run was resumed
        self._level: Level | None = None  # whose parts are received
        self._twin: Lattices | None = None  # the plan on the reference, for explanations

    def part(self, level: Level, state: MrfState, part: Part) -> None:
        """Count a part of a sweep, and report it to the callback."""
        if not self.reports or level.number != self.reports[-1]["level"]:
            self._begin(level)
        self._level = level
        free, sites = not state.active, level.grid.size
        left = state.temperature_sum / (1024 * sites)
        self._done = part.sites + (0 if self._ended else self._done)
        report = self.reports[-1]
        for what, count in {"sweeps": self._ended, "steps": part.steps, "relaxations": part.sites}.items():
            report[what] += int(count)
            report["equilibrium"][what] += 0 if free else int(count)
        report["fma"] += 0 if self._listed else level.work * part.sites
        self._ended, self._first_left = part.last, self._first_left or left
        self._advance(level.number, state, left, min(1.0, self._done / max(1, state.active or sites)))
        if self._callback:
            read, sweep = (self._run.of(level.number), level.grid, part.field), state.cooling + state.free + 1
            self._callback(
                Progress(
                    level=level.number,
                    levels=self._run.levels,
                    fraction=self._fraction,
                    doing=f"level {level.number}, sweep {sweep}, temperature {left:.3f}",
                    stage=f"level{level.number}-sweep{sweep:02d}" if part.last else None,
                    image=partial(picture, *read),
                    details={
                        **{"sweep": sweep, "step": report["steps"]},
                        **{"phase": "free" if free else "relax", "temperature_left": left},
                    },
                    maps={"temperature": partial(temperatures, *read)},
                    source=partial(sources, *read),
                    explain=partial(self._explain, level, state, part),
                )
            )

    def _explain(self, level: Level, state: MrfState, part: Part, *site: int) -> Explanation:
        """Return an explanation of how a site of the level would relax now."""
        if self._twin is None:
            self._twin = Lattices(self._run.plan, Reference(), self._run.seed)
        field, sweep = Field(*map(self._run.machine.get, part.field)), state.cooling + state.free + 1
        return explained(self._twin, Moment(level.number, sweep, field, state.penalty, part.turn), site)

    def _advance(self, level: int, state: MrfState, left: float, share: float) -> None:
        """Estimate the finished share of the run after ``share`` of a sweep that started at mean temperature ``left``.

        The finished share of a level's cooling is about 1 - sqrt(t / t_0); a sweep cools by about a tenth.
        """
        cooled, free = 1.0, 0.0
        if state.active:
            cooled = 1 - sqrt(left / self._first_left)
            cooled += min(0.1, 1 - cooled) * share
        else:
            free = min(1.0, (state.free + share) / max(1, self._run.free_sweeps(level)))
        self._fraction = max(self._fraction, fraction_done(self._expected, level, cooled, free))

    def step(self, state: MrfState, info: SweepInfo) -> None:
        """Keep the picture of a level at its end."""
        machine = self._run.machine
        if info.ended:
            level, report = self._run.level(info.level), self.reports[-1]
            self.stages.append(Stage(level.number, picture(self._run.of(level.number), level.grid, state.field)))
            if self._listed:
                evaluations = self._evaluated()
                report["weighed"] = evaluations / max(1, report["relaxations"])  # none if the whole level is known
                report["fma"] += evaluations * (level.work // level.proposal.slots)
            report["skipped"] = machine.spared - self._skipped
            report["seconds"] = time.perf_counter() - self._began
            self._level = None  # its arrays are free before the next level has its own

    def _evaluated(self) -> int:
        """Return the number of candidates that the sites of the level have evaluated, if the level lists candidates."""
        if not self._listed or self._level is None:
            return self._evaluations
        return self._evaluations + int(self._run.machine.get(self._level.evaluations).sum(dtype=np.int64))

    def _begin(self, level: Level) -> None:
        """Start the report of a level."""
        self._began, self._first_left, self._skipped = time.perf_counter(), 0.0, level.machine.spared
        self._evaluations = 0
        self._listed = isinstance(level.proposal, CandidateList)
        grid, candidates = level.grid, level.proposal.candidates.size
        names = ("layers", "rows", "cols")[-len(grid.shape) :]
        sizes = {"level": level.number, **dict(zip(names, grid.shape, strict=True)), "candidates": candidates}
        counts = {"sweeps": 0, "steps": 0, "relaxations": 0}
        work = {"fma": 0, "weighed": float(candidates), "skipped": 0, "seconds": 0.0}
        self.reports.append({**sizes, **counts, "equilibrium": dict(counts), **work})

    def save(self) -> dict[str, Any]:
        """Return everything received so far, as plain arrays and numbers."""
        return super().save() | {
            **{"fraction": self._fraction, "listed": self._listed, "first_left": self._first_left},
            **{"evaluations": self._evaluated(), "skipped": self._run.machine.spared - self._skipped},
        }

    def load(self, saved: dict[str, Any]) -> None:
        """Continue from the tree that `save` returned."""
        super().load(saved)
        self._fraction, self._first_left = saved["fraction"], saved["first_left"]
        self._listed = saved["listed"]
        self._skipped, self._evaluations = self._run.machine.spared - saved["skipped"], saved["evaluations"]


def output(run: Lattices, state: MrfState, source: NDArray[np.int32], record: MrfRecord) -> OutputWithSource:
    """Return the source map, temperatures, stages and statistics of a run that has ended."""
    place, t = run.sample.place(source), run.grid(0).latest(run.machine.get(state.temperature))
    statistics = known_before(run) | {"levels": record.reports, "use": None}
    taken = place[..., 0] >= 0
    if place.shape[-1] == 2 and taken.any():  # of one picture
        statistics["use"] = effective_use(place[taken][None], run.sample.pictures.pixels[0].shape).as_dict()
    given = run.plan.given
    if given and given.place is not None:
        place = np.where(given.data[..., None], given.place, place)
    return OutputWithSource(place, t / 1024, record.stages, statistics)


def known_before(run: Lattices) -> dict[str, Any]:
    """Return the statistics that are known before a run begins."""
    executed = {"levels": run.levels, "reduction": run.plan.sizes[-1].reduction, "schedule": run.plan.schedule.name}
    return {
        "options": vars(run.options) | executed,
        "lattice": run.sample.phases and run.sample.phases.statistics((run.plan.shape[-2], run.plan.shape[-1])),
    }


def picture(run: Lattices, grid: Grid, field: Field) -> NDArray[Any]:
    """Return the picture of a level, read back, in the sample's type."""
    values, source = run.machine.get(field.values), run.machine.get(field.source)
    image = run.sample.picture(grid.latest(values), grid.latest(source))
    return run.plan.given.shown(image, grid) if run.plan.given else image


def temperatures(run: Lattices, grid: Grid, field: Field) -> NDArray[np.float64]:
    """Return the temperatures of a level, read back, 0 to 1."""
    temperature: NDArray[np.float64] = grid.latest(run.machine.get(field.temperature)) / np.float64(1024)
    return temperature


def sources(run: Lattices, grid: Grid, field: Field) -> NDArray[np.int32]:
    """Return the source map of a level, read back: the position in the sample of each site, (rows, cols, 2 or 3)."""
    return run.sample.place(grid.latest(run.machine.get(field.source)))


def expected_work(whole: Lattices) -> dict[int, tuple[float, float]]:
    """Return the expected work of each level, for its cooling and its free sweeps, in evaluated candidates.

    Measured at xi = -1: the coarsest level takes about 0.6 |N| sweeps, and every other level relaxes each of its new
    sites about 6 times; a sweep has about 0.6 (|N| + 1) steps.
    """
    work = {}
    for level in range(whole.levels):
        run, grid = whole.of(level), whole.grid(level)
        coarsest = level == run.levels - 1
        sweeps = min(1024, 1 - 0.6 * len(run.offsets) / float(run.options.xi)) if coarsest else 6 * 0.75
        each = run.places(level).positions.size
        if not run.exhaustive(level):
            each = LISTED * min(each, most_listed(len(run.offsets), run.chance(level)))
        sweeps = 0.0 if run.coarser else sweeps  # it begins with an arrangement
        sweep = grid.size * each + STEP * min(grid.size, 0.6 * (len(run.offsets) + 1))
        share = 0.25 if run.kept_only else 1.0
        work[level] = (sweep * sweeps, sweep * share * run.free_sweeps(level))
    return work


def fraction_done(expected: dict[int, tuple[float, float]], level: int, cooled: float, free: float) -> float:
    """Return the finished share of the expected work, at the shares ``cooled`` and ``free`` of a level's sweeps."""
    cooling, sweeps = expected[level]
    before = sum(sum(work) for coarser, work in expected.items() if coarser > level)
    return min(1.0, (before + cooling * cooled + sweeps * free) / sum(map(sum, expected.values())))
