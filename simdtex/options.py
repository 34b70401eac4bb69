# SPDX-License-Identifier: BSD-3-Clause
"""The table of options: the declarations in the fields of a method's `Options`, and checks and texts of values.

An option is declared once, by `option`, as a field of the frozen dataclass ``Options`` of its method. The declaration
gives its check, its entry in the docstring, its type in ``simdtex/__init__.pyi``, and its entries on the
command line, on the live page and in the reference pages.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields
from difflib import get_close_matches
from importlib.util import find_spec
from inspect import signature
from math import isfinite, prod
from numbers import Integral, Real
from textwrap import indent, wrap
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T")

MOST = 2**31 - 1
"""The default maximum of an integer option, since kernels count in 32 bits."""

GREATEST = 1e6
"""The default maximum of a number option: a larger weight would make all others negligible."""

UNSET = object()
"""Marks a value that is not given, since None is a value."""

LONGEST = 100
"""The most characters of a value in an error message."""


class DataWarning(UserWarning):
    """Values of an input are not used as they are."""


@dataclass(frozen=True)
class Choice:
    """One of several words."""

    valid: tuple[str, ...]

    def check(self, name: str, value: Any) -> None:
        """Raise unless the value is one of the words."""
        one_of(name, value, self.valid)

    def __str__(self) -> str:
        return "{" + ", ".join(f'"{word}"' for word in self.valid) + "}"


@dataclass(frozen=True)
class Whole:
    """An integer from `least` to `most`."""

    least: int
    most: int = MOST

    def check(self, name: str, value: Any) -> None:
        """Raise unless the value is an integer within the range."""
        whole(name, value, self.least, self.most)

    def __str__(self) -> str:
        return f"int, {self.least} or more" if self.most == MOST else f"int, {self.least} to {self.most}"


@dataclass(frozen=True)
class Number:
    """A number from `least` to `most`, one of which may be excluded."""

    least: float
    most: float = GREATEST
    above: bool = False
    below: bool = False

    def check(self, name: str, value: Any) -> None:
        """Raise unless the value is a number within the range."""
        real(name, value, self.least, self.most, above=self.above, below=self.below)

    def __str__(self) -> str:
        if self.below:
            return f"float, below {self.most}"
        least = f"above {self.least}" if self.above else f"{self.least} or more"
        return f"float, {least if self.most in (GREATEST, np.inf) else f'{self.least} to {self.most:g}'}"


@dataclass(frozen=True)
class Switch:
    """True or False."""

    def check(self, name: str, value: Any) -> None:
        """Raise unless the value is True or False."""
        true_or_false(name, value)

    def __str__(self) -> str:
        return "bool"


@dataclass(frozen=True)
class Numbers:
    """A tuple of numbers from 0 to ``most``, one of which is above 0; relative numbers may be counts up to 2**53."""

    most: float = GREATEST

    def check(self, name: str, value: Any) -> None:
        """Raise unless the value is such a tuple."""
        if not isinstance(value, tuple) or not value:
            raise TypeError(f"{name} must be a tuple of numbers, not {shown(value)}")
        for item in value:
            real(f"one of {name}", item, 0, self.most)
        if not any(value):
            raise ValueError(f"{name} are all 0; give a number above 0")

    def __str__(self) -> str:
        return "tuple of float"


@dataclass(frozen=True)
class Other:
    """Any other value: ``examine`` raises if it is not valid, and ``says`` is the type, as in a docstring.

    With ``flag`` the command line and the live page offer only True and False; the shell completes ``valid``.
    """

    examine: Callable[[Any], object]
    says: str
    flag: bool = False
    valid: tuple[str, ...] = ()

    def check(self, name: str, value: Any) -> None:
        """Raise unless the value is valid."""
        self.examine(value)

    def __str__(self) -> str:
        return self.says


Kind = Choice | Whole | Number | Switch | Numbers | Other


def is_flag(kind: Kind) -> bool:
    """Return whether the command line and the live page give no value but True or False."""
    return isinstance(kind, Switch) or (isinstance(kind, Other) and kind.flag)


@dataclass(frozen=True)
class Option:
    """The declaration of an option."""

    default: Any
    kind: Kind  # type and range
    help: str  # what the option does, in one sentence that begins with a verb and has no final stop
    more: str = ""  # further sentences for the docstring and the reference pages
    none: str = ""  # meaning of the default None
    symbol: str = ""  # symbol and equation in the paper
    paper: Any = UNSET  # the paper's value, if it differs from the default
    jobs: Mapping[str, Any] = field(default_factory=dict)  # job, named as its command: its default, if that differs
    shown: tuple[str, ...] = ()  # the commands that have the option
    group: str = ""  # the heading under which commands and the live page list it
    unit: str = ""
    slider: tuple[float, float, float] | None = None  # least, largest, step; a number without has no control
    label: str = ""  # the name on the live page; by default that of the field
    hint: str = ""  # the help on the live page, if the page offers less than the command line

    def default_of(self, job: str) -> Any:
        """Return the default value in a job; ``"simulate 3-D values"`` falls back on ``"simulate 3-D"``, and so on."""
        while job not in self.jobs and " " in job:
            job = job.rpartition(" ")[0]
        return self.jobs.get(job, self.default)

    def check(self, name: str, value: Any) -> None:
        """Raise unless the value is valid; None is valid if it is the default."""
        if value is not None or self.default is not None:
            self.kind.check(name, value)

    def described(self) -> str:
        """Return the declaration in sentences, but for the type and default."""
        text = [f"{self.help}.", self.more, f"None: {self.none}." if self.none else ""]
        text.append(f"In the paper: {self.symbol}." if self.symbol else "")
        if self.jobs:
            jobs = [f"``{quoted(value)}`` in ``{job}``" for job, value in self.jobs.items()]
            text.append(f"By default {', '.join(jobs)}.")
        text.append("" if self.paper is UNSET else f'With ``preset="paper"``: ``{quoted(self.paper)}``.')
        return " ".join(sentence for sentence in text if sentence)


PRESETS = ("default", "paper")

PRESET = Option(
    "default",
    Choice(PRESETS),
    "Start from the defaults of the method (default), or from the rules of its paper (paper)",
    group="Job",
)
"""The option ``preset``, which every method has in addition to its table."""


def option(default: Any, kind: Kind, help: str, **more: Any) -> Any:
    """Return a field of `Options` that declares an option; the arguments are those of `Option`."""
    return field(default=default, metadata={"option": Option(default, kind, help, **more)})


def table(options: Any) -> dict[str, Option]:
    """Return the options of a class, or of an instance, by name."""
    return {field.name: field.metadata["option"] for field in fields(options)}


def check(options: Any) -> None:
    """Raise unless every value of an instance is valid."""
    for name, option in table(options).items():
        option.check(name, getattr(options, name))


def has_presets(declared: Mapping[str, Option]) -> bool:
    """Return whether a paper has other values than the defaults of a table of options."""
    return any(option.paper is not UNSET for option in declared.values())


def preset_values(options: Any, preset: str) -> dict[str, Any]:
    """Return the values of a preset of a class of options."""
    one_of("preset", preset, PRESETS)
    declared = table(options).items() if preset == "paper" else ()
    return {name: option.paper for name, option in declared if option.paper is not UNSET}


ARGUMENTS = {"seed": "rng", "random_state": "rng"}
ARGUMENTS |= {name: name for name in ("rng", "device", "channel_axis", "callback", "checkpoint", "full_output")}
"""Arguments of the functions beside the options, by their names and by those of other libraries."""


def resolve(options: type[T], job: str, given: Mapping[str, Any], function: Callable[..., Any] | None = None) -> T:
    """Return the options of a job: the method's defaults < the job's < the preset's < the user's values.

    ``job`` is the name of its command. A name that is unknown may be a parameter of the public ``function``, misspelt.
    """
    declared = table(options)
    known = ["preset"] * has_presets(declared) + [*declared]
    for name in given:
        if name not in known:
            parameters = [*signature(function).parameters] if function else []
            near = get_close_matches(name, [*known, *parameters, *ARGUMENTS], 1, 0.66)
            meant = f" (did you mean {ARGUMENTS.get(near[0], near[0])!r}?)" if near else ""
            method = options.__module__.split(".")[2]
            raise TypeError(f"unknown option {name!r} of the method {method!r}{meant}; choose from: {', '.join(known)}")
    values = {name: option.default_of(job) for name, option in declared.items()}
    values |= preset_values(options, given.get("preset", "default"))
    values |= {name: tuple(value) if isinstance(value, list) else value for name, value in given.items()}
    values.pop("preset", None)
    return options(**values)


def documented(options: type[T]) -> type[T]:
    """Append the section Parameters to the docstring of a class of options."""
    lines = ["Parameters", "----------"]
    for name, option in table(options).items():
        default = ", optional" if option.default is None else f", default {quoted(option.default)}"
        unit = f", in {option.unit}" if option.unit else ""
        lines.append(f"{name} : {option.kind}{unit}{default}")
        lines += wrap(option.described(), 112, initial_indent="    ", subsequent_indent="    ", break_on_hyphens=False)
    section = indent("\n".join(lines), "    ")
    options.__doc__ = f"{(options.__doc__ or '').rstrip()}\n\n{section}\n    "
    return options


def quoted(value: Any) -> str:
    """Return a value as in Python, a text in double quotes."""
    return f'"{value}"' if isinstance(value, str) else str(value)


SMALLER = "give a smaller size"
"""The remedy for a too large output."""


def one_of(name: str, value: Any, valid: Iterable[str]) -> None:
    """Raise ValueError, which lists the valid values, unless the value is one of them."""
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
        raise ValueError(f"{name} is {shown(value, str)}; give {least} or more")
    if int(value) > most:
        raise ValueError(f"{name} is {shown(value, str)}; give {most} or fewer")


def real(
    name: str, value: Any, least: float, most: float = GREATEST, *, above: bool = False, below: bool = False
) -> None:
    """Raise unless the value is a number from `least` to `most`; `above` and `below` exclude these."""
    if isinstance(value, bool) or not isinstance(value, Real):
        raise TypeError(f"{name} must be a number, not {shown(value)}")
    if not (_finite(value) or value == most) or value < least or (above and value == least):
        raise ValueError(
            f"{name} is {shown(value, str)}; give a number {'above' if above else 'of at least'} {least:g}"
        )
    if float(value) > most or (below and value == most):
        raise ValueError(f"{name} is {shown(value, str)}; give {'a number below' if below else 'at most'} {most:g}")


def require(extra: str, *libraries: str) -> None:
    """Raise unless the libraries of an extra of the package are installed."""
    for library in libraries:
        if find_spec(library) is None:
            raise ValueError(f"{library} is not installed; pip install 'simdtex[{extra}]'")


def unmasked(name: str, value: Any) -> None:
    """Raise if a masked array hides values, which NumPy would not heed."""
    if np.ma.is_masked(value):
        count = int(np.count_nonzero(np.ma.getmaskarray(value)))
        raise ValueError(
            f"{name} has {count} masked value{'s' * (count != 1)}, and none may be masked; fill them first"
        )


def check_real(name: str, array: NDArray[Any]) -> None:
    """Raise unless an array holds real numbers."""
    if array.dtype.kind not in "buif":
        raise TypeError(f"{name} holds {array.dtype} values; convert it to integers or real floats")


LARGEST = 1e100
"""The largest value for which figures are computed: sums of squares are then finite."""


def moderate(name: str, *arrays: NDArray[Any]) -> None:
    """Raise ValueError if arrays have values beyond `LARGEST`."""
    if any(max(float(array.max()), -float(array.min())) > LARGEST for array in arrays):
        raise ValueError(f"{name} has values beyond {LARGEST:g}: give them in a larger unit")


def real_array(name: str, value: Any) -> NDArray[Any]:
    """Return the value as an array of finite real numbers; raise if it is not one."""
    unmasked(name, value)
    try:
        array = np.asarray(value)
    except ValueError:
        raise ValueError(f"{name} is ragged; give rows of equal length") from None
    check_real(name, array)
    if not np.isfinite(array).all():
        raise ValueError(f"{name} has values that are NaN or infinite; fill them first")
    return array


def shown(value: Any, form: Callable[[Any], str] = repr) -> str:
    """Return a value in one line, cut if it is long."""
    try:
        text = " ".join(form(value).split())
    except ValueError:  # an integer of thousands of digits
        return "a number of thousands of digits"
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."


def _finite(value: Real) -> bool:
    try:
        return isfinite(value)
    except OverflowError:  # an integer beyond the largest double
        return False


def within_32_bits(shape: tuple[int, ...], values: int, remedy: str = SMALLER) -> None:
    """Raise unless ``values`` values for each pixel of an output, or voxel of a block, can be counted in 32 bits."""
    if prod(shape) * values < 2**31:
        return
    size = " x ".join(str(side) for side in shape)
    what = f"an output of {shape[0]} rows x {shape[1]} columns" if len(shape) == 2 else f"a block of {size}"
    each = "" if values == 1 else f", {values} for each {'pixel' if len(shape) == 2 else 'voxel'}"
    raise ValueError(f"{what} is beyond 2**31 values{each}; {remedy}")


class Brief:
    """A base of dataclasses, declared with ``repr=False``, that hold arrays."""

    def __repr__(self) -> str:
        """Return the fields with the shape and the type of arrays, whose values would fill pages, without functions."""
        names = [field.name for field in fields(self) if field.repr]  # type: ignore[arg-type]
        values = {name: getattr(self, name) for name in names}
        told = [f"{name}={_short(value)}" for name, value in values.items() if not (value is None or callable(value))]
        return f"{type(self).__name__}({', '.join(told)})"


def _short(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {'x'.join(map(str, value.shape))}"
    if isinstance(value, dict):
        value = {name: _short(item) for name, item in value.items()}
    return shown(value)
