# SPDX-License-Identifier: BSD-3-Clause
"""What an option may be, said where it is declared; and one sentence that says what is wrong and what would be right.

A field of a method's options has its kind in its metadata: `words`, `integer`, `number_of`, `switch`. From there it is
checked, and the command line completes it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from difflib import get_close_matches
from math import isfinite, prod
from numbers import Integral, Real
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T")

MOST = 2**31 - 1
"""The largest whole number that an option takes, where it names no other: kernels count in 32 bits."""

GREATEST = 1e6
"""The largest number that an option takes, where it names no other: beyond it a weight is the only one that counts."""

LONGEST = 100
"""Characters of a value that a sentence repeats, at most."""


@dataclass(frozen=True)
class Words:
    """One of some words."""

    valid: tuple[str, ...]

    def check(self, name: str, value: Any) -> None:
        """Raise unless it is one of them."""
        one_of(name, value, self.valid)


@dataclass(frozen=True)
class Whole:
    """A whole number from `least` to `most`."""

    least: int
    most: int = MOST

    def check(self, name: str, value: Any) -> None:
        """Raise unless it is one."""
        whole(name, value, self.least, self.most)


@dataclass(frozen=True)
class Number:
    """A number from `least`, or above it, to `most`."""

    least: float
    most: float = GREATEST
    above: bool = False

    def check(self, name: str, value: Any) -> None:
        """Raise unless it is one."""
        real(name, value, self.least, self.most, above=self.above)


@dataclass(frozen=True)
class Switch:
    """True or False."""

    def check(self, name: str, value: Any) -> None:
        """Raise unless it is one of them."""
        true_or_false(name, value)


Kind = Words | Whole | Number | Switch


def words(default: str | None, *valid: str) -> Any:
    """A field that is one of these words."""
    return _declared(default, Words(valid))


def integer(default: int | None, least: int, most: int = MOST) -> Any:
    """A field that is a whole number."""
    return _declared(default, Whole(least, most))


def number_of(default: float | None, least: float, most: float = GREATEST, *, above: bool = False) -> Any:
    """A field that is a number."""
    return _declared(default, Number(least, most, above))


def switch(default: bool | None) -> Any:
    """A field that is True or False."""
    return _declared(default, Switch())


def _declared(default: Any, kind: Kind) -> Any:
    return field(default=default, metadata={"kind": kind})


def kinds(options: Any) -> dict[str, Kind]:
    """The kinds of a method's options, a class or one of its kind, by name: of those that are declared with one."""
    return {one.name: one.metadata["kind"] for one in fields(options) if "kind" in one.metadata}


def check(options: Any) -> None:
    """Raise unless every declared value is of its kind; None is where it is the default."""
    for one in fields(options):
        kind, value = one.metadata.get("kind"), getattr(options, one.name)
        if kind and not (value is None and one.default is None):
            kind.check(one.name, value)


def build(options: type[T], method: str, given: Mapping[str, Any], also: tuple[str, ...] = ()) -> T:
    """A method's options from what the user gave; an unknown name is a TypeError that lists the valid ones."""
    valid = [f.name for f in fields(options)]  # type: ignore[arg-type]
    for name in given:
        if name not in valid:
            near = get_close_matches(name, [*also, *valid], 1, 0.75)
            meant = f" (did you mean {near[0]!r}?)" if near else ""
            raise TypeError(
                f"unknown option {name!r} of the method {method!r}{meant}; choose from: {', '.join([*also, *valid])}"
            )
    return options(**given)


SMALLER = "give a smaller size"
"""What helps where an output is too large."""


def one_of(name: str, value: Any, valid: Iterable[str]) -> None:
    """Raise ValueError unless the value is one of the valid ones, and list them."""
    valid = list(valid)
    if not isinstance(value, str) or value not in valid:
        raise ValueError(f"unknown {name} {shown(value)}; choose one of: {', '.join(valid)}")


def true_or_false(name: str, value: Any) -> None:
    """Raise TypeError unless the value is True or False."""
    if not isinstance(value, bool):
        raise TypeError(f"{name} must be True or False, not {shown(value)}")


def whole(name: str, value: Any, least: int, most: float = MOST) -> None:
    """Raise unless the value is an integer from `least` to `most`."""
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise TypeError(f"{name} must be an integer, not {shown(value)}")
    if value < least:
        raise ValueError(f"{name} is {number(value)}; give {least} or more")
    if int(value) > most:
        raise ValueError(f"{name} is {number(value)}; give {most} or fewer")


def real(name: str, value: Any, least: float, most: float = GREATEST, *, above: bool = False) -> None:
    """Raise unless the value is a number from `least`, or above it, to `most`."""
    if isinstance(value, bool) or not isinstance(value, Real):
        raise TypeError(f"{name} must be a number, not {shown(value)}")
    if not _finite(value) or value < least or (above and value == least):
        raise ValueError(f"{name} is {number(value)}; give a number {'above' if above else 'of at least'} {least}")
    if float(value) > most:
        raise ValueError(f"{name} is {number(value)}; give at most {most:g}")


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


def shown(value: Any) -> str:
    """A value in one line, cut where it is long."""
    try:
        text = " ".join(repr(value).split())
    except ValueError:  # an integer of thousands of digits
        text = f"a value of type {type(value).__name__}"
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."


def number(value: Any) -> str:
    """A number, or what kind of number it is where it has too many digits."""
    try:
        text = str(value)
    except ValueError:
        return "a number of thousands of digits"
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."


def _finite(value: Real) -> bool:
    try:
        return isfinite(value)
    except OverflowError:  # an integer beyond the largest double
        return False


def within_32_bits(shape: tuple[int, ...], values: int, remedy: str = SMALLER) -> None:
    """Raise unless so many values for each pixel of an output, or voxel of a block, can be counted in 32 bits."""
    if prod(shape) * values < 2**31:
        return
    size = " x ".join(str(side) for side in shape)
    what = f"an output of {shape[0]} rows x {shape[1]} columns" if len(shape) == 2 else f"a block of {size}"
    each = "" if values == 1 else f", {values} for each {'pixel' if len(shape) == 2 else 'voxel'}"
    raise ValueError(f"{what} is beyond 2**31 values{each}; {remedy}")
