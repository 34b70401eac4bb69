# SPDX-License-Identifier: BSD-3-Clause
"""Random fields that look like a training image and honour data: `simulate`, and `estimate` without a simulation."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from functools import partial
from importlib.metadata import version
from math import prod
from queue import SimpleQueue
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.checkpoint import Checkpoint, Checkpointing, digest
from simdtex.declared import Cells, Estimate, Simulate
from simdtex.driver import check_sides, drive
from simdtex.inputs import Inputs, Placing, check_inputs, check_known
from simdtex.io.hard_data import HardData, place_hard_data
from simdtex.io.places import Place
from simdtex.jobs.inputs import Work, public
from simdtex.jobs.simulation.maps import Maps, check_region, missing_value
from simdtex.machine import Machine, memory, open_machine
from simdtex.methods import mrf
from simdtex.methods.mrf.density import Data, given_data
from simdtex.model.given import Given, Soft
from simdtex.model.pictures import Pictures
from simdtex.model.sample import Sample
from simdtex.options import moderate, require, resolve, whole, within_32_bits
from simdtex.run import Callback, Output, Progress

MOST_TOGETHER = 4
"""The most realisations that run on a processor at the same time, each with its own queue."""


@public("simulate")
def simulate(call: Simulate) -> Work:
    """Return realisations that look like a training image and honour data (multiple-point simulation).

    Returns
    -------
    xarray.DataArray
        Dimensions ``realisation``, ``z`` of a volume, ``y`` (row 0 is the smallest y), ``x`` and, with `channel_axis`,
        ``variable``, in the training image's type. The coordinates ``z``, ``y`` and ``x`` are those of the centres of
        cells; for a picture, a third number of `origin` and `cell` is ``z``. The coordinate ``seed`` is that of each
        realisation: `simdtex.synthesize` with it and the ``options`` returns the same map, unless `region` or a later
        parameter is used.
        Attributes: ``seed``, ``options`` (a JSON text), ``version``, ``device``, SHA-256 digests of the arrays
        ``training_image``, ``hard_data``, ``guide``, ``mask`` and those from `region` to `scale` that are given, and
        with `origin` or `cell` the sizes ``cell_x``, ``cell_y``, ``cell_z``. With `probabilities` or ``proportions``,
        by default those of the training image if there is one variable and no guide, the shares of all realisations are
        ``shares_asked`` and ``shares_reached``. All are texts and numbers, so that ``to_netcdf`` and ``to_zarr`` of
        xarray write them; ``units`` and ``long_name`` are those of a training image of xarray. With `region` there is a
        coordinate ``region`` (y, x) and, unless values are floats, the attribute ``missing``. ``plot(number=8)`` draws
        the first realisations.
    xarray.Dataset
        With `source`: that array is the variable ``simulation``; ``source_row`` and ``source_column`` (realisation, y,
        x), int32, are the row and the column in the training image, counted from 0, that each cell is from. A volume
        adds ``source_layer``, and several training images add ``source_image``, the number of the training image. Cells
        without a source, such as data, have -1. The dataset has the attributes, too.

    Notes
    -----
    Cost: n times that of `simdtex.synthesize`, and the memory of n results. Every combination of training image, eighth
    of a turn and size in `rotation`, `scale` and `image_map` is a separate training image, 64 at most. Each takes the
    memory of a further training image and 4 bytes per cell. The time of the coarsest level, which evaluates every
    candidate, is proportional to their number.

    Examples
    --------
    >>> from simdtex.jobs.simulation.ensemble import channels
    >>> import simdtex
    >>> training, _ = channels()
    >>> found = simdtex.simulate(training[:64, :64], 2, shape=(32, 40), categorical=True, order=8, rng=1)
    >>> dict(found.sizes)
    {'realisation': 2, 'y': 32, 'x': 40}
    """
    require("simulate", "xarray")
    from simdtex.figures.show import Realisations, Results, described

    n, first, axes, pictures, known = call.n, call.first, call.axes, call.training, call.known
    sides = ("layers", "rows", "columns")[-axes:]
    if axes == 2 and isinstance(call.shape, (tuple, list)) and len(call.shape) == 3:
        raise ValueError("shape is of a volume and the training image is a picture; give a training volume")
    if call.shape is not None:
        within_32_bits(check_sides(call.shape, sides), 1)
    maps = call.maps = Maps(**{name: getattr(call, name) for name in Maps._fields})
    size = _like(call) or maps.shape(axes) or pictures.pixels[0].shape[:-1]
    if call.like is None and isinstance(known, np.ndarray) and known.ndim == axes + (call.channel_axis is not None):
        size = known.shape if call.channel_axis is None else np.moveaxis(known, call.channel_axis, -1).shape[:-1]
    size = call.shape = check_sides(size if call.shape is None else call.shape, sides)
    place = placing(call)
    inputs = check_inputs(pictures, size, call.channel_axis, None, known, None, call.guide, place)
    missing: Any = None
    if maps.region is not None:
        inputs, missing = check_region(maps.region, size, inputs), missing_value(pictures.pixels)
    call.inputs = inputs
    chosen = resolve(mrf.Options, "simulate" if axes == 2 else "simulate 3-D", call.options)
    copies = maps.of_images(pictures, size)
    if copies and chosen.shares:
        raise ValueError("shares are those of the maps of training images, rotation and scale; leave shares out")
    sample = copies.pictures(pictures) if copies else pictures
    kinds = chosen.of(sample)
    check_several(call.several, known, kinds)
    categories = kinds.categories(0)
    soft = Soft(maps.of_categories(categories, size, place), copies.probability if copies else None)
    guides = inputs.guide
    if guides and copies:
        guides = tuple(one.of(guides[0]) for one in copies.copies), guides[1]
    told = chosen.proportions or guides or maps.probabilities is not None
    alone = pictures.pixels[0].shape[-1] == 1  # the shares of one of several variables could contradict the others
    if categories is not None and alone and not told:
        images = replace(kinds, shares=soft.shares) if copies else kinds
        chosen = replace(chosen, proportions=tuple(images.proportions().tolist()))
    plan = mrf.plan(sample, size, chosen, inputs.given, guides, soft=soft if soft.rows else None)
    pixels = pictures.pixels[0]
    columns = (axes + (len(pictures.pixels) > 1)) if call.source else 0
    each = 2 * prod(size) * (pixels.shape[-1] * pixels.dtype.itemsize + 4 * columns)  # realisations are copied once
    memory.require_host(n * (each + 64))
    made = np.empty((n, *size, pixels.shape[-1]), pixels.dtype)
    sources = np.empty((n, *size, columns), np.int32)
    finished: list[int] = []
    lock = Lock()

    def state() -> dict[str, Any]:
        return {"numbers": list(finished), "pictures": made[finished], "sources": sources[finished]}

    def run(
        machine: Machine, seed: int, callback: Callback | None, checkpointing: Checkpointing
    ) -> tuple[NDArray[Any], Output]:
        machines = [machine, *(open_machine(call.device) for _ in range(_together(machine, call.jobs, n) - 1))]
        if checkpointing.found is not None:
            finished.extend(checkpointing.found["numbers"])
            made[finished], sources[finished] = checkpointing.found["pictures"], checkpointing.found["sources"]
        shares = np.zeros(n)
        shares[finished] = 1

        def offer_finished(info: Any, tree: Callable[[], Any]) -> None:
            if isinstance(call.checkpoint, Checkpoint) and call.checkpoint.stopping:  # a realisation has no saved state
                with lock:
                    checkpointing.offer(info, state)

        def tell(number: int, progress: Progress) -> None:
            shares[number] = progress.fraction
            with lock:
                if callback:
                    doing = f"{len(finished)} of {n} realisations finished"
                    about = {"realisation": first + number, "finished": len(finished), "realisations": n}
                    callback(replace(progress, fraction=shares.sum() / n, doing=doing, details=about))

        def one(number: int, machine: Machine) -> None:
            told = callback and (
                lambda progress: tell(number, replace(progress, stage=None, source=None, explain=None))
            )
            own = Checkpointing(None, offer_finished)
            picture, output = drive(plan, machine, realisation_seed(seed, first + number), told, own)
            if inputs.given and inputs.given.outside is not None:
                picture[inputs.given.outside] = missing
            with lock:
                made[number] = picture
                if call.source:
                    at: Any = output.source
                    sources[number] = copies.sources(at, columns > axes) if copies else at
                finished.append(number)
                checkpointing.offer(None, state)
            name = f"realisation{first + number:04d}"
            tell(number, Progress(levels=plan.levels, fraction=1.0, doing="", stage=name, image=lambda: picture))

        try:
            _in_turn(one, [number for number in range(n) if number not in finished], machines)
        except BaseException:
            checkpointing.offer(None, state, now=True)  # those that wait for their turn
            raise
        return made, Output(None, statistics={"seed": seed, "device": machine.name})

    def finish(arrays: NDArray[Any], output: Output) -> Any:
        dims = ["realisation", *"zyx"[-axes:], "variable"][: arrays.ndim]
        along, sides_of_cells = grid_axes(size, call.place)
        seed = output.statistics["seed"]
        seeds = np.array([realisation_seed(seed, first + k) for k in range(n)], np.uint64)
        coordinates: dict[str, Any] = {"realisation": np.arange(first, first + n), **along}
        coordinates["seed"] = ("realisation", seeds)
        attributes = _attributes(output.statistics, chosen, inputs) | maps.digests()
        if inputs.given and inputs.given.outside is not None:
            coordinates["region"] = (dims[1 : 1 + axes], ~inputs.given.outside)
            attributes |= {} if pixels.dtype.kind == "f" else {"missing": missing.item()}
        if categories is not None and plan.kinds and plan.kinds.categories is not None:
            p = np.broadcast_to(plan.kinds.categories, (len(categories), *size))
            there = ~np.isnan(p[0])
            if inputs.given and inputs.given.outside is not None:
                there &= ~inputs.given.outside
            told = arrays.reshape(n, *size, -1)[:, there, 0]
            asked = np.array(chosen.proportions or p[:, there].sum(1))
            reached = np.array([(told == one).sum() for one in categories])
            for name, those in (("asked", asked), ("reached", reached)) if told.size else ():
                attributes[f"shares_{name}"] = " ".join(f"{one:.3f}" for one in those / those.sum())
        attributes |= sides_of_cells | described(call.given, known)
        made = Realisations(arrays, coords=coordinates, dims=dims, name="simulation", attrs=attributes)
        result = georeferenced(made, call.place)
        if not call.source:
            return result
        names = (*(("layer",) if axes > 2 else ()), "row", "column", "image")
        lattice = dims[: 1 + axes]
        places = {f"source_{name}": (lattice, sources[..., k]) for k, name in enumerate(names[:columns])}
        return Results({"simulation": result, **places}, attrs=result.attrs)

    return Work(run, chosen, None if call.channel_axis is None else -1, finish)


@public("estimate")
def estimate(call: Estimate) -> Work:
    """Return the probability of each category at each cell given data, or mean and variance: the LCPDF.

    Returns
    -------
    xarray.Dataset
        Dimensions ``z`` of a volume, ``y`` and ``x``, with coordinates as in `simdtex.simulate`. With `categorical` the
        variables ``probability`` (category, [z,] y, x), float64, which adds up to 1, and ``entropy`` ([z,] y, x) in
        bits; else ``mean`` and ``variance`` in the units of the training image. A cell with a datum has its value with
        certainty.
        ``plot()`` draws the maps.

    Notes
    -----
    Equations (6), (7) and (12): neighbours without data have t = 1, so they have no weight, and each datum is compared
    at its own offset from the cell. h is that of equation (8) for this number of data. The result has no sampling
    noise, and the same bits on every device. Cost: cells x pixels of the training image x `nearest` fma.

    Examples
    --------
    >>> import numpy as np, simdtex
    >>> training = np.tile([0, 0, 0, 1], (32, 8))
    >>> known = np.full((4, 6), np.nan)
    >>> known[2, 1] = 1
    >>> found = simdtex.estimate(training, known=known, categorical=True)
    >>> found.probability.sel(category=1)[2].values.round(2).tolist()
    [0.0, 1.0, 0.0, 0.0, 0.0, 0.88]
    """
    require("simulate", "xarray")
    from simdtex.figures.show import Results, described

    categorical, nearest, axes = call.categorical, call.nearest, call.axes
    pictures = mrf.Options(categorical=categorical).of(call.training)
    least = min(min(one.shape[-3:-1]) for one in pictures.pixels)
    reach = least // 8 if call.reach is None else call.reach
    whole("reach", reach, 0, least - 1)
    known, size = call.known, _like(call) or pictures.pixels[0].shape[:-1]
    if known is None:
        raise ValueError("an estimate requires data; give known")
    if call.like is None and isinstance(known, np.ndarray) and known.ndim == axes:
        size = known.shape
    size = check_sides(size if call.shape is None else call.shape, ("layers", "rows", "columns")[-axes:])
    along, sides_of_cells = grid_axes(size, call.place)
    check_several(call.several, known, pictures)
    given = check_known(known, size, None, pictures, place=placing(call))
    mrf.check_categories(pictures, given)
    if not categorical:
        moderate("the training image", *pictures.pixels)
    sample = Sample(pictures, pictures.channels * (nearest + 1), reach)
    positions = sample.places(np.zeros((1, axes), np.int32), 1).positions
    own = sample.own(positions)[:, 0]
    names, of = np.unique(own if categorical else sample.working[0, positions], return_inverse=True)
    data = Data(np.argwhere(given.whole), sample.scale.levels(given.values[given.whole]).T)

    def run(
        machine: Machine, seed: int, callback: Callback | None, checkpointing: Checkpointing
    ) -> tuple[NDArray[Any], Output]:
        memory.require(machine, 0, 8 * prod(size) * ((len(names) if categorical else 0) + 4))
        sites = np.argwhere(np.ones(size, bool))
        rows = given_data(machine, sample, of, data, sites, nearest, call.bandwidth)
        found, done = np.full((len(names) if categorical else 2, prod(size)), np.nan), 0
        for here, probability in rows:
            found[:, here] = probability.T if categorical else _moments(probability, of, own)
            done += here.size
            if callback:
                now, doing = found.T.reshape(*size, -1).copy, f"{done} of {len(sites)} cells"
                callback(Progress(fraction=done / len(sites), doing=doing, image=now))
        told = given.values[given.whole][:, 0]
        certain = names[:, None] == told if categorical else np.stack([told, np.zeros(len(told))])
        found[:, given.whole.ravel()] = certain
        return found.T.reshape(*size, -1), Output(None, statistics={"device": machine.name})

    def finish(found: NDArray[Any], output: Output) -> Any:
        dims, maps = tuple("zyx"[-axes:]), np.moveaxis(found, -1, 0)
        units = {"units": about["units"]} if "units" in (about := described(call.given)) else {}
        variables: dict[str, Any] = {
            "mean": (dims, maps[0], units),
            "variance": (dims, maps[1], {name: f"({unit})\u00b2" for name, unit in units.items()}),
        }
        if categorical:
            entropy = 0 - (maps * np.log2(np.where(maps > 0, maps, 1))).cumsum(0)[-1]
            variables = {"probability": (("category", *dims), maps), "entropy": (dims, entropy)}
            along["category"] = names
        attributes = {
            **{"version": version("simdtex"), "device": output.statistics["device"], "nearest": nearest},
            **{"reach": reach, "bandwidth": call.bandwidth, **digests(pictures, given), **sides_of_cells},
        }
        return georeferenced(Results(variables, along, attributes), call.place)

    return Work(run, None, -1, finish)


def _like(call: Simulate | Estimate) -> tuple[int, ...] | None:
    """Return the sides of ``like``, which gives the output's; None without."""
    if call.like is None:
        return None
    if not hasattr(call.like, "sizes") or call.place is None or not {"x", "y"} <= {*call.like.sizes}:
        raise ValueError("like has no coordinates x and y; give an array of xarray that has, or shape, origin and cell")
    size = tuple(call.like.sizes.get(axis, 1) for axis in "zyx"[-call.axes :])
    if call.shape is not None and tuple(call.shape) != size:
        raise ValueError(f"shape is {call.shape} and like has {size}; leave shape out")
    return size


def georeferenced(made: Any, place: Place | None) -> Any:
    """Return an array or dataset of xarray with its coordinate reference system and its units, if known, as in CF."""
    if place is None or not place.crs:
        return made
    found = made.assign_coords(spatial_ref=((), 0, {"crs_wkt": place.crs})).assign_attrs(crs=place.crs)
    with suppress(ImportError):  # the extra rasters
        from rasterio.crs import CRS

        system = CRS.from_wkt(place.crs)
        unit = {"metre": "m"}.get(system.units_factor[0], system.units_factor[0])
        for axis, degrees in (("x", "longitude degrees_east"), ("y", "latitude degrees_north")):
            if axis in found.coords:
                named = degrees.split() if system.is_geographic else (f"projection_{axis}_coordinate", unit)
                found[axis].attrs = dict(zip(("standard_name", "units"), named, strict=True)) | found[axis].attrs
    for one in found.data_vars.values() if hasattr(found, "data_vars") else [found]:
        one.attrs["grid_mapping"] = "spatial_ref"  # in the encoding, xarray reads it as a variable of data
    return found


def check_several(several: str, known: Any, pictures: Pictures) -> None:
    """Raise if different data of a table in one cell would become a mean of categories."""
    if several == "mean" and isinstance(known, HardData) and any(pictures.categorical or ()):
        raise ValueError("several is 'mean', which invents categories; give 'most', or 'refuse'")


def grid_axes(size: tuple[int, ...], place: Place | None) -> tuple[dict[str, Any], dict[str, float]]:
    """Return the coordinates of cells and the sizes of a cell as attributes; without a place, columns and rows."""
    at, sides = place.frame if place else ((), ())
    found: dict[str, Any] = {axis: np.arange(n) for axis, n in zip("zyx"[-len(size) :], size, strict=True)}
    for axis, first, side in zip("xyz", at, sides, strict=False):
        values, about = first + side * found.get(axis, 0), place.about.get(axis, {}) if place else {}
        found[axis] = ((axis,) if axis in found else (), values, about)
    return found, {f"cell_{axis}": side for axis, side in zip("xyz", sides, strict=False)}


def realisation_seed(seed: int, number: int) -> int:
    """Return the seed of a realisation from the seed of the simulation and the number of the realisation."""
    return int(np.random.SeedSequence(seed, spawn_key=(number,)).generate_state(1, np.uint64)[0])


def placing(call: Cells) -> Placing:
    """Return a function that places a table of data in the cells of a call."""
    return partial(place_hard_data, origin=call.origin, cell=call.cell, several=call.several, outside=call.outside)


def _together(machine: Machine, jobs: int | None, n: int) -> int:
    """Return how many realisations are made at a time."""
    if jobs is None:
        jobs = 1 if machine.kind == "gpu" else min(MOST_TOGETHER, os.cpu_count() or 1)
    return min(jobs, n)


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
    if given and given.given_mask.any():
        found["hard_data"] = digest(np.where(given.given_mask, given.values, 0), given.given_mask)
    return found


def _attributes(statistics: dict[str, Any], options: mrf.Options, inputs: Inputs) -> dict[str, Any]:
    text = json.dumps(
        vars(options), default=lambda value: value.tolist() if isinstance(value, np.generic) else str(value)
    )
    found: dict[str, Any] = {"seed": statistics["seed"], "version": version("simdtex")}
    found |= {"device": statistics["device"], "options": text}
    found |= digests(inputs.pictures, inputs.given)
    if inputs.guide:
        found["guide"] = digest(*inputs.guide[0], inputs.guide[1])
    if inputs.pictures.usable:
        found["mask"] = digest(*inputs.pictures.usable)
    return found


def _moments(
    probability: NDArray[np.float64], of: NDArray[np.integer], own: NDArray[Any]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return mean and variance of sites, (S,), from the probability of each level, (S, levels)."""
    values = own.astype(np.float64)
    count = np.bincount(of)
    level = np.bincount(of, values) / count
    within = np.bincount(of, (values - level[of]) ** 2) / count
    mean = (probability * level).cumsum(1)[:, -1]
    return mean, (probability * (within + (level - mean[:, None]) ** 2)).cumsum(1)[:, -1]
