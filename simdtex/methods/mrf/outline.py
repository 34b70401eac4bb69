# SPDX-License-Identifier: BSD-3-Clause
"""What a run of the method ``mrf`` is before there is a machine: all on the host, checked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex import schedules
from simdtex.machine.interface import Array, Machine
from simdtex.methods.mrf.holding import Holder, Holding
from simdtex.methods.mrf.level import Run, number_of_levels
from simdtex.methods.mrf.options import CATEGORIES as MOST
from simdtex.methods.mrf.options import Options
from simdtex.model.given import Given, Planes, planes
from simdtex.model.guide import Beside, Guide
from simdtex.model.lattice import Grid, neighbourhood_offsets
from simdtex.model.pictures import Pictures
from simdtex.model.sample import NothingUsable, Sample
from simdtex.ops.finish import around

LABELS = 64
"""Labels of a guide, at most: each is a channel."""


class Kit(NamedTuple):
    """What a sample is laid out with beside its pictures: see `simdtex.model.sample.Sample`."""

    values: int
    margin: int
    weight: float
    step: int
    unsure: float
    apart: int

    def sample(self, pictures: Pictures, beside: Sequence[Beside]) -> Sample:
        """The sample."""
        return Sample(pictures, self.values, self.margin, self.weight, self.step, beside, self.unsure, self.apart)


@dataclass(frozen=True)
class Outline:
    """A run without a machine.

    Attributes
    ----------
    sample : Sample
    kit : Kit
        What it is laid out with.
    shape : (int, int)
        Rows and columns of X.
    offsets : (N, 2) int32 array
        The neighbourhood.
    options : Options
        As they are executed.
    schedule : simdtex.schedules.Schedule
    seed : int
    levels : int
    laid : Planes, optional
        Given values as the field has them.
    """

    sample: Sample
    kit: Kit
    shape: tuple[int, int]
    offsets: NDArray[np.int32] = field(repr=False)
    options: Options
    schedule: schedules.Schedule
    seed: int
    levels: int
    laid: Planes | None = None

    def holding(self, machine: Machine) -> Holding:
        """What is given, of the whole output."""
        finest = Grid(*self.shape, 1, self.options.boundary == "torus")
        return Holding(machine, finest, self.levels, self.sample.guides, self.laid)

    def run(self, machine: Machine, holding: Holder, weighed: Array) -> Run:
        """The run on a machine; ``weighed`` counts the candidates that each site of the whole has weighed."""
        return Run(
            machine=machine,
            sample=self.sample,
            planes=self.sample.planes(machine),
            shape=self.shape,
            offsets=self.offsets,
            options=self.options,
            schedule=schedules.Checked(self.schedule) if self.options.check_schedule else self.schedule,
            seed=self.seed,
            levels=self.levels,
            weighed=weighed,
            holding=holding,
        )


def outlined(
    pixels: NDArray[Any] | Pictures,
    shape: tuple[int, int],
    options: Options,
    seed: int,
    given: Given | None = None,
    guide: tuple[tuple[NDArray[Any], ...], NDArray[Any]] | None = None,
) -> Outline:
    """Check what a run is given, and lay its sample out; arguments as of `simdtex.methods.mrf.synthesize`."""
    pictures = options.of(pixels if isinstance(pixels, Pictures) else Pictures((pixels,)))
    check_categories(pictures, given, options)
    options = options.resolved(pictures)
    offsets = neighbourhood_offsets(options.order)
    levels = number_of_levels([picture.shape[:2] for picture in pictures.pixels], offsets, shape, options)  # 1
    beside: list[Beside] = [check_guide(guide, options)] if guide else []
    if given and given.partly:
        if options.pixel == "density":
            raise ValueError('sites that are known in part choose among pixels of the sample; give pixel="source"')
        beside.append(given.colocated(pictures.pixels))
    channels = pictures.channels + bool(options.structure) + sum(one.channels for one in beside)
    heavy = max(1.0, options.data_weight, len(offsets) / 4) if given or beside else 1.0  # in sums of squares
    values = round(heavy * (channels * len(offsets) + len(beside)))
    levels, kit, sample = sampled(pictures, levels, offsets, values, options, beside)
    laid = planes(given, sample) if given and given.whole.any() else None
    return Outline(sample, kit, shape, offsets, options, schedules.get(options.schedule), seed, levels, laid)


def sampled(
    pictures: Pictures,
    levels: int,
    offsets: NDArray[np.int32],
    values: int,
    options: Options,
    beside: Sequence[Beside],
) -> tuple[int, Kit, Sample]:
    """How many levels there are, and the sample; fewer, where some level has no candidate and nobody asked for it."""
    far = int(around(options.finish)[0].max()) if options.finish else 0
    for fewer in range(levels, 0, -1):
        step = 2 ** (fewer - 1)
        kit = Kit(values, int(offsets.max()) * step, options.structure, step, options.unsure, far)
        sample = kit.sample(pictures, beside)
        try:
            for number in range(fewer):
                sample.allowed(offsets, 2**number, options.phases, options.edges)
        except NothingUsable:
            if fewer == 1 or options.levels is not None:
                raise
            continue
        break
    return fewer, kit, sample


def check_categories(pictures: Pictures, given: Given | None, options: Options) -> None:
    """Raise where a category is given that the sample does not have, or a share of one."""
    for variable in range(pictures.pixels[0].shape[-1]):
        categories = pictures.categories(variable)
        if categories is None:
            continue
        if given:
            told = np.unique(given.values[given.known[..., variable], variable])
            strange = told[~np.isin(told, categories)]
            if strange.size:
                raise ValueError(
                    f"known has the category {strange[0]} and the sample has {_listed(categories)}; give one of these"
                )
        if len(categories) > MOST:
            raise ValueError(
                f"a variable has {len(categories)} categories; give {MOST} or fewer, or leave categorical out"
            )
    if options.proportions:
        found = pictures.categories(0)
        if found is None or pictures.pixels[0].shape[-1] > 1:
            raise ValueError("proportions are of one variable of categories; give categorical=True, or leave them out")
        if len(found) != len(options.proportions):
            raise ValueError(
                f"there are {len(options.proportions)} proportions and {len(found)} categories, {_listed(found)}; "
                "give one for each"
            )


def check_guide(guide: tuple[tuple[NDArray[Any], ...], NDArray[Any]], options: Options) -> Guide:
    """The guide with its kind and weight; raises where it names a label that the sample lacks."""
    if options.pixel == "density":
        raise ValueError('a guide chooses among pixels of the sample; give pixel="source"')
    samples, output = guide
    labels = options.labels
    if labels is None:
        integers = all(one.dtype.kind in "iu" for one in (*samples, output))
        labels = integers and all(np.unique(one).size <= MOST for one in samples)
    if labels:
        for channel in range(output.shape[-1]):
            there = np.unique(np.concatenate([np.unique(one[..., channel]) for one in samples]))
            told = np.unique(output[..., channel])
            told = told[~np.isnan(told)] if told.dtype.kind == "f" else told
            strange = told[~np.isin(told, there)]
            if strange.size:
                raise ValueError(
                    f"the guide of the output asks for the label {strange[0]} and that of the sample has "
                    f"{_listed(there)}; give labels that the sample has"
                )
            if there.size > LABELS:
                raise ValueError(f"the guide has {there.size} labels; give {LABELS} or fewer, or labels=False")
    return Guide(samples, output, labels, options.guide_weight)


def _listed(values: NDArray[Any]) -> str:
    """Up to ten values in words."""
    words = [str(value) for value in values[:10]]
    return ", ".join(words) + (", ..." if len(values) > 10 else "")
