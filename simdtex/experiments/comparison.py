# SPDX-License-Identifier: BSD-3-Clause
"""Parallel schedules compared: the same job under each, what it took, how it moved and what came of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from math import isfinite, isqrt
from statistics import mean, stdev
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex import schedules as known
from simdtex.driver import check_shape
from simdtex.experiments.quality import COPIED_PATCH, Quality, measure
from simdtex.experiments.recorder import Noted, Recorder, Sweep
from simdtex.io.image import check_sample
from simdtex.machine import Machine, open_machine
from simdtex.methods.mrf import Options
from simdtex.options import resolve
from simdtex.random import as_seed
from simdtex.run import Relaxing
from simdtex.schedules import Schedule
from simdtex.synthesis import synthesize

__all__ = ["FIGURES", "Comparison", "Entry", "Now", "Recorder", "Run", "Spread", "Sweep", "compare"]

Tell = Callable[[Relaxing], Any]

MEASURED = "plausibility", "coverage", "copying", "histogram_distance", "seam"
"""The figures of merit of each run, out of `simdtex.experiments.quality.FIGURES`."""


@dataclass(frozen=True)
class Run:
    """One run of a schedule with one seed.

    Attributes
    ----------
    schedule : str
    seed : int
    image : array
        The output, with the sample's type and axes.
    quality : simdtex.experiments.quality.Quality
        Of the output against the sample: plausibility, coverage, copying, histogram distance and seam.
    sweeps : tuple of Sweep
        All levels, the coarsest first.
    levels : list of dict
        As in `simdtex.run.Output.statistics`.
    seconds : float
        Wall time, without what watching it took.
    device_seconds : float or None
        Time that the device spent in kernels, where it says so.
    accounting : dict
        What the run would take on the processor array, as in `simdtex.run.Output.statistics`.
    met : tuple or None
        Level and pixel indices (site, site) of two neighbours that a schedule relaxed together although it claims
        equation (14).
    """

    schedule: str
    seed: int
    image: NDArray[Any]
    quality: Quality
    sweeps: tuple[Sweep, ...]
    levels: list[dict[str, Any]]
    seconds: float
    device_seconds: float | None
    accounting: dict[str, Any]
    met: tuple[int, int, int] | None

    @property
    def finest(self) -> tuple[Sweep, ...]:
        """The sweeps of the finest level."""
        return tuple(sweep for sweep in self.sweeps if sweep.level == 0)

    def figure(self, name: str) -> float | None:
        """One of `FIGURES`; None where the run has none of it."""
        value = FIGURES[name](self)
        return None if value is None else float(value)


def _equilibrium(what: str, *, every_level: bool = False, per_site: bool = False) -> Callable[[Run], float]:
    def count(run: Run) -> float:
        levels = run.levels if every_level else [level for level in run.levels if level["level"] == 0]
        finest = next(level for level in run.levels if level["level"] == 0)
        sites = finest["rows"] * finest["cols"] if per_site else 1
        return float(sum(level["equilibrium"][what] for level in levels) / sites)

    return count


def _cooling(what: str) -> Callable[[Run], float | None]:
    def average(run: Run) -> float | None:
        found = [getattr(sweep, what) for sweep in run.finest if sweep.phase == "relax"]
        found = [value for value in found if value is not None]
        return mean(found) if found else None

    return average


def _free(what: str, least: int) -> Callable[[Run], float | None]:
    def last(run: Run) -> float | None:
        free = [sweep for sweep in run.finest if sweep.phase == "free"]
        return getattr(free[-1], what) if len(free) >= least else None

    return last


FIGURES: dict[str, Callable[[Run], float | None]] = {
    "steps": _equilibrium("steps"),
    "sweeps": _equilibrium("sweeps"),
    "relaxations_per_site": _equilibrium("relaxations", per_site=True),
    "all_steps": _equilibrium("steps", every_level=True),
    "all_sweeps": _equilibrium("sweeps", every_level=True),
    "all_relaxations_per_site": _equilibrium("relaxations", every_level=True, per_site=True),
    "seconds": lambda run: run.seconds,
    "device_seconds": lambda run: run.device_seconds,
    "utilisation": lambda run: run.accounting["utilisation"],
    "model_seconds": lambda run: run.accounting["model_seconds"],
    "passes": lambda run: run.accounting["passes"],
    "changed_cooling": _cooling("changed"),
    "oscillation_cooling": _cooling("returned"),
    "changed_free": _free("changed", 1),
    "oscillation_free": _free("returned", 2),  # so that both the change and the return were free
    "plausibility": lambda run: run.quality.plausibility,
    "coverage": lambda run: run.quality.coverage,
    "histogram_distance": lambda run: run.quality.histogram_distance,
    "copying": lambda run: run.quality.copying,
    "seam": lambda run: run.quality.seam,
}
"""The figures of a run by name; `compare` says what each is."""


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
    runs : tuple of Run
        One for each seed.
    """

    name: str
    claims: tuple[bool, ...]
    runs: tuple[Run, ...]

    @property
    def independent(self) -> bool:
        """Whether it keeps equation (14): it claims so at every level, and no step of any run broke it."""
        return all(self.claims) and not any(run.met for run in self.runs)

    @property
    def caught(self) -> bool:
        """Whether it broke equation (14) where it claims to keep it."""
        return any(run.met for run in self.runs)

    def figure(self, name: str) -> Spread | None:
        """One of `FIGURES` over the seeds; None where a run has none of it, or one that is not finite."""
        found = [run.figure(name) for run in self.runs]
        values = tuple(value for value in found if value is not None)
        if len(values) < len(found):
            return None
        if not all(map(isfinite, values)):  # of samples near the largest number: they have no mean
            return None
        return Spread(mean(values), stdev(values) if len(values) > 1 else None, values)


@dataclass(frozen=True)
class Comparison:
    """What `compare` found.

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
        In the order asked for.
    """

    sample: NDArray[Any]
    shape: tuple[int, int]
    channel_axis: int | None
    seeds: tuple[int, ...]
    device: str
    options: dict[str, Any]
    entries: tuple[Entry, ...] = field(repr=False)

    def results(self) -> dict[str, Any]:
        """Everything but the pictures, as JSON knows it; the same for the same seeds but for ``seconds``."""
        return {
            "sample_shape": list(self.sample.shape),
            "shape": list(self.shape),
            "seeds": list(self.seeds),
            "device": self.device,
            "options": self.options,
            "schedules": [_entry_results(entry) for entry in self.entries],
        }


def _entry_results(entry: Entry) -> dict[str, Any]:
    found = {name: entry.figure(name) for name in FIGURES}
    runs = [
        {
            "seed": run.seed,
            "seconds": run.seconds,
            "device_seconds": run.device_seconds,
            "quality": {name: getattr(run.quality, name) for name in MEASURED},
            "accounting": run.accounting,
            "levels": run.levels,
            "sweeps": [asdict(sweep) for sweep in run.sweeps],
        }
        for run in entry.runs
    ]
    return {
        "name": entry.name,
        "keeps_equation_14": entry.independent,
        "claims_by_level": list(entry.claims),
        "caught": entry.caught,
        "figures": {name: None if spread is None else asdict(spread) for name, spread in found.items()},
        "runs": runs,
    }


@dataclass(frozen=True)
class Now:
    """Where a comparison stands.

    ``schedule`` and ``seed`` of the present run, ``run`` its number from 1 out of ``runs``, ``progress`` where it
    stands itself, and ``fraction`` of the whole, 0 to 1.
    """

    schedule: str
    seed: int
    run: int
    runs: int
    progress: Relaxing
    fraction: float


def compare(
    sample: ArrayLike,
    shape: tuple[int, int],
    schedules: Sequence[str | Schedule] = known.TOGETHER,
    *,
    seeds: Sequence[int] = (1, 2, 3),
    channel_axis: int | None = None,
    device: str | Machine | None = None,
    callback: Callable[[Now], Any] | None = None,
    **options: Any,
) -> Comparison:
    """Run the same job under several schedules, and measure each.

    Parameters
    ----------
    sample : (rows, cols) or, with `channel_axis`, (rows, cols, channels) array
        At least 9 x 9 pixels.
    shape : (int, int)
        Rows and columns of the outputs, each 9 or more.
    schedules : sequence of str or simdtex.schedules.Schedule
        All of different names.
    seeds : sequence of int
        One run of each schedule for every seed; all different.
    channel_axis : int, optional
        As in `simdtex.synthesize`.
    device : str, optional
        As in `simdtex.synthesize`; all runs are on one machine.
    callback : callable, optional
        Called with a `Now` several times a second; an exception ends the comparison.
    **options
        Of the method ``mrf``, see `simdtex.methods.mrf.Options`, which says what defaults differ in ``schedules``:
        ``search`` is ``"exact"``, since a schedule is judged by the model, not by a list of candidates.

    Returns
    -------
    Comparison
        The same for the same seeds, but for times.

    Raises
    ------
    ValueError, TypeError
        As `simdtex.synthesize`; no schedules or no seeds, one of them twice; pictures of fewer than 9 x 9 pixels.

    Notes
    -----
    The figures of a run are, by name: ``steps``, ``sweeps`` and ``relaxations_per_site`` of the finest level until no
    temperature was left; the same with ``all_`` over every level, relaxations per site of the finest. ``seconds``
    and ``device_seconds``. ``utilisation`` of the processor array, 0 to 1, its ``passes``, and ``model_seconds``,
    what a MasPar MP-1 would take by a model. ``changed_cooling`` and ``oscillation_cooling``: mean over
    the sweeps of the finest level until its equilibrium; ``changed_free`` and ``oscillation_free``: in its last free
    sweep, the latter from two free sweeps on. ``plausibility``, ``coverage``, ``histogram_distance``, ``copying`` and
    ``seam`` as in `simdtex.experiments.quality`.

    Whether a schedule keeps equation (14) is asked for each level's lattice, and where it says so every step is checked
    after the run. Before the first run of each schedule a small one is made, so that no time includes building kernels.

    Cost: schedules x seeds runs of `simdtex.synthesize`, and about 1 s each for the quality. Memory: two pictures
    more, and 4 bytes a relaxation of schedules that claim equation (14).

    Examples
    --------
    >>> from skimage import data
    >>> import simdtex.experiments.comparison
    >>> brick = data.brick()[:32, :32]
    >>> found = simdtex.experiments.comparison.compare(brick, (24, 24), ["coloring", "synchronous"], seeds=[1], order=2)
    >>> [(entry.name, entry.independent) for entry in found.entries]
    [('coloring', True), ('synchronous', False)]
    """
    chosen = [known.get(schedule) for schedule in schedules]
    names = [schedule.name for schedule in chosen]
    keys = [as_seed(seed) for seed in seeds]
    _check_distinct("schedule", names)
    _check_distinct("seed", keys)
    if "schedule" in options:
        raise TypeError("schedule is no option here; give schedules, a sequence of them")
    settled = resolve(Options, "schedules", options)
    pixels = check_sample(sample, channel_axis)
    size = _check_sides(pixels.shape[:2], shape)
    job = _Job(np.asarray(sample), pixels, channel_axis, open_machine(device, profile=True), vars(settled))
    found: dict[str, list[tuple[Run, tuple[bool, ...]]]] = {name: [] for name in names}
    turns = [(seed, schedule) for seed in keys for schedule in chosen]  # a slow hour then slows all schedules alike
    for number, (seed, schedule) in enumerate(turns, 1):
        tell = None if callback is None else partial(_tell, callback, schedule.name, seed, number, len(turns))
        if not found[schedule.name]:
            job.warm_up(schedule, size, tell)
        found[schedule.name].append(job.run(schedule, seed, size, tell))
    entries = [Entry(name, done[0][1], tuple(run for run, _ in done)) for name, done in found.items()]
    settings = {name: value for name, value in job.settings.items() if name != "schedule"}
    return Comparison(job.sample, size, channel_axis, tuple(keys), job.machine.name, settings, tuple(entries))


class _Job:
    """What is the same for every run."""

    def __init__(
        self,
        sample: NDArray[Any],
        pixels: NDArray[Any],
        channel_axis: int | None,
        machine: Machine,
        options: dict[str, Any],
    ) -> None:
        self.sample, self.channel_axis, self.machine, self.options = sample, channel_axis, machine, options
        self.settings: dict[str, Any] = {}
        self._grey = pixels if channel_axis is not None else pixels[..., 0]  # channels last, as the quality wants them

    def run(
        self, schedule: Schedule, seed: int, size: tuple[int, int], tell: Tell | None
    ) -> tuple[Run, tuple[bool, ...]]:
        """One run, and at which levels the schedule claims equation (14)."""
        noted, recorder = Noted(schedule), Recorder(self.channel_axis, tell, self.machine.sync)
        image, said = self._synthesize(noted, seed, size, recorder, self.options)
        self.settings = said["options"]
        made = image if self.channel_axis is None else np.moveaxis(image, self.channel_axis, -1)
        run = Run(
            schedule.name,
            seed,
            image,
            measure(self._grey, made, figures=MEASURED),
            tuple(recorder.sweeps),
            said["levels"],
            said["seconds"] - recorder.seconds,
            said["device_seconds"],
            said["accounting"],
            noted.met(),
        )
        return run, tuple(noted.claims)

    def warm_up(self, schedule: Schedule, size: tuple[int, int], tell: Tell | None) -> None:
        """Build every kernel that the schedule needs, by a small picture of at most two levels."""
        side, levels = 4 * isqrt(self.options["order"]) + 1, self.options["levels"]
        small = (min(size[0], side), min(size[1], side))
        fewer = {} if levels is None else {"levels": min(levels, 2)}
        self._synthesize(schedule, 0, small, tell and (lambda progress: tell(replace(progress, fraction=0.0))), fewer)

    def _synthesize(
        self, schedule: Schedule, seed: int, size: tuple[int, int], callback: Tell | None, changed: dict[str, Any]
    ) -> tuple[NDArray[Any], dict[str, Any]]:
        image, output = synthesize(
            self.sample,
            size,
            channel_axis=self.channel_axis,
            rng=seed,
            device=self.machine,
            callback=callback,
            full_output=True,
            **{**self.options, **changed, "schedule": schedule},
        )
        return image, output.statistics


def _tell(callback: Callable[[Now], Any], schedule: str, seed: int, number: int, runs: int, progress: Relaxing) -> None:
    callback(Now(schedule, seed, number, runs, progress, (number - 1 + progress.fraction) / runs))


def _check_distinct(what: str, given: Sequence[Any]) -> None:
    if not given:
        raise ValueError(f"there are no {what}s to compare; give one or more")
    for one in given:
        if given.count(one) > 1:
            raise ValueError(f"the {what} {one} is given twice; give each once")


def _check_sides(sample: tuple[int, ...], shape: tuple[int, int]) -> tuple[int, int]:
    """The output's shape, where both pictures are large enough to be measured."""
    if min(sample) < COPIED_PATCH:
        raise ValueError(
            f"the sample of {sample[0]} rows x {sample[1]} columns is too small to compare with; "
            f"give {COPIED_PATCH}x{COPIED_PATCH} pixels or more"
        )
    return check_shape(shape, COPIED_PATCH)
