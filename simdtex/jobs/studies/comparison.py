# SPDX-License-Identifier: BSD-3-Clause
"""Comparison of parallel schedules for the same job: steps and times, changes of the picture, and the result."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, fields
from math import isfinite, isqrt
from statistics import mean, stdev
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex import schedules as known
from simdtex.inputs import check_shape
from simdtex.io.image import check_sample
from simdtex.jobs.studies.quality import COPIED_PATCH, as_planes, measure
from simdtex.jobs.synthesis.job import synthesize
from simdtex.machine import Machine, open_machine
from simdtex.methods.mrf.options import ORDERS, Options
from simdtex.options import resolve
from simdtex.random import as_seed
from simdtex.run import Callback, Progress
from simdtex.schedules import Schedule, Setting, Watched

__all__ = ["FIGURES", "Comparison", "Entry", "Recorder", "ScheduleRun", "Spread", "SweepRecord", "compare"]

FIGURES = (
    *("steps", "sweeps", "relaxations_per_site", "all_steps", "all_sweeps", "all_relaxations_per_site"),
    *("seconds", "device_seconds", "utilisation", "model_seconds", "passes"),
    *("changed_cooling", "oscillation_cooling", "changed_free", "oscillation_free"),
    *("plausibility", "coverage", "histogram_distance", "copying", "seam"),
)
"""The names of a run's figures, see `compare`."""

MEASURED = FIGURES[-5:]
"""The names of the figures of `simdtex.jobs.studies.quality`."""


@dataclass(frozen=True)
class SweepRecord:
    """A sweep of a level.

    Attributes
    ----------
    level, sweep : int
        The level, 0 the finest, and the sweep within it, from 1.
    phase : str
        ``"relax"`` until equilibrium, then ``"free"``.
    steps : int
        Steps of the level until the end of the sweep.
    before, left : float
        Mean temperature of the level's sites at the start and at the end of the sweep, 0 to 1.
    changed : float or None
        Share of the level's sites whose pixel differs from that a sweep ago; None in the first sweep.
    returned : float or None
        The oscillation index: share of the level's sites whose pixel differs from that a sweep ago, and equals that two
        sweeps ago; None in the first two sweeps.
    """

    level: int
    sweep: int
    phase: str
    steps: int
    before: float
    left: float
    changed: float | None
    returned: float | None


class Recorder:
    """A callback that compares the pictures after every sweep of a level; it holds the last two.

    Parameters
    ----------
    channel_axis : int, optional
        The channel axis of the pictures.
    then : callable, optional
        Called with every progress, before it is recorded.
    wait : callable, optional
        Waits for the device; called before the recorder measures its own time.

    Attributes
    ----------
    sweeps : list of SweepRecord
    seconds : float
        Time spent on recording.
    """

    def __init__(
        self,
        channel_axis: int | None = None,
        then: Callback = lambda progress: None,
        wait: Callable[[], Any] = lambda: None,
    ) -> None:
        self.sweeps: list[SweepRecord] = []
        self.seconds = 0.0
        self._axis, self._then, self._wait = channel_axis, then, wait
        self._last: list[NDArray[Any]] = []

    def __call__(self, progress: Progress) -> None:
        """Record if a sweep has ended."""
        self._then(progress)
        if not progress.stage:
            return
        self._wait()
        began = time.perf_counter()
        image = progress.image()
        if not self.sweeps or progress.level != self.sweeps[-1].level:
            self._last = []
        moved = [image != earlier for earlier in self._last]  # from one and from two sweeps ago
        moved = moved if self._axis is None else [differs.any(self._axis) for differs in moved]
        self.sweeps.append(
            SweepRecord(
                progress.level,
                progress.sweep,
                progress.phase,
                progress.step,
                float(progress.temperature_left),
                float(progress.temperature().mean()),
                float(moved[0].mean()) if moved else None,
                float((moved[0] & ~moved[1]).mean()) if len(moved) > 1 else None,
            )
        )
        self._last = [image, *self._last][:2]
        self.seconds += time.perf_counter() - began


class Noted(Watched):
    """A wrapper that notes, level by level, whether a schedule claims to keep equation (14)."""

    def __init__(self, schedule: Schedule) -> None:
        super().__init__(schedule)
        self.claims: list[bool] = []

    def init(self, setting: Setting) -> Any:
        """Return the schedule's own state."""
        self.claims.append(bool(self.independent(setting.grid, setting.offsets)))
        return super().init(setting)


@dataclass(frozen=True)
class ScheduleRun:
    """One run of a schedule with one seed.

    Attributes
    ----------
    schedule : str
    seed : int
    image : array
        The output, with the sample's type and axes.
    figures : dict
        The `FIGURES` by name; None for each that the run lacks.
    sweeps : tuple of SweepRecord
        All levels, the coarsest first.
    levels : list of dict
        As in `simdtex.run.Output.statistics`.
    accounting : dict
        The cost of the run on the processor array, as in `simdtex.run.Output.statistics`.
    """

    schedule: str
    seed: int
    image: NDArray[Any]
    figures: dict[str, float | None]
    sweeps: tuple[SweepRecord, ...]
    levels: list[dict[str, Any]]
    accounting: dict[str, Any]

    @property
    def finest(self) -> tuple[SweepRecord, ...]:
        """The sweeps of the finest level."""
        return tuple(sweep for sweep in self.sweeps if sweep.level == 0)


def _figures(statistics: dict[str, Any], sweeps: Sequence[SweepRecord]) -> dict[str, float | None]:
    """Return the figures of a run, except those of its output and its wall time."""
    levels = statistics["levels"]
    finest = next(level for level in levels if level["level"] == 0)
    figures: dict[str, float | None] = {"device_seconds": statistics["device_seconds"]}
    for what, name, per in (
        ("steps", "steps", 1),
        ("sweeps", "sweeps", 1),
        ("relaxations", "relaxations_per_site", finest["rows"] * finest["cols"]),
    ):
        figures[name] = finest["equilibrium"][what] / per
        figures[f"all_{name}"] = sum(level["equilibrium"][what] for level in levels) / per
    figures |= {name: float(statistics["accounting"][name]) for name in ("utilisation", "model_seconds", "passes")}
    at_finest = [sweep for sweep in sweeps if sweep.level == 0]
    free = [sweep for sweep in at_finest if sweep.phase == "free"]
    for name, what, least in (("changed", "changed", 1), ("oscillation", "returned", 2)):
        cooling = [getattr(sweep, what) for sweep in at_finest if sweep.phase == "relax"]
        cooling = [value for value in cooling if value is not None]
        figures[f"{name}_cooling"] = mean(cooling) if cooling else None
        # a change and its return both lie in free sweeps
        figures[f"{name}_free"] = getattr(free[-1], what) if len(free) >= least else None
    return figures


@dataclass(frozen=True)
class Spread:
    """A figure over the seeds: ``mean``, ``deviation`` (standard deviation, n - 1; None for one seed), ``values``."""

    mean: float
    deviation: float | None
    values: tuple[float, ...]


@dataclass(frozen=True)
class Entry:
    """A schedule and its runs.

    Attributes
    ----------
    name : str
    claims : tuple of bool
        Per level, the coarsest first, whether it claims to keep equation (14) there.
    runs : tuple of ScheduleRun
        One for each seed.
    """

    name: str
    claims: tuple[bool, ...]
    runs: tuple[ScheduleRun, ...]

    @property
    def independent(self) -> bool:
        """Whether it claims to keep equation (14) at every level."""
        return all(self.claims)

    def figure(self, name: str) -> Spread | None:
        """Return one of `FIGURES` over the seeds; None if a run lacks it, or if it is not finite."""
        values = tuple(value for run in self.runs if (value := run.figures[name]) is not None)
        if len(values) < len(self.runs) or not all(map(isfinite, values)):
            return None
        return Spread(mean(values), stdev(values) if len(values) > 1 else None, values)


@dataclass(frozen=True)
class Comparison:
    """Several schedules and their runs, as `compare` returns them.

    Attributes
    ----------
    sample : array
    shape : (int, int)
        Rows and columns of the outputs.
    channel_axis : int or None
    seeds : tuple of int
    device : str
    options : dict
        All options of the method but the schedule.
    entries : tuple of Entry
        One for each schedule, in the given order.
    """

    sample: NDArray[Any]
    shape: tuple[int, int]
    channel_axis: int | None
    seeds: tuple[int, ...]
    device: str
    options: dict[str, Any]
    entries: tuple[Entry, ...] = field(repr=False)

    def results(self) -> dict[str, Any]:
        """Return everything but the pictures, for JSON; except for times, the same for the same seeds."""
        return {
            "sample_shape": list(self.sample.shape),
            "shape": list(self.shape),
            "seeds": list(self.seeds),
            "device": self.device,
            "options": self.options,
            "schedules": [
                {
                    "name": entry.name,
                    "keeps_equation_14": entry.independent,
                    "claims_by_level": list(entry.claims),
                    "figures": {name: (found := entry.figure(name)) and asdict(found) for name in FIGURES},
                    "runs": [
                        {one.name: getattr(run, one.name) for one in fields(run) if one.name not in ("image", "sweeps")}
                        | {"sweeps": [asdict(sweep) for sweep in run.sweeps]}
                        for run in entry.runs
                    ],
                }
                for entry in self.entries
            ],
        }


def compare(
    sample: ArrayLike,
    shape: tuple[int, int],
    schedules: Sequence[str | Schedule] = known.PARALLEL,
    *,
    seeds: Sequence[int] = (1, 2, 3),
    channel_axis: int | None = None,
    device: str | Machine | None = None,
    callback: Callback | None = None,
    **options: Any,
) -> Comparison:
    """Return a comparison of several schedules for the same job.

    Parameters
    ----------
    sample : (rows, cols) or, with `channel_axis`, (rows, cols, channels) array
        At least 9 x 9 pixels.
    shape : (int, int)
        Rows and columns of the outputs, each 9 or more.
    schedules : sequence of str or simdtex.schedules.Schedule
        The schedules, with different names.
    seeds : sequence of int
        The seeds, all different: one run of each schedule for every seed.
    channel_axis : int, optional
        As in `simdtex.synthesize`.
    device : str, optional
        As in `simdtex.synthesize`; all runs are on one machine.
    callback : callable, optional
        As in `simdtex.synthesize`; the fraction is that of all runs.
    **options
        Options of the method ``mrf``, see `simdtex.methods.mrf.Options`, which lists the defaults that differ in
        ``schedules``: ``search`` is ``"exact"``, so that the model decides and not a list of candidates.

    Returns
    -------
    Comparison
        Except for times, the same for the same seeds.

    Raises
    ------
    ValueError, TypeError
        As in `simdtex.synthesize`; or there are no schedules or no seeds, one occurs twice, or a picture has fewer than
        9 x 9 pixels.

    Notes
    -----
    The figures of a run are, by name: ``steps``, ``sweeps`` and ``relaxations_per_site`` of the finest level until all
    temperatures were 0; the same with ``all_`` over every level, relaxations per site of the finest. ``seconds``
    and ``device_seconds``. ``utilisation`` of the processor array, 0 to 1, its ``passes``, and ``model_seconds``,
    the time of a MasPar MP-1 by a model. ``changed_cooling`` and ``oscillation_cooling``: mean over
    the sweeps of the finest level until its equilibrium; ``changed_free`` and ``oscillation_free``: in its last free
    sweep, the latter with at least two free sweeps. ``plausibility``, ``coverage``, ``histogram_distance``, ``copying``
    and ``seam`` as in `simdtex.jobs.studies.quality`.

    A schedule claims whether it keeps equation (14) on the lattice of each level; `simdtex.schedules.Checked` checks
    the claim of your own schedule. A small run precedes the first run of each schedule, so that no time includes
    building kernels.

    Cost: schedules x seeds runs of `simdtex.synthesize`, and about 1 s each for the quality. Memory: two pictures
    more.

    Examples
    --------
    >>> from skimage import data
    >>> from simdtex.jobs.studies.comparison import compare
    >>> brick = data.brick()[:32, :32]
    >>> found = compare(brick, (24, 24), ["coloring", "synchronous"], seeds=[1], order=2)
    >>> [(entry.name, entry.independent) for entry in found.entries]
    [('coloring', True), ('synchronous', False)]
    """
    chosen = {schedule.name: schedule for schedule in map(known.get, schedules)}
    keys = [as_seed(seed) for seed in seeds]
    _check_distinct("schedule", [known.get(schedule).name for schedule in schedules])
    _check_distinct("seed", keys)
    if "schedule" in options:
        raise TypeError("schedule is no option here; give schedules, a sequence of them")
    settings = vars(resolve(Options, "schedules", options))
    if settings["array"] is None:
        raise ValueError("array is None, but a comparison counts the passes of one; leave array out for a full MP-1")
    pixels = check_sample(sample, channel_axis)
    size = _check_sides(as_planes(pixels).shape[:2], shape)
    machine = open_machine(device, profile=True)
    call = _Call(np.asarray(sample), pixels, channel_axis, machine, settings)
    runs: dict[str, list[tuple[ScheduleRun, tuple[bool, ...]]]] = {name: [] for name in chosen}
    turns = [(seed, name) for seed in keys for name in chosen]  # so that changes of the load affect all alike
    for number, (seed, name) in enumerate(turns):

        def report(progress: Progress, number: int = number, seed: int = seed, name: str = name) -> None:
            if callback:
                job = f"run {number + 1} of {len(turns)}: {name}, seed {seed}"
                callback(progress.within(number, len(turns), job))

        if not runs[name]:
            call.build_kernels(chosen[name], size)
        run, claims, settings = call.run(chosen[name], seed, size, report)
        runs[name].append((run, claims))
    entries = [Entry(name, done[0][1], tuple(run for run, _ in done)) for name, done in runs.items()]
    settings = {name: value for name, value in settings.items() if name != "schedule"}
    return Comparison(call.sample, size, channel_axis, tuple(keys), machine.name, settings, tuple(entries))


@dataclass(frozen=True)
class _Call:
    """The job of every run: the given sample, its pixels with channels last, and the options."""

    sample: NDArray[Any]
    pixels: NDArray[Any]
    channel_axis: int | None
    machine: Machine
    options: dict[str, Any]

    def run(
        self, schedule: Schedule, seed: int, size: tuple[int, int], tell: Callback
    ) -> tuple[ScheduleRun, tuple[bool, ...], dict[str, Any]]:
        """Return a run, the schedule's claim of equation (14) at each level, and the options as executed."""
        noted, recorder = Noted(schedule), Recorder(self.channel_axis, tell, self.machine.sync)
        image, said = self._synthesize(noted, seed, size, callback=recorder)
        made = image[..., None] if self.channel_axis is None else np.moveaxis(image, self.channel_axis, -1)
        quality = measure(self.pixels, made)
        figures = _figures(said, recorder.sweeps) | {name: getattr(quality, name) for name in MEASURED}
        figures["seconds"] = said["seconds"] - recorder.seconds
        levels, accounting = said["levels"], said["accounting"]
        run = ScheduleRun(schedule.name, seed, image, figures, tuple(recorder.sweeps), levels, accounting)
        return run, tuple(noted.claims), said["options"]

    def build_kernels(self, schedule: Schedule, size: tuple[int, int]) -> None:
        """Build every kernel that the schedule needs, by a small picture of at most two levels."""
        side, levels = 4 * isqrt(self.options["order"] or ORDERS[2]) + 1, self.options["levels"]
        small = (min(size[0], side), min(size[1], side))
        self._synthesize(schedule, 0, small, **({} if levels is None else {"levels": min(levels, 2)}))

    def _synthesize(
        self, schedule: Schedule, seed: int, size: tuple[int, int], **more: Any
    ) -> tuple[NDArray[Any], dict[str, Any]]:
        common: dict[str, Any] = {"channel_axis": self.channel_axis, "rng": seed, "device": self.machine}
        options = {**self.options, "schedule": schedule, **more}
        image, output = synthesize(self.sample, size, full_output=True, **common, **options)
        return image, output.statistics


def _check_distinct(what: str, items: Sequence[Any]) -> None:
    if not items:
        raise ValueError(f"there are no {what}s to compare; give one or more")
    for item in items:
        if items.count(item) > 1:
            raise ValueError(f"the {what} {item} is given twice; give each once")


def _check_sides(sample: tuple[int, ...], shape: tuple[int, int]) -> tuple[int, int]:
    """Return the output's shape; raise unless both pictures are large enough for measurements."""
    if min(sample) < COPIED_PATCH:
        raise ValueError(
            f"the sample of {sample[0]} rows x {sample[1]} columns is too small to compare with; "
            f"give {COPIED_PATCH}x{COPIED_PATCH} pixels or more"
        )
    return check_shape(shape, COPIED_PATCH)
