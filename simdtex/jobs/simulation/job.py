# SPDX-License-Identifier: BSD-3-Clause
"""Random fields that look like a training image and honour data: `simulate`, and `estimate` without a simulation."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from importlib.metadata import version
from math import prod
from queue import SimpleQueue
from threading import Lock
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex.checkpoint import Checkpointing, digest
from simdtex.driver import Device, Kept, Seed, drive, run
from simdtex.inputs import check_inputs, check_known
from simdtex.io.hard_data import HardData
from simdtex.io.places import Location
from simdtex.jobs.simulation import maps, shares
from simdtex.jobs.simulation.maps import Cells, digests, georeferenced, grid_axes, plan_cells
from simdtex.jobs.simulation.shares import Spread
from simdtex.machine import Machine, memory, open_machine
from simdtex.methods import mrf
from simdtex.methods.mrf.density import given_data
from simdtex.model.given import Given, Soft
from simdtex.model.guide import GuidePair
from simdtex.model.light import Light
from simdtex.model.pictures import Pictures, Turned
from simdtex.model.sample import Sample
from simdtex.options import moderate, real, resolve, true_or_false, whole
from simdtex.run import Callback, Output, Progress

MOST_TOGETHER = 4
"""The most realisations that run on a processor at the same time, each with its own queue."""


def simulate(
    training: ArrayLike | Sequence[ArrayLike],
    n: int,
    *,
    mask: ArrayLike | Sequence[ArrayLike] | None = None,
    known: ArrayLike | HardData | str | os.PathLike[str] | None = None,
    origin: Sequence[float] | None = None,
    cell: Sequence[float] | None = None,
    like: Any = None,
    several: Literal["refuse", "mean", "most"] = "refuse",
    outside: Literal["refuse", "skip"] = "refuse",
    guide: tuple[Any, Any] | None = None,
    first: int = 0,
    shape: tuple[int, ...] | None = None,
    region: ArrayLike | None = None,
    probabilities: ArrayLike | HardData | str | os.PathLike[str] | None = None,
    image_map: ArrayLike | None = None,
    rotation: ArrayLike | None = None,
    scale: ArrayLike | None = None,
    source: bool = False,
    jobs: int | None = None,
    channel_axis: int | None = None,
    rng: Seed = None,
    device: Device = None,
    callback: Callback | None = None,
    checkpoint: Kept = None,
    **options: Any,
) -> Any:
    """Return realisations that look like a training image and honour data (multiple-point simulation).

    Parameters
    ----------
    training : (rows, cols) or (layers, rows, cols) array, or a list of such
        The training image, a picture or a volume; unknown values are NaN. With ``categorical=True`` its values are
        categories. With `channel_axis` it has one more axis, for variables.
    n : int, 1 or more
        Make this many realisations.
    mask : (rows, cols) bool array, or a list of such, optional
        True for pixels of the training image that may be taken; all other pixels are still neighbours.
    known : array of `shape` (and the channel axis), HardData, pandas.DataFrame or path, optional
        Conditioning data as in `simdtex.synthesize`: values of the output, which do not change by a bit.
    origin : (x, y) or (x, y, z), optional
        The centre of the first cell, in the units of the table and of the result. None: see `like`, else 0.
    cell : (x, y) or (x, y, z), optional
        The size of a cell. None: see `like`, else 1; without both, coordinates are columns and rows.
    like : array or dataset of xarray, optional
        An array with coordinates y and x: the output has its origin, cells and coordinate reference system. None: those
        of `known` and the maps that are arrays of xarray, which have to lie at one place; else `origin` and `cell`;
        else those of such a training image.
    several : {"refuse", "mean", "most"}
        Of different data of a table in one cell take none, but raise; their mean, if they are no categories; or the
        most frequent. See `simdtex.place_hard_data`.
    outside : {"refuse", "skip"}
        Treat data of a table outside of the cells as an error (refuse), or leave them out (skip).
    guide : (array, array), optional
        Two pictures or volumes, of the training image's size and of the output's, as in `simdtex.synthesize`.
    first : int, 0 or more
        Start with the realisation of this number.
    shape : (int, int) or (int, int, int), optional
        Rows and columns of each realisation, or layers, rows and columns. None: those of `like`, `known`, or of the
        first map below, if that is an array, else of the training image.
    region : (rows, cols) or (layers, rows, cols) bool array, optional
        True for cells that are simulated. All other cells have no value: NaN in floats, else the attribute
        ``missing``.
    probabilities : (categories, rows, cols) array, or table or its path, optional
        Soft data, of a volume (categories, layers, rows, cols): the probability at each cell of each category of the
        first variable, in ascending order of category; the sum is 1, and unknown probabilities are NaN. A table has the
        columns x, y, and one for each category. See `soft_weight`.
    image_map : ([layers,] rows, cols) or (training images, [layers,] rows, cols) array, optional
        The number, from 0, of the training image of each cell, or the weight of each training image at each cell. NaN:
        any training image.
    rotation : ([layers,] rows, cols) array, optional
        Rotation of the training image at each cell, of a volume about z, in degrees from x to y (from columns to rows),
        rounded to eighths of a turn. NaN: any rotation of another cell.
    scale : ([layers,] rows, cols) array, optional
        Factor by which all axes of the training image are enlarged at each cell, 1/2 to 2, rounded to powers of the
        square root of 2. NaN: any factor of another cell.
    source : bool
        Return the position in the training image of each cell of each realisation too.
    jobs : int, 1 or more, optional
        Make this many realisations at a time. None: one for each core, at most 4; on a GPU 1.
    channel_axis : int, optional
        The axis of training images that holds variables; None for a single one.
    rng : int or numpy.random.Generator, optional
        The seed: the same one gives the same bytes on every device. None draws one at random.
    device : str or Machine, optional
        Part of a name, index of ``simdtex devices``, or ``"reference"``. None: SIMDTEX_DEVICE, else a GPU, else a CPU.
    callback : callable, optional
        Called several times a second with a `simdtex.run.Progress`; an error that it raises ends the run.
    checkpoint : path or simdtex.Checkpoint, optional
        Keep the state of the run in this file, from which the same call continues it; removed when the run has ended.
    **options
        Those of the method, see `simdtex.methods.mrf.Options`.

    Returns
    -------
    xarray.DataArray
        Dimensions ``realisation``, ``z`` of a volume, ``y`` (row 0 is the smallest y), ``x`` and, with `channel_axis`,
        ``variable``, in the training image's type. The coordinates ``z``, ``y`` and ``x`` are those of the centres of
        cells; for a picture, a third number of `origin` and `cell` is ``z``. The coordinate ``seed`` is that of each
        realisation: `simdtex.synthesize` with it, the ``options`` and the shares below as ``proportions`` returns the
        same map, unless there are data, or `region` or a later parameter is used.
        Attributes, texts and numbers that xarray can write: ``seed``, ``options`` (a JSON text), ``version``,
        ``device``; SHA-256 digests of ``training_image``, ``hard_data``, ``guide``, ``mask`` and the maps from `region`
        to `scale`; with `origin` or `cell` the sizes ``cell_x``, ``cell_y``, ``cell_z``; ``units`` and ``long_name`` of
        a training image of xarray. With one variable and no guide, the coordinates ``share_0``, ... named by the
        categories, or by the greatest values of classes of values, are the shares that each realisation aims at
        (``share_spread``). ``shares_asked`` and ``shares_reached`` are the means of all realisations, also with
        ``proportions`` or `probabilities`.
        With `region` there is a coordinate ``region`` (y, x) and, unless values are floats, the attribute ``missing``.
        ``plot(number=8)`` draws the first realisations.
    xarray.Dataset
        With `source`: that array is the variable ``simulation``; ``source_row`` and ``source_column``, of a volume also
        ``source_layer``, int32, are where in the training image each cell is from, counted from 0, and
        ``source_image`` is the number of several training images. Cells without a source, such as data, have -1.

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
    >>> from simdtex.jobs.simulation.ensemble import channels
    >>> import simdtex
    >>> training, _ = channels()
    >>> found = simdtex.simulate(training[:64, :64], 2, shape=(32, 40), categorical=True, order=8, rng=1)
    >>> dict(found.sizes)
    {'realisation': 2, 'y': 32, 'x': 40}
    """
    given = {"like": like, "known": known, "guide": guide, "mask": mask, "region": region}
    given |= {"probabilities": probabilities, "image_map": image_map, "rotation": rotation, "scale": scale}
    place: Any = {"origin": origin, "cell": cell, "several": several, "outside": outside}
    cells = plan_cells(training, shape, given, channel_axis, **place)
    job = plan_simulation(cells, n, first, source, jobs, **options)
    values, output = run("simulate", job, rng, device, callback, checkpoint)
    return job.result(values, output)


def plan_simulation(
    cells: Cells, n: int, first: int = 0, source: bool = False, jobs: int | None = None, **options: Any
) -> Simulation:
    """Check the arguments of `simulate`, of which ``cells`` has those on the training image, and return its job."""
    whole("n", n, 1)
    whole("first", first, 0)
    true_or_false("source", source)
    if jobs is not None:
        whole("jobs", jobs, 1)
    pictures, size, arrays = cells.training, cells.size, cells.given
    inputs = check_inputs(pictures, size, cells.channel_axis, None, arrays["known"], None, arrays["guide"], cells.put)
    missing: Any = None
    if arrays["region"] is not None:
        inputs, missing = maps.check_region(arrays["region"], size, inputs), maps.missing_value(pictures.pixels)
    kind = ("simulate" if len(size) == 2 else "simulate 3-D") + " values" * (options.get("categorical") is not True)
    chosen = resolve(mrf.Options, kind, options, simulate)
    copies, training, guide = maps.copies_of(arrays, pictures, size), pictures, inputs.guide
    if copies:
        if chosen.shares:
            raise ValueError("shares are those of the maps of training images, rotation and scale; leave shares out")
        training = copies.pictures(pictures)
        guide = guide and (tuple(copy.of(guide[0]) for copy in copies.copies), guide[1])
    kinds = chosen.of(training)
    cells.check_several(kinds)
    categories = kinds.categories(0)
    probabilities = maps.of_categories(arrays["probabilities"], categories, size, cells.put)
    soft = Soft(probabilities, copies.probability if copies else None)
    alone = pictures.pixels[0].shape[-1] == 1  # the shares of one of several variables could contradict the others
    spread: Spread | None = None
    asked = probabilities is None or (chosen.soft_weight and not np.isnan(probabilities).all())
    if (categories is not None or chosen.scores) and alone and asked and not (chosen.proportions or guide):
        images = replace(kinds, shares=soft.shares) if copies else kinds
        of = [copy.image for copy in copies.copies] if copies else range(len(pictures.pixels))
        distinct = [of.index(image) for image in sorted(set(of))]
        spread = shares.spread(images, distinct, probabilities, size, inputs.given, chosen.share_spread)
    shas = digests(pictures, inputs.given)
    if inputs.guide:
        shas["guide"] = digest(*inputs.guide[0], inputs.guide[1])
    if pictures.usable:
        shas["mask"] = digest(*pictures.usable)
    parts = (training, inputs.given, guide, soft, copies, source, chosen, spread)
    axis = None if cells.channel_axis is None else -1
    of_maps = maps.digests_of_maps(arrays)
    return Simulation(of_maps, n, first, size, *parts, cells._replace(given={}), shas, missing, jobs, axis)


@dataclass(frozen=True)
class Simulation:
    """The job of `simulate`: a run of one plan for each realisation; ``training`` and ``guide`` have the ``copies``."""

    maps: dict[str, str]
    n: int
    first: int
    shape: tuple[int, ...]
    training: Pictures
    known: Given | None
    guide: GuidePair | None
    soft: Soft
    copies: Turned | None
    source: bool
    options: mrf.Options
    spread: Spread | None = field(compare=False)
    cells: Cells = field(compare=False)
    digests: dict[str, str] = field(compare=False)
    missing: Any = field(compare=False)
    jobs: int | None = field(compare=False)
    channel_axis: int | None = field(compare=False)
    light: Light = field(default=Light(), compare=False)

    @property
    def outside(self) -> NDArray[np.bool_] | None:
        """Cells that take no part; None without a region."""
        return self.known.outside if self.known else None

    @property
    def sources(self) -> tuple[str, ...]:
        """The columns of the source map; empty if there is none."""
        names = (*("layer", "row", "column")[-len(self.shape) :], "image")
        return names[: len(self.shape) + (len(self.cells.training.pixels) > 1)] if self.source else ()

    def plan(self) -> mrf.MrfPlan:
        """Return the plan of all runs."""
        soft = self.soft if self.soft.rows else None
        return mrf.plan(self.training, self.shape, self.options, self.known, self.guide, soft=soft)

    def make(
        self, machine: Machine, seed: int, callback: Callback | None, checkpointing: Checkpointing
    ) -> tuple[NDArray[Any], Output]:
        """Make all realisations, and return them; the source of the output is that of all."""
        batch = Batch(self, seed, callback, checkpointing)
        left = [n for n in range(self.n) if n not in batch.finished]
        usual = 1 if machine.kind == "gpu" else min(MOST_TOGETHER, os.cpu_count() or 1)
        together = min(self.jobs or usual, self.n)
        # each has a queue, but a profile is of a single machine
        info: Any = machine if machine.seconds is not None else getattr(machine, "info", "reference")
        for free in (machine, *(open_machine(info) for _ in range(together - 1))):
            batch.free.put(free)
        try:
            with ThreadPoolExecutor(together) as workers:
                list(workers.map(batch.make, left))  # the first error cancels those that wait
        except BaseException:
            checkpointing.offer(None, batch.state, now=True)  # those that wait for their turn
            raise
        statistics = {"seed": seed, "device": machine.name, "shares": self.shares(batch), "aims": batch.aims}
        return batch.values, Output(batch.sources, statistics=statistics)

    def shares(self, batch: Batch) -> dict[str, str]:
        """Return the shares of categories, or of classes of values, that were asked and reached, as attributes."""
        kinds = batch.plan.kinds
        if not (self.spread or (kinds and kinds.categories is not None)):
            return {}
        classes = self.options.of(self.training).classes
        p = np.broadcast_to(
            1.0 if kinds is None or kinds.categories is None else kinds.categories, (len(classes), *self.shape)
        )
        there = ~np.isnan(p[0])
        if self.outside is not None:
            there &= ~self.outside
        made = batch.values[:, there, 0]
        if not made.size:
            return {}
        asked = np.array(self.options.proportions or p[:, there].sum(1)) if batch.aims is None else batch.aims.sum(0)
        reached = np.bincount(np.searchsorted(classes, made).ravel(), minlength=len(classes))[: len(classes)]
        both = {"shares_asked": asked, "shares_reached": reached}
        return {name: " ".join(f"{share:.3f}" for share in those / those.sum()) for name, those in both.items()}

    def result(self, values: NDArray[Any], output: Output) -> Any:
        """Return the array or dataset of xarray."""
        from simdtex.figures.show import Realisations, Results

        lattice = ["realisation", *"zyx"[-len(self.shape) :]]
        dims, numbers = [*lattice, "variable"][: values.ndim], range(self.first, self.first + self.n)
        along, sides = grid_axes(self.shape, self.cells.place)
        seed, device, shares = (output.statistics[name] for name in ("seed", "device", "shares"))
        seeds = np.array([realisation_seed(seed, n) for n in numbers], np.uint64)
        coordinates: dict[str, Any] = {"realisation": np.array(numbers), **along, "seed": ("realisation", seeds)}
        if self.spread:
            aims = zip(self.options.of(self.training).classes, output.statistics["aims"].T, strict=True)
            coordinates |= {f"share_{name:g}": ("realisation", column) for name, column in aims}
        attributes = {"seed": seed, "version": version("simdtex"), "device": device}
        attributes["options"] = json.dumps(
            vars(self.options), default=lambda value: value.tolist() if isinstance(value, np.generic) else str(value)
        )
        attributes |= self.digests | self.maps
        if self.outside is not None:
            coordinates["region"] = (lattice[1:], ~self.outside)
            attributes |= {} if values.dtype.kind == "f" else {"missing": self.missing.item()}
        attributes |= shares | sides | self.cells.about
        made = Realisations(values, coords=coordinates, dims=dims, name="simulation", attrs=attributes)
        placed = georeferenced(made, self.cells.place)
        if not self.source:
            return placed
        assert output.source is not None
        places = {f"source_{name}": (lattice, output.source[..., k]) for k, name in enumerate(self.sources)}
        return Results({"simulation": placed, **places}, attrs=placed.attrs)


class Batch:
    """The realisations of a run; threads make one each at a time on the ``free`` machines."""

    def __init__(self, job: Simulation, seed: int, callback: Callback | None, checkpointing: Checkpointing) -> None:
        self.job, self.callback, self.checkpointing = job, callback, checkpointing
        self.plan, self.free = job.plan(), SimpleQueue[Machine]()
        pixels, columns = job.training.pixels[0], len(job.sources)
        values = prod(job.shape) * (pixels.shape[-1] * pixels.dtype.itemsize + 4 * columns)
        memory.require_host(job.n * (2 * values + 64))  # realisations are copied once
        self.values = np.empty((job.n, *job.shape, pixels.shape[-1]), pixels.dtype)
        self.sources = np.empty((job.n, *job.shape, columns), np.int32)
        self.finished: list[int] = []
        self.fractions, self.lock = np.zeros(job.n), Lock()
        self.seeds = [realisation_seed(seed, job.first + number) for number in range(job.n)]
        self.aims = np.array([job.spread.draw(each) for each in self.seeds]) if job.spread else None
        if checkpointing.found is not None:
            self.finished += checkpointing.found["numbers"]
            self.values[self.finished] = checkpointing.found["pictures"]
            self.sources[self.finished] = checkpointing.found["sources"]
            self.fractions[self.finished] = 1

    def state(self) -> dict[str, Any]:
        """Return the finished realisations, as plain arrays."""
        done = self.finished
        return {"numbers": list(done), "pictures": self.values[done], "sources": self.sources[done]}

    def make(self, number: int) -> None:
        """Make a realisation on a free machine."""
        job, nested, machine = self.job, Checkpointing(None, self._offer), self.free.get()
        told, plan = self.callback and partial(self._tell, number), self.plan
        if job.spread and self.aims is not None:
            plan = job.spread.on(plan, self.aims[number])
        try:
            picture, output = drive(plan, machine, self.seeds[number], told, nested)
        finally:
            self.free.put(machine)
        if job.outside is not None:
            picture[job.outside] = job.missing
        with self.lock:
            self.values[number] = picture
            if job.source:
                at: Any = output.source
                self.sources[number] = job.copies.sources(at, "image" in job.sources) if job.copies else at
            self.finished.append(number)
            self.checkpointing.offer(None, self.state)
        if self.callback:
            done = Progress(levels=self.plan.levels, fraction=1.0, doing="", image=lambda: picture)
            self._tell(number, done, f"realisation{job.first + number:04d}")

    def _offer(self, info: Any, tree: Callable[[], Any]) -> None:
        """Offer the state after a step of a realisation, which itself has no saved state, if the run is to stop."""
        if self.checkpointing.stopping():
            with self.lock:
                self.checkpointing.offer(info, self.state)

    def _tell(self, number: int, progress: Progress, stage: str | None = None) -> None:
        """Call back with the progress of all realisations; ``stage`` is the name of one that is complete."""
        assert self.callback
        self.fractions[number] = progress.fraction
        n = self.job.n
        with self.lock:
            finished = len(self.finished)
            about = {"realisation": self.job.first + number, "finished": finished, "realisations": n}
            doing, fraction = f"{finished} of {n} realisations finished", self.fractions.sum() / n
            more: Any = {"stage": stage, "source": None, "explain": None, "details": about}
            self.callback(replace(progress, fraction=fraction, doing=doing, **more))


def realisation_seed(seed: int, number: int) -> int:
    """Return the seed of a realisation from the seed of the simulation and the number of the realisation."""
    return int(np.random.SeedSequence(seed, spawn_key=(number,)).generate_state(1, np.uint64)[0])


def estimate(
    training: ArrayLike | Sequence[ArrayLike],
    *,
    mask: ArrayLike | Sequence[ArrayLike] | None = None,
    known: ArrayLike | HardData | str | os.PathLike[str] | None = None,
    origin: Sequence[float] | None = None,
    cell: Sequence[float] | None = None,
    like: Any = None,
    several: Literal["refuse", "mean", "most"] = "refuse",
    outside: Literal["refuse", "skip"] = "refuse",
    shape: tuple[int, ...] | None = None,
    categorical: bool = False,
    nearest: int = 8,
    reach: int | None = None,
    bandwidth: float = 1.0,
    device: Device = None,
    callback: Callback | None = None,
) -> Any:
    """Return the probability of each category at each cell given data, or mean and variance: the LCPDF.

    Parameters
    ----------
    training : (rows, cols) or (layers, rows, cols) array, or a list of such
        The training image, as in `simdtex.simulate`; one variable.
    known : array of `shape`, HardData, pandas.DataFrame or path
        The data, as in `simdtex.simulate`.
    shape : (int, int) or (int, int, int), optional
        [Layers,] rows and columns of the result. None: those of `known` if an array, else of the training image.
    mask, origin, cell, like, several, outside, device, callback
        As in `simdtex.simulate`.
    categorical : bool
        Treat values as categories.
    nearest : int, 0 to 64
        Use this many data for each cell, the nearest.
    reach : int, 0 or more, optional
        Use data up to this many cells away. None: an eighth of the smaller of rows and columns of `training`.
    bandwidth : float, above 0
        h in units of h_opt, equation (8).

    Returns
    -------
    xarray.Dataset
        Dimensions ``z`` of a volume, ``y`` and ``x``, with coordinates as in `simdtex.simulate`. With `categorical` the
        variables ``probability`` (category, [z,] y, x), float64, which adds up to 1, and ``entropy`` ([z,] y, x) in
        bits; else ``mean`` and ``variance`` in the units of the training image. A cell with a datum has its value with
        certainty.
        ``plot()`` draws the maps.

    Raises
    ------
    ValueError, TypeError
        An argument is invalid; the message names the remedy.

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
    given = {"like": like, "known": known, "mask": mask}
    cells = plan_cells(training, shape, given, origin=origin, cell=cell, several=several, outside=outside)
    job = plan_estimation(cells, categorical, nearest, reach, bandwidth)
    return job.result(*run("estimate", job, None, device, callback, None))


def plan_estimation(
    cells: Cells, categorical: bool = False, nearest: int = 8, reach: int | None = None, bandwidth: float = 1.0
) -> Estimation:
    """Check the arguments of `estimate`, of which ``cells`` has those on the training image, and return its job."""
    true_or_false("categorical", categorical)
    whole("nearest", nearest, 0, 64)
    real("bandwidth", bandwidth, 0, above=True)
    options = mrf.Options(categorical=categorical)
    training = options.of(cells.training)
    least = min(min(picture.shape[-3:-1]) for picture in training.pixels)
    reach = least // 8 if reach is None else reach
    whole("reach", reach, 0, least - 1)
    if cells.given["known"] is None:
        raise ValueError("an estimate requires data; give known")
    cells.check_several(training)
    known = check_known(cells.given["known"], cells.size, None, training, place=cells.put)
    mrf.check_categories(training, known)
    if not categorical:
        moderate("the training image", *training.pixels)
    attributes = {"nearest": nearest, "reach": reach, "bandwidth": bandwidth, **digests(training, known)}
    return Estimation(training, known, cells.size, cells.place, cells.about.get("units", ""), attributes, options)


@dataclass(frozen=True)
class Estimation:
    """The job of `estimate`; ``attributes`` are those of the result, and ``units`` of its values, "" without."""

    training: Pictures
    known: Given
    shape: tuple[int, ...]
    place: Location | None
    units: str
    attributes: dict[str, Any]
    options: mrf.Options
    channel_axis: int | None = -1
    light: Light = field(default=Light())

    def make(
        self, machine: Machine, seed: int, callback: Callback | None, checkpointing: Checkpointing
    ) -> tuple[NDArray[Any], Output]:
        """Return the probabilities of a cell, or its mean and variance, as channels."""
        nearest, cells, there = self.attributes["nearest"], prod(self.shape), self.known.whole
        sample = Sample(self.training, self.training.channels * (nearest + 1), self.attributes["reach"])
        positions = sample.places(np.zeros((1, len(self.shape)), np.int32), 1).positions
        own = sample.own(positions)[:, 0]
        names, of = np.unique(own if self.options.categorical else sample.working[0, positions], return_inverse=True)
        data = mrf.Data(np.argwhere(there), sample.scale.levels(self.known.values[there]).T)
        categories = len(names) if self.options.categorical else 0
        memory.require(machine, 0, 8 * cells * (categories + 4))
        sites = np.argwhere(np.ones(self.shape, bool))
        found, done = np.full((categories or 2, cells), np.nan), 0
        for here, p in given_data(machine, sample, of, data, sites, nearest, self.attributes["bandwidth"]):
            found[:, here] = p.T if self.options.categorical else _moments(p, of, own)
            done += here.size
            if callback:
                now, doing = found.T.reshape(*self.shape, -1).copy, f"{done} of {cells} cells"
                callback(Progress(fraction=done / cells, doing=doing, image=now))
        told = self.known.values[there][:, 0]
        certain = names[:, None] == told if self.options.categorical else np.stack([told, np.zeros(len(told))])
        found[:, there.ravel()] = certain
        return found.T.reshape(*self.shape, -1), Output(None, statistics={"device": machine.name, "names": names})

    def result(self, values: NDArray[Any], output: Output) -> Any:
        """Return the dataset of xarray."""
        from simdtex.figures.show import Results

        dims, maps = tuple("zyx"[-len(self.shape) :]), np.moveaxis(values, -1, 0)
        along, sides = grid_axes(self.shape, self.place)
        if self.options.categorical:
            entropy = 0 - (maps * np.log2(np.where(maps > 0, maps, 1))).cumsum(0)[-1]
            variables: dict[str, Any] = {"probability": (("category", *dims), maps), "entropy": (dims, entropy)}
            along["category"] = output.statistics["names"]
        else:
            units = [{"units": unit} if self.units else {} for unit in (self.units, f"({self.units})\u00b2")]
            variables = {"mean": (dims, maps[0], units[0]), "variance": (dims, maps[1], units[1])}
        attributes = {"version": version("simdtex"), "device": output.statistics["device"], **self.attributes, **sides}
        return georeferenced(Results(variables, along, attributes), self.place)


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
