# SPDX-License-Identifier: BSD-3-Clause
"""The distribution at each cell given data, without a simulation: `estimate`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import partial
from importlib.metadata import version
from math import prod
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex.driver import check_shape
from simdtex.io.hard_data import HardData, place_hard_data
from simdtex.jobs.inputs import as_known, check_known, check_samples
from simdtex.jobs.simulation import check_several, digests, grid_axes
from simdtex.machine import memory, open_machine
from simdtex.methods import mrf
from simdtex.methods.mrf.density import Data, given_data
from simdtex.model.sample import Sample
from simdtex.options import moderate, real, require, whole
from simdtex.run import Callback, Progress

if TYPE_CHECKING:
    import xarray

MOST = 64
"""The most data for a cell."""


def estimate(
    training: ArrayLike,
    *,
    known: ArrayLike | HardData | str | os.PathLike[str],
    shape: tuple[int, int] | None = None,
    several: Literal["refuse", "mean", "most"] = "refuse",
    outside: Literal["refuse", "skip"] = "refuse",
    origin: Sequence[float] | None = None,
    cell: Sequence[float] | None = None,
    mask: ArrayLike | None = None,
    categorical: bool = False,
    nearest: int = 8,
    reach: int | None = None,
    bandwidth: float = 1.0,
    device: str | None = None,
    callback: Callback | None = None,
) -> xarray.Dataset:
    """Return the probability of each category at each cell given data, or mean and variance: the LCPDF.

    Parameters
    ----------
    training : (rows, cols) array, or a list of such
        The training image, as in `simdtex.simulate`; one variable.
    known : array, HardData or path
        The data, as in `simdtex.simulate`.
    shape : (int, int), optional
        Rows and columns of the result. None: those of `known` if it is an array, else of the training image.
    several, outside, origin, cell, mask
        As in `simdtex.simulate`.
    categorical : bool
        Whether values are categories.
    nearest : int
        Number of nearest data for a cell, 0 to 64.
    reach : int, optional
        Largest distance of a datum, in cells. None: an eighth of the smaller side of the training image.
    bandwidth : float
        h in units of h_opt, equation (8).
    device : str, optional
        As in `simdtex.synthesize`.
    callback : callable, optional
        Called with a `simdtex.run.Progress` after each part of the cells. Its ``image()`` are the maps, (y, x, maps);
        unfinished cells are NaN. If it raises an error, the run ends.

    Returns
    -------
    xarray.Dataset
        Dimensions ``y`` and ``x``, with coordinates as in `simdtex.simulate`. With `categorical` the variables
        ``probability`` (category, y, x), float64, which adds up to 1, and ``entropy`` (y, x) in bits; else ``mean`` and
        ``variance`` (y, x) in the units of the training image. A cell with a datum has its value with certainty.
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
    require("simulate", "xarray")
    from simdtex.model.show import Results, described

    whole("nearest", nearest, 0, MOST)
    real("bandwidth", bandwidth, 0, above=True)
    pictures = mrf.Options(categorical=categorical).of(check_samples(training, None, mask))
    least = min(min(one.shape[:2]) for one in pictures.pixels)
    reach = least // 8 if reach is None else reach
    whole("reach", reach, 0, least - 1)
    known = as_known(known, pictures=pictures)
    size = pictures.pixels[0].shape[:2] if shape is None else shape
    size = check_shape(known.shape if shape is None and isinstance(known, np.ndarray) and known.ndim == 2 else size)
    along, sides_of_cells = grid_axes(size, origin, cell)
    place = partial(place_hard_data, origin=origin, cell=cell, several=several, outside=outside)
    check_several(several, known, pictures)
    given = check_known(known, size, None, pictures, place=place)
    mrf.check_categories(pictures, given)
    if not categorical:
        moderate("the training image", *pictures.pixels)
    sample, machine = Sample(pictures, pictures.channels * (nearest + 1), reach), open_machine(device)
    positions = sample.places(np.zeros((1, 2), np.int32), 1).positions
    own = sample.own(positions)[:, 0]
    names, of = np.unique(own if categorical else sample.working[0, positions], return_inverse=True)
    memory.require(machine, 0, 8 * prod(size) * ((len(names) if categorical else 0) + 4))
    data = Data(np.argwhere(given.whole), sample.scale.levels(given.values[given.whole]).T)
    sites = np.argwhere(np.ones(size, bool))
    rows = given_data(machine, sample, of, data, sites, nearest, bandwidth)
    found, done = np.full((len(names) if categorical else 2, prod(size)), np.nan), 0
    for here, probability in rows:
        found[:, here] = probability.T if categorical else _moments(probability, of, own)
        done += here.size
        if callback:
            callback(Progress(level=0, levels=1, fraction=done / len(sites), image=found.T.reshape(*size, -1).copy))
    certain = given.whole.ravel()
    told = given.values[given.whole][:, 0]
    found[:, certain] = names[:, None] == told if categorical else np.stack([told, np.zeros(len(told))])
    dims = ("y", "x")
    maps = found.reshape(-1, *size)
    units = {"units": about["units"]} if "units" in (about := described(training)) else {}
    variables: dict[str, Any] = {
        "mean": (dims, maps[0], units),
        "variance": (dims, maps[1], {name: f"({unit})\u00b2" for name, unit in units.items()}),
    }
    if categorical:
        entropy = 0 - (maps * np.log2(np.where(maps > 0, maps, 1))).cumsum(0)[-1]
        variables = {"probability": (("category", *dims), maps), "entropy": (dims, entropy)}
        along["category"] = names
    attributes = {
        **{"version": version("simdtex"), "device": machine.name, "nearest": nearest, "reach": reach},
        **{"bandwidth": bandwidth, **digests(pictures, given), **sides_of_cells},
    }
    return Results(variables, along, attributes)


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
