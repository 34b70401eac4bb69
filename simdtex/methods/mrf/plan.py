# SPDX-License-Identifier: BSD-3-Clause
"""The plan of a run of the method ``mrf``: all of its input, validated, on the host."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import isqrt, log2, prod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex import schedules
from simdtex.machine import Machine, memory
from simdtex.methods.mrf.algorithm import MrfRun
from simdtex.methods.mrf.conditioning import centre_known, heaviest
from simdtex.methods.mrf.finish import gaussian_offsets
from simdtex.methods.mrf.level import number_of_levels
from simdtex.methods.mrf.options import Options, of_palette
from simdtex.methods.mrf.problem import Input
from simdtex.model.given import Given, Soft, planes
from simdtex.model.guide import AnyGuide, Guide, GuidePair, Surroundings
from simdtex.model.lattice import neighbourhood_offsets
from simdtex.model.pictures import CATEGORIES as MOST
from simdtex.model.pictures import NothingUsable, Pictures
from simdtex.model.regularity import Phases, parse_lattice, phases
from simdtex.model.sample import Sample
from simdtex.options import within_32_bits

LABELS = 64
"""The most labels of a guide; each label is a channel."""

NEAR = 4
"""The number of levels that share the most reduced sample: the coarsest has a spacing of 8 of its pixels."""

CELL = 20
"""The fewest pixels of a reduced sample along the vectors of its lattice."""


class MrfPlan(Input):
    """A run of the method ``mrf`` before it has a machine and a seed."""

    def on(self, machine: Machine, seed: int) -> MrfRun:
        """Return the run of the plan on a machine; raise if its memory does not suffice.

        Notes
        -----
        Memory on the device, in bytes: 18 + 2 channels per output pixel (24 + 4 channels with the schedule ``block``),
        14 channels + 80 per pixel of the sample with its margin, and the scratch memory of the machine. On the host,
        which includes a CPU's device memory: 84 per output pixel (100 with ``block``) and 10 + 1.5 n for each of its
        channels, n the bytes of a value of the sample, and 64 per pixel of the sample (benchmarks/memory.py). Soft
        data: 4 per output pixel and kind on the device, and 32 on the host. A regular sample: 12 per output pixel and
        56 per pixel of the sample on the device, and as much on the host.
        """
        copies = 2 if self.schedule.tile else 1
        pixels, channels = prod(self.shape), len(self.sample.working)
        within_32_bits(self.shape, channels * copies, self.remedy)
        field, held = copies * (6 + 2 * channels), sum(plan.sample.rows * plan.sample.cols for plan in self.sizes)
        each = 68 + 16 * copies + channels * (10 + 3 * self.sample.pixels.dtype.itemsize // 2)
        kinds = self.kinds.rows if self.kinds else 0
        phases = 12 * pixels + 56 * held if self.sample.waves else 0
        device = pixels * (12 + field + 4 * kinds) + held * (14 * channels + 80) + phases
        memory.require(machine, device, pixels * (each + 32 * kinds) + 64 * held + phases, self.remedy)
        return MrfRun(self, machine, seed)


def plan(
    pictures: Pictures,
    shape: tuple[int, ...],
    options: Options,
    given: Given | None = None,
    guide: GuidePair | Surroundings | None = None,
    most: int | None = None,
    soft: Soft | None = None,
    period: tuple[int, int] | None = None,
) -> MrfPlan:
    """Return the plan of a run of Y, the sample, and X, the output, with its input validated.

    ``shape`` are [layers,] rows and columns of X, ``given`` its conditioning data, ``soft`` the probability of each
    category and of each picture of Y at its sites, and ``guide`` the label, number or colour at each place of Y and X;
    ``most`` is the largest number of levels if the option ``levels`` is None, and ``period`` the rows and columns after
    which the lattice of a regular sample repeats on a torus, None: those of X.
    """
    pictures = options.of(pictures)
    if soft and soft.images is not None:
        pictures = replace(pictures, shares=soft.shares)
    check_categories(pictures, given, options.proportions)
    if pictures.deep:
        check_volume(options)
    options = options.resolved(pictures)
    offsets = neighbourhood_offsets(options.neighbourhood, len(shape))
    sides = [picture.shape[:-1] for picture in pictures.pixels]
    if soft and soft.images is not None:  # each picture must serve the sites that it is probable at
        sides = [min(sides, key=lambda side: min(side[-2:]))]
    levels = number_of_levels(sides, offsets, shape, options)  # 1
    levels = levels if most is None or options.levels is not None else min(levels, most)
    guides: list[AnyGuide] = []
    if guide:
        guides.append(guide if isinstance(guide, Surroundings) else check_guide(guide, options))
    if given and given.partly:
        if options.pixel == "density":
            raise ValueError('sites that are known in part choose among pixels of the sample; give pixel="source"')
        guides.append(given.colocated(pictures))
    known = (given.values, given.data, given.place) if given and given.data.any() else None
    lattice = parse_lattice(options.lattice)
    torus = options.boundary == "torus"
    regular = None if lattice is None else phases(pictures, period or (shape[0], shape[1]), torus, lattice, known)
    channels = pictures.channels + bool(options.structure) + sum(extra.channels for extra in guides)
    heavy = heaviest(options, len(offsets)) if given or guides else 1.0  # in sums of squares
    values = round(heavy * (channels * len(offsets) + len(guides)))
    if given and given.partly:
        values += guides[-1].channels * centre_known(options, len(offsets), given.reduced(pictures)) ** 2
    scenes = [Scene(pictures, shape, given, guides, regular)]
    count = halvings(scenes[0], options, levels, soft)
    while True:  # with as many halvings as leave known pixels
        try:
            return reduced(scenes, count, levels, offsets, values, options, soft)
        except NothingUsable:
            if not count or options.reduction is not None:
                raise
            count -= 1


def reduced(
    scenes: list[Scene],
    count: int,
    levels: int,
    offsets: NDArray[np.int32],
    values: int,
    options: Options,
    soft: Soft | None,
) -> MrfPlan:
    """Return the plan of a scene, the first of ``scenes``, that is halved ``count`` times for the coarse levels."""
    while len(scenes) <= count:
        scenes.append(scenes[-1].halved())
    coarser: MrfPlan | None = None
    for times, scene in reversed(list(enumerate(scenes[: count + 1]))):
        fewer, sample = sampled(scene, 1 if coarser else levels - times, offsets, values, options, 2**times)
        levels = levels if coarser else fewer + times
        known = planes(scene.given, sample) if scene.given and scene.given.whole.any() else None
        schedule, rest = schedules.get(options.schedule), {"reduction": 2**times, "coarser": coarser}
        coarser = MrfPlan(sample, scene.shape, offsets, options, schedule, levels, scene.given, known, soft, **rest)
    assert coarser
    return coarser


class Scene(NamedTuple):
    """The input of a run that has a size: the sample's pictures, the shape of the output, and what belongs to both."""

    pictures: Pictures
    shape: tuple[int, ...]
    given: Given | None
    guides: list[Any]
    regular: Phases | None

    def halved(self) -> Scene:
        """Return the input of half the size."""
        return Scene(
            self.pictures.halved(),
            tuple(-(-side // 2) for side in self.shape),
            self.given and self.given.halved(),
            [guide.halved() for guide in self.guides],
            self.regular and self.regular.halved(),
        )


def halvings(scene: Scene, options: Options, levels: int, soft: Soft | None) -> int:
    """Return how many times the sample is halved for the coarse levels."""
    side = min(min(picture.shape[:2]) for picture in scene.pictures.pixels)
    given, most = scene.given, min(levels - 1, int(log2(max(1, side // (2 * isqrt(options.neighbourhood) + 1)))))
    loose = given is not None and (given.place is None or given.outside is not None or given.partly)
    kept = options.categorical or options.pixel == "density" or scene.pictures.pixels[0].dtype == np.bool_
    never = scene.pictures.deep or kept or loose or soft is not None
    if options.reduction is None:
        never = never or options.search == "exact" or options.phases > 1 or of_palette(scene.pictures.pixels)
        shortest = np.hypot(*scene.regular.output.basis.T).min() if scene.regular else np.inf
        while most and shortest < CELL * 2**most:
            most -= 1
        return 0 if never else max(0, min(most, levels - NEAR))
    asked = options.reduction.bit_length() - 1
    if asked and never:
        raise ValueError(
            f"reduction={options.reduction} takes means, which categories, densities, volumes, soft data and known "
            "values that are not from the sample do not allow; leave it out"
        )
    if asked > most:
        raise ValueError(
            f"reduction={options.reduction} is too much for {levels} levels and this sample; give at most {2**most}"
        )
    return asked


def sampled(
    scene: Scene, levels: int, offsets: NDArray[np.int32], values: int, options: Options, reduction: int
) -> tuple[int, Sample]:
    """Return the number of levels and the sample; if ``options.levels`` is None, every level has a candidate."""
    far = int(gaussian_offsets(options.finish)[0].max()) if options.finish else 0
    for fewer in range(levels, 0, -1):
        step = 2 ** (fewer - 1)
        margin = int(offsets[:, 1].max()) * step
        sample = Sample(
            *(scene.pictures, values, margin, options.structure, step, scene.guides, far, scene.regular, reduction)
        )
        try:
            for level in range(fewer):
                sample.places(offsets, 2**level, options.phases, options.edges)
        except NothingUsable:
            if fewer == 1 or options.levels is not None:
                raise
            continue
        break
    return fewer, sample


def check_volume(options: Options) -> None:
    """Raise if a volume has an option, as it is given, that only pictures support."""
    flat = {
        "boundary": options.boundary == "torus",
        "array": options.array is not None,
        "schedule": schedules.get(options.schedule).tile is not None,
        "finish": bool(options.finish),
        "structure": options.structure not in (0, Options.structure),
        "lattice": options.lattice not in ("auto", "none"),
    }
    for name in filter(flat.get, flat):
        raise ValueError(f"{name}={vars(options)[name]} is for pictures; leave it out for a volume")


def check_categories(pictures: Pictures, given: Given | None, proportions: Sequence[float] | None = None) -> None:
    """Raise if a known value or a proportion refers to a category that the sample lacks."""
    for variable in range(pictures.pixels[0].shape[-1]):
        categories = pictures.categories(variable)
        if categories is None:
            continue
        if given:
            asked = np.unique(given.values[given.given_mask[..., variable], variable])
            strange = asked[~np.isin(asked, categories)]
            if strange.size:
                raise ValueError(
                    f"known has the category {strange[0]} and the sample has {_listed(categories)}; give one of these"
                )
        if len(categories) > MOST:
            raise ValueError(
                f"a variable has {len(categories)} categories; give {MOST} or fewer, or leave categorical out"
            )
    if proportions:
        classes = pictures.classes
        if pictures.pixels[0].shape[-1] > 1:
            raise ValueError("proportions are of one variable; leave them out")
        if len(classes) != len(proportions):
            names = "categories," if pictures.categories(0) is not None else "classes of values up to"
            raise ValueError(
                f"there are {len(proportions)} proportions and {len(classes)} {names} {_listed(classes)}; give one for "
                "each"
            )


def check_guide(guide: GuidePair, options: Options) -> Guide:
    """Return the guide with its kind and weight; raise if the output has a label that the sample lacks."""
    if options.pixel == "density":
        raise ValueError('a guide chooses among pixels of the sample; give pixel="source"')
    samples, output = guide
    labels = options.labels
    if labels is None:
        integers = all(picture.dtype.kind in "iu" for picture in (*samples, output))
        labels = integers and all(np.unique(picture).size <= MOST for picture in samples)
    if labels:
        for channel in range(output.shape[-1]):
            there = np.unique(np.concatenate([np.unique(picture[..., channel]) for picture in samples]))
            asked = np.unique(output[..., channel])
            asked = asked[~np.isnan(asked)] if asked.dtype.kind == "f" else asked
            strange = asked[~np.isin(asked, there)]
            if strange.size:
                raise ValueError(
                    f"the guide of the output asks for the label {strange[0]} and that of the sample has "
                    f"{_listed(there)}; give labels that the sample has"
                )
            if there.size > LABELS:
                raise ValueError(f"the guide has {there.size} labels; give {LABELS} or fewer, or labels=False")
    return Guide(samples, output, labels, options.guide_weight)


def _listed(values: NDArray[Any]) -> str:
    """Return up to ten values as text."""
    words = [str(value) for value in values[:10]]
    return ", ".join(words) + (", ..." if len(values) > 10 else "")
