# SPDX-License-Identifier: BSD-3-Clause
"""Checks of the arrays of a job: each returns what a job takes, or raises with the remedy."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Sequence
from math import inf, prod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex.io.hard_data import HardData, place_hard_data, read_hard_data
from simdtex.io.image import AXES, as_array, cast, check_sample, pixels_of, plain_array
from simdtex.machine import memory
from simdtex.model.given import Given
from simdtex.model.guide import GuidePair
from simdtex.model.pictures import Mask, Pictures, check_alike, unknown_in
from simdtex.options import DataWarning, check_real, real_array, whole

Placing = Callable[..., "np.ma.MaskedArray[Any, Any]"]
"""`place_hard_data`, or a function that also knows the origin and the cells of the grid."""


class Inputs(NamedTuple):
    """The arrays of a job: the sample's ``pictures``, the ``given`` values of the output, and the ``guide`` of both."""

    pictures: Pictures
    given: Given | None = None
    guide: GuidePair | None = None

    @property
    def plain(self) -> bool:
        """Whether there is one sample and no other array."""
        return self.pictures.clean and self.given is None and self.guide is None


def with_channels_last(options: dict[str, Any], channel_axis: int | None) -> dict[str, Any]:
    """Return the options, with the channels of the picture ``start`` moved to the last axis."""
    start = options.get("start")
    if start is None or channel_axis is None or real_array("start", start).ndim < 3:
        return options
    return options | {"start": np.moveaxis(np.asarray(start), channel_axis, -1)}


def check_shape(shape: Any, least: int = 1) -> tuple[int, int]:
    """Return the rows and columns of an output; raise unless they are two integers of at least ``least``."""
    rows, cols = check_sides(shape, ("rows", "columns"), least)
    return rows, cols


def check_sides(shape: Any, names: tuple[str, ...], least: int = 1) -> tuple[int, ...]:
    """Return the sides of an output, called ``names``; raise unless they are integers of at least ``least``."""
    try:
        sides = tuple(shape)
    except TypeError:
        sides = ()
    if len(sides) != len(names):
        count = {2: "two", 3: "three"}[len(names)]
        raise ValueError(f"shape must be {count} integers ({', '.join(names)}), not {shape!r}")
    for name, side in zip(names, sides, strict=True):
        whole(f"{name} of the output", side, least, inf)  # `within_32_bits` limits their product in one sentence
    return tuple(int(side) for side in sides)


def check_inputs(
    sample: ArrayLike | Sequence[ArrayLike] | Pictures,
    shape: tuple[int, ...],
    channel_axis: int | None = None,
    mask: Any = None,
    known: Any = None,
    known_source: Any = None,
    guide: Any = None,
    place: Placing = place_hard_data,
) -> Inputs:
    """Check the arrays of a job, as in `simdtex.synthesize`, and return them; ``sample`` may already be checked."""
    pictures = sample if isinstance(sample, Pictures) else check_samples(sample, channel_axis, mask)
    data = None if known is None else check_known(known, shape, channel_axis, pictures, known_source, place)
    return Inputs(pictures, data, None if guide is None else check_guide(guide, shape, pictures))


def check_samples(sample: Any, channel_axis: int | None, mask: Any = None, axes: int = 2) -> Pictures:
    """Check a sample, or a list or tuple of samples, with the mask or masks of usable pixels, and return them."""
    several = is_several(sample, channel_axis, axes)
    arrays: list[Any] = [as_array("a sample", picture) for picture in sample] if several else [sample]
    if several and len(kinds := {array.ndim for array in arrays}) > 1:
        counts = f"{min(kinds)} and {max(kinds)}"
        raise ValueError(f"the samples have {counts} axes; give samples of one type, grey or colour")
    pixels, unknown = zip(*(check_picture(array, channel_axis, axes) for array in arrays), strict=True)
    for index, picture in enumerate(pixels[1:], 1):
        check_alike(f"sample {index}", picture, "sample 0", pixels[0])
    if mask is None:
        return Pictures(pixels, unknown)
    masks = list(mask) if several and np.iterable(mask) else [mask]
    if len(masks) != len(pixels):
        raise ValueError(f"there are {len(pixels)} samples and {len(masks)} masks; give one mask for each")
    usable = tuple(check_mask(array, picture.shape[:-1]) for array, picture in zip(masks, pixels, strict=True))
    if not any(array.any() for array in usable):
        raise ValueError("the mask leaves nothing of the sample to be used; set it True where pixels may be taken from")
    return Pictures(pixels, unknown, usable)


def check_picture(image: Any, channel_axis: int | None, axes: int = 2) -> tuple[NDArray[Any], Mask]:
    """Check a picture; return its pixels ([layers,] rows, cols, channels), and where one is NaN or masked."""
    array = as_array("the sample", image)
    pixels = check_sample(array, channel_axis, unknown=True, axes=axes)
    hidden = np.ma.getmaskarray(array)
    return pixels, unknown_in(pixels) | (hidden if channel_axis is None else hidden.any(channel_axis))


def is_several(sample: Any, channel_axis: int | None, axes: int = 2) -> bool:
    """Return whether a sample is a list or tuple of samples, and not one array written as a list."""
    if not isinstance(sample, (list, tuple)):
        return False
    each = [0 if isinstance(item, (list, tuple)) else np.ndim(item) for item in sample]
    return axes + (channel_axis is not None) in each and min(each) >= 2


def check_mask(mask: Any, shape: tuple[int, ...], name: str = "mask", of: str = "the picture") -> Mask:
    """Return a mask as a bool array of ``shape``; raise if it is not one."""
    array = plain_array(name, mask)
    if array.dtype != np.bool_:
        raise TypeError(f"{name} holds {array.dtype} values; give True and False")
    _check_size(name, array.shape, of, shape)
    return array


def as_known(known: Any, name: str = "known", pictures: Pictures | None = None) -> HardData | NDArray[Any]:
    """Return known values as an array or as a table; codes of unknown ones within ``pictures`` are values."""
    if isinstance(known, (str, os.PathLike)) or all(isinstance(text, str) for text in getattr(known, "columns", [0])):
        if pictures is None:
            return read_hard_data(known)
        low, high = _ranges(pictures)
        return read_hard_data(known, valid=(float(low.min()), float(high.max())))
    return known if isinstance(known, HardData) else as_array(name, known)


def _ranges(pictures: Pictures) -> tuple[Any, Any]:
    """Return the smallest and the largest known value of each variable of the samples."""
    ends = np.fmin, np.fmax
    low, high = (f.reduce([f.reduce(array, tuple(range(array.ndim - 1))) for array in pictures.pixels]) for f in ends)
    return low, high


def check_known(
    known: Any,
    shape: tuple[int, ...],
    channel_axis: int | None,
    pictures: Pictures,
    source: Any = None,
    place: Placing = place_hard_data,
) -> Given:
    """Check the known values of an output: a masked array, floats with NaN, a table or its path; return them."""
    known = as_known(known, pictures=pictures)
    variables, dtype = pictures.pixels[0].shape[-1], pictures.pixels[0].dtype
    if isinstance(known, HardData):
        if len(known.names) != variables:
            raise ValueError(
                f"a datum has {len(known.names)} values, {', '.join(known.names)}, and a pixel of the sample "
                f"{variables}; give as many, or choose columns: value of read_hard_data, --columns value=NAME"
            )
        memory.require_host(prod(shape) * variables * (dtype.itemsize + 1))  # values and a mask
        array = place(known, shape, dtype).reshape(*shape, variables)
    else:
        axes = len(shape) + (channel_axis is not None)
        check_real("known", known)
        if known.ndim != axes:
            wanted = AXES[len(shape)] if channel_axis is None else "the channel axis too"
            raise ValueError(f"known is {known.ndim}-dimensional; give {wanted}")
        array = known[..., None] if channel_axis is None else np.moveaxis(known, channel_axis, -1)
    _check_size("known", array.shape, "the output", (*shape, variables))
    there, values = ~np.ma.getmaskarray(array), np.ma.getdata(array)
    if values.dtype.kind == "f":
        there &= ~np.isnan(values)
        if np.isinf(values[there]).any():
            raise ValueError("known has infinite values; give numbers, or NaN where nothing is known")
    if not there.any():
        raise ValueError("known has no value; leave it out, or give numbers where something is known")
    if there.all():
        raise ValueError("known leaves nothing to do; give NaN or a masked array where the output is to be made")
    kept = np.where(there, values, np.zeros((), values.dtype))
    converted, wrong = cast(kept, dtype)
    if wrong.any():
        raise ValueError(f"known holds {kept[wrong][0]}, which the sample's type {dtype} does not; give such values")
    _warn_beyond(converted, there, pictures)
    return Given(converted, there, None if source is None else _check_source(source, there, pictures))


def _warn_beyond(values: NDArray[Any], there: NDArray[np.bool_], pictures: Pictures) -> None:
    """Warn of known values beyond those of the samples, which no candidate has."""
    low, high = _ranges(pictures)
    beyond = there & ((values < low) | (values > high))
    if beyond.any():
        variable = int(np.argwhere(beyond)[0][-1])
        warnings.warn(
            f"{np.count_nonzero(beyond)} of {np.count_nonzero(there)} known values are beyond those of the sample, "
            f"{low[variable]:g} to {high[variable]:g}, the first {values[beyond][0]:g}; no candidate is like them",
            DataWarning,
            stacklevel=2,
        )


def _check_source(source: Any, there: Mask, pictures: Pictures) -> NDArray[np.int32]:
    """Return the positions of known pixels in the sample, (rows, cols, 2 or 3)."""
    place = plain_array("known_source", source)
    columns = 2 if len(pictures.pixels) == 1 else 3
    if place.dtype.kind not in "iu" or place.shape != (*there.shape[:2], columns):
        raise ValueError(
            f"known_source is no array of integers ({there.shape[0]}, {there.shape[1]}, {columns}); give a source map"
        )
    used = (place[..., 0] >= 0) & there.all(-1)
    positions = place[used]
    image = positions[:, 2] if columns == 3 else np.zeros(len(positions), np.intp)
    inside = (image >= 0) & (image < len(pictures.pixels))
    sizes = np.array([picture.shape[:2] for picture in pictures.pixels])[np.where(inside, image, 0).astype(np.intp)]
    inside &= ((positions[:, :2] >= 0) & (positions[:, :2] < sizes)).all(-1)
    if not inside.all():  # before a cast, which would wrap
        raise ValueError("known_source points outside the sample; give -1 where a pixel is not from there")
    checked = np.full(place.shape, -1, np.int32)
    checked[used] = positions
    return checked


def check_guide(guide: Any, shape: tuple[int, ...], pictures: Pictures) -> GuidePair:
    """Check a guide ``(of the sample, of the output)``, arrays (rows, cols[, G]) or of a volume, and return it."""
    if not isinstance(guide, (tuple, list)) or len(guide) != 2:
        raise TypeError("guide is no pair; give (guide of the sample, guide of the output)")
    first, second = guide
    count = len(pictures.pixels)
    if count > 1 and not (isinstance(first, (list, tuple)) and len(first) == count):
        raise ValueError(f"there are {count} samples; give a list of a guide for each")
    listed = count > 1 or (isinstance(first, (list, tuple)) and len(first) == 1 and hasattr(first[0], "ndim"))
    axes = len(shape)
    samples = tuple(_guide("the guide of the sample", array, axes) for array in (first if listed else [first]))
    output = _guide("the guide of the output", second, axes)
    for index, (array, picture) in enumerate(zip(samples, pictures.pixels, strict=True)):
        which = f"sample {index}" if count > 1 else "the sample"
        _check_size(f"the guide of {which}", array.shape[:-1], which, picture.shape[:-1])
        if array.shape[-1] != output.shape[-1]:
            raise ValueError(
                f"the guide of the sample has {array.shape[-1]} channels and that of the output {output.shape[-1]}; "
                "give as many"
            )
        if unknown_in(array).any():
            raise ValueError("the guide of the sample has NaN; give a number everywhere; NaN is for that of the output")
    _check_size("the guide of the output", output.shape[:-1], "the output", shape)
    return samples, output


def _guide(name: str, array: Any, axes: int) -> NDArray[Any]:
    guide = pixels_of(name, array, axes)
    if guide.dtype.kind == "f" and np.isinf(guide).any():
        raise ValueError(f"{name} has infinite values; give numbers")
    guide = guide.astype(np.uint8) if guide.dtype == np.bool_ else guide
    return guide[..., None] if guide.ndim == axes else guide


def _check_size(name: str, shape: tuple[int, ...], other: str, wanted: tuple[int, ...]) -> None:
    if shape != wanted:
        sizes = ["x".join(map(str, sides)) for sides in (shape, wanted)]
        raise ValueError(f"{name} is {sizes[0]} and {other} {sizes[1]} (rows x columns); give one size")
