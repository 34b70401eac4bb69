# SPDX-License-Identifier: BSD-3-Clause
"""The classifier as a program: distances from every class, a Potts field, and a test for unknown textures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import prod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from simdtex import schedules
from simdtex.checkpoint import like
from simdtex.driver import SingleRun
from simdtex.jobs.classification.model import (
    MEANS,
    UNITS,
    Model,
    Region,
    blurred,
    learn,
    measured,
    prepared,
    windowed,
)
from simdtex.jobs.classification.operations import LOGS, WEIGHTS, exemplars, features, gaussian, potts, window
from simdtex.jobs.classification.options import Options
from simdtex.jobs.classification.patterns import NEAR, PATTERNS, WEIGHT, patterns
from simdtex.machine import Machine, memory
from simdtex.machine.interface import Array
from simdtex.model.lattice import Grid, neighbourhood_offsets
from simdtex.model.pictures import Mask
from simdtex.options import within_32_bits
from simdtex.run import Callback, Observer, Output, Progress

WORK = 2**32
"""About the number of multiply-adds of a step."""

SITES_AT_ONCE = 2**17
"""The most sites whose fits are computed together."""

FEWEST_ROWS = 32
"""The fewest rows whose patterns are compared together, since those around them are needed, too."""

SPREAD = 4
"""Degrees of freedom of the squared difference of a window's measures: see docs/classification.rst."""

PATTERN_FACTOR = round(UNITS / LOGS * WEIGHT)
"""Evidence, in `UNITS`, of one unit of the logarithms of probabilities by patterns."""

STEPS = 64
"""The most steps of a sweep, since each takes a pass over the picture."""


@dataclass(frozen=True)
class Classification(SingleRun):
    """The job of `classify`; ``classes`` are regions of each class or a trained model, ``names`` those of labels."""

    image: NDArray[Any]
    unknown: Mask
    classes: Sequence[Sequence[Region]] | Model
    names: dict[int, str]
    options: Options
    channel_axis = None  # of labels

    def on(self, machine: Machine, seed: int) -> ClassificationRun:
        """Return the run on a machine, with trained classes."""
        shape, count, bands = self.image.shape[:2], len(self.names), self.image.shape[-1]
        within_32_bits(shape, count)
        sites, experts = prod(shape), 2 * self.options.levels
        part = min(sites, max(SITES_AT_ONCE, FEWEST_ROWS * shape[1]))
        around = int(3 * self.options.window) + FEWEST_ROWS  # rows that the windows and neighbourhoods of a part reach
        slab = min(sites, part + 2 * around * shape[1])
        planes = experts + PATTERNS * self.options.levels
        device = sites * (16 * count + experts * bands) + slab * 14 * planes
        host = sites * (count * (2 * experts + 22) + 24 * bands + 64 + experts * bands) + part * (24 * planes + 24)
        host += slab * 3 * planes
        memory.require(machine, device, host)
        model = self.classes
        if not isinstance(model, Model):
            model = learn(machine, model, list(self.names.values()), self.options, seed)
        return ClassificationRun(machine, self, model, seed)


class ClassificationState(NamedTuple):
    """The state between two steps: ``done`` rows are compared; the next step writes into the arrays."""

    done: int
    logs: NDArray[np.uint16]  # (E + 1, classes, rows, cols), of distances and, last, of probabilities by patterns
    labels: NDArray[np.uint8]  # (rows, cols), 0 the first class
    schedule: Any
    changed: tuple[int, ...] = ()  # labels, of each sweep


class _Segment(NamedTuple):
    """The sites of a label in a strip, cut to the ``part`` that windows reach: all, those inside, and the tested."""

    part: tuple[slice, ...]
    own: Mask
    inner: Mask
    at: Mask


class ClassificationRun:
    """A classification on a machine: rows are compared with the classes, then labels are relaxed, sweep by sweep."""

    def __init__(self, machine: Machine, plan: Classification, model: Model, seed: int) -> None:
        self.machine, self.plan, self.model, self.options = machine, plan, model, plan.options
        self.labels = np.array([0, *plan.names], np.uint8)
        self.grid = Grid.of(plan.image.shape[:2], torus=False)
        self.schedule = schedules.get(plan.options.schedule)
        self._setting = schedules.Setting(machine, self.grid, neighbourhood_offsets(1), 1, seed, 0)
        self._everywhere = schedules.Masked(self.grid)
        _, info = self.schedule.step(self._setting, self.schedule.init(self._setting), self._everywhere)
        if info.sites.size / len(info.ranges) * STEPS < self.grid.size:
            raise ValueError(
                f"the schedule {self.schedule.name} takes more than {STEPS} steps to a sweep, and each takes a pass "
                "over the picture; choose synchronous, checkerboard, coloring or random-subset"
            )
        self._taps, self._coupling = gaussian(plan.options.window), machine.put(gaussian(plan.options.coupling))
        self._weight = round(WEIGHTS * plan.options.weight)
        self._size = 2 * max(expert.reach for expert in model.experts) + 1  # of the largest neighbourhood
        self._levels = prepared(machine, model.scale, plan.image, model.experts[-1].level + 1)
        self._on_host = [np.asarray(machine.get(level)) for level in self._levels]
        self._exemplars = [known.on(machine) for known in model.exemplars]
        self._classes = machine.put(np.arange(len(plan.names), dtype=np.int32))

    def begin(self) -> ClassificationState:
        """Return the state before any comparison."""
        shape = self.plan.image.shape[:2]
        logs = np.zeros((len(self.model.experts) + 1, len(self.plan.names), *shape), np.uint16)
        return ClassificationState(0, logs, np.zeros(shape, np.uint8), self.schedule.init(self._setting))

    def step(self, state: ClassificationState, watch: Callable[..., None]) -> tuple[ClassificationState, None]:
        """Compare the next rows with the exemplars of every class or, after the last row, relax labels in a sweep."""
        return (self._compared(state) if state.done < self.grid.rows else self._swept(state)), None

    def shown(self, state: ClassificationState) -> NDArray[np.uint8]:
        """Return the labels so far, (rows, cols, 1), 0 where pixels are not yet compared."""
        labels: NDArray[np.uint8] = self.labels[state.labels + np.uint8(1)]
        labels[state.done :] = 0
        return labels[..., None]

    def _compared(self, state: ClassificationState) -> ClassificationState:
        machine, cols = self.machine, self.grid.cols
        each = sum(known.doubled.size for known in self._exemplars)
        end = min(self.grid.rows, state.done + max(1, WORK // (each * cols)))
        sites = machine.put(np.arange(state.done * cols, end * cols, dtype=np.int32))
        for e, (expert, known) in enumerate(zip(self.model.experts, self._exemplars, strict=True)):
            offsets = machine.put(expert.offsets)
            values = features(machine, self._levels[expert.level], sites, offsets, expert.contrast)
            nearest = machine.get(exemplars(machine, values, known))
            state.logs[e, :, state.done : end] = nearest.reshape(len(nearest), -1, cols)
        band = max(FEWEST_ROWS, SITES_AT_ONCE // cols)
        for first in range(-(-state.done // band) * band, end, band):
            state.logs[-1, :, first : first + band] = self._patterned(first, min(first + band, self.grid.rows))
        if end < self.grid.rows:
            state.labels[state.done : end] = self._single(state.logs[:, :, state.done : end]).argmax(0)
        else:
            state.labels[:] = self._evidence(state.logs).argmax(0)
        return state._replace(done=end)

    def _patterned(self, first: int, end: int) -> NDArray[np.uint16]:
        """Return the logarithms of probabilities by the patterns around the sites of some rows, (classes, n, cols)."""
        slab = slice(max(0, first - len(NEAR) // 2), min(self.grid.rows, end + len(NEAR) // 2))
        here = np.zeros((slab.stop - slab.start, self.grid.cols), bool)
        here[first - slab.start : end - slab.start] = True
        means, _ = windowed(self.machine, patterns(self._on_host, slab), np.ones_like(here), NEAR, here)
        return self.model.discriminant.logarithms(means / float(MEANS)).reshape(-1, end - first, self.grid.cols)

    def _single(self, logs: NDArray[np.uint16]) -> NDArray[np.int32]:
        """Return the evidence of single sites, (classes, ...) int32 in 2**-18: equation (6), and patterns."""
        total = np.empty(logs.shape[1:], np.int32)
        total[:] = self.model.offsets.reshape(-1, *[1] * (total.ndim - 1))
        for factor, log in zip((*(expert.factor for expert in self.model.experts), PATTERN_FACTOR), logs, strict=True):
            total -= np.int32(factor) * log.astype(np.int32)
        return total

    def _evidence(self, logs: NDArray[np.uint16]) -> NDArray[np.int32]:
        """Return the evidence of each class averaged over the window ``smoothing``, (classes, rows, cols) int32."""
        total = self._single(logs)
        if self.options.smoothing:
            for plane in total:
                plane[:] = blurred(plane, gaussian(self.options.smoothing))
        return total

    def _votes(self, labels: Array) -> Array:
        """Return the votes of the labels around each site for every class."""
        return window(self.machine, labels, self._classes, self._coupling)

    def _swept(self, state: ClassificationState) -> ClassificationState:
        machine = self.machine
        evidence, labels = machine.put(self._evidence(state.logs)), machine.put(state.labels)
        for after, chosen in schedules.decisions(self.schedule, self._setting, state.schedule, self._everywhere):
            memory = after
            for group in chosen.apart(machine):
                if group.sites.size:
                    sites = machine.put(group.sites.astype(np.int32))
                    labels = potts(machine, sites, evidence, self._votes(labels), self._weight, labels)
        swept = machine.get(labels)
        changed = int(np.count_nonzero(swept != state.labels))
        return ClassificationState(state.done, state.logs, swept, memory, (*state.changed, changed))

    def ended(self, state: ClassificationState) -> bool:
        """Return whether all rows are compared, and the last sweep changed no label or no sweep is left."""
        settled = len(state.changed) >= self.options.sweeps or 0 in state.changed[-1:]
        return state.done == self.grid.rows and settled

    def result(self, state: ClassificationState, observer: ClassificationRecord) -> tuple[NDArray[Any], Output]:
        """Return labels (rows, cols, 1) uint8, 0 unknown; fits and probabilities."""
        fit, rejected = self._fits(state)
        index = np.where(rejected | self.plan.unknown, 0, state.labels + 1)
        energy = self._evidence(state.logs)
        votes = self.machine.get(self._votes(self.machine.put(state.labels))).view(np.int32)
        energy += np.int32(self._weight) * votes // WEIGHTS
        energy -= energy.max(0)
        chance = np.exp(energy.astype(np.float32) / np.float32(UNITS))
        chance /= chance.sum(0)
        names = {0: "unknown"} | self.plan.names
        shares = np.bincount(index.ravel(), minlength=len(names)) / index.size
        options = vars(self.options) | {"levels": self.model.experts[-1].level + 1, "schedule": self.schedule.name}
        statistics: dict[str, Any] = {
            "options": options,
            "classes": [
                {"label": label, "name": name, "share": float(share)}
                for (label, name), share in zip(names.items(), shares, strict=True)
            ],
            "changed": list(state.changed),
        }
        for c, about in enumerate(statistics["classes"][1:]):
            about |= {"exemplars": self.model.counts[c], "own": float(self.model.own[c].mean())}
        more = {"fit": np.moveaxis(fit, 0, -1), "probability": np.moveaxis(chance, 0, -1)}
        return self.labels[index][..., None], Output(None, statistics=statistics, **more)

    def _fits(self, state: ClassificationState) -> tuple[NDArray[np.float32], Mask]:
        """Return the fit of each class at each site, (classes, rows, cols), and a mask of sites of a rejected class."""
        from scipy.special import fdtrc, fdtri

        _, classes, rows, cols = state.logs.shape
        fit, rejected = np.zeros((classes, rows, cols), np.float32), np.zeros((rows, cols), bool)
        freedom, size = self.model.freedom, self._size
        limit = fdtri(SPREAD, freedom, 1 - self.options.unknown) if self.options.unknown else np.inf
        reach = len(self._taps) // 2
        band, margin = max(1, SITES_AT_ONCE // cols), reach + size // 2
        for first in range(0, rows, band):
            slab, here = slice(max(0, first - margin), first + band + margin), slice(first, first + band)
            labels = state.labels[slab]
            inside = np.zeros(labels.shape, bool)
            inside[first - slab.start :][:band] = True
            patterned, segments = patterns(self._on_host, slab), []
            for label in np.unique(state.labels[here]):
                members = labels == label
                inner = ndimage.minimum_filter(members, size, mode="nearest")  # no neighbour beyond the segment
                (box,) = ndimage.find_objects(members.astype(np.int8))
                part = tuple(slice(max(0, side.start - reach), side.stop + reach) for side in box)
                segment = _Segment(part, *(mask[part] for mask in (members, inner, members & inside)))
                segments.append((label, segment, self._means(patterned, np.zeros_like(members), segment)))
            for c, null in enumerate(self.model.nulls):
                logs = state.logs[:-1, c, slab]
                copied = ndimage.maximum_filter((logs == 0).all(0), size, mode="nearest")  # a sample of the picture
                for label, segment, means in segments:
                    there = state.labels[here] == label
                    distance = null.distance(measured(self._means(logs, copied, segment), means))
                    distance[copied[segment.part][segment.at]] = 0  # samples of the picture fit
                    fit[c, here][there] = fdtrc(SPREAD, freedom, distance)
                    if c == label:
                        rejected[here][there] = distance > limit
        return fit, rejected

    def _means(self, planes: NDArray[np.uint16], copied: Mask, segment: _Segment) -> NDArray[np.int64]:
        """Return the means of planes over the windows of the tested sites of a segment, without copies."""
        part, own, inner, at = segment
        planes, copied = np.ascontiguousarray(planes[:, *part]), copied[part]
        means, filled = windowed(self.machine, planes, inner & ~copied, self._taps, at)
        if not (filled | copied[at]).all():  # a narrow segment
            means = np.where(filled, means, windowed(self.machine, planes, own & ~copied, self._taps, at)[0])
        return means

    def save(self, state: ClassificationState) -> dict[str, Any]:
        """Return a copy of the state that needs no machine."""
        return state._replace(logs=state.logs.copy(), labels=state.labels.copy())._asdict()

    def load(self, saved: dict[str, Any]) -> ClassificationState:
        """Return the state that `save` copied."""
        kept = like(self.schedule.init(self._setting), saved["schedule"])
        return ClassificationState(**saved | {"schedule": kept, "changed": tuple(saved["changed"])})

    def observer(self, callback: Callback | None) -> ClassificationRecord:
        """Return the observer of this run."""
        return ClassificationRecord(self, callback)


class ClassificationRecord(Observer):
    """The observer of a classification: the state holds everything that it reports."""

    _run: ClassificationRun

    def step(self, state: ClassificationState, info: None) -> None:
        """Report a step."""
        if self._callback:
            compared, sweeps = state.done / self._run.grid.rows, len(state.changed)
            self._callback(
                Progress(
                    fraction=0.9 * compared + 0.1 * sweeps / max(1, self._run.options.sweeps),
                    doing=f"sweep {sweeps}" if sweeps else f"compared {100 * compared:.0f} %",
                    image=lambda: self._run.shown(state),
                )
            )
