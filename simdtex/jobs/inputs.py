# SPDX-License-Identifier: BSD-3-Clause
"""The inputs of a job, each checked once, where it enters the Python API; and what all public functions share."""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from copy import deepcopy
from dataclasses import replace
from functools import partial, wraps
from inspect import Parameter, Signature, cleandoc
from math import prod
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex.checkpoint import Checkpointing, digest
from simdtex.driver import Plan, check_shape, check_sides, drive, execute
from simdtex.inputs import Input, inputs, options_of, parameter_types
from simdtex.io.hard_data import HardData, place_hard_data, read_hard_data
from simdtex.io.image import AXES, as_array, cast, check_sample, pixels_of, plain_array
from simdtex.io.places import ascending, located
from simdtex.machine import Machine, memory
from simdtex.maspar.accounting import accounting
from simdtex.model.given import Given
from simdtex.model.guide import GuidePair
from simdtex.model.light import Relit, Trend, trend, unevenness
from simdtex.model.pictures import HALVES, Mask, Pictures, Turned, check_alike, few, turned, unknown_in
from simdtex.options import UNSET, DataWarning, check_real, entries, lists, option_parameters
from simdtex.run import Callback, Output, Progress

SUMS = 1e-3
"""The largest deviation of a sum of probabilities from 1; they are divided by the sum."""

RAISES = """\
Raises
------
ValueError, TypeError
    An argument is invalid; the message names the remedy.
"""

OUTPUT = """\
output : simdtex.run.Output
    Only with ``full_output=True``.
"""

SHARED = ("rng", "device", "callback", "checkpoint", "options")
"""The inputs of a job that are not copied; a schedule among the options may tell its owner what it saw."""

ABSENT = SimpleNamespace(channel_axis=None, rng=None, full_output=False, checkpoint=None, mask=None, known_source=None)
"""The values of inputs that a job does not have."""


class Work(NamedTuple):
    """What the function of a job does, once its inputs are checked.

    ``run`` is a plan, or a function that drives several in turn; ``options`` are those of the method; ``axis`` is the
    channel axis of the returned picture; and ``finish(picture, output)`` returns what the function returns instead.
    ``light`` is for the statistics, and ``relit`` puts the light back into pictures of the run.
    """

    run: Plan | Callable[[Machine, int, Callback | None, Checkpointing], tuple[NDArray[Any], Output]]
    options: Any
    axis: int | None
    finish: Callable[[Any, Output], Any] | None = None
    light: dict[str, Any] | None = None
    relit: Relit | None = None

    def lit(
        self, machine: Machine, seed: int, callback: Callback | None, checkpointing: Checkpointing
    ) -> tuple[NDArray[Any], Output]:
        """Run the job; its pictures have the light of the picture that they continue."""
        run: Any = (
            self.run
            if callable(self.run)
            else partial(drive, self.run, others=accounting(vars(self.options).get("array")))
        )
        relit, seen = self.relit, callback
        if relit and callback:

            def seen(progress: Progress) -> Any:
                return callback(replace(progress, image=lambda: relit(progress.image(), progress.level)))

        made, output = run(machine, seed, seen, checkpointing)
        if self.light:
            output.statistics["light"] = self.light
        if relit is None:
            return made, output
        stages = [replace(stage, image=relit(stage.image, stage.level)) for stage in output.stages]
        return relit(made), replace(output, stages=stages)


def public(job: str, without: str = "") -> Callable[[Callable[[Any], Work]], Any]:
    """Return a decorator that makes the public function of a job from a function that plans it.

    ``plan(call)`` gets all inputs of `simdtex.inputs` by name, as their checks return them, and ``options``, those of
    the job's methods, but for the one `without`, as they were given. The public function has these parameters, and its
    docstring describes them; it opens the device and the checkpoint, runs the `Work` and returns the result. Its
    attribute ``prepare``, with the same parameters, returns the call and the work.
    """
    own = {name: one for name, one in inputs(job).items() if not one.command_only}
    methods = [*options_of(job).values()]
    written = Signature(
        [
            *(_parameter(name, own[name], type_) for name, type_ in parameter_types(job).items()),
            *[Parameter("options", Parameter.VAR_KEYWORD, annotation="Any")] * bool(methods),
        ]
    )

    def decorate(plan: Callable[[Any], Work]) -> Any:
        def prepare(*args: Any, **given: Any) -> tuple[Any, Work]:
            bound = written.bind(*args, **given)
            bound.apply_defaults()
            if bound.arguments.get("callback") is not None:
                bound.arguments |= {name: kept(one) for name, one in bound.arguments.items() if name not in SHARED}
            call = SimpleNamespace(**{**vars(ABSENT), **bound.arguments})
            for name, one in own.items():
                value = getattr(call, name)
                one.check(name, value)
                if one.checker and value is not None:
                    setattr(call, name, CHECKS[one.checker](name, value, call))
            return call, plan(call)

        @wraps(plan)
        def function(*args: Any, **given: Any) -> Any:
            call, work = prepare(*args, **given)

            def identity() -> dict[str, Any]:
                found = {name: IDENTITIES[one.identity](call, name) for name, one in own.items() if one.identity}
                return found | {"options": work.options}

            shared = (work.axis, call.rng, call.device, call.callback, bool(work.finish or call.full_output))
            made: Any = execute(plan.__name__, work.lit, identity, *shared, call.checkpoint)
            return work.finish(*made) if work.finish else made

        if plan.__doc__:
            function.__doc__ = _described(plan.__doc__, own, methods)
        vars(function).update(__signature__=written, prepare=prepare)
        return lists(option_parameters(job, *methods, without=without))(function)

    return decorate


def kept(value: Any) -> Any:
    """Return a copy of an argument, whose arrays a callback may change; itself if it is of a type without copies."""
    with suppress(Exception):
        return deepcopy(value)
    return value


def _described(doc: str, own: dict[str, Input], methods: list[Any]) -> str:
    """Return the docstring of a public function from one without the sections Parameters and Raises."""
    about, returns, *notes = re.split(r"^(?=\w+\n---)", cleandoc(doc), flags=re.MULTILINE)
    alone = {name for name, one in own.items() if one.method and len(methods) > 1}  # of one of several methods
    told = {name: replace(one, doc=f"``{one.method}``: {one.doc}") for name, one in own.items() if name in alone}
    tables = ", ".join(f"`{one.__module__.removesuffix('.options')}.{one.__qualname__}`" for one in methods)
    options = f"**options\n    Those of the method, see {tables}.\n" if methods else ""
    output = OUTPUT if "full_output" in own and "\noutput :" not in returns else ""
    return about + "\n".join(
        [f"{entries(own | told)}\n{options}", f"{returns.rstrip()}\n{output}", RAISES, "".join(notes)]
    )


def _parameter(name: str, one: Input, type_: str) -> Parameter:
    kind = Parameter.POSITIONAL_OR_KEYWORD if one.positional else Parameter.KEYWORD_ONLY
    return Parameter(name, kind, default=Parameter.empty if one.default is UNSET else one.default, annotation=type_)


# The arrays of a job

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

    def identity(self, name: str) -> Any:
        """Return the arrays of an argument, as a part of the identity of a run."""
        if name in ("sample", "training"):
            return self.pictures.pixels, self.pictures.known
        if name in ("mask", "guide"):
            return self.pictures.usable if name == "mask" else self.guide
        given = self.given if self.given and self.given.given_mask.any() else None
        if name == "known_source":
            return given and given.place
        return given and (np.where(given.given_mask, given.values, 0), given.given_mask)


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
    """Check the arrays of a job, and return them; the parameters are those of `simdtex.synthesize`.

    ``sample`` may already be checked. ``place(table, shape, dtype)`` places a table of known values.
    """
    pictures = sample if isinstance(sample, Pictures) else check_samples(sample, channel_axis, mask)
    given = None if known is None else check_known(known, shape, channel_axis, pictures, known_source, place)
    return Inputs(pictures, given, None if guide is None else check_guide(guide, shape, pictures))


def check_samples(sample: Any, channel_axis: int | None, mask: Any = None, axes: int = 2) -> Pictures:
    """Check a sample, or a list or tuple of samples, with the ``mask`` or masks of usable pixels, and return them.

    With 3 ``axes`` the samples are volumes.
    """
    several = is_several(sample, channel_axis, axes)
    arrays: list[Any] = [as_array("a sample", one) for one in sample] if several else [sample]
    if several and len(kinds := {one.ndim for one in arrays}) > 1:
        counts = f"{min(kinds)} and {max(kinds)}"
        raise ValueError(f"the samples have {counts} axes; give samples of one type, grey or colour")
    pixels, unknown = zip(*(check_picture(one, channel_axis, axes) for one in arrays), strict=True)
    for number, picture in enumerate(pixels[1:], 1):
        check_alike(f"sample {number}", picture, "sample 0", pixels[0])
    if mask is None:
        return Pictures(pixels, unknown)
    masks = list(mask) if several and np.iterable(mask) else [mask]
    if len(masks) != len(pixels):
        raise ValueError(f"there are {len(pixels)} samples and {len(masks)} masks; give one mask for each")
    usable = tuple(check_mask(one, picture.shape[:-1]) for one, picture in zip(masks, pixels, strict=True))
    if not any(one.any() for one in usable):
        raise ValueError("the mask leaves nothing of the sample to be used; set it True where pixels may be taken from")
    return Pictures(pixels, unknown, usable)


def check_picture(image: Any, channel_axis: int | None, axes: int = 2) -> tuple[NDArray[Any], Mask]:
    """Check a picture; return its pixels (rows, cols, channels), and the mask (rows, cols) of unknown ones.

    A pixel is unknown if a channel is NaN or masked. With 3 ``axes`` it is a volume (layers, rows, cols, channels).
    """
    array = as_array("the sample", image)
    pixels = check_sample(array, channel_axis, unknown=True, axes=axes)
    hidden = np.ma.getmaskarray(array)
    return pixels, unknown_in(pixels) | (hidden if channel_axis is None else hidden.any(channel_axis))


def with_light(pictures: Pictures, light: str, categorical: Any = False) -> tuple[Pictures, dict[str, Any]]:
    """Return the pictures of a sample with the option ``light``, and how uneven their light is, for the statistics.

    Only pixels that are known and may be taken count. Raises ValueError if the values are categories.
    """
    about = {"light": light, **unevenness(pictures.pixels[0])}
    if light == "keep":
        return pictures, about
    use = [np.ones(one.shape[:2], bool) for one in pictures.pixels]
    for masks in filter(None, (pictures.known, pictures.usable)):
        use = [one & mask for one, mask in zip(use, masks, strict=True)]
    found = trends(pictures.pixels, use, categorical)
    pixels = tuple(one.removed(picture) for one, picture in zip(found, pictures.pixels, strict=True))
    return replace(pictures, pixels=pixels), about


def trends(pixels: Sequence[NDArray[Any]], use: Sequence[Mask], categorical: Any) -> list[Trend]:
    """Return the trends that ``light="even"`` removes; raise ValueError if the values are categories."""
    if categorical or few(pixels):
        raise ValueError(
            'light="even" subtracts a smooth trend, and categories, or at most 16 different pixels, have none; '
            "leave light out"
        )
    return [trend(*pair) for pair in zip(pixels, use, strict=True)]


def is_several(sample: Any, channel_axis: int | None, axes: int = 2) -> bool:
    """Return whether a sample is a list or tuple of samples, and not one array written as a list."""
    if not isinstance(sample, (list, tuple)):
        return False
    each = [0 if isinstance(one, (list, tuple)) else np.ndim(one) for one in sample]
    return axes + (channel_axis is not None) in each and min(each) >= 2


def check_mask(mask: Any, shape: tuple[int, ...], name: str = "mask", of: str = "the picture") -> Mask:
    """Return a mask as a bool array of ``shape``; raise if it is not one."""
    found = plain_array(name, mask)
    if found.dtype != np.bool_:
        raise TypeError(f"{name} holds {found.dtype} values; give True and False")
    _check_size(name, found.shape, of, shape)
    return found


def as_known(known: Any, name: str = "known", pictures: Pictures | None = None) -> HardData | NDArray[Any]:
    """Return known values as an array or as a table: a path, or a DataFrame whose columns have names.

    Codes of unknown values within the values of ``pictures`` are values.
    """
    if isinstance(known, (str, os.PathLike)) or all(isinstance(one, str) for one in getattr(known, "columns", [0])):
        if pictures is None:
            return read_hard_data(known)
        low, high = _ranges(pictures)
        return read_hard_data(known, valid=(float(low.min()), float(high.max())))
    return known if isinstance(known, HardData) else as_array(name, known)


def _ranges(pictures: Pictures) -> tuple[Any, Any]:
    """Return the smallest and the largest known value of each variable of the samples."""
    ends = np.fmin, np.fmax
    low, high = (end.reduce([end.reduce(one, tuple(range(one.ndim - 1))) for one in pictures.pixels]) for end in ends)
    return low, high


def check_known(
    known: Any,
    shape: tuple[int, ...],
    channel_axis: int | None,
    pictures: Pictures,
    source: Any = None,
    place: Placing = place_hard_data,
) -> Given:
    """Check the known values of an output, and return them.

    ``known`` is a masked array, floats with NaN for unknown values, a table or its path.
    """
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
            raise ValueError(
                f"known is {known.ndim}-dimensional; give "
                f"{AXES[len(shape)] if channel_axis is None else 'the channel axis too'}"
            )
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
    found, wrong = cast(kept, dtype)
    if wrong.any():
        raise ValueError(f"known holds {kept[wrong][0]}, which the sample's type {dtype} does not; give such values")
    _warn_beyond(found, there, pictures)
    return Given(found, there, None if source is None else _check_source(source, there, pictures))


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
    own = place[used]
    number = own[:, 2] if columns == 3 else np.zeros(len(own), np.intp)
    inside = (number >= 0) & (number < len(pictures.pixels))
    sizes = np.array([picture.shape[:2] for picture in pictures.pixels])[np.where(inside, number, 0).astype(np.intp)]
    if not (inside & ((own[:, :2] >= 0) & (own[:, :2] < sizes)).all(-1)).all():  # before a cast, which would wrap
        raise ValueError("known_source points outside the sample; give -1 where a pixel is not from there")
    found = np.full(place.shape, -1, np.int32)
    found[used] = own
    return found


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
    samples = tuple(_guide("the guide of the sample", one, axes) for one in (first if listed else [first]))
    output = _guide("the guide of the output", second, axes)
    for number, (one, picture) in enumerate(zip(samples, pictures.pixels, strict=True)):
        which = f"sample {number}" if count > 1 else "the sample"
        _check_size(f"the guide of {which}", one.shape[:-1], which, picture.shape[:-1])
        if one.shape[-1] != output.shape[-1]:
            raise ValueError(
                f"the guide of the sample has {one.shape[-1]} channels and that of the output {output.shape[-1]}; "
                "give as many"
            )
        if unknown_in(one).any():
            raise ValueError("the guide of the sample has NaN; give a number everywhere; NaN is for that of the output")
    _check_size("the guide of the output", output.shape[:-1], "the output", shape)
    return samples, output


def _guide(name: str, array: Any, axes: int) -> NDArray[Any]:
    found = pixels_of(name, array, axes)
    if found.dtype.kind == "f" and np.isinf(found).any():
        raise ValueError(f"{name} has infinite values; give numbers")
    found = found.astype(np.uint8) if found.dtype == np.bool_ else found
    return found[..., None] if found.ndim == axes else found


def _check_size(name: str, shape: tuple[int, ...], other: str, wanted: tuple[int, ...]) -> None:
    if shape != wanted:
        sizes = ["x".join(map(str, sides)) for sides in (shape, wanted)]
        raise ValueError(f"{name} is {sizes[0]} and {other} {sizes[1]} (rows x columns); give one size")


# The maps of a simulation


class Maps(NamedTuple):
    """The maps of a simulation as arrays or tables, see `simdtex.simulate`; None if not given."""

    region: NDArray[Any] | HardData | None = None
    probabilities: NDArray[Any] | HardData | None = None
    image_map: NDArray[Any] | HardData | None = None
    rotation: NDArray[Any] | HardData | None = None
    scale: NDArray[Any] | HardData | None = None

    def shape(self, axes: int) -> tuple[int, ...] | None:
        """Return the sides of the first map that is an array: rows and columns and, with 3 ``axes``, layers."""
        shapes = (np.shape(one)[-axes:] for one in self if one is not None and not isinstance(one, HardData))
        return next((shape for shape in shapes if len(shape) == axes), None)

    def digest(self, name: str) -> str | None:
        """Return the SHA-256 digest of a map; None if it is not given."""
        one = getattr(self, name)
        if one is None:
            return None
        table = isinstance(one, HardData)
        return digest(*((one.points, one.values) if table else (np.ma.getdata(one), np.ma.getmaskarray(one))))

    def digests(self) -> dict[str, str]:
        """Return the SHA-256 digest of each map, by name."""
        return {name: found for name in self._fields if (found := self.digest(name))}

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


# The checks and identities that declarations name


def _training(name: str, value: Any, call: Any) -> Pictures:
    """Return training images, of which those of three axes, without that of the variables, are volumes.

    Arrays of xarray get their axes in ascending order here, and the call the place of its output.
    """
    value, output = ascending(value), {}
    for one in ("like", "known", "guide", "mask", *Maps._fields):
        if hasattr(call, one):
            output[one] = ascending(getattr(call, one))
            setattr(call, one, output[one])
    call.place = located(output, value, call.origin, call.cell)
    if call.place:
        call.origin, call.cell = call.place.frame
    first = value[0] if isinstance(value, (list, tuple)) and value else value
    call.axes = 3 if getattr(first, "ndim", 2) - (call.channel_axis is not None) > 2 else 2
    call.given, call.sample = value, (found := check_samples(value, call.channel_axis, call.mask, call.axes))
    return found


def _texture(name: str, value: Any, call: Any) -> Pictures:
    """Return samples that are like the picture and not from it."""
    found = check_samples(value, call.channel_axis)
    check_alike("the sample", found.pixels[0], "the picture", call.image[0])
    return found


CHECKS: dict[str, Callable[[str, Any, Any], Any]] = {
    "samples": lambda name, value, call: check_samples(value, call.channel_axis, call.mask),
    "training": _training,
    "texture": _texture,
    "picture": lambda name, value, call: check_sample(value, call.channel_axis),
    "picture with gaps": lambda name, value, call: check_picture(value, call.channel_axis),
    "hole": lambda name, value, call: check_mask(value, call.image[0].shape[:2]),
    "rows and columns": lambda name, value, call: check_shape(value),
    "tile": lambda name, value, call: check_shape(value if np.ndim(value) else (value, value), 16),
    "block": lambda name, value, call: check_sides(value, ("depth", "rows", "columns")),
    "data": lambda name, value, call: as_known(value, name, call.sample if name == "known" else None),
}
"""The checks that declarations name; see `simdtex.inputs.Input`."""

IDENTITIES: dict[bool | str, Callable[[Any, str], Any]] = {
    True: getattr,
    "arrays": lambda call, name: call.inputs.identity(name),
    "maps": lambda call, name: call.maps.digest(name),
}
"""What identifies a run, of inputs that the plan has placed in ``call.inputs`` and ``call.maps``."""
