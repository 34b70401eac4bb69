# SPDX-License-Identifier: BSD-3-Clause
"""A whole run of the method ``mrf``: what Algorithm 1 is given, and what comes of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex import schedules
from simdtex.machine import memory
from simdtex.machine.interface import Machine
from simdtex.maspar.array import parse_array
from simdtex.methods.mrf.algorithm import anneal
from simdtex.methods.mrf.holding import Holding
from simdtex.methods.mrf.level import Run, number_of_levels
from simdtex.methods.mrf.observers import Observer
from simdtex.methods.mrf.options import CATEGORIES as MOST
from simdtex.methods.mrf.options import Options
from simdtex.model.given import Given, planes
from simdtex.model.guide import Beside, Guide
from simdtex.model.lattice import Grid, neighbourhood_offsets
from simdtex.model.pictures import Pictures
from simdtex.model.sample import NothingUsable, Sample
from simdtex.model.use import effective_use
from simdtex.ops.finish import around, finish
from simdtex.ops.neighbourhood import Field
from simdtex.options import within_32_bits
from simdtex.run import Callback, Output, device_seconds

AT_ONCE = 2**20
"""Sites that are finished together."""

LABELS = 64
"""Labels of a guide, at most: each is a channel."""


def synthesize(
    machine: Machine,
    pixels: NDArray[Any] | Pictures,
    shape: tuple[int, int],
    options: Options,
    seed: int,
    callback: Callback | None = None,
    given: Given | None = None,
    guide: tuple[tuple[NDArray[Any], ...], NDArray[Any]] | None = None,
) -> tuple[NDArray[Any], Output]:
    """Algorithm 1: nonparametric multiscale MRF texture synthesis.

    Parameters
    ----------
    machine : Machine
        What executes the steps.
    pixels : (rows, cols, channels) array, or Pictures
        Y, the sample.
    shape : (int, int)
        Rows and columns of X, the output.
    options : Options
    seed : int
        Key of every random number.
    callback : callable, optional
        Called with a `simdtex.run.Relaxing` after every part of a sweep.
    given : Given, optional
        Sites of X whose values are given; they stay what they are.
    guide : (tuple of (rows, cols, G) arrays, (H, W, G) array), optional
        What tells where to be what: for each picture of the sample, and for X.

    Returns
    -------
    image : (rows, cols, channels) array
        In the sample's type.
    output : simdtex.run.Output
        Source map, temperatures, stages and statistics.

    Notes
    -----
    Cost: sweeps x sites x candidates x |N| x channels x 2 fma, about 7 sweeps a level; the coherent search weighs some
    6 candidates, the exact search all of the level; the structure channel is a channel more. Memory on the device, in
    bytes: 18 + 2 channels per output pixel (24 + 4 channels with the schedule ``block``), 14 channels + 4 similar + 159
    per pixel of the sample with its margin, and the machine's scratch memory or, if that is more, 65 per candidate. On
    the host, where a CPU's device memory is too: 84 per output pixel (100 with ``block``) and 10 + 1.5 n for each of
    its channels, n the bytes of a value of the sample, and 64 per pixel of the sample (benchmarks/memory.py). Both are
    asked for first.
    """
    launches, worked = machine.launches, machine.seconds
    run = laid_out(machine, pixels, shape, options, seed, given, guide)
    observer, state = Observer(run, callback), None
    for level, state, info in anneal(run, watch=observer.part):
        observer.sweep(level, state, info)
    assert state is not None  # there is a level, and it has a sweep
    grid = Grid(*shape)
    source, temperatures = (grid.view(machine.get(plane)) for plane in (state.source, state.temperature))
    if run.options.finish:
        image = finished(run, state.field, source)
    else:
        image = run.sample.picture(grid.view(machine.get(state.values)), source)
    if given:
        image = given.shown(image, grid)
    place = run.sample.place(source)
    meter, account = observer.meter, observer.account
    statistics = {
        "device": machine.name,
        "seed": seed,
        "options": vars(run.options) | {"levels": run.levels, "schedule": run.schedule.name},
        "seconds": meter.seconds,
        "device_seconds": device_seconds(machine, worked),
        "accounting": account.report() | {"emulated": run.emulated, "launches": machine.launches - launches},
        "levels": meter.reports,
        "use": used(place, run.sample.pictures),
    }
    return image, Output(place, temperatures / 1024, observer.stages, statistics)


def check_categories(pictures: Pictures, given: Given | None, options: Options) -> None:
    """Raise where a category is given that the sample does not have, or a share of one."""
    for variable in range(pictures.pixels[0].shape[-1]):
        categories = pictures.categories(variable)
        if categories is None:
            continue
        if given:
            told = np.unique(given.values[given.known[..., variable], variable])
            strange = told[~np.isin(told, categories)]
            if strange.size:
                raise ValueError(
                    f"known has the category {strange[0]} and the sample has {_listed(categories)}; give one of these"
                )
        if len(categories) > MOST:
            raise ValueError(
                f"a variable has {len(categories)} categories; give {MOST} or fewer, or leave categorical out"
            )
    if options.proportions:
        found = pictures.categories(0)
        if found is None or pictures.pixels[0].shape[-1] > 1:
            raise ValueError("proportions are of one variable of categories; give categorical=True, or leave them out")
        if len(found) != len(options.proportions):
            raise ValueError(
                f"there are {len(options.proportions)} proportions and {len(found)} categories, {_listed(found)}; "
                "give one for each"
            )


def check_guide(guide: tuple[tuple[NDArray[Any], ...], NDArray[Any]], options: Options) -> Guide:
    """The guide with its kind and weight; raises where it names a label that the sample lacks."""
    if options.pixel == "density":
        raise ValueError('a guide chooses among pixels of the sample; give pixel="source"')
    samples, output = guide
    labels = options.labels
    if labels is None:
        integers = all(one.dtype.kind in "iu" for one in (*samples, output))
        labels = integers and all(np.unique(one).size <= MOST for one in samples)
    if labels:
        for channel in range(output.shape[-1]):
            there = np.unique(np.concatenate([np.unique(one[..., channel]) for one in samples]))
            told = np.unique(output[..., channel])
            told = told[~np.isnan(told)] if told.dtype.kind == "f" else told
            strange = told[~np.isin(told, there)]
            if strange.size:
                raise ValueError(
                    f"the guide of the output asks for the label {strange[0]} and that of the sample has "
                    f"{_listed(there)}; give labels that the sample has"
                )
            if there.size > LABELS:
                raise ValueError(f"the guide has {there.size} labels; give {LABELS} or fewer, or labels=False")
    return Guide(samples, output, labels, options.guide_weight)


def _listed(values: NDArray[Any]) -> str:
    """Up to ten values in words."""
    words = [str(value) for value in values[:10]]
    return ", ".join(words) + (", ..." if len(values) > 10 else "")


def used(place: NDArray[np.int32], pictures: Pictures) -> dict[str, Any] | None:
    """How evenly the sample is used, where it is one picture and something is from there."""
    if place.shape[-1] > 2 or (place[..., 0] < 0).all():
        return None
    return effective_use(place[place[..., 0] >= 0][None], pictures.pixels[0].shape).as_dict()


def laid_out(
    machine: Machine,
    pixels: NDArray[Any] | Pictures,
    shape: tuple[int, int],
    options: Options,
    seed: int,
    given: Given | None = None,
    guide: tuple[tuple[NDArray[Any], ...], NDArray[Any]] | None = None,
) -> Run:
    """Lay out a run on a machine; the arguments are those of `synthesize`."""
    pictures = options.of(pixels if isinstance(pixels, Pictures) else Pictures((pixels,)))
    check_categories(pictures, given, options)
    options = options.resolved(pictures)
    offsets = neighbourhood_offsets(options.order)
    levels = number_of_levels([picture.shape[:2] for picture in pictures.pixels], offsets, shape, options)  # 1
    beside: list[Beside] = [check_guide(guide, options)] if guide else []
    if given and given.partly:
        if options.pixel == "density":
            raise ValueError('sites that are known in part choose among pixels of the sample; give pixel="source"')
        beside.append(given.colocated(pictures.pixels))
    channels = pictures.channels + bool(options.structure) + sum(one.channels for one in beside)
    heavy = max(1.0, options.data_weight, len(offsets) / 4) if given or beside else 1.0  # in sums of squares
    values = round(heavy * (channels * len(offsets) + len(beside)))
    levels, sample = sampled(pictures, levels, offsets, values, options, beside)
    schedule = schedules.get(options.schedule)
    _check_memory(machine, sample, shape, options.similar, copies=2 if schedule.tile else 1)
    emulated = bool(options.array) and options.emulate
    if options.array and emulated:
        machine = machine.emulate(parse_array(options.array, options.mapping))
    laid = planes(given, sample) if given and given.whole.any() else None
    return Run(
        machine=machine,
        sample=sample,
        planes=sample.planes(machine),
        shape=shape,
        offsets=offsets,
        options=options,
        schedule=schedules.Checked(schedule) if options.check_schedule else schedule,
        seed=seed,
        levels=levels,
        emulated=emulated,
        weighed=machine.put(np.zeros(shape, np.int32)),
        holding=Holding(machine, Grid(*shape, 1, options.boundary == "torus"), levels, sample.guides, laid),
        given=given,
    )


def sampled(
    pictures: Pictures,
    levels: int,
    offsets: NDArray[np.int32],
    values: int,
    options: Options,
    beside: Sequence[Beside],
) -> tuple[int, Sample]:
    """How many levels there are, and the sample; fewer, where some level has no candidate and nobody asked for it."""
    far = int(around(options.finish)[0].max()) if options.finish else 0
    for fewer in range(levels, 0, -1):
        step = 2 ** (fewer - 1)
        margin = int(offsets.max()) * step
        sample = Sample(pictures, values, margin, options.structure, step, beside, options.unsure, far)
        try:
            for number in range(fewer):
                sample.allowed(offsets, 2**number, options.phases, options.edges)
        except NothingUsable:
            if fewer == 1 or options.levels is not None:
                raise
            continue
        break
    return fewer, sample


def finished(run: Run, field: Field, seen: NDArray[np.int32]) -> NDArray[Any]:
    """The picture with the finish (`simdtex.ops.finish`), in the sample's type.

    Parameters
    ----------
    run : Run
    field : Field
        Of the finest level.
    seen : (rows, cols) int32 array
        Its sources on the host.
    """
    sample, grid, ring = run.sample, run.grid(0), around(run.options.finish or 0)
    picture = np.empty((*run.shape, sample.shown), sample.pixels.dtype)
    rows = max(1, AT_ONCE // grid.cols)
    known = np.zeros(run.shape, bool) if run.holding.laid is None else run.holding.laid.known
    given = run.machine.put(known.view(np.uint8))
    for top in range(0, grid.rows, rows):
        here = seen[top : top + rows]
        by = finish(run.machine, field, given, grid, run.planes, sample, *ring, top * grid.cols, here.size)
        picture[top : top + rows] = sample.moved(here, by.reshape(-1, *here.shape))
    return picture


def _check_memory(machine: Machine, sample: Sample, shape: tuple[int, int], similar: int, copies: int) -> None:
    pixels, channels = shape[0] * shape[1], len(sample.working)
    within_32_bits(shape, channels * copies)
    field, held = copies * (6 + 2 * channels), sample.rows * sample.cols
    host = pixels * (68 + 16 * copies + channels * (10 + 3 * sample.pixels.dtype.itemsize // 2)) + 64 * held
    memory.require(machine, pixels * (12 + field) + held * (14 * channels + 159 + 4 * similar), host)
