# SPDX-License-Identifier: BSD-3-Clause
"""Checks that options share: one sentence that says what is wrong and what would be right."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields
from math import isfinite
from numbers import Integral, Real
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T")


def build(options: type[T], method: str, given: Mapping[str, Any], also: tuple[str, ...] = ()) -> T:
    """A method's options from what the user gave; an unknown name is a TypeError that lists the valid ones."""
    valid = [f.name for f in fields(options)]  # type: ignore[arg-type]
    for name in given:
        if name not in valid:
            raise TypeError(
                f"unknown option {name!r} of the method {method!r}; choose from: {', '.join([*also, *valid])}"
            )
    return options(**given)


def one_of(name: str, value: Any, valid: Iterable[str]) -> None:
    """Raise ValueError unless the value is one of the valid ones, and list them."""
    valid = list(valid)
    if value not in valid:
        raise ValueError(f"unknown {name} {value!r}; choose one of: {', '.join(valid)}")


def true_or_false(name: str, value: Any) -> None:
    """Raise TypeError unless the value is True or False."""
    if not isinstance(value, bool):
        raise TypeError(f"{name} must be True or False, not {value!r}")


def whole(name: str, value: Any, least: int) -> None:
    """Raise unless the value is an integer of at least `least`."""
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise TypeError(f"{name} must be an integer, not {value!r}")
    if value < least:
        raise ValueError(f"{name} is {value}; give {least} or more")


def real(name: str, value: Any, least: float, *, above: bool = False) -> None:
    """Raise unless the value is a finite number of at least (or above) `least`."""
    if isinstance(value, bool) or not isinstance(value, Real):
        raise TypeError(f"{name} must be a number, not {value!r}")
    if not _finite(value) or value < least or (above and value == least):
        raise ValueError(f"{name} is {value}; give a number {'above' if above else 'of at least'} {least}")


def unmasked(name: str, value: Any) -> None:
    """Raise where a masked array hides values, which would be taken as if they were there."""
    if np.ma.is_masked(value):
        count = int(np.count_nonzero(np.ma.getmaskarray(value)))
        raise ValueError(
            f"{name} has {count} masked value{'s' * (count != 1)}, and none may be masked; fill them first"
        )


def real_array(name: str, value: Any) -> NDArray[Any]:
    """The value as an array of finite real numbers; raises where it is none."""
    unmasked(name, value)
    try:
        array = np.asarray(value)
    except ValueError:
        raise ValueError(f"{name} is ragged; give rows of equal length") from None
    if array.dtype.kind not in "buif":
        raise TypeError(f"{name} holds {array.dtype} values; convert it to integers or real floats")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} has values that are NaN or infinite; fill them first")
    return array


def _finite(value: Real) -> bool:
    try:
        return isfinite(value)
    except OverflowError:  # an integer beyond the largest double
        return False


def within_32_bits(shape: tuple[int, int], values: int) -> None:
    """Raise unless so many values for each pixel of an output can be counted in 32 bits."""
    if shape[0] * shape[1] * values >= 2**31:
        raise ValueError(
            f"an output of {shape[0]} rows x {shape[1]} columns is beyond 2**31 values; give a smaller size"
        )
