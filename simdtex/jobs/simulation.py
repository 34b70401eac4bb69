# SPDX-License-Identifier: BSD-3-Clause
"""Realisations of a random field with the statistics of a training image: `simulate`."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from importlib.metadata import version
from math import prod
from queue import SimpleQueue
from threading import Lock
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from simdtex.checkpoint import Checkpoint, Checkpointing, digest, opened
from simdtex.driver import check_sides, drive, restored
from simdtex.io.grids import frame
from simdtex.io.hard_data import HardData, place_hard_data
from simdtex.jobs.inputs import Inputs, as_known, check_inputs, check_samples
from simdtex.machine import Machine, memory, open_machine
from simdtex.methods import mrf
from simdtex.options import resolve, whole, within_32_bits
from simdtex.run import Callback, Simulating

if TYPE_CHECKING:
    import xarray

AT_ONCE = 4
"""Realisations that a processor works on at once, at most: each has a queue of its own."""


def simulate(
    training: ArrayLike,
    n: int,
    *,
    shape: tuple[int, ...] | None = None,
    known: ArrayLike | HardData | str | os.PathLike[str] | None = None,
    several: str = "refuse",
    origin: Sequence[float] | None = None,
    cell: Sequence[float] | None = None,
    guide: tuple[Any, Any] | None = None,
    mask: ArrayLike | None = None,
    first: int = 0,
    jobs: int | None = None,
    channel_axis: int | None = None,
    rng: int | np.random.Generator | None = None,
    device: str | None = None,
    callback: Callback | None = None,
    checkpoint: str | os.PathLike[str] | Checkpoint | None = None,
    **options: Any,
) -> xarray.DataArray:
    """Simulate realisations that look like a training image and honour data: multiple-point simulation.

    Parameters
    ----------
    training : (rows, cols) or (layers, rows, cols) array, or a list of (rows, cols) arrays
        The training image, a picture or a volume, NaN where it is unknown. With ``categorical=True`` its numbers name
        categories. With `channel_axis` it has an axis more, of variables.
    n : int
        How many realisations, 1 or more.
    shape : (int, int) or (int, int, int), optional
        Rows and columns of each, or layers, rows and columns. None: those of `known`, where that is an array, else of
        the training image.
    known : array, HardData or path, optional
        What is known: a masked array, or floats with NaN where nothing is known, of `shape`; or a table ``x,y,value``
        (`simdtex.read_hard_data`) or its file. Every realisation has these values, to the bit.
    several : {"refuse", "mean", "most"}
        What becomes of data of a table that lie in one cell and differ: an error, their mean, or the most frequent
        value, as in `simdtex.place_hard_data`.
    origin : (x, y) or (x, y, z), optional
        The centre of the first cell of a realisation, in the units of the table and of the result's coordinates. None
        is 0.
    cell : (x, y) or (x, y, z), optional
        The size of a cell. None is 1; without `origin` and `cell`, coordinates are columns and rows.
    guide, mask
        As in `simdtex.synthesize`: secondary data of the training image and of the realisations, and what of the
        training image may be used.
    first : int
        Number of the first realisation.
    jobs : int, optional
        Realisations at a time. None: one for each core of a processor, at most 4; on a GPU 1.
    channel_axis : int, optional
        The axis of the training image that holds variables; None for one variable.
    rng : int or numpy.random.Generator, optional
        The seed. A realisation depends on it and on its own number alone, whatever `n`, `first` and `jobs` are.
    device : str, optional
        As in `simdtex.synthesize`.
    callback : callable, optional
        Called with a `simdtex.run.Simulating` after every realisation.
    checkpoint
        As in `simdtex.synthesize`; it keeps the realisations that are finished.
    **options
        Of the method ``mrf``: see `simdtex.methods.mrf.Options`, which says what defaults differ in ``simulate``.

    Returns
    -------
    xarray.DataArray
        Dimensions ``realisation``, ``z`` of a volume, ``y`` (row 0 is the smallest y), ``x`` and, with `channel_axis`,
        ``variable``, in the training image's type. The coordinates ``z``, ``y`` and ``x`` are those of the centres of
        cells; of a picture, a third number of `origin` and `cell` is the coordinate ``z``. The coordinate ``seed`` is
        that of each realisation: with it `simdtex.synthesize` gives the same picture. Attributes: ``seed``, ``options``
        (a JSON text), ``version``, ``device``, SHA-256 digests of the arrays ``training_image``, ``hard_data``,
        ``guide`` and ``mask`` that are given, and with `origin` or `cell` the sizes ``cell_x``, ``cell_y``, ``cell_z``.
        All are texts and numbers, so that ``to_netcdf`` and ``to_zarr`` of xarray write them.

    Raises
    ------
    ValueError, TypeError
        What is wrong and what would be right, in one sentence.

    Notes
    -----
    Cost: n times that of `simdtex.synthesize`, and of memory n results.

    Examples
    --------
    >>> from simdtex.experiments.ensemble import channels
    >>> import simdtex
    >>> training, _ = channels()
    >>> found = simdtex.simulate(training[:64, :64], 2, shape=(32, 40), categorical=True, order=8, rng=1)
    >>> dict(found.sizes)
    {'realisation': 2, 'y': 32, 'x': 40}
    """
    xr = _xarray()
    whole("n", n, 1)
    whole("first", first, 0)
    if jobs is not None:
        whole("jobs", jobs, 1)
    axes = 3 if getattr(training, "ndim", 2) - (channel_axis is not None) == 3 else 2
    sides = ("layers", "rows", "columns")[-axes:]
    if shape is not None:
        within_32_bits(check_sides(shape, sides), 1)
    lies = frame(origin, cell)
    pictures = check_samples(training, channel_axis, mask, axes)
    known = None if known is None else as_known(known)
    size = check_sides(pictures.pixels[0].shape[:-1] if shape is None else shape, sides)
    if shape is None and isinstance(known, np.ndarray) and known.ndim == axes + (channel_axis is not None):
        size = known.shape if channel_axis is None else np.moveaxis(known, channel_axis, -1).shape[:-1]
    place = partial(place_hard_data, origin=origin, cell=cell, several=several)
    inputs = check_inputs(pictures, size, channel_axis, None, known, None, guide, place)
    chosen = resolve(mrf.Options, "simulate" if axes == 2 else "simulate 3-D", options)
    plan = mrf.plan(inputs.pictures, size, chosen, inputs.given, inputs.guide)
    pixels = inputs.pictures.pixels[0]
    each = 2 * prod((*size, pixels.shape[-1])) * pixels.dtype.itemsize  # they are copied once
    memory.require_host(n * (each + 64))
    made = np.empty((n, *size, pixels.shape[-1]), pixels.dtype)
    machines = _machines(device, jobs, n)
    finished: list[int] = []
    lock = Lock()

    def identity() -> dict[str, Any]:
        return {"shape": size, "n": n, "first": first, "options": chosen, **inputs.identity()}

    def state() -> dict[str, Any]:
        return {"numbers": list(finished), "pictures": made[finished]}

    with opened(checkpoint, "simulate", rng, identity, machines[0].name) as (seed, checkpointing):
        seeds = np.array([realisation_seed(seed, first + k) for k in range(n)], np.uint64)
        if checkpointing.found is not None:
            finished += checkpointing.found["numbers"]
            made[finished] = checkpointing.found["pictures"]

        def offer_finished(info: Any, tree: Callable[[], Any]) -> None:
            if isinstance(checkpoint, Checkpoint) and checkpoint.stopping:  # a realisation has no state of its own
                with lock:
                    checkpointing.offer(info, state)

        def one(number: int, machine: Machine) -> None:
            picture, _ = drive(plan, machine, int(seeds[number]), None, Checkpointing(None, offer_finished))
            with lock:
                made[number] = picture
                finished.append(number)
                checkpointing.offer(None, state)
                if callback:
                    shown = restored(picture, None if channel_axis is None else -1)
                    done = {"realisation": first + number, "finished": len(finished), "realisations": n}
                    callback(Simulating(level=0, levels=1, fraction=len(finished) / n, image=lambda: shown, **done))

        try:
            _in_turn(one, [number for number in range(n) if number not in finished], machines)
        except BaseException:
            checkpointing.offer(None, state, now=True)  # those that wait for their turn
            raise
    dims, arrays = ["realisation", *"zyx"[-axes:], "variable"], made
    if channel_axis is None:
        dims, arrays = dims[:-1], made[..., 0]
    coordinates: dict[str, Any] = {"realisation": np.arange(first, first + n), "seed": ("realisation", seeds)}
    coordinates |= {axis: np.arange(side) for axis, side in zip("zyx"[-axes:], size, strict=True)}
    attributes = _attributes(seed, chosen, machines[0].name, inputs)
    if origin is not None or cell is not None:
        for axis, at, side in zip("xyz", *lies, strict=False):
            coordinates[axis] = at + side * coordinates[axis] if axis in coordinates else at
            attributes[f"cell_{axis}"] = side
    result: xarray.DataArray = xr.DataArray(arrays, coords=coordinates, dims=dims, name="simulation", attrs=attributes)
    return result


def realisation_seed(seed: int, number: int) -> int:
    """Return the seed of a realisation, from that of the simulation and its number."""
    return int(np.random.SeedSequence(seed, spawn_key=(number,)).generate_state(1, np.uint64)[0])


def _machines(device: str | None, jobs: int | None, n: int) -> list[Machine]:
    first = open_machine(device)
    if jobs is None:
        jobs = 1 if first.kind == "gpu" else min(AT_ONCE, os.cpu_count() or 1)
    return [first, *(open_machine(device) for _ in range(min(jobs, n) - 1))]


def _in_turn(one: Callable[[int, Machine], None], numbers: list[int], machines: list[Machine]) -> None:
    """Simulate each number on a machine that is free; the first error ends it all."""
    free: SimpleQueue[Machine] = SimpleQueue()
    for machine in machines:
        free.put(machine)

    def job(number: int) -> None:
        machine = free.get()
        try:
            one(number, machine)
        finally:
            free.put(machine)

    with ThreadPoolExecutor(len(machines)) as workers:
        futures = [workers.submit(job, number) for number in numbers]
        try:
            for future in futures:
                future.result()
        except BaseException:
            workers.shutdown(wait=False, cancel_futures=True)
            raise


def _attributes(seed: int, options: mrf.Options, device: str, inputs: Inputs) -> dict[str, Any]:
    text = json.dumps(
        vars(options), default=lambda value: value.tolist() if isinstance(value, np.generic) else str(value)
    )
    found: dict[str, Any] = {"seed": seed, "version": version("simdtex"), "device": device, "options": text}
    pictures = inputs.pictures  # whose pixels are completed where they are unknown
    found["training_image"] = digest(*pictures.pixels, *(pictures.known or ()))
    if inputs.given:
        found["hard_data"] = digest(np.where(inputs.given.known, inputs.given.values, 0), inputs.given.known)
    if inputs.guide:
        found["guide"] = digest(*inputs.guide[0], inputs.guide[1])
    if pictures.usable:
        found["mask"] = digest(*pictures.usable)
    return found


def _xarray() -> Any:
    try:
        import xarray
    except ModuleNotFoundError:
        raise ValueError("xarray is not installed; pip install 'simdtex[simulate]'") from None
    return xarray
