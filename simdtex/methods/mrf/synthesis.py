# SPDX-License-Identifier: BSD-3-Clause
"""A whole run of the method ``mrf``: what Algorithm 1 is given, and what comes of it."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.checkpoints.keep import NOTHING, Keep
from simdtex.machine import memory
from simdtex.machine.interface import Machine
from simdtex.methods.mrf.algorithm import anneal
from simdtex.methods.mrf.keeping import kept, restored
from simdtex.methods.mrf.level import Run
from simdtex.methods.mrf.observers import Observer
from simdtex.methods.mrf.options import Options
from simdtex.methods.mrf.outline import outlined
from simdtex.model.given import Given
from simdtex.model.lattice import Grid
from simdtex.model.pictures import Pictures
from simdtex.model.sample import Sample
from simdtex.model.use import effective_use
from simdtex.ops.finish import around, finish
from simdtex.ops.neighbourhood import Field
from simdtex.options import SMALLER, within_32_bits
from simdtex.run import Callback, Output, device_seconds

TILED = f"{SMALLER}, or make it in tiles: --tiles 2048, or simdtex.distributed"
"""What helps where an output is too large for this machine."""

AT_ONCE = 2**20
"""Sites that are finished together."""


def synthesize(
    machine: Machine,
    pixels: NDArray[Any] | Pictures,
    shape: tuple[int, int],
    options: Options,
    seed: int,
    callback: Callback | None = None,
    given: Given | None = None,
    guide: tuple[tuple[NDArray[Any], ...], NDArray[Any]] | None = None,
    keep: Keep = NOTHING,
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
    keep : Keep
        Keeps the state after every sweep.

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
    observer, found = Observer(run, callback), keep.found
    state = begun = None if found is None else restored(run, observer, found)
    for level, state, info in anneal(run, begun, watch=observer.part):
        observer.sweep(level, state, info)
        keep.offer(partial(kept, run, state, observer), ended=info.level if info.ended else None)
    assert state is not None  # there is a level, and it has a sweep
    grid = Grid(*shape)
    source, temperatures = (grid.view(machine.get(plane)) for plane in (state.source, state.temperature))
    if run.options.finish:
        known = given.whole if given and given.whole.any() else None
        image = finished(run, run.grid(0), state.field, known, source)
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
        "accounting": account.report() | {"launches": machine.launches - launches},
        "levels": meter.reports,
        "use": used(place, run.sample.pictures),
    }
    return image, Output(place, temperatures / 1024, observer.stages, statistics)


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
    outline = outlined(pixels, shape, options, seed, given, guide)
    schedule, options = outline.schedule, outline.options
    _check_memory(machine, outline.sample, shape, options.similar, copies=2 if schedule.tile else 1)
    run = outline.run(machine, outline.holding(machine), machine.put(np.zeros(shape, np.int32)))
    return replace(run, given=given)


def finished(
    run: Run, grid: Grid, field: Field, known: NDArray[np.bool_] | None, seen: NDArray[np.int32], first: int = 0
) -> NDArray[Any]:
    """The picture with the finish (`simdtex.ops.finish`), in the sample's type.

    Parameters
    ----------
    run : Run
    grid : Grid
        The finest level, or a window of it.
    field : Field
        Of that.
    known : (H, W) bool array, optional
        Which sites of that are given.
    seen : (rows, cols) int32 array
        Sources on the host: of all rows, or of some.
    first : int
        The first of these rows.
    """
    sample, ring = run.sample, around(run.options.finish or 0)
    picture = np.empty((*seen.shape, sample.shown), sample.pixels.dtype)
    rows = max(1, AT_ONCE // grid.cols)
    known = np.zeros((grid.height, grid.width), bool) if known is None else known
    given = run.machine.put(known.view(np.uint8))
    for top in range(0, len(seen), rows):
        here = seen[top : top + rows]
        by = finish(run.machine, field, given, grid, run.planes, sample, *ring, (first + top) * grid.cols, here.size)
        picture[top : top + rows] = sample.moved(here, by.reshape(-1, *here.shape))
    return picture


def _check_memory(machine: Machine, sample: Sample, shape: tuple[int, int], similar: int, copies: int) -> None:
    pixels, channels = shape[0] * shape[1], len(sample.working)
    within_32_bits(shape, channels * copies, TILED)
    field, held = copies * (6 + 2 * channels), sample.rows * sample.cols
    host = pixels * (68 + 16 * copies + channels * (10 + 3 * sample.pixels.dtype.itemsize // 2)) + 64 * held
    memory.require(machine, pixels * (12 + field) + held * (14 * channels + 159 + 4 * similar), host, TILED)
