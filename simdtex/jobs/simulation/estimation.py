# SPDX-License-Identifier: BSD-3-Clause
"""What data and a training image say of each cell, without a simulation: `estimate`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from math import prod
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex.checkpoint import Checkpointing
from simdtex.driver import Device, run
from simdtex.inputs import check_known
from simdtex.io.hard_data import HardData
from simdtex.io.places import Place
from simdtex.jobs.simulation.cells import Cells, digests, georeferenced, grid_axes, plan_cells
from simdtex.machine import Machine, memory
from simdtex.methods import mrf
from simdtex.methods.mrf.density import Data, given_data
from simdtex.model.given import Given
from simdtex.model.light import Light
from simdtex.model.pictures import Pictures
from simdtex.model.sample import Sample
from simdtex.options import moderate, real, true_or_false, whole
from simdtex.run import Callback, Output, Progress


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
    least = min(min(one.shape[-3:-1]) for one in training.pixels)
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
    place: Place | None
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
        data = Data(np.argwhere(there), sample.scale.levels(self.known.values[there]).T)
        count = len(names) if self.options.categorical else 2
        memory.require(machine, 0, 8 * cells * ((len(names) if self.options.categorical else 0) + 4))
        sites = np.argwhere(np.ones(self.shape, bool))
        found, done = np.full((count, cells), np.nan), 0
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
            units = [{"units": one} if self.units else {} for one in (self.units, f"({self.units})\u00b2")]
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
