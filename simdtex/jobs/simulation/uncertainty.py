# SPDX-License-Identifier: BSD-3-Clause
"""Uncertainty of realisations: maps, volumes at wells, proportions of layers, and errors, as arrays of xarray.

The functions take an `xarray.DataArray` as `simdtex.simulate` returns it, a map or a volume, with its coordinates on
the ground. The results keep its attributes, and have ``long_name`` and ``units``, which plots of xarray show. Cells
outside of a region are NaN. Coordinates of a single value, such as z of a map, become attributes.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from math import prod, sqrt
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from simdtex.io.hard_data import HardData, place_hard_data
from simdtex.io.rasters import axis_place
from simdtex.options import require

if TYPE_CHECKING:
    from xarray import DataArray, Dataset

Array = NDArray[Any]
CLASSES = tuple(k / 10 for k in range(11))  # of probabilities


def probability(realisations: DataArray, category: float) -> DataArray:
    """Return the share of the realisations in which each cell has a category, 0 to 1."""
    field, what = _field(realisations, category).mean("realisation"), label(realisations, "category")
    return _described(field, realisations, "probability", f"probability of {what} {category}", "")


def e_type(realisations: DataArray) -> DataArray:
    """Return the mean of the realisations at each cell: the E-type estimate of a continuous variable."""
    field = _field(realisations).mean("realisation")
    return _described(field, realisations, "e_type", f"E-type of {label(realisations)}")


def quantiles(realisations: DataArray, q: ArrayLike = (0.1, 0.5, 0.9)) -> DataArray:
    """Return quantiles of a continuous variable at each cell, with the dimension ``quantile`` (`numpy.quantile`)."""
    field = _field(realisations).quantile(q, "realisation")
    return _described(field, realisations, "quantiles", f"quantile of {label(realisations)}")


def connected_volume(realisations: DataArray, category: float, well: ArrayLike) -> DataArray:
    """Return the volume of the bodies of a category that contain a cell of a well, for each realisation.

    Parameters
    ----------
    realisations : DataArray, (realisation, [z,] y, x)
    category : number
    well : array_like, (2,), (3,), (n, 2) or (n, 3)
        x and y on the ground, of all layers, or x, y and z. Bodies that several points meet count once.

    Returns
    -------
    DataArray, (realisation,)
        Cells, connected by their sides, times the size of a cell, of a map an area; 0 where no well meets the category.
        ``.quantile([0.1, 0.5, 0.9])`` gives P10, P50 and P90. P10 is the small one, which is P90 of many reserves.

    Raises
    ------
    ValueError, TypeError
        A point is outside of the cells, or the realisations have other dimensions.
    """
    field, wells = _field(realisations, category), np.atleast_2d(np.asarray(well, np.float64))
    axes = [axis for axis in "zyx" if axis in realisations.dims]
    if wells.shape[1] not in (2, 3) or {*realisations.dims} != {"realisation", *axes} or axes[-2:] != ["y", "x"]:
        raise ValueError("give x, y and perhaps z of the well, and realisations of one variable with y and x")
    origin, cell = zip(*(axis_place(realisations, axis) for axis in "xyz"[: wells.shape[1]]), strict=True)
    sizes = [realisations.sizes[axis] for axis in axes][-wells.shape[1] :]
    table = HardData(wells, np.ones((len(wells), 1)), ("well",))
    hit = ~np.ma.getmaskarray(place_hard_data(table, sizes, origin=origin, cell=cell))

    def cells(image: Array) -> int:
        labels, _ = ndimage.label(image == 1)
        bodies = np.unique(labels[np.broadcast_to(hit, labels.shape)])
        return int(np.isin(labels, bodies[bodies > 0]).sum())

    field = field.transpose("realisation", *axes)
    units = [realisations[axis].attrs.get("units", "") for axis in axes]
    unit = units[0] + " \u00b2\u00b3"[len(axes) - 1] if units[0] and len({*units}) == 1 else " ".join(units).strip()
    what = f"{'volume' if len(axes) > 2 else 'area'} of {label(realisations, 'category')} {category} at the well"
    counts = np.array([cells(image) for image in field.values])
    volume = counts * prod(axis_place(realisations, axis)[1] for axis in axes)
    volumes = field.isel(dict.fromkeys(axes, 0), drop=True).copy(data=volume)
    return _described(volumes, realisations, "connected_volume", what, unit)


def vertical_proportions(data: DataArray | ArrayLike, categories: Sequence[int] | None = None) -> DataArray:
    """Return the share of each category in each layer, (category, [realisation,] z), of realisations or a volume.

    Categories are those of the data by default. A plain array is (z, y, x).
    """
    data = named(data, "z", "y", "x")
    names = np.unique(data.values[_known(data).values]) if categories is None else np.asarray(categories)
    categorical = _field(data, named(names, "category", coords={"category": names}), of="z")
    shares = categorical.mean(("y", "x")).transpose("category", ...)
    return _described(shares, data, "vertical_proportions", f"share of {label(data, 'a category')} in a layer", "")


def standard_error(realisations: DataArray, category: float | None = None) -> DataArray:
    """Return the standard error of the map after 2, 3, ... realisations, (realisations,), over all cells.

    The map is `probability` or, without a category, `e_type`. A cell's error is the standard deviation of the first n
    realisations over the root of n, since realisations are independent; the result is the root of the mean of its
    square over the cells. For half the error four times as many realisations are needed.
    """
    field = _field(realisations, category).transpose("realisation", ...)
    total = squares = np.zeros(field.shape[1:])
    errors = []
    for n, image in enumerate(field.values - field.values[0], 1):
        total, squares = total + image, squares + image**2
        if n > 1:
            errors.append(sqrt(max(0.0, np.nanmean(squares - total**2 / n)) / (n * (n - 1))))
    counts = ("realisations", np.arange(2, len(field) + 1), {"long_name": "number of realisations"})
    curve = named(errors, "realisations", coords={"realisations": counts})
    unit = None if category is None else ""
    return _described(curve, realisations, "standard_error", "standard error of the map", unit)


def reliability(probability: ArrayLike, truth: ArrayLike, bounds: Sequence[float] = CLASSES) -> Dataset:
    """Return how often what has a probability is true, by classes of the probability: a reliability diagram.

    Parameters
    ----------
    probability, truth : array_like
        Probabilities of any shape, as of one or several maps, and 1 where it is true, 0 elsewhere. NaN is left out.
    bounds : sequence of float
        Of classes, ascending from 0 to 1; a class has its lower bound, and the last one has 1.

    Returns
    -------
    xarray.Dataset
        For each class, (lower,) with the coordinate ``upper``, the mean ``probability``, the ``frequency`` of what is
        true, both NaN in an empty class, and the ``number`` of cells. ``plot()`` draws them.

    Raises
    ------
    ValueError
        The shapes or places differ, a value is no probability or neither 0 nor 1, or bounds do not ascend from 0 to 1.

    Examples
    --------
    >>> from simdtex import ensemble
    >>> ensemble.reliability([0.1, 0.2, 0.2, 0.9], [0, 0, 1, 1], bounds=[0, 0.5, 1]).frequency.values.round(2).tolist()
    [0.33, 1.0]
    """
    from simdtex.figures.show import Results

    p, true = (np.ma.filled(np.ma.asarray(one, np.float64), np.nan) for one in (probability, truth))
    both: list[Any] = [one for one in (probability, truth) if hasattr(one, "dims")]
    places, edges = [[(dim, one[dim].values.tolist()) for dim in one.dims] for one in both], np.asarray(bounds, float)
    if p.shape != true.shape or places[1:] not in ([], places[:1]):
        raise ValueError(f"probability {p.shape} and truth {true.shape} are of different cells; give both of the same")
    if edges.ndim != 1 or len(edges) < 2 or edges[0] != 0 or edges[-1] != 1 or not (np.diff(edges) > 0).all():
        raise ValueError("the bounds do not ascend from 0 to 1; give some as [0, 0.1, 0.9, 1]")
    p, true = (one[~np.isnan(p + true)] for one in (p, true))
    if not (((p >= 0) & (p <= 1)).all() and np.isin(true, (0, 1)).all()):
        raise ValueError("probabilities are 0 to 1, and the truth is 0 or 1; give maps == category as the truth")
    number, sums, hits = (np.histogram(p, edges, weights=weights)[0] for weights in (None, p, true))
    each = np.where(number, number, np.nan)
    found = {"probability": sums / each, "frequency": hits / each, "number": number, "upper": edges[1:]}
    return Results({name: ("lower", one) for name, one in found.items()}, {"lower": edges[:-1]}).set_coords("upper")


def named(data: Any, *dims: str, **about: Any) -> DataArray:
    """Return an array of xarray as it is, and a plain one with the names of its axes."""
    require("simulate", "xarray")
    import xarray

    array: DataArray = data if isinstance(data, xarray.DataArray) else xarray.DataArray(data, dims=dims, **about)
    return array


def _known(data: DataArray) -> DataArray:
    """Return where the data are known: numbers, inside of the region if there is one."""
    known: DataArray = data.notnull() & data.coords.get("region", True)
    return known


def _field(data: DataArray, category: Any = None, of: str = "realisation") -> DataArray:
    """Return values, or the indicator of a category, as floats with NaN where they are unknown."""
    if of not in getattr(data, "dims", ()):
        raise TypeError(f"give an xarray.DataArray with the dimension {of}, as simdtex.simulate returns")
    if category is None and json.loads(data.attrs.get("options", "{}")).get("categorical") is True:
        raise ValueError("the realisations are of categories, which have no mean; use probability, or name a category")
    field: DataArray = (data if category is None else category == data).astype(float).where(_known(data))
    return field


def label(data: DataArray, unnamed: str = "the values") -> str:
    """Return the name of a variable for plots; "simulation" is no name."""
    return str(data.attrs.get("long_name") or (unnamed if data.name in (None, "simulation") else data.name))


def _described(field: DataArray, data: DataArray, name: str, long_name: str, units: str | None = None) -> DataArray:
    """Return a result with a name, and with the attributes of its data but ``long_name`` and ``units``."""
    alone = {key: coord.item() for key, coord in field.coords.items() if coord.ndim == 0 and key not in field.dims}
    units = data.attrs.get("units", "") if units is None else units
    field = field.reset_coords([*alone], drop=True).rename(name)
    field.attrs = {**data.attrs, **alone, "long_name": long_name, "units": units}
    for unused in {"missing", "spatial_ref", *([] if units else ["units"])} & {*field.attrs}:
        del field.attrs[unused]
    return field
