# SPDX-License-Identifier: BSD-3-Clause
"""Nonparametric multiscale Markov random field: Algorithm 1 of Paget and Longstaff (1998).

`synthesize` is the algorithm, step by step; `_relax` is its body, steps 6.2.2.1 to 6.2.2.3. The numbers in
the comments are the algorithm's own.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import partial
from itertools import pairwise
from math import log2, prod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex import schedules
from simdtex.machine import Machine
from simdtex.machine.interface import Array
from simdtex.maspar.accounting import Account
from simdtex.maspar.array import parse_array
from simdtex.methods.mrf.meter import Meter
from simdtex.methods.mrf.options import PRESETS, Options, make_options
from simdtex.model.lattice import Grid, neighbourhood_offsets
from simdtex.model.sample import Candidates, Sample
from simdtex.ops import lcpdf
from simdtex.ops.coherence import coherence
from simdtex.ops.commit import commit
from simdtex.ops.nearest import lay_out, nearest
from simdtex.ops.neighbourhood import Field, neighbourhood
from simdtex.ops.search import Rule, Table, search, search_apart, table
from simdtex.ops.snapshot import snapshot
from simdtex.ops.start import start
from simdtex.ops.temperature import temperature
from simdtex.options import within_32_bits
from simdtex.run import Callback, Output, Relaxing, Stage, device_seconds

__all__ = ["PRESETS", "Options", "check_fit", "make_options", "synthesize"]

ENOUGH = 64
"""Candidates that the sample must still have at the coarsest of the default levels."""

FEW = 1024
"""Candidates up to which coherent search weighs all of them in its own kernel."""

TOGETHER = 2**16
"""Sites that coherent search relaxes between two looks at the clock."""


@dataclass(frozen=True)
class _Run:
    """What stays the same throughout a run."""

    machine: Machine
    emulated: bool
    sample: Sample
    planes: Array
    shape: tuple[int, int]
    offsets: NDArray[np.int32]
    options: Options
    schedule: schedules.Schedule
    seed: int
    levels: int
    account: Account
    callback: Callback | None


class _Level(NamedTuple):
    """What the relaxation of one level needs; equations (10) and (11)."""

    number: int
    grid: Grid
    offsets: Array
    candidates: Candidates
    window: lcpdf.Window
    relaxation: str
    coherent: _Coherent | None
    strip: Any = None

    @property
    def weighed(self) -> int:
        """Most candidates that a site weighs."""
        return self.coherent.table.slots if self.coherent else self.candidates.size


class _Coherent(NamedTuple):
    """What coherent search of a level needs beside that; ``ahead``: the schedule's sweeps can run in place."""

    table: Table
    rule: Rule
    weighed: Array
    ahead: bool


def synthesize(
    machine: Machine,
    pixels: NDArray[Any],
    shape: tuple[int, int],
    options: Options,
    seed: int,
    callback: Callback | None = None,
) -> tuple[NDArray[Any], Output]:
    """Algorithm 1: nonparametric multiscale MRF texture synthesis.

    Parameters
    ----------
    machine : Machine
        What executes the steps.
    pixels : (rows, cols, channels) array
        Y, the sample.
    shape : (int, int)
        Rows and columns of X, the output.
    options : Options
    seed : int
        Key of every random number.
    callback : callable, optional
        Called with a `simdtex.run.Relaxing` after every piece of a step.

    Returns
    -------
    image : (rows, cols, channels) array
        In the sample's type.
    output : simdtex.run.Output
        Source map, temperatures, stages and statistics.

    Notes
    -----
    Cost: sweeps x sites x candidates x |N| x channels x 2 fma, about 7 sweeps a level; with coherent search some 7
    candidates instead of all. Memory on the device, in bytes: 18 + 2 channels per output pixel (24 + 4 channels with
    the schedule ``block``), 14 channels + 4 similar + 151 per pixel of the sample with its margin, and the machine's
    scratch memory or, if that is more, 65 per candidate. On the host: about 50 per output pixel.
    """
    options = options.resolved()
    offsets = neighbourhood_offsets(options.order)
    levels = _number_of_levels(pixels.shape[:2], offsets, shape, options)  # 1
    margin = int(offsets.max()) * 2 ** (levels - 1) if options.edges != "whole" else 0
    sample = Sample(pixels, pixels.shape[-1] * len(offsets), margin)
    schedule = schedules.get(options.schedule)
    _check_memory(machine, sample, shape, options.similar, copies=2 if getattr(schedule, "tile", None) else 1)
    if options.check_schedule:
        schedule = schedules.Checked(schedule)
    planes = sample.planes(machine)
    array = parse_array(options.array or "maspar-mp1-16k", options.mapping)
    emulated = bool(options.array) and options.emulate
    machine = machine.emulate(array) if emulated else machine
    account = Account(array, packed=options.array is None)
    launches, worked = machine.launches, machine.seconds
    run = _Run(machine, emulated, sample, planes, shape, offsets, options, schedule, seed, levels, account, callback)
    meter = Meter(_expected_work(run))
    stages = []

    everywhere = machine.put(sample.positions(np.zeros((1, 2), np.int32), 1))
    field = start(machine, planes, everywhere, Grid(*shape), seed)  # 2, 5
    for number in reversed(range(levels)):  # 6
        level, spared = _level(run, number), machine.spared  # 3, 4, 6.1
        meter.begin(number, level.grid, level.candidates.size, level.weighed)
        words = sample.channels + 1 + bool(options.coherence)  # of a neighbour: pixel, temperature, source
        account.begin(level.grid, offsets, level.weighed, sample.channels, words)
        state = schedule.init(machine, level.grid, offsets, options.order, seed, number)
        while (temperatures := _temperatures(run, level, field)).any():  # 6.2
            field, state = _sweep(run, level, field, state, temperatures, "relax", meter)
        for _ in range(options.free_sweeps):
            field, state = _sweep(run, level, field, state, temperatures, "free", meter)
        stages.append(Stage(number, _picture(run, level, field)))
        meter.end(machine.spared - spared, _weighed(run, level))

    values, source, temperatures = (Grid(*shape).view(machine.get(plane)) for plane in field)
    image = sample.picture(values, source)
    statistics = {
        "device": machine.name,
        "seed": seed,
        "options": {f.name: getattr(options, f.name) for f in fields(Options)}
        | {"levels": levels, "schedule": schedule.name},
        "seconds": meter.seconds,
        "device_seconds": device_seconds(machine, worked),
        "accounting": account.report() | {"emulated": emulated, "launches": machine.launches - launches},
        "levels": meter.reports,
    }
    return image, Output(sample.place(source), temperatures / 1024, stages, statistics)


def _level(run: _Run, number: int) -> _Level:
    """Define the lattice, the candidates and the bandwidth of a level."""
    options, sample, offsets = run.options, run.sample, run.offsets
    grid = Grid(*run.shape, 2**number, options.boundary == "torus")
    candidates = sample.candidates(run.machine, offsets, grid.spacing, options.phases, options.edges, run.planes)
    dimensions = sample.channels * (len(offsets) + 1)
    h = options.bandwidth * lcpdf.optimal_bandwidth(sample.variance, candidates.size, dimensions)
    by_draw = number == run.levels - 1 and options.coarsest == "gibbs"
    relaxation = "gibbs" if by_draw else options.relaxation
    window = lcpdf.window(h, sample.top)
    level = _Level(number, grid, run.machine.put(offsets), candidates, window, relaxation, None)
    level = level._replace(coherent=_coherent(run, level)) if options.search == "coherent" else level
    if level.coherent:
        return level
    return level._replace(strip=lay_out(run.machine, sample, offsets, grid.spacing, options.phases, options.edges))


def _coherent(run: _Run, level: _Level) -> _Coherent | None:
    """Lay out coherent search; None where all of many candidates are to be weighed: exact search is made for that."""
    options, grid = run.options, level.grid
    exhaustive = level.number == run.levels - 1 or level.candidates.size <= options.exhaustive
    if exhaustive and level.candidates.size > FEW:
        return None
    how = {"suggesting": options.suggesting, "similar": options.similar, "chance": options.chance}
    working = run.sample.working
    laid = table(run.machine, level.candidates, working, run.offsets, grid.spacing, **how, exhaustive=exhaustive)
    gibbs, noisy = level.relaxation == "gibbs", options.pixel == "density"
    rule = Rule(_favour(options), _xi(options), level.window, gibbs, noisy, run.seed, level.number)
    weighed = run.machine.put(np.zeros(run.shape, np.int32))
    in_place = run.schedule.independent(grid, run.offsets) and not getattr(run.schedule, "tile", None)
    ahead = callable(getattr(run.schedule, "sweep", None)) and not run.emulated and in_place
    return _Coherent(laid, rule, weighed, ahead)


def _favour(options: Options) -> np.float32:
    return np.float32(1 / (1 + (options.coherence or 0)))


def _xi(options: Options) -> int:
    return min(-1, round(options.xi * 1024))


def _weighed(run: _Run, level: _Level) -> tuple[int, int] | None:
    """Candidates that a level's relaxations have weighed, and the fma of each; None where they have weighed all."""
    if not level.coherent:
        return None
    weighed = level.grid.view(run.machine.get(level.coherent.weighed))
    return int(weighed.sum(dtype=np.int64)), 2 * len(run.offsets) * run.sample.channels


def _sweep(
    run: _Run,
    level: _Level,
    field: Field,
    state: Any,
    temperatures: NDArray[np.uint16],
    phase: str,
    meter: Meter,
) -> tuple[Field, Any]:
    """Relax about as many sites as have t > 0, or, in the phase ``"free"``, as there are: a sweep of the schedule."""
    machine, schedule = run.machine, run.schedule
    everywhere = np.ones(temperatures.shape, bool)

    def active() -> NDArray[np.bool_]:
        return _temperatures(run, level, field) > 0 if phase == "relax" else everywhere

    left = float(temperatures.mean()) / 1024 if phase == "relax" else 0.0
    sweep = meter.sweep(phase, left)
    wanted, relaxed = int((temperatures > 0).sum()) if phase == "relax" else everywhere.size, 0
    neighbours, channels = len(run.offsets), run.sample.channels
    weighed = level.weighed
    stores = not level.coherent and _stores(run.options, level)
    size = machine.chunk(weighed, neighbours, channels, stores)
    where = {"level": level.number, "sweep": sweep, "phase": phase, "temperature_left": left}
    if level.coherent and level.coherent.ahead:
        now = temperatures > 0 if phase == "relax" else everywhere
        return _sweep_ahead(run, level, field, state, now, meter, where)
    old = False
    while True:
        state, info = schedule.step(state, active)  # 6.2.1
        grid = replace(level.grid, tile=info.tile)
        if info.tile and not old:  # what tiles see of one another until the sweep ends
            field, old = Field(*(snapshot(machine, plane, grid.height) for plane in field)), True
        where["step"] = meter.step()
        run.account.step(info.sites)
        outcomes: list[Any] = []
        for part, sites in machine.pieces(info.sites, grid, size):  # 6.2.2
            if outcomes:
                _tell(run, level, field, meter, where, False)
            outcomes.append((part, _relax(run, part, level, grid, field, sites, info.turn)))
            work = 2 * weighed * neighbours * channels * len(sites)
            machine.sync(work)
            relaxed += len(sites)
            meter.add(len(sites), 0 if level.coherent else work, min(1.0, relaxed / wanted))
        for part, outcome in outcomes:  # no site sees another of its step
            field = commit(part, field, *outcome)
        _tell(run, level, field, meter, where, info.last)
        if info.last:
            return field, state


def _sweep_ahead(
    run: _Run, level: _Level, field: Field, state: Any, active: NDArray[np.bool_], meter: Meter, where: dict[str, Any]
) -> tuple[Field, Any]:
    """A whole sweep of coherent search in place: the schedule knows its steps beforehand and keeps equation (14)."""
    assert level.coherent
    machine, (laid, rule, weighed, _) = run.machine, level.coherent
    state, plan = run.schedule.sweep(state, lambda: active)  # type: ignore[attr-defined]
    sites, steps = machine.put(plan.sites), len(plan.bounds) - 1
    work = 2 * laid.slots * len(run.offsets) * run.sample.channels
    together = max(1, steps * TOGETHER // max(1, plan.sites.size))
    for first in range(0, steps, together):
        bounds = plan.bounds[first : first + together + 1]
        field = search(machine, sites, bounds, field, weighed, laid, level.offsets, level.grid, rule, plan.turn)
        if run.account.packed:
            run.account.packed_steps(np.diff(bounds))
        else:
            for begin, end in pairwise(bounds.tolist()):
                run.account.step(plan.sites[begin:end])
        relaxed = int(bounds[-1] - bounds[0])
        machine.sync(work * relaxed)
        where["step"] = meter.step(len(bounds) - 1)
        meter.add(relaxed, 0, int(bounds[-1]) / max(1, plan.sites.size))
        _tell(run, level, field, meter, where, int(bounds[-1]) == plan.sites.size)
    return field, state


def _relax(
    run: _Run, machine: Machine, level: _Level, grid: Grid, field: Field, sites: NDArray[np.int32], turn: int
) -> tuple[Array, lcpdf.Relaxed, Array]:
    """Steps 6.2.2.1 to 6.2.2.3 for sites that relax together: the sites, what they take, and how warm they are."""
    options = run.options
    number, _, offsets, candidates, window, relaxation, coherent, _ = level
    here = machine.put(sites)
    if coherent:
        table, rule, weighed, _ = coherent
        return here, *search_apart(machine, here, field, weighed, table, offsets, grid, rule, turn)
    if not _stores(options, level):
        relaxed = nearest(machine, here, field, offsets, grid, candidates, level.strip, _favour(options))
    else:
        near = neighbourhood(machine, here, field, offsets, grid)  # 6.2.2.1
        distances = lcpdf.distance(machine, near, candidates)
        if options.coherence:
            distances = coherence(machine, distances, candidates, here, field, offsets, grid, _favour(options))
        density = options.pixel == "density"
        if relaxation == "gibbs":  # 6.2.2.2
            relaxed = lcpdf.draw(machine, distances, candidates, here, window, density, run.seed, number, turn)
        elif run.sample.channels == 1 and window.top == 255:
            relaxed = lcpdf.mode(machine, distances, candidates, window)
        else:
            relaxed = lcpdf.mode_vector(machine, distances, candidates, window)
    cooled = temperature(machine, here, field, offsets, grid, _xi(options))  # 6.2.2.3
    return here, relaxed, cooled


def _stores(options: Options, level: _Level) -> bool:
    """Whether a step takes more of its distances than the least."""
    return level.relaxation == "gibbs" or options.pixel == "density"


def _tell(run: _Run, level: _Level, field: Field, meter: Meter, where: dict[str, Any], last: bool) -> None:
    if run.callback:
        image, warmth = partial(_picture, run, level, field), partial(_warmth, run, level, field)
        now: dict[str, Any] = {"end_of_sweep": last, "fraction": meter.fraction, "image": image, "temperature": warmth}
        run.callback(Relaxing(levels=run.levels, **where, **now))


def _temperatures(run: _Run, level: _Level, field: Field) -> NDArray[np.uint16]:
    return np.ascontiguousarray(level.grid.view(run.machine.get(field.temperature)))


def _warmth(run: _Run, level: _Level, field: Field) -> NDArray[np.float64]:
    return _temperatures(run, level, field) / np.float64(1024)


def _picture(run: _Run, level: _Level, field: Field) -> NDArray[Any]:
    """Read the level's picture back, in the sample's type."""
    values, source = run.machine.get(field.values), run.machine.get(field.source)
    return run.sample.picture(level.grid.view(values), level.grid.view(source))


def _expected_work(run: _Run) -> dict[int, tuple[float, float]]:
    """Relaxations times candidates that cooling and free sweeps of each level should take, as measured at xi = -1.

    The coarsest level takes about 0.6 |N| sweeps, the others relax each of their new sites about 6 times.
    """
    work = {}
    for number in range(run.levels):
        grid, options = Grid(*run.shape, 2**number), run.options
        coarsest = number == run.levels - 1
        sweeps = min(1024, 1 - 0.6 * len(run.offsets) / options.xi) if coarsest else 6 * 0.75
        candidates = run.sample.positions(run.offsets, grid.spacing, options.phases, options.edges).size
        if options.search == "coherent" and not coarsest and candidates > options.exhaustive:
            own = min(options.suggesting, len(run.offsets)) + 1
            candidates = min(candidates, own * (1 + options.similar) + max(1, options.chance))
        sites = grid.rows * grid.cols * candidates
        work[number] = (sites * sweeps, float(sites * options.free_sweeps))
    return work


def _number_of_levels(
    sample: tuple[int, ...], offsets: NDArray[np.int32], shape: tuple[int, int], options: Options
) -> int:
    """M, checked against the sample's rows and columns and against M <= 1 + log2(min(Mx, My))."""
    check_fit(sample, int(offsets.max()), options.order)
    step = 1 if options.phases == "all" else 2

    def candidates(levels: int) -> int:
        spacing = 2 ** (levels - 1)
        margin = 0 if options.edges != "whole" else 2 * int(offsets.max()) * spacing
        return prod(max(0, n - margin) // (spacing if step == 2 else 1) for n in sample)

    most = 1 + int(log2(min(*shape, *sample)))
    while most > 1 and not candidates(most):
        most -= 1
    if options.levels is None:
        levels = 1
        reach = 2 * int(offsets.max()) * 2  # of a neighbourhood at the next level
        while levels < most and candidates(levels + 1) >= ENOUGH and min(shape) > reach * 2 ** (levels - 1):
            levels += 1
        return levels
    if options.levels > most:
        raise ValueError(f"levels={options.levels} is too many for this sample, output and order; give at most {most}")
    return options.levels


def check_fit(sample: tuple[int, ...], radius: int, order: int) -> None:
    """Raise unless the sample holds one whole neighbourhood at least."""
    side = min(sample)
    if side > 2 * radius:
        return
    largest = ((side - 1) // 2 + 1) ** 2 - 1 if side > 2 else 0
    raise ValueError(
        f"a neighbourhood of order {order} does not fit the sample of {sample[0]} rows x {sample[1]} columns; "
        + (f"the largest order that fits is {largest}" if largest else "give at least 3x3 pixels")
    )


def _check_memory(machine: Machine, sample: Sample, shape: tuple[int, int], similar: int, copies: int) -> None:
    pixels, channels = shape[0] * shape[1], sample.channels
    within_32_bits(shape, channels * copies)
    field = copies * (6 + 2 * channels)
    machine.require(pixels * (12 + field) + sample.rows * sample.cols * (14 * channels + 151 + 4 * similar))
