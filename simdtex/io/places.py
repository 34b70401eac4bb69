# SPDX-License-Identifier: BSD-3-Clause
"""Where the cells of an output lie: their place as the arrays of xarray and the options of a run give it.

y points north. Values have the axes ([z,] y, x), each in ascending order of its coordinate, so that row 0 is the
southern edge. The grids that belong to the output give its place; a training image gives it only if none of them does.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, NamedTuple

from simdtex.io import rasters
from simdtex.io.grids import CellFrame, frame
from simdtex.io.rasters import axis_attributes, axis_of, axis_place
from simdtex.options import DataWarning

SAME = 0.01
"""The most by which cells of one place differ in their position, in cells."""


class Location(NamedTuple):
    """Where the cells of the array ``name`` lie; ``sides`` are its numbers of cells along x, y and, of a volume, z."""

    name: str
    frame: CellFrame
    sides: tuple[int, ...] = ()
    crs: str = ""  # WKT; empty if unknown
    about: Mapping[str, Mapping[str, str]] = {}  # the attributes of its axes, by name

    @property
    def told(self) -> bool:
        """Whether it is a place, and coordinates are no mere numbers of columns and rows."""
        return self.frame.told or bool(self.crs) or any(self.about.values())

    def __str__(self) -> str:
        at, size = (", ".join(f"{value:.12g}" for value in numbers) for numbers in self.frame)
        return f"{self.name} lies at {at} with cells of {size}"


def ascending(array: Any) -> Any:
    """Return an array of xarray, or each of a list, with the axes z, y and x in ascending order of coordinates."""
    if isinstance(array, (list, tuple)):
        return type(array)([ascending(each) for each in array])
    if not hasattr(array, "coords"):
        return array
    named = {dim: axis for dim in array.dims if (axis := axis_of(str(dim)))}
    return rasters.ascending(array, named) if sorted(named.values())[:2] == ["x", "y"] else array


def place_of(name: str, array: Any) -> Location | None:
    """Return the place of an array that `ascending` has returned; None if it has no coordinates."""
    if not hasattr(array, "coords") or not {"x", "y"} <= {*array.dims} & {*array.coords}:
        return None
    lies = frame(*zip(*(axis_place(array, axis) for axis in "xyz"), strict=True))
    about = array.attrs, *(coordinate.attrs for coordinate in array.coords.values() if coordinate.ndim == 0)
    crs = next((str(attrs[key]) for attrs in about for key in ("crs_wkt", "crs") if key in attrs), "")
    sides = tuple(array.sizes[axis] for axis in "xyz" if axis in array.dims)
    return Location(name, lies, sides, crs, axis_attributes(array))


def located(output: Mapping[str, Any], training: Any, origin: Any, cell: Any) -> Location | None:
    """Return the place of an output from its arrays, else from ``origin`` and ``cell``, else from the training image.

    Arrays are as `ascending` returns them. Raises ValueError if two places differ.
    """
    options, free = frame(origin, cell), origin is None and cell is None
    last = {name: array[-1] if isinstance(array, tuple) else array for name, array in output.items()}  # of a guide
    places = [place for name, array in last.items() if (place := place_of(name, array))]
    told = [place for place in places if place.told]
    image = training[0] if isinstance(training, (list, tuple)) else training
    trained = None
    try:
        trained = None if places else place_of("the training image", image)
    except ValueError as error:
        warnings.warn(f"the training image gives no place, since {error}", DataWarning, stacklevel=2)
    first = told[0] if told else trained if trained and trained.told else None
    if first is None:
        return None if free else Location("the output", options)
    axes, both = None if free else len(options.origin), zip(first.frame, (origin, cell), strict=True)
    wanted = frame(*(numbers[:axes] if option is None else option for numbers, option in both))
    asked = Location("that of origin and cell", wanted, about=first.about)
    for other in (*told[1:], asked) if told else ():
        _check_same(first, other)
    if told or free:
        return first._replace(crs=next((place.crs for place in told if place.crs), first.crs))
    return asked._replace(crs=first.crs if origin is None or cell is None else "")


def _check_same(first: Location, other: Location) -> None:
    """Raise unless cells lie at the same place."""
    for at, size, to, side, n in zip(*first.frame, *other.frame, first.sides, strict=False):
        if max(abs(to - at), abs(to - at + (n - 1) * (side - size))) > SAME * size:
            raise ValueError(f"{first}, and {other}; give one place")
    if first.crs and other.crs and first.crs != other.crs:
        with suppress(ImportError):  # the extra rasters, without which only the texts can be compared
            from rasterio.crs import CRS

            if CRS.from_user_input(first.crs) == CRS.from_user_input(other.crs):
                return
        both = f"{first.name} and {other.name}"
        raise ValueError(f"{both} have different coordinate reference systems; warp one of them, as by gdalwarp")
