# SPDX-License-Identifier: BSD-3-Clause
"""The data of Algorithm 1: the lattices of a run, and the state that passes from sweep to sweep."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import isqrt, log2, prod, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex import schedules
from simdtex.machine.interface import Array, Machine
from simdtex.methods.mrf import lcpdf
from simdtex.methods.mrf.conditioning import Conditioning, Conditions
from simdtex.methods.mrf.costs import Costs, Kinds, Phased, ScatteredData
from simdtex.methods.mrf.lcpdf import SiteChoice
from simdtex.methods.mrf.neighbourhood import Field
from simdtex.methods.mrf.options import Options, largest_order
from simdtex.methods.mrf.problem import Input
from simdtex.methods.mrf.relax import (
    EXHAUSTIVE,
    IN_PHASE,
    AllCandidates,
    CandidateList,
    InPhase,
    Relaxation,
    alike,
    in_phase,
)
from simdtex.methods.mrf.square import TAIL, square_of
from simdtex.methods.mrf.use import STEPS, FairUse, Regions
from simdtex.model.given import nearest_data
from simdtex.model.lattice import Grid
from simdtex.model.sample import Candidates, Places
from simdtex.schedules import Setting
from simdtex.schedules.schedule import Lists
from simdtex.schedules.sites import among, stretches

WHOLE = 256
"""Number of candidates of a coarsest level up to which neighbourhoods cover much of the sample's layout."""

SMALL = 128
"""Number of candidates of a coarsest level from which novelty counts in full: among fewer, hardly two are alike."""

FEWEST, WIDE = 32, 8
"""The fewest candidates of the coarsest level of a small sample, up to a spacing of ``WIDE`` pixels."""

GAIN, FINER = (STEPS // 16, STEPS // 20), (8, 2)
"""The most steps by which the penalty of a category, or of a class of values, changes after a sweep of the coarsest
level; and the factors of those at finer levels."""

ALL = 2**12
"""The most candidates of the coarsest level, which evaluates all, for more than one decimation of the sample."""

TOGETHER = 2**16
"""Number of sites that one kernel relaxes between two checks of the clock."""


class MrfState(NamedTuple):
    """The state of a run after a sweep, as arrays and numbers: all that the run needs to continue.

    Of the machine, and overwritten by the next sweep: ``values`` (C, H, W) uint16, working grey levels x; ``source``
    (H, W) int32, pixel indices in the sample, including its margin; ``temperature`` (H, W) uint16, t in 1/1024.
    ``penalty`` (n + regions x kinds,) float32 are those during the next sweep, of each candidate of the level and of
    each kind in each region (`simdtex.methods.mrf.use.use_penalty`); ``schedule``, arrays and numbers, is the
    schedule's own state; ``level`` is 0 at the finest; ``cooling`` and ``free`` count the finished sweeps of the level;
    ``active`` are the active sites of the level, and ``temperature_sum`` the sum of their temperatures in 1/1024.
    """

    values: Array
    source: Array
    temperature: Array
    penalty: NDArray[np.float32]
    schedule: Any
    level: int
    cooling: int = 0
    free: int = 0
    active: int = 0
    temperature_sum: int = 0

    @property
    def field(self) -> Field:
        """The arrays over sites."""
        return Field(*self[:3])


class SweepInfo(NamedTuple):
    """A description of a step.

    ``level``; ``sweep``, the sweep of the level, from 1, or 0 if the step entered the level; ``chosen``, the decisions
    of the schedule; ``ended``, whether the level ends with the step.
    """

    level: int
    sweep: int = 0
    chosen: tuple[schedules.Info, ...] = ()
    ended: bool = False


class Part(NamedTuple):
    """A part of a sweep.

    ``steps``, the number of steps of the schedule that start with it; ``sites``, the number of relaxed sites; ``last``,
    whether the sweep ends with it; ``turn``, the key of its random numbers; ``field``, the arrays over sites.
    """

    steps: int
    sites: int
    last: bool
    turn: int
    field: Field


class Lattices:
    """A plan on a machine: the constants of the run, and its levels.

    ``seed`` is the key of every random number; ``conditions`` are conditioning data and guides, None: those of the
    plan. ``planes`` are the sample's working levels on the machine. ``coarser`` are the levels with a sample of half
    the size, None without any.
    """

    def __init__(self, plan: Input, machine: Machine, seed: int, conditions: Conditions | None = None) -> None:
        self.plan, self.machine, self.seed, self.levels = plan, machine, seed, plan.levels
        self.sample, self.options, self.offsets = plan.sample, plan.options, plan.offsets
        self.planes = plan.sample.planes(machine)
        self.conditions = conditions or Conditioning(plan)
        coarser = plan.coarser
        self.coarser = Lattices(coarser, machine, seed, self.conditions.coarser(coarser)) if coarser else None
        self._last: Level | None = None  # without the parts that depend on the window
        self._whole: Level | None = None
        self._in_phase: Any = None  # positions and their phases, which most levels share

    def of(self, level: int) -> Lattices:
        """Return the lattices that have the sample of a level: these, or coarser ones."""
        return self.coarser.of(level) if self.coarser and self.plan.of(level) is not self.plan else self

    def spacing(self, level: int) -> int:
        """Return the number of pixels of the sample from site to site of a level."""
        return int(2**level // self.plan.reduction)

    @cached_property
    def squares(self) -> NDArray[np.int32] | None:
        """The first pixel of the square of each pixel of the sample of half the size; None if there is no such sample.

        If there is one, the level above has it, and the only level of this sample begins with its arrangement. Pixels
        that no site has, as those of the margin, have -1.
        """
        if not self.coarser:
            return None
        coarser = self.coarser.sample
        first = self.sample.index(coarser.place(np.arange(coarser.inside.size, dtype=np.int32)))
        return np.where(coarser.inside.ravel(), first, np.int32(-1))

    def grid(self, level: int) -> Grid:
        """Return the lattice of a level, equation (10), in pixels of the level's sample."""
        return self.plan.of(level).grid(level)

    def level(self, level: int, window: tuple[int, int, int, int] | None = None) -> Level:
        """Define the lattice, the neighbourhood, the candidates and the bandwidth of a level: (8), (10) and (11).

        ``window`` is (first row, first column, rows, columns) of a window of the lattice; the arrays of the state then
        hold only the sites of the window. None: the whole lattice.
        """
        lattices = self.of(level)
        if lattices is not self:
            return lattices.level(level, window)
        if self._last is None or self._last.number != level:
            self._last = self._whole = None  # the arrays of one level are enough to keep
            self._last = self._level(level)
        if window is not None:
            return self._on(self._last, self.grid(level).window(*window))
        self._whole = self._whole or self._on(self._last, self.grid(level))
        return self._whole

    def _level(self, level: int) -> Level:
        """Return a level without its parts that depend on the window."""
        options, sample, machine, offsets = self.options, self.sample, self.machine, self.offsets
        grid, places = self.grid(level), self.places(level)
        coarsest, count = level == self.levels - 1, places.positions.size
        every, spaced = self.exhaustive(level), count // (places.spacing // places.step) ** offsets.shape[1]
        candidates = sample.candidates(machine, places, self.planes, every)
        square = square_of(machine, sample, places, every)
        proposal: AllCandidates | CandidateList = AllCandidates(candidates, square)
        if not every:
            proposal = CandidateList(candidates, square, len(offsets), self.chance(level), self._of_phase(candidates))
        novelty = options.novelty * min(1.0, WHOLE / spaced, (spaced / SMALL) ** 2) if coarsest else 0.0
        relaxation = Relaxation(
            grid=grid,
            offsets=machine.put(offsets),
            proposal=proposal,  # 6.2.2.1 the LCPDF, equations (6) and (12), of these candidates
            costs=Costs(
                penalty=None,
                discount=np.float32(1 / (1 + options.coherence)),
                novelty=np.float32(novelty * sample.channels * sample.variance),
                phased=self._phased(level, candidates),
                kinds=self._kinds(candidates),
            ),
            choice=self.choice(level),  # 6.2.2.2
            xi=min(-1, round(options.xi * 1024)),  # 6.2.2.3 the temperature, equation (13)
            seed=self.seed,
            level=level,
            confidences=self.conditions.confidences,
        )
        setting = Setting(machine, grid, offsets, options.neighbourhood, self.seed, level)
        regions = self.regions
        if regions and self.of_values:
            regions = replace(regions, unit=np.float32(self.typical_distance * self.change(level) / STEPS))
        return Level(setting, self.plan.schedule, relaxation, self.rate(level), self.fair_use(level), regions)

    def choice(self, level: int) -> SiteChoice:
        """Return the choice among the candidates of a level, with the bandwidth of equation (8)."""
        options, sample, count = self.options, self.sample, self.places(level).positions.size
        dimensions = sample.channels * (len(self.offsets) + 1)
        h = options.bandwidth * lcpdf.optimal_bandwidth(sample.variance, count, dimensions)
        draws = options.relaxation == "gibbs" or level == self.levels - 1
        return SiteChoice(draws, options.pixel == "density", lcpdf.window(h, sample.top))

    def _on(self, level: Level, grid: Grid) -> Level:
        """Return the level with the parts that depend on the window, for a lattice or a window of it."""
        machine, schedule, number, costs = self.machine, level.schedule, level.number, level.relaxation.costs
        waves = self.sample.waves
        costs = costs._replace(
            phased=costs.phased and waves and costs.phased._replace(sites=machine.put(waves.at(grid))),
            scattered=self._scattered(number, grid),
        )
        proposal = level.proposal
        if isinstance(proposal, CandidateList) and proposal.phases and waves:
            proposal = proposal._replace(phases=proposal.phases._replace(sites=machine.put(waves.phase_at(grid))))
        if isinstance(proposal, CandidateList) and self.conditions.confidences.known:
            proposal = proposal._replace(phases=self._alike(number, proposal, grid))
        return replace(
            level,
            setting=level.setting._replace(grid=grid),
            relaxation=level.relaxation._replace(
                grid=replace(grid, tile=schedule.tile), costs=costs, proposal=proposal
            ),
            in_place=schedule.independent(grid, self.offsets) and not schedule.tile,
            evaluations=machine.put(np.zeros(grid.shape, np.int32)),
            movable=self.conditions.movable(machine, number, grid, self.kept_only),
            soft=self._soft(grid),
            lists={},
        )

    def _alike(self, level: int, proposal: CandidateList, grid: Grid) -> InPhase:
        """Return the phases of a proposal, and more of them: candidates alike in the variables known at some sites."""
        machine, known, held = self.machine, self.conditions.confidences.known, self.conditions.at(level, grid)
        assert held
        size = proposal.candidates.size
        begin, numbers, phase = np.array([0, size]), np.arange(size), np.zeros(grid.shape, np.int32)
        if proposal.phases:
            begin, numbers, phase = (np.array(machine.get(array)) for array in proposal.phases)
        levels = self.sample.working[-known:, machine.get(proposal.candidates.positions)]
        groups = list(alike(levels, held.values[-known:].reshape(known, -1)))
        for k, (_, sites) in enumerate(groups):
            phase.flat[sites] = begin.size - 1 + k
        begin = np.append(begin, begin[-1] + np.cumsum([len(those) for those, _ in groups]))
        numbers = np.concatenate([numbers, *(those for those, _ in groups)])
        return InPhase(*(machine.put(array.astype(np.int32)) for array in (begin, numbers, phase)))

    def _kinds(self, candidates: Candidates) -> Kinds | None:
        """Return the kinds of candidates that soft data know; None without soft data."""
        if self.plan.kinds is None:
            return None
        those = self.plan.kinds.kinds(self.sample, self.machine.get(candidates.positions))
        return Kinds(self.machine.put(np.pad(those, ((0, 0), (0, TAIL)))), None)  # as many as `Phased` has

    def _soft(self, grid: Grid) -> NDArray[np.float32] | None:
        """Return the cost of each kind at the sites of a lattice or a window of it, (kinds, H, W)."""
        rate = self.options.soft_weight * self.typical_distance
        return self.plan.kinds.costs(self.sample, grid, rate) if self.plan.kinds else None

    @cached_property
    def regions(self) -> Regions | None:
        """The shares of categories that are asked: those of the whole, or of regions of a map of probabilities."""
        soft, wanted = self.plan.kinds, self.options.proportions
        if soft is None or soft.categories is None or not (wanted or self.options.soft_weight):
            return None
        grid, unit = self.grid(0), np.float32(self.typical_distance / STEPS)
        p, of = soft.categories, np.zeros(grid.shape, np.int32)
        if wanted:
            p = np.reshape(wanted, (-1, *[1] * len(grid.shape))) / sum(wanted)
        else:
            of = soft.regions()
            if (of < 0).all():
                return None
        p = np.broadcast_to(p, (len(p), *grid.shape))
        return Regions(p, of, self.sample.category, grid, int(self.offsets.max()), unit)

    def _phased(self, level: int, candidates: Candidates) -> Phased | None:
        """Return the phases of candidates of a regular sample, and their weights; None if the sample is not regular."""
        waves = self.sample.waves
        if not waves:
            return None
        weight = np.float32(round(sqrt(1.25 * len(self.offsets))))  # weight of a guide at the neighbours and the site
        tolerance = np.float32(round(float(weight) ** 2 * waves.half(self.places(level).step)))
        those = self.sample.phases_at(self.machine.get(candidates.positions)).astype(np.float32)
        those = np.pad(those, ((0, 0), (0, TAIL)))
        return Phased(self.machine.put(those), None, weight, tolerance)

    def _scattered(self, level: int, grid: Grid) -> ScatteredData | None:
        """Return the conditioning data between the sites of a lattice or a window of it; None if there are none."""
        data = self.conditions.scattered(level)
        if data is None:
            return None
        site, datum, apart = nearest_data(data.place, grid, self.options.neighbourhood)
        if not site.size:
            return None
        begin = np.searchsorted(site, np.arange(grid.size + 1)).astype(np.int32)
        strides = np.array([self.sample.layer * self.sample.cols, self.sample.cols, 1])
        reach = (apart @ strides[-apart.shape[1] :]).astype(np.int32)
        put = self.machine.put
        return ScatteredData(put(begin), put(reach), put(data.values[datum]), self.conditions.confidences.hard)

    @property
    def typical_distance(self) -> float:
        """N C sigma^2: half of the mean distance between two neighbourhoods."""
        return len(self.offsets) * self.sample.channels * self.sample.variance

    def rate(self, level: int) -> float:
        """Return lambda N C sigma^2, see `Level`; 0 if the levels begin with an arrangement, which decides the use."""
        return 0.0 if self.coarser else self.options.balance * self.typical_distance * self.change(level)

    def change(self, level: int) -> float:
        """Return the factor of penalties: of a simulation less at fine levels, where neighbours differ less, else 1."""
        return (
            self.sample.changes[self.spacing(level).bit_length() - 1]
            if self.regions or self.sample.pictures.scores
            else 1.0
        )

    @property
    def of_values(self) -> bool:
        """Whether the first variable has values that are no categories."""
        kinds = self.sample.pictures.categorical
        return not (kinds and kinds[0])

    def free_sweeps(self, level: int) -> int:
        """Return the number of free sweeps of a level."""
        kept = self.options.free_sites == "kept"
        return 0 if kept and not 0 == level < self.levels - 1 else self.options.free_sweeps

    @property
    def kept_only(self) -> bool:
        """Whether free sweeps relax only the sites that are also on the level above."""
        return self.options.free_sites == "kept" and not self.coarser  # else all are: see `squares`

    def exhaustive(self, level: int) -> bool:
        """Return whether a site of a level evaluates all its candidates."""
        if self.options.search == "exact" or (level == self.levels - 1 and not self.phased):
            return True
        return bool(self.places(level).positions.size <= EXHAUSTIVE)

    def fair_use(self, level: int) -> FairUse:
        """Return the positions of the candidates of a level, and the fair use of each."""
        places = self.places(level)
        around = int(self.offsets[:, 1].max()) * (places.spacing // places.step)
        fair, listed = self.sample.fair(places), not self.exhaustive(level)
        if not self.regions:
            return FairUse(places.shape, around, fair, listed)
        values = self.of_values
        gain = GAIN[values] * (1 if level == self.levels - 1 else FINER[values])
        return FairUse(places.shape, around, fair, listed, self.regions.wanted(self.grid(level)), gain, not values)

    def places(self, level: int) -> Places:
        """Return the places of the candidates of a level: all of a regular sample, since few are of a site's phase."""
        spacing, phases = self.spacing(level), self.options.phases
        if level == self.levels - 1:  # a place of it is one of every finer level, whatever their phases
            decimated = self.sample.height * self.sample.width // spacing**2
            phases = min(phases, max(1, isqrt(ALL // max(1, decimated))))
        edges = "reflect" if self.options.edges == "auto" and self.plan.reduction > 1 else self.options.edges
        return self.sample.places(self.offsets, spacing, spacing if self.phased else phases, edges)

    @property
    def phased(self) -> bool:
        """Whether the candidates of a site are of its phase on the lattice of a regular sample."""
        return self.sample.waves is not None and self.options.search == "coherent"

    def chance(self, level: int) -> int:
        """Return the number of random candidates of a level.

        Of a regular sample they are all of a phase at the coarsest level, and a quarter as many at each finer level,
        which has four times as many sites.
        """
        chance = max(self.options.chance_at(level), int(self.conditions.confidences.known > 0))  # one that is alike
        return max(chance, IN_PHASE >> 2 * (self.levels - 1 - level)) if self.phased else chance

    def _of_phase(self, candidates: Candidates) -> InPhase | None:
        """Return the candidates of each phase, without the sites' phases; None if the sample is not regular."""
        if not self.phased or not self.sample.waves:
            return None
        positions = self.machine.get(candidates.positions)
        if self._in_phase is None or not np.array_equal(self._in_phase[0], positions):
            of = self.sample.phase_numbers_at(positions)
            self._in_phase = positions, *in_phase(of, self.sample.waves.divisions)
        _, begin, numbers = self._in_phase
        return InPhase(self.machine.put(begin), self.machine.put(numbers), None)


@dataclass(frozen=True)
class Level:
    """The constants of a level.

    ``setting`` is the input of its ``schedule``, and ``relaxation`` that of its sites, except for the penalty of each
    candidate, which changes with every sweep. ``rate``, lambda N C sigma^2, is the cost of a candidate whose
    surroundings are used twice as often as their share; ``fair_use`` has the positions of the candidates and their
    shares, and ``regions`` the shares of categories that are asked. ``in_place``: whether sites of a step may be
    written while others of it are read, since no two are neighbours. ``evaluations`` (H, W) int32 counts the candidates
    that each site has evaluated; ``movable`` (H, W) uint16 is 0 at sites that free sweeps do not change, None if there
    are none; ``soft`` (kinds, H, W) float32 is the cost of each kind by soft data, without the penalties of the kinds;
    ``lists`` are the schedule's lists of sites on the machine, each of which is made, or copied there, once.
    """

    setting: Setting
    schedule: schedules.Schedule
    relaxation: Relaxation
    rate: float
    fair_use: FairUse
    regions: Regions | None = None
    in_place: bool = False
    evaluations: Array = None
    movable: Array | None = None
    soft: NDArray[np.float32] | None = None
    lists: dict[Any, Any] = field(default_factory=dict, repr=False)

    @property
    def number(self) -> int:
        """The l of Algorithm 1, 0 the finest."""
        return self.setting.level

    @property
    def grid(self) -> Grid:
        """The lattice, or a window of it with its origin in the whole."""
        return self.relaxation.grid

    @property
    def proposal(self) -> AllCandidates | CandidateList:
        """The candidates that a site evaluates."""
        return self.relaxation.proposal

    @property
    def machine(self) -> Machine:
        """The machine that executes the steps."""
        return self.setting.machine

    @property
    def work(self) -> int:
        """The most fma of a relaxation: 2 for every candidate, neighbour and channel."""
        channels = self.proposal.candidates.pixels.shape[0]
        return 2 * self.proposal.slots * len(self.setting.offsets) * int(channels)

    @property
    def at_once(self) -> int:
        """The most sites that are relaxed between two checks of the clock; scratch memory limits it."""
        channels, neighbours = int(self.proposal.candidates.pixels.shape[0]), len(self.setting.offsets)
        choice, slots, greys = self.relaxation.choice, self.proposal.slots, 0
        if choice.mode:  # passes over candidates and grey levels
            greys = choice.window.top + 1
            slots = (2 * channels + 2) * (slots + greys * greys // neighbours)
        most = self.machine.chunk(slots, neighbours, channels, 12 * greys)
        return max(most, TOGETHER) if isinstance(self.proposal, CandidateList) and self.in_place else most


def with_penalty(level: Level, penalty: NDArray[np.float32]) -> Relaxation:
    """Return the relaxation of the level in a sweep, with the penalties of candidates, and of kinds in regions."""
    (of_candidates, of_kinds), costs = level.fair_use.split(penalty), level.relaxation.costs
    padded, kinds = level.machine.put(np.pad(of_candidates, (0, TAIL))), costs.kinds  # whole vectors are read
    if kinds and level.soft is not None:
        soft = level.regions.costs(level.soft, of_kinds, level.grid) if level.regions else level.soft
        kinds = kinds._replace(sites=level.machine.put(soft))
    return level.relaxation._replace(costs=costs._replace(penalty=padded, kinds=kinds))


class ActiveSites:
    """The active sites: those with a temperature above 0 or, in a ``free`` sweep, all that are not known."""

    def __init__(self, level: Level, temperature: Array, free: bool) -> None:
        self._level = level
        self._plane = level.movable if free else temperature  # above 0 at active sites; None: all are active
        self.kept = level.lists

    def mask(self) -> NDArray[np.bool_]:
        """Return the mask of active sites, read back from the machine."""
        grid = self._level.grid
        if self._plane is None:
            return np.ones(grid.shape, bool)
        return np.asarray(grid.latest(self._level.machine.get(self._plane)) > 0)

    def numbers(self) -> NDArray[np.int64]:
        """Return the numbers of active sites, read back from the machine."""
        grid = self._level.grid
        return np.arange(grid.size) if self._plane is None else np.flatnonzero(self.mask())

    def among(self, sites: Array, starts: NDArray[np.int64], machine: Machine | None = None) -> Lists:
        """Return the active sites of a list, found on the machine."""
        known, device = self.kept, self._level.machine
        if id(sites) not in known:
            begins, firsts = stretches(starts)
            known[id(sites)] = sites, sites if machine else device.put(sites), device.put(begins), firsts
        _, here, begins, firsts = known[id(sites)]
        if self._plane is None:
            return here, starts
        return among(device, here, begins, firsts, self._plane)


def parts(ranges: NDArray[np.int64], most: int) -> Iterator[tuple[NDArray[np.int64], int, bool]]:
    """Yield parts of at most ``most`` sites: their ranges, the number of steps started, and whether it is the last.

    ``ranges`` (steps, 2) are the begin and the end of each step's sites in a list. A step of more sites is cut; several
    short steps form one part.
    """
    held: list[tuple[int, int]] = []
    sites = begun = 0
    for step, (begin, end) in enumerate(ranges.tolist(), 1):
        for first in range(begin, max(end, begin + 1), most):
            last = min(end, first + most)
            if held and sites + last - first > most:
                yield np.array(held, np.int64), begun, False
                held, sites = [], 0
            held.append((first, last))
            sites, begun = sites + last - first, step
    yield np.array(held, np.int64), begun, True


def number_of_levels(
    samples: Sequence[tuple[int, ...]], offsets: NDArray[np.int32], shape: tuple[int, ...], options: Options
) -> int:
    """Return M, checked against the sides of the sample's pictures and against M <= 1 + log2(min(Mx, My)).

    The number of layers of a volume does not limit M: only its rows and columns do.
    """
    radius = int(offsets[:, 1].max())
    for sample in samples:
        check_fit(sample, radius, options.neighbourhood)

    def candidates(levels: int) -> int:
        spacing = 2 ** (levels - 1)
        return sum(prod(-(-n // spacing) for n in one[:-2]) * prod(n // spacing for n in one[-2:]) for one in samples)

    most = 1 + int(log2(min(*shape[-2:], *(side for sample in samples for side in sample[-2:]))))
    if options.levels is None:
        levels = 1
        least = 2 * radius if options.overview >= FEWEST else 1  # sites in a row of the coarsest lattice, less one
        while levels < most and min(shape[-2:]) > least * 2**levels:
            if candidates(levels + 1) < (min(FEWEST, options.overview) if 2**levels <= WIDE else options.overview):
                break
            levels += 1
        return levels
    if options.levels > most:
        raise ValueError(f"levels={options.levels} is too many for this sample, output and order; give at most {most}")
    return options.levels


def check_fit(sample: tuple[int, ...], radius: int, order: int) -> None:
    """Raise ValueError unless the sample holds at least one whole neighbourhood."""
    side = min(sample)
    if side > 2 * radius:
        return
    least = "x".join("3" * len(sample))
    largest = f"the largest order that fits is {largest_order(side)}" if side > 2 else ""
    names = ("layers", "rows", "columns")[-len(sample) :]
    sides = " x ".join(f"{n} {name}" for n, name in zip(sample, names, strict=True))
    remedy = largest or f"give at least {least} pixels"
    raise ValueError(f"a neighbourhood of order {order} does not fit the sample of {sides}; {remedy}")
