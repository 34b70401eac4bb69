# SPDX-License-Identifier: BSD-3-Clause
"""What users give beside a sample: several samples, masks, known values, guides; checked, and brought into one form."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex.io.image import check_sample
from simdtex.model.given import Given
from simdtex.model.pictures import Mask, Pictures
from simdtex.options import unmasked


class Inputs(NamedTuple):
    """A job's arrays: the sample's ``pictures``, what is ``given`` of the output, and the ``guide`` as two arrays."""

    pictures: Pictures
    given: Given | None = None
    guide: tuple[tuple[NDArray[Any], ...], NDArray[Any]] | None = None

    @property
    def plain(self) -> bool:
        """Whether there is one sample and nothing else."""
        return self.pictures.clean and self.given is None and self.guide is None

    def identity(self) -> dict[str, Any]:
        """Return everything, by the names that users give it, as what identifies a run."""
        given = self.given
        values = given and (np.where(given.known, given.values, 0), given.known)
        return {
            **{"sample": (self.pictures.pixels, self.pictures.known), "mask": self.pictures.usable, "known": values},
            **{"known_source": given and given.place, "guide": self.guide},
        }


def check_inputs(
    sample: ArrayLike | Sequence[ArrayLike],
    shape: tuple[int, int],
    channel_axis: int | None = None,
    mask: Any = None,
    known: Any = None,
    known_source: Any = None,
    guide: Any = None,
) -> Inputs:
    """Check a job's arrays against one another; the arguments are those of `simdtex.synthesize`."""
    pictures = check_samples(sample, channel_axis, mask)
    given = None if known is None else check_known(known, shape, channel_axis, pictures, known_source)
    return Inputs(pictures, given, None if guide is None else check_guide(guide, shape, pictures))


def check_samples(sample: ArrayLike | Sequence[ArrayLike], channel_axis: int | None, mask: Any = None) -> Pictures:
    """The pictures of a sample: one array, or a list or tuple of arrays; ``mask`` says what may be used, likewise."""
    several = is_several(sample, channel_axis)
    arrays: list[Any] = list(sample) if several else [sample]  # type: ignore[arg-type]
    pixels = [check_sample(array, channel_axis, unknown=True) for array in arrays]
    for number, picture in enumerate(pixels[1:], 1):
        if picture.dtype != pixels[0].dtype or picture.shape[2] != pixels[0].shape[2]:
            raise ValueError(
                f"sample {number} has {_kind(picture)} and sample 0 {_kind(pixels[0])}; give samples of one type"
            )
    gaps = tuple(masked_in(array, channel_axis) for array in arrays)
    unknown = gaps if any(gap.any() for gap in gaps) else None
    if mask is None:
        return Pictures(tuple(pixels), unknown)
    masks = list(mask) if several and np.iterable(mask) else [mask]
    if len(masks) != len(pixels):
        raise ValueError(f"there are {len(pixels)} samples and {len(masks)} masks; give one mask for each")
    usable = [check_mask("mask", one, picture.shape[:2]) for one, picture in zip(masks, pixels, strict=True)]
    if not any(one.any() for one in usable):
        raise ValueError("the mask leaves nothing of the sample to be used; set it True where pixels may be taken from")
    return Pictures(tuple(pixels), unknown, tuple(usable))


def masked_in(array: Any, channel_axis: int | None) -> Mask:
    """Where a masked array (rows, cols) is masked in any channel; nowhere where it is no masked array."""
    mask = np.ma.getmaskarray(array) if np.ma.isMaskedArray(array) else np.zeros(np.shape(array), bool)
    return mask if channel_axis is None else np.asarray(mask.any(channel_axis))


def is_several(sample: Any, channel_axis: int | None) -> bool:
    """Whether a sample is a list or tuple of samples, and not one array written as a list."""
    if not isinstance(sample, (list, tuple)) or not sample:
        return False
    axes = 2 if channel_axis is None else 3
    return all(isinstance(one, np.ndarray) and one.ndim == axes for one in sample)


def check_array(name: str, values: Any) -> NDArray[Any]:
    """An array, or one clear sentence."""
    unmasked(name, values)
    try:
        return np.asarray(values)
    except ValueError:
        raise ValueError(f"{name} is ragged; give rows of equal length") from None


def check_mask(name: str, mask: Any, shape: tuple[int, int]) -> Mask:
    """A bool array of a shape, or one clear sentence."""
    found = check_array(name, mask)
    if found.dtype != np.bool_:
        raise TypeError(f"{name} holds {found.dtype} values; give True and False")
    if found.shape != shape:
        raise ValueError(
            f"{name} is {_size(found)} and the picture {shape[0]}x{shape[1]} (rows x columns); give one size"
        )
    return found


def check_known(
    known: Any, shape: tuple[int, int], channel_axis: int | None, pictures: Pictures, source: Any = None
) -> Given:
    """What is given of an output: a masked array, or an array of floats with NaN for unknown."""
    array = known if isinstance(known, np.ma.MaskedArray) else np.ma.asarray(check_array("known", known))
    axes = 2 if channel_axis is None else 3
    if array.dtype.kind not in "buif":
        raise TypeError(f"known holds {array.dtype} values; give integers or real floats")
    if array.ndim != axes:
        raise ValueError(
            f"known is {array.ndim}-dimensional; give {'(rows, cols)' if axes == 2 else 'the channel axis too'}"
        )
    array = array[..., None] if channel_axis is None else np.moveaxis(array, channel_axis, -1)
    variables, dtype = pictures.pixels[0].shape[2], pictures.pixels[0].dtype
    if array.shape != (*shape, variables):
        raise ValueError(
            f"known is {_size(array)} with {array.shape[2]} channels and the output {shape[0]}x{shape[1]} (rows x "
            f"columns) with {variables}; give one size"
        )
    there = ~np.ma.getmaskarray(array)
    values = array.data
    if values.dtype.kind == "f":
        there &= ~np.isnan(values)
        if np.isinf(values[there]).any():
            raise ValueError("known has infinite values; give numbers, or NaN where nothing is known")
    if not there.any():
        raise ValueError("known has no value; leave it out, or give numbers where something is known")
    if there.all():
        raise ValueError("known leaves nothing to do; give NaN or a masked array where the output is to be made")
    return Given(
        _cast("known", values, there, dtype), there, None if source is None else check_place(source, there, pictures)
    )


def check_place(source: Any, there: Mask, pictures: Pictures) -> NDArray[np.int32]:
    """Where in the sample known pixels are from, (rows, cols, 2 or 3)."""
    place = check_array("known_source", source)
    columns = 2 if len(pictures.pixels) == 1 else 3
    if place.dtype.kind not in "iu" or place.shape != (*there.shape[:2], columns):
        raise ValueError(
            f"known_source is no array of integers ({there.shape[0]}, {there.shape[1]}, {columns}); give a source map"
        )
    used = (place[..., 0] >= 0) & there.all(-1)
    row, col, *rest = np.moveaxis(place[used], -1, 0)
    number = rest[0] if rest else np.zeros(row.shape, np.int32)
    inside = (number >= 0) & (number < len(pictures.pixels))
    sizes = np.array([picture.shape[:2] for picture in pictures.pixels])
    rows, cols = sizes[np.where(inside, number, 0).astype(np.intp)].T
    if not (inside & (row < rows) & (col >= 0) & (col < cols)).all():  # as they are given: a cast would wrap
        raise ValueError("known_source points outside the sample; give -1 where a pixel is not from there")
    found = np.full(place.shape, -1, np.int32)
    found[used] = place[used]
    return found


def check_guide(
    guide: Any, shape: tuple[int, int], pictures: Pictures
) -> tuple[tuple[NDArray[Any], ...], NDArray[Any]]:
    """A guide, ``(of the sample, of the output)``: arrays (rows, cols) or (rows, cols, G)."""
    if not isinstance(guide, (tuple, list)) or len(guide) != 2:
        raise TypeError("guide is no pair; give (guide of the sample, guide of the output)")
    first, second = guide
    several = len(pictures.pixels) > 1
    if several and not (isinstance(first, (list, tuple)) and len(first) == len(pictures.pixels)):
        raise ValueError(f"there are {len(pictures.pixels)} samples; give a list of a guide for each")
    listed = several or (isinstance(first, (list, tuple)) and len(first) == 1 and isinstance(first[0], np.ndarray))
    samples = [_guide("the guide of the sample", one) for one in (first if listed else [first])]
    output = _guide("the guide of the output", second)
    for number, (one, picture) in enumerate(zip(samples, pictures.pixels, strict=True)):
        if one.shape[:2] != picture.shape[:2]:
            which = f"sample {number}" if several else "the sample"
            raise ValueError(f"the guide of {which} is {_size(one)} and {which} {_size(picture)}; give one size")
        if one.shape[2] != output.shape[2]:
            raise ValueError(
                f"the guide of the sample has {one.shape[2]} channels and that of the output {output.shape[2]}; "
                "give as many"
            )
        if one.dtype.kind == "f" and np.isnan(one).any():
            raise ValueError(
                "the guide of the sample has NaN; give a number everywhere, and NaN in that of the output alone"
            )
    if output.shape[:2] != shape:
        raise ValueError(
            f"the guide of the output is {_size(output)} and the output {shape[0]}x{shape[1]} (rows x columns); "
            "give one size"
        )
    return tuple(samples), output


def _guide(name: str, array: Any) -> NDArray[Any]:
    found = check_array(name, array)
    if found.dtype.kind not in "buif":
        raise TypeError(f"{name} holds {found.dtype} values; give integers or real floats")
    if found.ndim not in (2, 3) or not found.size:
        raise ValueError(f"{name} is {found.ndim}-dimensional; give (rows, cols) or (rows, cols, channels)")
    if found.dtype.kind == "f" and np.isinf(found).any():
        raise ValueError(f"{name} has infinite values; give numbers")
    found = found.astype(np.uint8) if found.dtype == np.bool_ else found
    return found[..., None] if found.ndim == 2 else found


def _cast(name: str, values: NDArray[Any], there: Mask, dtype: np.dtype[Any]) -> NDArray[Any]:
    """Values as a type that must hold those that are there exactly; 0 elsewhere."""
    kept = np.where(there, values, np.zeros((), values.dtype))
    with np.errstate(invalid="ignore", over="ignore"):
        found = kept.astype(dtype)
        wrong = there & (found.astype(np.float64) != kept.astype(np.float64))
    if dtype.kind == "f":
        wrong &= ~np.isfinite(found)
    if wrong.any():
        raise ValueError(
            f"{name} holds {kept[wrong][0]}, which the sample's type {dtype} does not; give values of that type"
        )
    return np.asarray(found)


def _kind(picture: NDArray[Any]) -> str:
    return f"{picture.shape[2]} channels of {picture.dtype}"


def _size(array: NDArray[Any]) -> str:
    return "x".join(str(n) for n in array.shape[:2])
