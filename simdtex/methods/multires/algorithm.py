# SPDX-License-Identifier: BSD-3-Clause
"""Multiresolution sampling: the procedure of De Bonet (1997).

`analyse` (analysis.py) is the first phase; `MultiresRun` is the second, the paper's SynthesizePyramid and
CollapsePyramid level by level. Numbers in parentheses are the paper's equations. Level 0 is the finest.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import prod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.machine import Machine, memory
from simdtex.machine.interface import Array
from simdtex.methods.multires.analysis import (
    Analysis,
    analyse,
    copied,
    first_launch,
    lattice,
    pixels,
    places,
    read_sources,
    structure_of,
)
from simdtex.methods.multires.candidates import Sampled, candidates
from simdtex.methods.multires.options import Options
from simdtex.methods.pyramid.laplacian import laplacian_collapse
from simdtex.model.source_map import effective_use
from simdtex.options import within_32_bits
from simdtex.run import Callback, Observer, Output, OutputWithSource, Progress, Stage, paced

VALUES = 4
"""The most values per output pixel that kernels index: two counts, with all levels together."""


@dataclass(frozen=True)
class MultiresPlan:
    """A run of the method ``multires`` before it has a machine and a seed.

    Attributes
    ----------
    sample : (rows, cols, channels) array
    shape : (int, int)
        Rows and columns of the output.
    options : Options
    analysis : Analysis, optional
        The analysis of the sample, made on the same machine with the same options; None: `on` makes it.
    """

    sample: NDArray[Any]
    shape: tuple[int, int]
    options: Options
    analysis: Analysis | None = None

    def on(self, machine: Machine, seed: int) -> MultiresRun:
        """Return the run on a machine after the first phase of the paper; raise if the memory does not suffice."""
        channels, size = self.sample.shape[-1], self.sample.dtype.itemsize
        within_32_bits(self.shape, max(VALUES, channels))  # before any work
        memory.require_host(_on_host(self.shape, channels, size))
        analysis = self.analysis or analyse(machine, self.sample, self.options)
        return MultiresRun(machine, analysis, self.shape, self.options, seed)


class MultiresState(NamedTuple):
    """The state between two launches.

    ``level``, the current level; ``done``, its number of sampled pixels; ``source`` and ``counts`` of all levels, as in
    `simdtex.methods.multires.candidates.Sampled`; ``picture``, G of the level above.
    """

    level: int
    done: int
    source: Array
    counts: Array
    picture: Array | None


End = tuple[Stage, NDArray[np.int32]]
"""The end of a level: its stage, and the numbers (rows, cols, 2) of candidates and of nodes compared."""


class MultiresRun:
    """The second phase of the paper: SynthesizePyramid and CollapsePyramid, level by level.

    No pixel depends on another of its level; a step samples some pixels of a level, or collapses the level. Cost: for
    every four pixels at most the nodes above them, times the features; some thousandths of that at usual thresholds.
    Memory on the device, in bytes per output pixel: 20 + 5.3 channels, beside the analysis; on the host, which includes
    a CPU's device memory, 66 and 4 + n for each channel, n the bytes of a value of the sample (benchmarks/memory.py).
    """

    def __init__(
        self, machine: Machine, analysis: Analysis, shape: tuple[int, int], options: Options, seed: int
    ) -> None:
        channels = len(analysis.sample.planes)
        within_32_bits(shape, max(VALUES, channels))
        self.machine, self.analysis, self.options, self.seed = machine, analysis, options, seed
        self.shapes = [tiled(shape, analysis.shapes[0], size, 2**level) for level, size in enumerate(analysis.shapes)]
        held = 4 * (pixels(analysis.shapes) * channels + prod(analysis.features.shape))
        on_device = pixels(self.shapes) * (12 + 4 * channels) + prod(shape) * 4 + held
        memory.require(machine, on_device, _on_host(shape, channels, analysis.sample.pixels.dtype.itemsize))
        self._lattice = machine.put(lattice(self.shapes, 0))
        self._structure = structure_of(machine, analysis, options)
        self._launches: Iterator[tuple[int, int]] = iter(())

    def begin(self) -> MultiresState:
        """Return the first state, whose top level is that of the sample, copied and repeated."""
        top = self.analysis.levels - 1
        sampled = copied(self.machine, self.shapes, self.analysis.shapes[top])
        return self._entered(MultiresState(top, pixels([self.shapes[top]]), sampled.source, sampled.counts, None))

    def _entered(self, state: MultiresState) -> MultiresState:
        """Return the state, after planning the launches of its level."""
        if 0 <= state.level < self.analysis.levels - 1:
            count, least = pixels([self.shapes[state.level]]), first_launch(self.analysis, state.level)
            self._launches = paced(count, least, state.done)
        return state

    def step(self, state: MultiresState, watch: Any = None) -> tuple[MultiresState, End | None]:
        """Sample some pixels of the level, (9) to (12), or collapse it if all are sampled."""
        level, sampled = state.level, Sampled(state.source, state.counts, self._lattice)
        if state.done < pixels([self.shapes[level]]):  # Loop x', y'
            first, end = next(self._launches)
            match = self.options.parity == "match"
            sampled = candidates(self.machine, self._structure, sampled, level, range(first, end), match, self.seed)
            self.machine.sync()
            return state._replace(done=end, source=sampled.source, counts=sampled.counts), None
        analysis = self.analysis
        source, counts = read_sources(self.machine, sampled, self.shapes, level)
        picture = self._collapsed(level, source, state.picture)  # CollapsePyramid
        image = analysis.sample.picture(self.machine.get(picture), source if level == 0 else None)
        pixel = analysis.place.ravel()[source].astype(np.int32) if level == 0 else source
        place = places(pixel, analysis.shapes[level][1])
        stage = Stage(level, image, place, np.ascontiguousarray(counts[..., 0]))
        after = state._replace(level=level - 1, done=0, picture=picture)  # Loop i from top level downto 0
        return self._entered(after), (stage, counts)

    def _collapsed(self, level: int, source: NDArray[np.int32], coarse: Array | None) -> Array:
        """Return G of a level of the output, from its source map and G of the level above."""
        band = self.analysis.bands[level]
        if coarse is None:
            residue = self.machine.get(band)
            return self.machine.put(np.ascontiguousarray(residue.reshape(len(residue), -1)[:, source]))
        blend = self.options.seams == "blend"
        return laplacian_collapse(self.machine, band, self.machine.put(source), coarse, self.analysis.torus, blend)

    def ended(self, state: MultiresState) -> bool:
        """Return whether all levels are collapsed."""
        return state.level < 0

    def result(self, state: MultiresState, observer: MultiresRecord) -> tuple[NDArray[Any], Output]:
        """Return the finest level's picture, with its source map, stages and statistics."""
        finest = observer.stages[-1]
        assert finest.source is not None
        statistics = {
            "options": vars(self.options) | {"levels": self.analysis.levels},
            "levels": observer.reports,
            "use": effective_use(finest.source, self.analysis.shapes[0]).as_dict(),
        }
        return finest.image, OutputWithSource(finest.source, None, observer.stages, statistics)

    def save(self, state: MultiresState) -> dict[str, Any]:
        """Return a copy of the state that needs no machine."""
        get = self.machine.get
        picture = None if state.picture is None else get(state.picture)
        return state._replace(source=get(state.source), counts=get(state.counts), picture=picture)._asdict()

    def load(self, saved: dict[str, Any]) -> MultiresState:
        """Return the state that `save` copied, on this machine."""
        state, put = MultiresState(**saved), self.machine.put
        picture = None if state.picture is None else put(state.picture)
        return self._entered(state._replace(source=put(state.source), counts=put(state.counts), picture=picture))

    def observer(self, callback: Callback | None) -> MultiresRecord:
        """Return the observer of this run."""
        return MultiresRecord(self, callback)


class MultiresRecord(Observer):
    """The observer of a run: it reports every launch, and keeps the stage of every level."""

    _run: MultiresRun

    def step(self, state: MultiresState, end: End | None) -> None:
        """Report the sampled pixels; at the end of a level, keep its stage and report it."""
        if end:
            stage, counts = end
            self.stages.append(stage)
            mean, compared = (float(np.ascontiguousarray(counts[..., k]).mean()) for k in range(2))
            self.report(
                **{"level": stage.level, "rows": counts.shape[0], "cols": counts.shape[1]},
                **{"candidates": mean, "most": int(counts[..., 0].max())},
                **{"nodes": pixels(self._run.analysis.shapes[stage.level + 1 :]), "compared": compared},
            )
        if self._callback:
            shapes, last, level = self._run.shapes, self.stages[-1], state.level + bool(end)
            self._callback(
                Progress(
                    level=level,
                    levels=len(shapes),
                    fraction=(pixels(shapes[state.level + 1 :]) + state.done) / pixels(shapes),
                    doing=f"level {level}",
                    stage=f"level{level}" if end else None,
                    image=lambda: last.image,
                    maps={"candidates": lambda: np.asarray(last.candidates)},
                )
            )


def tiled(shape: tuple[int, int], sample: tuple[int, int], size: tuple[int, int], spacing: int) -> tuple[int, int]:
    """Return rows and columns of a level of the output: tiles like the sample's level, and the beginning of one."""
    rows, cols = (n // m * k + -(-(n % m) // spacing) for n, m, k in zip(shape, sample, size, strict=True))
    return rows, cols


def _on_host(shape: tuple[int, int], channels: int, itemsize: int) -> int:
    """Return the bytes on the host of an output with its stages."""
    return prod(shape) * (66 + channels * (4 + itemsize))
