# SPDX-License-Identifier: BSD-3-Clause
"""A whole run of the method ``mrf``: what Algorithm 1 is given, and what comes of it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex import schedules
from simdtex.machine.interface import Array, Machine
from simdtex.maspar.array import parse_array
from simdtex.methods.mrf.algorithm import anneal
from simdtex.methods.mrf.level import Run, number_of_levels
from simdtex.methods.mrf.observers import Observer
from simdtex.methods.mrf.options import Options
from simdtex.model.lattice import Grid, neighbourhood_offsets
from simdtex.model.sample import Sample
from simdtex.model.use import effective_use
from simdtex.ops.finish import around, finish
from simdtex.options import within_32_bits
from simdtex.run import Callback, Output, device_seconds

AT_ONCE = 2**20
"""Sites that are finished together."""


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
        Called with a `simdtex.run.Relaxing` after every part of a sweep.

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
    the host: about 50 per output pixel.
    """
    launches, worked = machine.launches, machine.seconds
    run = laid_out(machine, pixels, shape, options, seed)
    observer, state = Observer(run, callback), None
    for level, state, info in anneal(run, watch=observer.part):
        observer.sweep(level, state, info)
    assert state is not None  # there is a level, and it has a sweep
    grid = Grid(*shape)
    source, temperatures = (grid.view(machine.get(plane)) for plane in (state.source, state.temperature))
    if run.options.finish:
        image = finished(run, state.source, source)
    else:
        image = run.sample.picture(grid.view(machine.get(state.values)), source)
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
        "use": effective_use(place, pixels.shape).as_dict(),
    }
    return image, Output(place, temperatures / 1024, observer.stages, statistics)


def laid_out(machine: Machine, pixels: NDArray[Any], shape: tuple[int, int], options: Options, seed: int) -> Run:
    """Lay out a run on a machine; the arguments are those of `synthesize`."""
    options = options.resolved(pixels)
    offsets = neighbourhood_offsets(options.order)
    levels = number_of_levels(pixels.shape[:2], offsets, shape, options)  # 1
    channels, margin = pixels.shape[-1] + bool(options.structure), int(offsets.max()) * 2 ** (levels - 1)
    sample = Sample(pixels, channels * len(offsets), margin, options.structure)
    schedule = schedules.get(options.schedule)
    _check_memory(machine, sample, shape, options.similar, copies=2 if schedule.tile else 1)
    emulated = bool(options.array) and options.emulate
    if options.array and emulated:
        machine = machine.emulate(parse_array(options.array, options.mapping))
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
    )


def finished(run: Run, source: Array, seen: NDArray[np.int32]) -> NDArray[Any]:
    """The picture with the finish (`simdtex.ops.finish`), in the sample's type.

    Parameters
    ----------
    run : Run
    source : (H, W) int32 array of the machine
        Of the finest level.
    seen : (rows, cols) int32 array
        The same on the host.
    """
    sample, grid, ring = run.sample, run.grid(0), around(run.options.finish or 0)
    picture = np.empty((*run.shape, sample.shown), sample.pixels.dtype)
    rows = max(1, AT_ONCE // grid.cols)
    for top in range(0, grid.rows, rows):
        here = seen[top : top + rows]
        by = finish(run.machine, source, grid, run.planes, sample, *ring, top * grid.cols, here.size)
        picture[top : top + rows] = sample.moved(here, by.reshape(-1, *here.shape))
    return picture


def _check_memory(machine: Machine, sample: Sample, shape: tuple[int, int], similar: int, copies: int) -> None:
    pixels, channels = shape[0] * shape[1], sample.channels
    within_32_bits(shape, channels * copies)
    field = copies * (6 + 2 * channels)
    machine.require(pixels * (12 + field) + sample.rows * sample.cols * (14 * channels + 159 + 4 * similar))
