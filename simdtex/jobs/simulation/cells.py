# SPDX-License-Identifier: BSD-3-Clause
"""The cells of an output on the ground: where they lie, how many there are, and what is given in them."""

from __future__ import annotations

from contextlib import suppress
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from simdtex.checkpoint import digest
from simdtex.driver import check_sides
from simdtex.inputs import Placing, as_known, check_samples
from simdtex.io.hard_data import HardData, place_hard_data
from simdtex.io.places import Place, ascending, located
from simdtex.jobs.simulation.maps import Maps
from simdtex.model.given import Given
from simdtex.model.pictures import Pictures
from simdtex.options import one_of, require, within_32_bits

SEVERAL, OUTSIDE = ("refuse", "mean", "most"), ("refuse", "skip")
"""What is done with different data of a table in one cell, and with data outside of the cells."""


class Cells(NamedTuple):
    """The cells of an output, (``size``).

    ``given`` are arrays and tables by the names of the parameters of `simdtex.simulate`, ``about`` the attributes of
    the values, and ``place`` is None if nothing says where the cells lie. ``put(table, shape, dtype)`` places a table.
    """

    training: Pictures
    given: dict[str, Any]
    about: dict[str, str]
    size: tuple[int, ...]
    place: Place | None
    several: str
    put: Placing

    def check_several(self, pictures: Pictures) -> None:
        """Raise if different data of a table in one cell would become a mean of categories."""
        if self.several == "mean" and isinstance(self.given["known"], HardData) and any(pictures.categorical or ()):
            raise ValueError("several is 'mean', which invents categories; give 'most', or 'refuse'")


def plan_cells(
    training: Any,
    shape: Any,
    given: dict[str, Any],
    channel_axis: int | None = None,
    *,
    origin: Any,
    cell: Any,
    several: str,
    outside: str,
) -> Cells:
    """Check a training image and what is ``given`` in the cells of an output, and return the cells.

    Arrays of xarray get their axes in ascending order. A training image of three axes, without that of the variables,
    is a volume.
    """
    require("simulate", "xarray")
    from simdtex.figures.show import described

    training, given = ascending(training), {name: ascending(one) for name, one in given.items()}
    place = located(given, training, origin, cell)
    if place:
        origin, cell = place.frame
    first = training[0] if isinstance(training, (list, tuple)) and training else training
    axes = 3 if getattr(first, "ndim", 2) - (channel_axis is not None) > 2 else 2
    pictures = check_samples(training, channel_axis, given["mask"], axes)
    one_of("several", several, SEVERAL)
    one_of("outside", outside, OUTSIDE)
    for name in ("known", *Maps._fields):
        if given.get(name) is not None:
            given[name] = as_known(given[name], name, pictures if name == "known" else None)
    usual = _like(given["like"], shape, place, axes) or _sides(given, axes, channel_axis)
    sides = ("layers", "rows", "columns")[-axes:]
    if axes == 2 and isinstance(shape, (tuple, list)) and len(shape) == 3:
        raise ValueError("shape is of a volume and the training image is a picture; give a training volume")
    size = check_sides((usual or pictures.pixels[0].shape[:-1]) if shape is None else shape, sides)
    within_32_bits(size, 1)
    put = partial(place_hard_data, origin=origin, cell=cell, several=several, outside=outside)  # type: ignore[arg-type]
    return Cells(pictures, given, described(training, given["known"]), size, place, several, put)


def _like(like: Any, shape: Any, place: Place | None, axes: int) -> tuple[int, ...] | None:
    """Return the sides of ``like``, which gives the output's; None without."""
    if like is None:
        return None
    if not hasattr(like, "sizes") or place is None or not {"x", "y"} <= {*like.sizes}:
        raise ValueError("like has no coordinates x and y; give an array of xarray that has, or shape, origin and cell")
    size = tuple(like.sizes.get(axis, 1) for axis in "zyx"[-axes:])
    if shape is not None and tuple(shape) != size:
        raise ValueError(f"shape is {shape} and like has {size}; leave shape out")
    return size


def _sides(given: dict[str, Any], axes: int, channel_axis: int | None) -> tuple[int, ...] | None:
    """Return the sides of the known values, else of the first map, that is an array; None without one."""
    known = given["known"]
    if isinstance(known, np.ndarray) and known.ndim == axes + (channel_axis is not None):
        sides = known if channel_axis is None else np.moveaxis(known, channel_axis, -1)[..., 0]
        return tuple(sides.shape)
    shapes = [tuple(getattr(given.get(name), "shape", ())[-axes:]) for name in Maps._fields]
    return next((shape for shape in shapes if len(shape) == axes), None)


def grid_axes(size: tuple[int, ...], place: Place | None) -> tuple[dict[str, Any], dict[str, float]]:
    """Return the coordinates of cells and the sizes of a cell as attributes; without a place, columns and rows."""
    at, sides = place.frame if place else ((), ())
    found: dict[str, Any] = {axis: np.arange(n) for axis, n in zip("zyx"[-len(size) :], size, strict=True)}
    for axis, first, side in zip("xyz", at, sides, strict=False):
        values, about = first + side * found.get(axis, 0), place.about.get(axis, {}) if place else {}
        found[axis] = ((axis,) if axis in found else (), values, about)
    return found, {f"cell_{axis}": side for axis, side in zip("xyz", sides, strict=False)}


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


def digests(pictures: Pictures, given: Given | None) -> dict[str, str]:
    """Return the digests of hard data and of the training images, with their unknown pixels completed."""
    found = {"training_image": digest(*pictures.pixels, *(pictures.known or ()))}
    if given and given.given_mask.any():
        found["hard_data"] = digest(np.where(given.given_mask, given.values, 0), given.given_mask)
    return found
