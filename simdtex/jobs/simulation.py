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
from typing import TYPE_CHECKING, Any, Literal, Unpack, overload

import numpy as np
from numpy.typing import ArrayLike

from simdtex.checkpoint import Checkpoint, Checkpointing, digest, opened
from simdtex.driver import check_sides, drive, restored
from simdtex.io.grids import frame
from simdtex.io.hard_data import HardData, place_hard_data
from simdtex.jobs.inputs import Inputs, as_known, check_inputs, check_samples
from simdtex.jobs.maps import Maps, check_region, missing_value
from simdtex.machine import Machine, memory, open_machine
from simdtex.methods import mrf
from simdtex.methods.typed_options import SimulateOptions
from simdtex.model.given import Given, Soft
from simdtex.model.pictures import Pictures
from simdtex.options import lists_options, require, resolve, whole, within_32_bits
from simdtex.run import Callback, Simulating

if TYPE_CHECKING:
    import xarray

AT_ONCE = 4
"""The most realisations that run on a processor at the same time, each with its own queue."""


@overload
def simulate(
    training: ArrayLike, n: int, *, source: Literal[True], **options: Unpack[SimulateOptions]
) -> xarray.Dataset: ...
@overload
def simulate(
    training: ArrayLike, n: int, *, source: Literal[False] = ..., **options: Unpack[SimulateOptions]
) -> xarray.DataArray: ...
@lists_options("simulate", mrf.Options)
def simulate(
    training: ArrayLike,
    n: int,
    *,
    shape: tuple[int, ...] | None = None,
    known: ArrayLike | HardData | str | os.PathLike[str] | None = None,
    several: Literal["refuse", "mean", "most"] = "refuse",
    outside: Literal["refuse", "skip"] = "refuse",
    origin: Sequence[float] | None = None,
    cell: Sequence[float] | None = None,
    guide: tuple[Any, Any] | None = None,
    mask: ArrayLike | None = None,
    region: ArrayLike | None = None,
    probabilities: ArrayLike | HardData | str | os.PathLike[str] | None = None,
    image_map: ArrayLike | None = None,
    rotation: ArrayLike | None = None,
    scale: ArrayLike | None = None,
    source: bool = False,
    first: int = 0,
    jobs: int | None = None,
    channel_axis: int | None = None,
    rng: int | np.random.Generator | None = None,
    device: str | None = None,
    callback: Callback | None = None,
    checkpoint: str | os.PathLike[str] | Checkpoint | None = None,
    **options: Any,
) -> xarray.DataArray | xarray.Dataset:
    """Return realisations that look like a training image and honour data (multiple-point simulation).

    Parameters
    ----------
    training : (rows, cols) or (layers, rows, cols) array, or a list of (rows, cols) arrays
        The training image, a picture or a volume; unknown values are NaN. With ``categorical=True`` its values are
        categories. With `channel_axis` it has one more axis, for variables.
    n : int
        Number of realisations, 1 or more.
    shape : (int, int) or (int, int, int), optional
        Rows and columns of each realisation, or layers, rows and columns. None: those of `known`, or of the first map
        below, if that is an array, else of the training image.
    known : array, HardData, pandas.DataFrame or path, optional
        Hard data: a masked array of `shape`, floats with NaN for unknown values, a table of x, y and value
        (`simdtex.read_hard_data`), its file or a DataFrame. Every realisation has these values, to the bit.
    several : {"refuse", "mean", "most"}
        Value for different data of a table in one cell: an error, their mean (not of categories), or the most frequent
        value, as in `simdtex.place_hard_data`.
    outside : {"refuse", "skip"}
        Data of a table outside the cells: an error, or left out with a warning.
    origin : (x, y) or (x, y, z), optional
        The centre of the first cell of a realisation, in the units of the table and of the result's coordinates. None
        is 0.
    cell : (x, y) or (x, y, z), optional
        The size of a cell. None is 1; without `origin` and `cell`, coordinates are columns and rows.
    guide, mask
        As in `simdtex.synthesize`: secondary data of the training image and of the realisations, and the part of the
        training image that may be used.
    region : (rows, cols) or (layers, rows, cols) bool array, optional
        True for cells that are simulated. All other cells have no value: NaN in floats, else the attribute
        ``missing``.
    probabilities : (categories, rows, cols) array, or table or its path, optional
        Soft data, of a volume (categories, layers, rows, cols): the probability at each cell of each category of the
        first variable, in ascending order of category; the sum is 1, and unknown probabilities are NaN. A table has the
        columns x, y, and one for each category. See `soft_weight`.
    image_map : (rows, cols) or (training images, rows, cols) array, optional
        The number, from 0, of the training image of each cell, or the weight of each training image at each cell. NaN:
        any training image. This and the next two parameters are not for volumes.
    rotation : (rows, cols) array, optional
        Rotation of the training image at each cell, in degrees from x to y (from columns to rows), rounded to eighths
        of a turn. NaN: any rotation of another cell.
    scale : (rows, cols) array, optional
        Factor by which the training image is enlarged at each cell, 1/2 to 2, rounded to powers of the square root of
        2. NaN: any factor of another cell.
    source : bool
        Return the position in the training image of each cell of each realisation too.
    first : int
        Number of the first realisation.
    jobs : int, optional
        Number of realisations at a time. None: one for each core of a CPU, at most 4; on a GPU 1.
    channel_axis : int, optional
        The axis of the training image that holds variables; None for one variable.
    rng : int or numpy.random.Generator, optional
        The seed. A realisation depends only on the seed and on its number, not on `n`, `first` and `jobs`.
    device : str, optional
        As in `simdtex.synthesize`.
    callback : callable, optional
        Called with a `simdtex.run.Simulating` after every part of a realisation.
    checkpoint
        As in `simdtex.synthesize`; it keeps the finished realisations.
    **options
        Of the method ``mrf``: see `simdtex.methods.mrf.Options`, which lists the defaults that differ in ``simulate``.

    Returns
    -------
    xarray.DataArray
        Dimensions ``realisation``, ``z`` of a volume, ``y`` (row 0 is the smallest y), ``x`` and, with `channel_axis`,
        ``variable``, in the training image's type. The coordinates ``z``, ``y`` and ``x`` are those of the centres of
        cells; for a picture, a third number of `origin` and `cell` is ``z``. The coordinate ``seed`` is that of each
        realisation: `simdtex.synthesize` with it returns the same map, unless `region` or a later parameter is used.
        Attributes: ``seed``, ``options`` (a JSON text), ``version``, ``device``, SHA-256 digests of the arrays
        ``training_image``, ``hard_data``, ``guide``, ``mask`` and those from `region` to `scale` that are given, and
        with `origin` or `cell` the sizes ``cell_x``, ``cell_y``, ``cell_z``. All are texts and numbers, so that
        ``to_netcdf`` and ``to_zarr`` of xarray write them; ``units`` and ``long_name`` are those of a training image of
        xarray. With `region` there is a coordinate ``region`` (y, x) and, unless values are floats, the attribute
        ``missing``. ``plot(number=8)`` draws the first realisations.
    xarray.Dataset
        With `source`: that array is the variable ``simulation``; ``source_row`` and ``source_column`` (realisation, y,
        x), int32, are the row and the column in the training image, counted from 0, that each cell is from. A volume
        adds ``source_layer``, and several training images add ``source_image``, the number of the training image. Cells
        without a source, such as data, have -1. The dataset has the attributes, too.

    Raises
    ------
    ValueError, TypeError
        An argument is invalid; the message names the remedy.

    Notes
    -----
    Cost: n times that of `simdtex.synthesize`, and the memory of n results. Every combination of training image, eighth
    of a turn and size in `rotation`, `scale` and `image_map` is a separate training image, 64 at most. Each takes the
    memory of a further training image and 4 bytes per cell. The time of the coarsest level, which evaluates every
    candidate, is proportional to their number.

    Examples
    --------
    >>> from simdtex.experiments.ensemble import channels
    >>> import simdtex
    >>> training, _ = channels()
    >>> found = simdtex.simulate(training[:64, :64], 2, shape=(32, 40), categorical=True, order=8, rng=1)
    >>> dict(found.sizes)
    {'realisation': 2, 'y': 32, 'x': 40}
    """
    require("simulate", "xarray")
    from simdtex.model.show import Realisations, Results, described

    whole("n", n, 1)
    whole("first", first, 0)
    if jobs is not None:
        whole("jobs", jobs, 1)
    axes = 3 if getattr(training, "ndim", 2) - (channel_axis is not None) == 3 else 2
    sides = ("layers", "rows", "columns")[-axes:]
    if shape is not None:
        within_32_bits(check_sides(shape, sides), 1)
    frame(origin, cell)  # raises early
    pictures = check_samples(training, channel_axis, mask, axes)
    known = None if known is None else as_known(known, pictures=pictures)
    given = {"region": region, "probabilities": probabilities, "image_map": image_map, "rotation": rotation}
    given["scale"] = scale
    flat = ("image_map", "rotation", "scale")
    if axes > 2 and (asked := [name for name in flat if given[name] is not None]):
        raise ValueError(f"{asked[0]} is for training images of two axes; leave it out for a volume")
    maps = Maps(**{name: as_known(one, name) for name, one in given.items() if one is not None})
    size = check_sides((maps.shape(axes) or pictures.pixels[0].shape[:-1]) if shape is None else shape, sides)
    if shape is None and isinstance(known, np.ndarray) and known.ndim == axes + (channel_axis is not None):
        size = known.shape if channel_axis is None else np.moveaxis(known, channel_axis, -1).shape[:-1]
    place = partial(place_hard_data, origin=origin, cell=cell, several=several, outside=outside)
    inputs = check_inputs(pictures, size, channel_axis, None, known, None, guide, place)
    inputs = inputs if region is None else check_region(maps.region, size, inputs)
    missing: Any = None if region is None else missing_value(pictures.pixels)
    chosen = resolve(mrf.Options, "simulate" if axes == 2 else "simulate 3-D", options)
    copies = maps.of_images(pictures, (size[-2], size[-1]))
    if copies and chosen.shares:
        raise ValueError("shares are those of the maps of training images, rotation and scale; leave shares out")
    kinds = chosen.of(pictures)
    check_several(several, known, kinds)
    categories = kinds.categories(0)
    soft = Soft(maps.of_categories(categories, size, place), copies.probability if copies else None)
    sample, guides = inputs.pictures, inputs.guide
    if copies:
        sample = copies.pictures(sample)
        guides = guides and (tuple(one.of(guides[0]) for one in copies.copies), guides[1])
    plan = mrf.plan(sample, size, chosen, inputs.given, guides, soft=soft if soft.rows else None)
    pixels = pictures.pixels[0]
    columns = (axes + (len(pictures.pixels) > 1)) if source else 0
    each = 2 * prod(size) * (pixels.shape[-1] * pixels.dtype.itemsize + 4 * columns)  # realisations are copied once
    memory.require_host(n * (each + 64))
    made = np.empty((n, *size, pixels.shape[-1]), pixels.dtype)
    sources = np.empty((n, *size, columns), np.int32)
    machines = _machines(device, jobs, n)
    finished: list[int] = []
    lock = Lock()

    def identity() -> dict[str, Any]:
        call = {"shape": size, "n": n, "first": first, "options": chosen, "source": source}
        return {**call, **inputs.identity(), **maps.digests()}

    def state() -> dict[str, Any]:
        return {"numbers": list(finished), "pictures": made[finished], "sources": sources[finished]}

    with opened(checkpoint, "simulate", rng, identity, machines[0].name) as (seed, checkpointing):
        seeds = np.array([realisation_seed(seed, first + k) for k in range(n)], np.uint64)
        if checkpointing.found is not None:
            finished += checkpointing.found["numbers"]
            made[finished], sources[finished] = checkpointing.found["pictures"], checkpointing.found["sources"]

        def offer_finished(info: Any, tree: Callable[[], Any]) -> None:
            if isinstance(checkpoint, Checkpoint) and checkpoint.stopping:  # a realisation has no saved state
                with lock:
                    checkpointing.offer(info, state)

        shares = np.zeros(n)
        shares[finished] = 1
        axis, call = None if channel_axis is None else -1, callback or (lambda progress: None)

        def tell(number: int, progress: Any, picture: Any = None) -> None:
            """Report a part of a realisation, or without ``progress`` its end."""
            shares[number] = progress.fraction if progress else 1
            levels = {"level": progress.level if progress else 0, "levels": plan.levels}
            where = {"realisation": first + number, "finished": len(finished), "realisations": n}
            read = (lambda: restored(progress.image(), axis)) if progress else (lambda: restored(picture, axis))
            with lock:
                call(Simulating(fraction=shares.sum() / n, image=read, complete=progress is None, **levels, **where))

        def one(number: int, machine: Machine) -> None:
            told = callback and partial(tell, number)
            picture, output = drive(plan, machine, int(seeds[number]), told, Checkpointing(None, offer_finished))
            if inputs.given and inputs.given.outside is not None:
                picture[inputs.given.outside] = missing
            with lock:
                made[number] = picture
                if source:
                    place: Any = output.source
                    sources[number] = copies.sources(place, columns == 3) if copies else place
                finished.append(number)
                checkpointing.offer(None, state)
            tell(number, None, picture)

        try:
            _in_turn(one, [number for number in range(n) if number not in finished], machines)
        except BaseException:
            checkpointing.offer(None, state, now=True)  # those that wait for their turn
            raise
    dims, arrays = ["realisation", *"zyx"[-axes:], "variable"], made
    if channel_axis is None:
        dims, arrays = dims[:-1], made[..., 0]
    along, sides_of_cells = grid_axes(size, origin, cell)
    coordinates: dict[str, Any] = {"realisation": np.arange(first, first + n), **along, "seed": ("realisation", seeds)}
    attributes = _attributes(seed, chosen, machines[0].name, inputs) | maps.digests()
    if inputs.given and inputs.given.outside is not None:
        coordinates["region"] = (dims[1 : 1 + axes], ~inputs.given.outside)
        attributes |= {} if pixels.dtype.kind == "f" else {"missing": missing.item()}
    attributes |= sides_of_cells | described(training)
    result = Realisations(arrays, coords=coordinates, dims=dims, name="simulation", attrs=attributes)
    if not source:
        return result
    names = (*(("layer",) if axes > 2 else ()), "row", "column", "image")
    lattice = dims[: 1 + axes]
    places = {f"source_{name}": (lattice, sources[..., k]) for k, name in enumerate(names[:columns])}
    return Results({"simulation": result, **places}, attrs=attributes)


def check_several(several: str, known: Any, pictures: Pictures) -> None:
    """Raise if different data of a table in one cell would become a mean of categories."""
    if several == "mean" and isinstance(known, HardData) and any(pictures.categorical or ()):
        raise ValueError("several is 'mean', which invents categories; give 'most', or 'refuse'")


def grid_axes(size: tuple[int, ...], origin: Any, cell: Any) -> tuple[dict[str, Any], dict[str, float]]:
    """Return the coordinates of cells, and the sizes of a cell as attributes; rows and columns without both."""
    at, sides = ((), ()) if origin is None and cell is None else frame(origin, cell)
    found: dict[str, Any] = {axis: np.arange(n) for axis, n in zip("zyx"[-len(size) :], size, strict=True)}
    for axis, first, side in zip("xyz", at, sides, strict=False):
        found[axis] = first + side * found[axis] if axis in found else first
    return found, {f"cell_{axis}": side for axis, side in zip("xyz", sides, strict=False)}


def realisation_seed(seed: int, number: int) -> int:
    """Return the seed of a realisation from the seed of the simulation and the number of the realisation."""
    return int(np.random.SeedSequence(seed, spawn_key=(number,)).generate_state(1, np.uint64)[0])


def _machines(device: str | None, jobs: int | None, n: int) -> list[Machine]:
    first = open_machine(device)
    if jobs is None:
        jobs = 1 if first.kind == "gpu" else min(AT_ONCE, os.cpu_count() or 1)
    return [first, *(open_machine(device) for _ in range(min(jobs, n) - 1))]


def _in_turn(one: Callable[[int, Machine], None], numbers: list[int], machines: list[Machine]) -> None:
    """Call ``one`` for each number on a free machine; the first error ends all calls."""
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


def digests(pictures: Pictures, given: Given | None) -> dict[str, str]:
    """Return the digests of hard data and of the training images, with their unknown pixels completed."""
    found = {"training_image": digest(*pictures.pixels, *(pictures.known or ()))}
    if given and given.told.any():
        found["hard_data"] = digest(np.where(given.told, given.values, 0), given.told)
    return found


def _attributes(seed: int, options: mrf.Options, device: str, inputs: Inputs) -> dict[str, Any]:
    text = json.dumps(
        vars(options), default=lambda value: value.tolist() if isinstance(value, np.generic) else str(value)
    )
    found: dict[str, Any] = {"seed": seed, "version": version("simdtex"), "device": device, "options": text}
    found |= digests(inputs.pictures, inputs.given)
    if inputs.guide:
        found["guide"] = digest(*inputs.guide[0], inputs.guide[1])
    if inputs.pictures.usable:
        found["mask"] = digest(*inputs.pictures.usable)
    return found
