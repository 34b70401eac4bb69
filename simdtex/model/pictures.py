# SPDX-License-Identifier: BSD-3-Clause
"""The pictures of a sample: which pixels are known, which may be used, and which variables are categories."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Pictures:
    """Pictures of one type that a texture is taken from.

    Parameters
    ----------
    pixels : tuple of (rows, cols, C) arrays
        Pictures of any sizes, NaN where a pixel is unknown; or one volume (layers, rows, cols, C).
    unknown : tuple of (rows, cols) bool arrays, optional
        Unknown pixels in addition to NaN: they are never taken, and are no neighbours.
    usable : tuple of (rows, cols) bool arrays, optional
        True for pixels that may be taken; all pixels are neighbours. None: all may be taken.
    categorical : tuple of C bools, optional
        Whether the numbers of a variable (a channel) name categories. None: none do.
    weights : tuple of C floats, optional
        Weights of the variables, which are scaled to the same spread. None: all are on one scale, as colours are.
    shares : tuple of floats, optional
        The share of the output for each picture; they need not add up to 1. None: the pixels of all pictures have equal
        weights.
    """

    pixels: tuple[NDArray[Any], ...]
    unknown: tuple[Mask, ...] | None = None
    usable: tuple[Mask, ...] | None = None
    categorical: tuple[bool, ...] | None = None
    weights: tuple[float, ...] | None = None
    shares: tuple[float, ...] | None = None
    known: tuple[Mask, ...] | None = field(init=False)

    def __post_init__(self) -> None:
        """Replace unknown pixels by the nearest known one, so that every neighbourhood has values."""
        gaps = [unknown_in(picture) for picture in self.pixels]
        if self.unknown:
            gaps = [gap | more for gap, more in zip(gaps, self.unknown, strict=True)]
        if not any(gap.any() for gap in gaps):
            object.__setattr__(self, "known", None)
            return
        if any(gap.all() for gap in gaps):
            raise ValueError("a sample has no known pixel; leave it out")
        object.__setattr__(self, "unknown", tuple(gaps))  # lost in completed pixels; for `replace`
        object.__setattr__(self, "known", tuple(~gap for gap in gaps))
        object.__setattr__(self, "pixels", tuple(completed(*pair) for pair in zip(self.pixels, gaps, strict=True)))

    @property
    def deep(self) -> bool:
        """Whether the sample is a volume."""
        return self.pixels[0].ndim > 3

    @property
    def clean(self) -> bool:
        """Whether there is only one picture, whose pixels are all known and may be taken."""
        return len(self.pixels) == 1 and self.known is None and self.usable is None

    def categories(self, variable: int) -> NDArray[Any] | None:
        """Return the categories of a variable in ascending order; None if it is not categorical."""
        if not (self.categorical and self.categorical[variable]):
            return None
        return np.unique(np.concatenate([self.values(variable, number) for number in range(len(self.pixels))]))

    def values(self, variable: int, number: int) -> NDArray[Any]:
        """Return the known values of a variable in one of the pictures, (n,)."""
        plane = self.pixels[number][..., variable]
        return plane[self.known[number]] if self.known else plane.ravel()

    @property
    def channels(self) -> int:
        """Number of channels of working levels: one for a variable, or one for each category if these are 3 or more."""
        found = [self.categories(variable) for variable in range(self.pixels[0].shape[-1])]
        return sum(1 if those is None or len(those) < 3 else len(those) for those in found)


def kind(picture: NDArray[Any]) -> str:
    """Return the channels and the type of a picture ([layers,] rows, cols, C) as text."""
    count = picture.shape[-1]
    return f"{count} channel{'s' * (count != 1)} of {picture.dtype}"


def check_alike(name: str, picture: NDArray[Any], other: str, like: NDArray[Any]) -> None:
    """Raise unless two pictures with a channel axis have the same type and number of channels."""
    if (picture.dtype, picture.shape[-1]) != (like.dtype, like.shape[-1]):
        raise ValueError(f"{name} has {kind(picture)} and {other} {kind(like)}; convert them to one type")


def unknown_in(picture: NDArray[Any]) -> Mask:
    """Return where a picture ([layers,] rows, cols, C) is NaN in any channel."""
    if picture.dtype.kind != "f":
        return np.zeros(picture.shape[:-1], bool)
    found: Mask = np.isnan(picture).any(-1)
    return found


def completed(picture: NDArray[Any], unknown: Mask) -> NDArray[Any]:
    """Return the picture (rows, cols, C) with each unknown pixel replaced by the nearest known one."""
    if not unknown.any():
        return picture
    from scipy.ndimage import distance_transform_edt  # only for unknown pixels, since it loads slowly

    nearest = distance_transform_edt(unknown, return_distances=False, return_indices=True)
    filled: NDArray[Any] = np.ascontiguousarray(picture[tuple(nearest)])
    return filled
