# SPDX-License-Identifier: BSD-3-Clause
"""The model of a classifier: exemplars of its classes, their distances from their own class, and the drift of these."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from simdtex import random
from simdtex.jobs.classification.operations import (
    LOGS,
    SIXTEENTHS,
    Exemplars,
    exemplars,
    features,
    gaussian,
    stacked,
    window,
)
from simdtex.jobs.classification.options import Options
from simdtex.jobs.classification.patterns import NEAR, OWN, Discriminant, patterns, roots
from simdtex.machine import Machine
from simdtex.machine.interface import Array
from simdtex.model.lattice import neighbourhood_offsets
from simdtex.model.pictures import Mask, Pictures
from simdtex.model.scale import Scale

SMOOTHING = (0.0, 0.8, 1.8, 3.6, 7.2)
"""Standard deviations of the Gaussians that smooth the levels, pixels."""

LEAST_SAMPLE_SIDE = 32
"""The least side of a sample at level 0, pixels; each further level doubles it."""

TEMPERATURE = 0.5
"""Evidence is the mean logarithm of squared distances divided by this."""

FEWEST_NEIGHBOURHOODS = 16
"""The fewest neighbourhoods of a class at a level."""

TOO_FEW = 8
"""The fewest neighbourhoods for a comparison with a part."""

BANDS = 14
"""The most bands of a picture."""

VALUES = 258
"""The most values of a raw neighbourhood, 0 to 255 each: sums of their products are then below 2**24 and exact."""

CLASSES = 254
"""The most classes: labels are bytes, and 0 is unknown."""

BOX = 128
"""The most rows and columns of a part of a sample that is compared with the other parts."""

UNITS = 2**18
"""Units in 1 of evidence, and of votes."""

MEANS = 16
"""Units of a mean logarithm over a window in one unit of its logarithms."""

RAW = 0.35
"""Share of raw neighbourhoods in the evidence; those with compressed contrast have the rest."""

FINER = (1.0, 0.3, 0.09, 0.027, 0.0081)
"""Weights of the evidence of levels, the finest first."""

FLOOR = 1e-4
"""The least variance of a measure."""


class Expert(NamedTuple):
    """A comparison of neighbourhoods by ``offsets`` (N, 2); ``factor``: evidence of one unit of its logarithms."""

    level: int
    contrast: bool
    offsets: NDArray[np.int32]
    reach: int
    factor: int


def experts_of(options: Options, levels: int) -> list[Expert]:
    """Return the experts of levels, raw and contrast-compressed ones at each; weights add up to 1 / `TEMPERATURE`."""
    total = sum(FINER[:levels])
    experts = []
    for level in range(levels):
        for contrast, order, share in ((False, options.order, RAW), (True, 2 * options.order, 1 - RAW)):
            near = neighbourhood_offsets(order) * 2**level
            offsets = np.concatenate([np.zeros((1, 2), np.int32), near]).astype(np.int32)
            factor = round(UNITS / LOGS * FINER[level] * share / total / TEMPERATURE)
            experts.append(Expert(level, contrast, offsets, isqrt(order) * 2**level, factor))
    return experts


class Region(NamedTuple):
    """Sites of a class in a picture (rows, cols, B): ``whole`` neighbourhoods or only centres; ``judged`` alone."""

    pixels: NDArray[Any]
    sites: Mask
    whole: bool = True  # neighbourhoods lie within the sites
    judged: bool = False  # the sites only show how the class differs from its exemplars


class Null(NamedTuple):
    """The differences of a class from itself: mean and variance (M,) of each of M measures over a window."""

    mean: NDArray[np.float64]
    variance: NDArray[np.float64]

    def distance(self, measures: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the mean of squared differences of measures (M, n), each relative to its variance."""
        total = np.zeros(measures.shape[1])
        for value, mean, variance in zip(measures, self.mean, self.variance, strict=True):
            total += (value - mean) ** 2 / variance
        return total / len(measures)


@dataclass(frozen=True)
class Model:
    """A trained classifier, without any machine; lists and arrays have an entry for each expert or class."""

    scale: Scale
    experts: list[Expert]
    exemplars: list[Exemplars]
    offsets: NDArray[np.int64]  # of the evidence
    discriminant: Discriminant
    nulls: list[Null]
    freedom: int  # of the variances of nulls
    own: NDArray[np.float64]  # (classes, E), mean logarithms of distances of a class from itself
    counts: list[int]  # of exemplars


def prepared(machine: Machine, scale: Scale, pixels: NDArray[Any], levels: int) -> list[Array]:
    """Return the levels of a picture on a machine, smoothed by `SMOOTHING`: (B, rows, cols) uint16 in sixteenths."""
    planes = scale.levels(pixels).astype(np.int64) * (SIXTEENTHS if scale.top == 255 else 1)
    stack = [machine.put(planes.astype(np.uint16))]
    for level in range(1, levels):
        stack.append(machine.put(blurred(planes, gaussian(SMOOTHING[level])).astype(np.uint16)))
    return stack


def measured(means: NDArray[np.int64], patterned: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the measures of windows, (M, n): mean logarithms (E, n), and roots of the frequencies of patterns."""
    return np.concatenate([means / float(MEANS * LOGS), roots(patterned / float(MEANS))])


def blurred(planes: NDArray[Any], taps: NDArray[np.uint32]) -> NDArray[np.int64]:
    """Return planes (..., rows, cols) averaged over the window of `gaussian`, mirrored beyond the border."""
    smooth = planes.astype(np.float64)  # exact for integers below 2**34 in magnitude
    for axis in (-2, -1):
        smooth = ndimage.correlate1d(smooth, taps.astype(np.float64), axis, mode="mirror")
    return smooth.astype(np.int64) + UNITS // 2 >> 18


def learn(
    machine: Machine, classes: Sequence[Sequence[Region]], names: Sequence[str], options: Options, seed: int
) -> Model:
    """Return the model of classes, each given by regions of pictures; raise if one has too few neighbourhoods."""
    regions = [region for several in classes for region in several]
    bands = regions[0].pixels.shape[-1]
    if (values := bands * len(experts_of(options, 1)[0].offsets)) > VALUES:
        few = f"give a smaller order, so that there are {VALUES} at most"
        raise ValueError(f"order={options.order} with {bands} bands compares {values} values; {few}")
    scale = Scale(Pictures(tuple(region.pixels for region in regions)), 512)  # values of up to 12 bits
    levels = _levels_of(options, classes, names)
    experts = experts_of(options, levels)
    taught = [_Class(machine, scale, experts, options, seed, c, one) for c, one in enumerate(classes)]
    drawn = [[known.draw(expert) for expert in experts] for known in taught]
    selves = [known.judge() for known in taught]
    own = np.array([distances.mean for distances in selves])
    counts = [min(map(len, exemplars_of)) for exemplars_of in drawn]
    offsets = []
    for c, count in enumerate(counts):
        typical = sum(expert.factor * options.typical * own[c, e] * LOGS for e, expert in enumerate(experts))
        fewer = 2 * np.log(count / max(counts)) * LOGS  # equation (6) divides by the number of neighbourhoods
        shift = sum(expert.factor * fewer / (len(expert.offsets) * bands) for expert in experts)
        offsets.append(round(typical - shift))
    nulls, freedom = _nulls(selves)
    pooled = [stacked([exemplars_of[e] for exemplars_of in drawn]) for e in range(len(experts))]
    discriminant = Discriminant.of([one.patterns for one in selves], [one.parts[:, len(experts) :] for one in selves])
    return Model(scale, experts, pooled, np.array(offsets, np.int64), discriminant, nulls, freedom, own, counts)


def _levels_of(options: Options, classes: Sequence[Sequence[Region]], names: Sequence[str]) -> int:
    """Return the number of levels at which all classes have enough sites; raise if it is 0."""
    regions = [region for several in classes for region in several]
    side = min(min(region.sites.shape) for region in regions)
    most = max(1, sum(side >= LEAST_SAMPLE_SIDE << level for level in range(options.levels)))
    for levels in range(most, 0, -1):
        reach = experts_of(options, levels)[-1].reach
        counts = [sum(int(_centres(region, reach).sum()) for region in one if not region.judged) for one in classes]
        if min(counts) >= FEWEST_NEIGHBOURHOODS:
            return levels
    few = int(np.argmin(counts))
    raise ValueError(
        f"class {names[few]!r} has {counts[few]} whole neighbourhoods of {2 * reach + 1}x{2 * reach + 1} "
        f"pixels, and {FEWEST_NEIGHBOURHOODS} are needed; give a larger sample of it"
    )


def _centres(region: Region, reach: int) -> Mask:
    """Return the sites whose neighbourhoods of ``reach`` pixels are whole."""
    rows, cols = region.sites.shape
    inside = np.zeros((rows, cols), bool)
    inside[reach : rows - reach, reach : cols - reach] = True
    if not region.whole or region.sites.all():
        return inside & region.sites
    return np.asarray(inside & ndimage.minimum_filter(region.sites, 2 * reach + 1, mode="nearest"))


def _cropped(region: Region, margin: int) -> Region:
    """Return the part of a region with its sites and ``margin`` pixels around them."""
    (sides,) = ndimage.find_objects(region.sites.astype(np.uint8))
    box = tuple(slice(max(0, side.start - margin), side.stop + margin) for side in sides)
    return region._replace(pixels=region.pixels[box], sites=region.sites[box])


class OwnDistances(NamedTuple):
    """How the parts of a class differ from the rest of it: mean logarithms (E,), measures, roots of frequencies."""

    mean: NDArray[np.float64]
    windows: NDArray[np.float64]  # (M, n), measures
    parts: NDArray[np.float64]  # (parts, M)
    patterns: NDArray[np.float64]  # (P, n)


class _Class:
    """The regions of a class on a machine; the ``number`` of the class and the seed are keys of what is drawn."""

    def __init__(
        self,
        machine: Machine,
        scale: Scale,
        experts: list[Expert],
        options: Options,
        seed: int,
        number: int,
        regions: Sequence[Region],
    ) -> None:
        self._machine, self._experts, self._options, self._seed, self._number = machine, experts, options, seed, number
        margin = experts[-1].reach + len(gaussian(SMOOTHING[experts[-1].level] or 1)) // 2
        self.regions = [_cropped(region, margin) for region in regions]
        self._levels = [prepared(machine, scale, region.pixels, experts[-1].level + 1) for region in self.regions]

    def draw(self, expert: Expert, without: tuple[int, Mask] | None = None) -> NDArray[np.float32]:
        """Return random neighbourhoods of the class, (n, K), outside of a part: a region's number, and sites there."""
        masks = [_centres(region, expert.reach) & (not region.judged) for region in self.regions]
        if without:
            masks[without[0]] &= ~without[1]
        sites, most = np.flatnonzero(np.concatenate([mask.ravel() for mask in masks])), self._options.exemplars
        if len(sites) < TOO_FEW and without:  # a small region, whose rest is too small
            return self.draw(expert)
        if len(sites) > most:
            words = random.draw4(self._seed, expert.level, self._number, sites, random.SEARCH)[0]
            sites = np.sort(sites[np.argsort(words, kind="stable")[:most]])
        drawn, first = [], 0
        for place, mask in enumerate(masks):
            here = sites[(sites >= first) & (sites < first + mask.size)] - first
            first += mask.size
            if here.size:
                drawn.append(self._features(place, expert, here).T)
        return np.concatenate(drawn)

    def _features(self, place: int, expert: Expert, sites: NDArray[np.intp]) -> NDArray[np.float32]:
        """Return the neighbourhoods of sites of a region, (K, S)."""
        put, levels = self._machine.put, self._levels[place]
        placed, offsets = put(sites.astype(np.int32)), put(expert.offsets)
        return np.asarray(
            self._machine.get(features(self._machine, levels[expert.level], placed, offsets, expert.contrast))
        )

    def judge(self) -> OwnDistances:
        """Return the distances of the quarters of the class from the rest of it."""
        machine, taps = self._machine, gaussian(self._options.window)
        windows, parts, own, near = [], [], [], []
        for place, region in enumerate(self.regions):
            logs = np.zeros((len(self._experts), *region.sites.shape), np.uint16)
            judged = np.zeros(region.sites.shape, bool)
            patterned = patterns([np.asarray(machine.get(level)) for level in self._levels[place]], slice(None))
            for sites in _quarters(region.sites):
                shown = np.flatnonzero(_boxed(sites))
                for e, expert in enumerate(self._experts):
                    rest = stacked([self.draw(expert, (place, sites))]).on(machine)
                    values = machine.put(self._features(place, expert, shown))
                    logs[e].reshape(-1)[shown] = machine.get(exemplars(machine, values, rest))[0]
                judged.reshape(-1)[shown] = True
                sums = [
                    MEANS * planes.reshape(len(planes), -1)[:, shown].sum(1, keepdims=True, dtype=np.int64)
                    for planes in (logs, patterned)
                ]
                parts.append(measured(*(plane // len(shown) for plane in sums))[:, 0])
                own.append(sums[0][:, 0] / (MEANS * len(shown) * LOGS))
            windows.append(measured(*(windowed(machine, one, judged, taps, judged)[0] for one in (logs, patterned))))
            near.append(roots(windowed(machine, patterned, judged, NEAR, judged)[0] / float(MEANS)))
        return OwnDistances(np.array(own).mean(0), np.concatenate(windows, 1), np.array(parts), np.concatenate(near, 1))


def _quarters(sites: Mask) -> list[Mask]:
    """Return sites in four nearly equal parts, divided by a row and by columns: above and below, left and right."""
    row, col = np.nonzero(sites)
    middle = np.median(row)
    parts = []
    for half in (row <= middle, row > middle):
        if not half.any():
            continue
        centre = np.median(col[half])
        for side in (half & (col <= centre), half & (col > centre)):
            if side.any():
                part = np.zeros_like(sites)
                part[row[side], col[side]] = True
                parts.append(part)
    return parts


def _boxed(sites: Mask) -> Mask:
    """Return the sites within a box of `BOX` x `BOX` pixels around their middle."""
    row, col = np.nonzero(sites)
    top, left = (max(0, int(np.median(axis)) - BOX // 2) for axis in (row, col))
    boxed = np.zeros_like(sites)
    boxed[top : top + BOX, left : left + BOX] = sites[top : top + BOX, left : left + BOX]
    return boxed


def windowed(
    machine: Machine, logs: NDArray[np.uint16], sites: Mask, taps: NDArray[np.uint32], at: Mask
) -> tuple[NDArray[np.int64], Mask]:
    """Return means of planes (P, rows, cols) over sites in the windows ``at`` n sites, (P, n), and if there are any."""
    labels, weights = machine.put(sites.astype(np.uint8)), machine.put(taps)
    ones = machine.put(np.ones(len(logs), np.int32))
    counts = machine.get(window(machine, labels, machine.put(np.ones(1, np.int32)), weights))[0, at].astype(np.int64)
    sums = machine.get(window(machine, labels, ones, weights, machine.put(logs)))[:, at].astype(np.int64)
    return (MEANS * sums + counts // 2) // np.maximum(counts, 1), counts > 0


def _nulls(selves: Sequence[OwnDistances]) -> tuple[list[Null], int]:
    """Return the distribution of each class, and the degrees of freedom of the drift, which is pooled over classes."""
    within = [_spread(distances.windows)[1] for distances in selves]
    pooled: NDArray[np.float64] = np.add.accumulate(within)[-1] / len(within)
    several = [distances.parts.T for distances in selves if len(distances.parts) > 1]
    drift = sum((_spread(parts)[1] for parts in several), np.zeros_like(pooled)) / max(1, len(several))
    nulls = [
        Null(_spread(distances.windows)[0], OWN * own + (1 - OWN) * pooled + drift + FLOOR)
        for distances, own in zip(selves, within, strict=True)
    ]
    return nulls, max(1, sum(parts.shape[1] - 1 for parts in several))


def _spread(values: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the mean and the variance of values (M, n), with the same order of summation on every machine."""
    n = values.shape[1]
    mean = np.array([np.add.accumulate(line)[-1] for line in values]) / n
    squares = np.array([np.add.accumulate((line - m) ** 2)[-1] for line, m in zip(values, mean, strict=True)])
    return mean, squares / max(1, n - 1)
