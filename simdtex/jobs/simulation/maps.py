# SPDX-License-Identifier: BSD-3-Clause
"""The cells of an output and where they lie; its maps: region, probabilities, training images, rotations, scales."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from math import prod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.checkpoint import digest
from simdtex.inputs import Inputs, Placing, as_known, check_mask, check_samples, check_sides
from simdtex.io.hard_data import HardData, place_hard_data
from simdtex.io.image import AXES, as_array
from simdtex.io.places import Location, ascending, located
from simdtex.model.given import Given
from simdtex.model.pictures import HALVES, Pictures, Turned, turned
from simdtex.options import check_real, one_of, require, within_32_bits

SUMS = 1e-3
"""The largest deviation of a sum of probabilities from 1; they are divided by the sum."""


MAP_NAMES = ("region", "probabilities", "image_map", "rotation", "scale")
"""The maps of a simulation, arrays or tables, by the names of the parameters of `simdtex.simulate`."""


def digests_of_maps(given: dict[str, Any]) -> dict[str, str]:
    """Return the SHA-256 digest of each map, by name."""
    maps = {name: given[name] for name in MAP_NAMES if given[name] is not None}
    return {
        name: digest(field.points, field.values)
        if isinstance(field, HardData)
        else digest(np.ma.getdata(field), np.ma.getmaskarray(field))
        for name, field in maps.items()
    }


def copies_of(given: dict[str, Any], pictures: Pictures, shape: tuple[int, ...]) -> Turned | None:
    """Return the copies of training images that the maps require; None without such maps."""
    if given["image_map"] is given["rotation"] is given["scale"] is None:
        return None
    rotation, scale = (
        given[name] if given[name] is None else _numbers(name, given[name], shape) for name in MAP_NAMES[3:]
    )
    most = 2.0 ** (HALVES / 2)
    if scale is not None and ((scale < 1 / most) | (scale > most)).any():
        raise ValueError(f"scale has {scale.min():g} to {scale.max():g}; give factors of {1 / most:g} to {most:g}")
    return turned(pictures, _images(given["image_map"], pictures, shape), rotation, scale)


def _images(image_map: Any, pictures: Pictures, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Return the probability of each training image, (training images, *shape)."""
    areas, count = [float(prod(picture.shape[:-1])) for picture in pictures.pixels], len(pictures.pixels)
    along = (-1, *[1] * len(shape))
    if image_map is None:
        return np.broadcast_to(np.array(areas).reshape(along) / sum(areas), (count, *shape))
    image_map = as_array("image_map", image_map)
    if image_map.ndim == 1 + len(shape):
        each = _numbers("image_map", image_map, (count, *shape))
        if (each < 0).any() or (each.sum(0) == 0).any():
            raise ValueError("image_map has weights below 0, or 0 alone; give 0 or more, and NaN where any will do")
        return np.asarray(each / each.sum(0))
    index = _numbers("image_map", image_map, shape)
    wrong = index[~np.isnan(index) & ~np.isin(index, np.arange(count))]
    if wrong.size:
        raise ValueError(
            f"image_map has {wrong[0]:g} and there {'is 1' if count == 1 else f'are {count}'} training "
            f"image{'s' * (count > 1)}; give numbers from 0 on, or weights (training images, {AXES[len(shape)][1:]}"
        )
    weights: NDArray[np.float64] = (index == np.arange(count).reshape(along)).astype(np.float64)
    weights[:, np.isnan(index)] = np.nan
    return weights


def of_categories(
    soft: Any, categories: NDArray[Any] | None, shape: tuple[int, ...], place: Placing
) -> NDArray[np.float64] | None:
    """Return the probability of each category, (categories, *shape), NaN where not given; None without a map."""
    if soft is None:
        return None
    if categories is None:
        raise ValueError("probabilities are of categories; give categorical=True (--categorical), or leave them out")
    names = ", ".join(map(str, categories[:10]))
    if isinstance(soft, HardData):
        if len(soft.names) != len(categories):
            raise ValueError(
                f"the table of probabilities has {len(soft.names)} values in a row and the training image the "
                f"{len(categories)} categories {names}; give x, y and one for each, in this order"
            )
        placed = place(soft, shape, np.float64).reshape(*shape, len(categories))
        soft = np.moveaxis(placed.filled(np.nan), -1, 0)
    p = as_array("probabilities", soft)
    if p.ndim != 1 + len(shape) or len(p) != len(categories):
        raise ValueError(
            f"probabilities are {'x'.join(map(str, p.shape))} and the training image has the {len(categories)} "
            f"categories {names}; give (categories, {AXES[len(shape)][1:]}, in this order"
        )
    p = _numbers("probabilities", p, (len(categories), *shape))
    unknown, total = np.isnan(p).any(0), p.sum(0)
    wrong = ~unknown & ((p < 0).any(0) | (abs(total - 1) > SUMS))
    if wrong.any():
        at = np.argwhere(wrong)[0]
        told = ", ".join(f"{share:g}" for share in p[(slice(None), *at)])
        raise ValueError(
            f"the probabilities of {_cell(at)} are {told}; give shares of 0 or more that add up to 1, or NaN"
        )
    p[:, unknown] = np.nan
    return np.asarray(p / total)


def _cell(at: NDArray[np.integer]) -> str:
    """Return the position of a cell, in words."""
    names = ("layer", "row", "column")[-len(at) :]
    return ", ".join(f"{name} {n}" for name, n in zip(names, at, strict=True))


def check_region(region: Any, shape: tuple[int, ...], inputs: Inputs) -> Inputs:
    """Return the inputs of a simulation without the cells where the region is False, which take no part."""
    inside = check_mask(region, shape, "region", "the output")
    if not inside.any():
        raise ValueError("region is False everywhere; set it True where cells are to be simulated")
    pixels = inputs.pictures.pixels[0]
    sides = (*shape, pixels.shape[-1])
    data = inputs.given or Given(np.zeros(sides, pixels.dtype), np.zeros(sides, bool))
    if (data.known & ~inside[..., None]).any():
        at = np.argwhere(data.known.any(-1) & ~inside)[0]
        raise ValueError(f"known has a value at {_cell(at)}, outside region; leave it out, or widen region")
    return inputs._replace(given=replace(data, known=data.known | ~inside[..., None], outside=~inside))


def missing_value(pixels: Sequence[NDArray[Any]]) -> Any:
    """Return the number that marks missing values: NaN, or the largest or smallest integer that images lack."""
    dtype = pixels[0].dtype
    if dtype.kind == "f":
        return dtype.type(np.nan)
    if dtype.kind in "iu":
        for value in (np.iinfo(dtype).max, np.iinfo(dtype).min):
            if not any((picture == value).any() for picture in pixels):
                return dtype.type(value)
    raise ValueError(f"{dtype} has no number that says that a cell is outside region; give the training image as int16")


def _numbers(name: str, values: Any, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Return a map as floats, NaN where it is masked."""
    array = as_array(name, values)
    check_real(name, array)
    if array.shape != shape:
        sides = ["x".join(map(str, size)) for size in (array.shape, shape)]
        raise ValueError(f"{name} is {sides[0]} and has to be {sides[1]}, as the output; give one size")
    field = np.where(np.ma.getmaskarray(array), np.nan, np.ma.getdata(array)).astype(np.float64)
    if np.isinf(field).any():
        raise ValueError(f"{name} has infinite values; give numbers, or NaN where nothing is said")
    return field


class Cells(NamedTuple):
    """The cells of an output; ``given`` are arrays and tables by parameter; ``put(table, shape, dtype)`` places one."""

    training: Pictures
    channel_axis: int | None
    given: dict[str, Any]
    about: dict[str, str]
    size: tuple[int, ...]
    place: Location | None
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
    named: Callable[[str], str] = str,
    *,
    origin: Any = None,
    cell: Any = None,
    several: Any = "refuse",
    outside: Any = "refuse",
) -> Cells:
    """Check a training image and what is ``given`` in cells of an output; ``named`` names parameters in messages."""
    require("simulate", "xarray")
    from simdtex.figures.show import described

    training, given = ascending(training), {name: ascending(value) for name, value in given.items()}
    place = located({named(name): value for name, value in given.items()}, training, origin, cell)
    if place:
        origin, cell = place.frame
    first = training[0] if isinstance(training, (list, tuple)) and training else training
    axes = 3 if getattr(first, "ndim", 2) - (channel_axis is not None) > 2 else 2
    pictures = check_samples(training, channel_axis, given["mask"], axes)
    one_of("several", several, ("refuse", "mean", "most"))
    one_of("outside", outside, ("refuse", "skip"))
    for name in ("known", *MAP_NAMES):
        if given.get(name) is not None:
            given[name] = as_known(given[name], name, pictures if name == "known" else None)
    sides = _size(shape, given, place, axes, channel_axis)
    size = check_sides(pictures.pixels[0].shape[:-1] if sides is None else sides, ("layers", "rows", "columns")[-axes:])
    within_32_bits(size, 1)
    put = partial(place_hard_data, origin=origin, cell=cell, several=several, outside=outside)
    return Cells(pictures, channel_axis, given, described(training, given["known"]), size, place, several, put)


def _size(shape: Any, given: dict[str, Any], place: Location | None, axes: int, channel_axis: int | None) -> Any:
    """Return the sides of ``shape``, ``like``, the known values or the first map that is an array; None without any."""
    like, known = given["like"], given["known"]
    if axes == 2 and isinstance(shape, (tuple, list)) and len(shape) == 3:
        raise ValueError("shape is of a volume and the training image is a picture; give a training volume")
    if like is not None:
        if not hasattr(like, "sizes") or place is None or not {"x", "y"} <= {*like.sizes}:
            remedy = "give an array of xarray that has, or shape, origin and cell"
            raise ValueError(f"like has no coordinates x and y; {remedy}")
        size = tuple(like.sizes.get(axis, 1) for axis in "zyx"[-axes:])
        if shape is not None and tuple(shape) != size:
            raise ValueError(f"shape is {shape} and like has {size}; leave shape (--size) out")
        return size
    if shape is not None:
        return shape
    if isinstance(known, np.ndarray) and known.ndim == axes + (channel_axis is not None):
        return known.shape if channel_axis is None else np.moveaxis(known, channel_axis, -1).shape[:-1]
    shapes = (getattr(given.get(name), "shape", ())[-axes:] for name in MAP_NAMES)
    return next((size for size in shapes if len(size) == axes), None)


def grid_axes(size: tuple[int, ...], place: Location | None) -> tuple[dict[str, Any], dict[str, float]]:
    """Return the coordinates of cells and the sizes of a cell as attributes; without a place, columns and rows."""
    at, sides = place.frame if place else ((), ())
    coords: dict[str, Any] = {axis: np.arange(n) for axis, n in zip("zyx"[-len(size) :], size, strict=True)}
    for axis, first, side in zip("xyz", at, sides, strict=False):
        values, about = first + side * coords.get(axis, 0), place.about.get(axis, {}) if place else {}
        coords[axis] = ((axis,) if axis in coords else (), values, about)
    return coords, {f"cell_{axis}": side for axis, side in zip("xyz", sides, strict=False)}


def georeferenced(made: Any, place: Location | None) -> Any:
    """Return an array or dataset of xarray with its coordinate reference system and its units, if known, as in CF."""
    if place is None or not place.crs:
        return made
    placed = made.assign_coords(spatial_ref=((), 0, {"crs_wkt": place.crs})).assign_attrs(crs=place.crs)
    with suppress(ImportError, ValueError):  # the extra rasters; a text that names no system
        from rasterio.crs import CRS

        system = CRS.from_user_input(place.crs)
        unit = {"metre": "m"}.get(system.units_factor[0], system.units_factor[0])
        for axis, degrees in (("x", "longitude degrees_east"), ("y", "latitude degrees_north")):
            if axis in placed.coords:
                named = degrees.split() if system.is_geographic else (f"projection_{axis}_coordinate", unit)
                placed[axis].attrs = dict(zip(("standard_name", "units"), named, strict=True)) | placed[axis].attrs
    for field in placed.data_vars.values() if hasattr(placed, "data_vars") else [placed]:
        field.attrs["grid_mapping"] = "spatial_ref"  # in the encoding, xarray reads it as a variable of data
    return placed


def digests(pictures: Pictures, data: Given | None) -> dict[str, str]:
    """Return the digests of hard data and of the training images, with their unknown pixels completed."""
    hashes = {"training_image": digest(*pictures.pixels, *(pictures.known or ()))}
    if data and data.given_mask.any():
        hashes["hard_data"] = digest(np.where(data.given_mask, data.values, 0), data.given_mask)
    return hashes
