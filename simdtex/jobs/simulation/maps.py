# SPDX-License-Identifier: BSD-3-Clause
"""The maps of a simulation: a region, probabilities, training images, rotations and scales."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import prod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.checkpoint import digest
from simdtex.inputs import Inputs, Placing, check_mask
from simdtex.io.hard_data import HardData
from simdtex.io.image import AXES, as_array
from simdtex.model.given import Given
from simdtex.model.pictures import HALVES, Pictures, Turned, turned
from simdtex.options import check_real

SUMS = 1e-3
"""The largest deviation of a sum of probabilities from 1; they are divided by the sum."""


class Maps(NamedTuple):
    """The maps of a simulation as arrays or tables, see `simdtex.simulate`; None if not given."""

    region: NDArray[Any] | HardData | None = None
    probabilities: NDArray[Any] | HardData | None = None
    image_map: NDArray[Any] | HardData | None = None
    rotation: NDArray[Any] | HardData | None = None
    scale: NDArray[Any] | HardData | None = None

    def digests(self) -> dict[str, str]:
        """Return the SHA-256 digest of each map, by name."""
        found = {}
        for name, one in self._asdict().items():
            if isinstance(one, HardData):
                found[name] = digest(one.points, one.values)
            elif one is not None:
                found[name] = digest(np.ma.getdata(one), np.ma.getmaskarray(one))
        return found

    def of_images(self, pictures: Pictures, shape: tuple[int, ...]) -> Turned | None:
        """Return the copies of training images that the maps require; None without such maps."""
        if self.image_map is self.rotation is self.scale is None:
            return None
        rotation = None if self.rotation is None else _numbers("rotation", self.rotation, shape)
        scale = None if self.scale is None else _numbers("scale", self.scale, shape)
        most = 2.0 ** (HALVES / 2)
        if scale is not None and ((scale < 1 / most) | (scale > most)).any():
            raise ValueError(f"scale has {scale.min():g} to {scale.max():g}; give factors of {1 / most:g} to {most:g}")
        return turned(pictures, self._images(pictures, shape), rotation, scale)

    def _images(self, pictures: Pictures, shape: tuple[int, ...]) -> NDArray[np.float64]:
        """Return the probability of each training image, (training images, *shape)."""
        areas, count = [float(prod(one.shape[:-1])) for one in pictures.pixels], len(pictures.pixels)
        along = (-1, *[1] * len(shape))
        if self.image_map is None:
            return np.broadcast_to(np.array(areas).reshape(along) / sum(areas), (count, *shape))
        given = as_array("image_map", self.image_map)
        if given.ndim == 1 + len(shape):
            each = _numbers("image_map", given, (count, *shape))
            if (each < 0).any() or (each.sum(0) == 0).any():
                raise ValueError("image_map has weights below 0, or 0 alone; give 0 or more, and NaN where any will do")
            return np.asarray(each / each.sum(0))
        number = _numbers("image_map", given, shape)
        told = number[~np.isnan(number)]
        if not (np.isin(told, np.arange(count))).all():
            wrong = told[~np.isin(told, np.arange(count))][0]
            raise ValueError(
                f"image_map has {wrong:g} and there {'is 1' if count == 1 else f'are {count}'} training "
                f"image{'s' * (count > 1)}; give numbers from 0 on, or weights (training images, {AXES[len(shape)][1:]}"
            )
        weights: NDArray[np.float64] = (number == np.arange(count).reshape(along)).astype(np.float64)
        weights[:, np.isnan(number)] = np.nan
        return weights

    def of_categories(
        self, categories: NDArray[Any] | None, shape: tuple[int, ...], place: Placing
    ) -> NDArray[np.float64] | None:
        """Return the probability of each category, (categories, *shape), NaN where not given; None without a map."""
        if self.probabilities is None:
            return None
        if categories is None:
            raise ValueError("probabilities are of categories; give categorical=True, or leave them out")
        given, names = self.probabilities, ", ".join(map(str, categories[:10]))
        if isinstance(given, HardData):
            if len(given.names) != len(categories):
                raise ValueError(
                    f"the table of probabilities has {len(given.names)} values in a row and the training image the "
                    f"{len(categories)} categories {names}; give x, y and one for each, in this order"
                )
            placed = place(given, shape, np.float64).reshape(*shape, len(categories))
            given = np.moveaxis(placed.filled(np.nan), -1, 0)
        found = as_array("probabilities", given)
        if found.ndim != 1 + len(shape) or len(found) != len(categories):
            raise ValueError(
                f"probabilities are {'x'.join(map(str, found.shape))} and the training image has the {len(categories)} "
                f"categories {names}; give (categories, {AXES[len(shape)][1:]}, in this order"
            )
        found = _numbers("probabilities", found, (len(categories), *shape))
        unknown = np.isnan(found).any(0)
        total = found.sum(0)
        off = ~unknown & ((found < 0).any(0) | (abs(total - 1) > SUMS))
        if off.any():
            at = np.argwhere(off)[0]
            told = ", ".join(f"{p:g}" for p in found[(slice(None), *at)])
            remedy = "give shares of 0 or more that add up to 1, or NaN"
            raise ValueError(f"the probabilities of {_cell(at)} are {told}; {remedy}")
        found[:, unknown] = np.nan
        return np.asarray(found / total)


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
    given = inputs.given or Given(np.zeros(sides, pixels.dtype), np.zeros(sides, bool))
    if (given.known & ~inside[..., None]).any():
        at = np.argwhere(given.known.any(-1) & ~inside)[0]
        raise ValueError(f"known has a value at {_cell(at)}, outside region; leave it out, or widen region")
    return inputs._replace(given=replace(given, known=given.known | ~inside[..., None], outside=~inside))


def missing_value(pixels: Sequence[NDArray[Any]]) -> Any:
    """Return the number that marks a missing value in arrays of the training images' type.

    It is NaN for floats; for integers the largest number of the type or, if the images have that, the smallest.
    """
    dtype = pixels[0].dtype
    if dtype.kind == "f":
        return dtype.type(np.nan)
    if dtype.kind in "iu":
        for number in (np.iinfo(dtype).max, np.iinfo(dtype).min):
            if not any((one == number).any() for one in pixels):
                return dtype.type(number)
    raise ValueError(f"{dtype} has no number that says that a cell is outside region; give the training image as int16")


def _numbers(name: str, values: Any, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Return a map as floats, NaN where it is masked."""
    array = as_array(name, values)
    check_real(name, array)
    if array.shape != shape:
        sides = ["x".join(map(str, one)) for one in (array.shape, shape)]
        raise ValueError(f"{name} is {sides[0]} and has to be {sides[1]}, as the output; give one size")
    found = np.where(np.ma.getmaskarray(array), np.nan, np.ma.getdata(array)).astype(np.float64)
    if np.isinf(found).any():
        raise ValueError(f"{name} has infinite values; give numbers, or NaN where nothing is said")
    return found
