# SPDX-License-Identifier: BSD-3-Clause
"""Multiresolution sampling: the procedure of De Bonet (1997).

`analyse` (analysis.py) is the first phase; `resample` is the second, his SynthesizePyramid and CollapsePyramid level by
level. Numbers in parentheses are the paper's equations. Level 0 is the finest.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from math import prod
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.checkpoints.keep import NOTHING, Keep
from simdtex.machine import Machine, memory
from simdtex.machine.interface import Array
from simdtex.methods.multires.alpha import alpha_of
from simdtex.methods.multires.analysis import Analysis, analyse
from simdtex.methods.multires.levels import (
    copied,
    first_launch,
    lattice,
    pixels,
    places,
    read_sources,
    structure_of,
    thresholds,
)
from simdtex.methods.multires.options import Options
from simdtex.model.use import effective_use
from simdtex.ops.candidates import Sampled, candidates
from simdtex.ops.laplacian import laplacian_blend, laplacian_collapse
from simdtex.options import within_32_bits
from simdtex.run import Callback, Output, Sampling, Stage, device_seconds, paced

VALUES = 4
"""Values for each pixel of an output that kernels number: two counts, all levels together."""


def synthesize(
    machine: Machine,
    sample: NDArray[Any],
    shape: tuple[int, int],
    options: Options,
    seed: int,
    callback: Callback | None = None,
    keep: Keep = NOTHING,
) -> tuple[NDArray[Any], Output]:
    """Both phases: `analyse`, then `resample`, which says what comes in and out."""
    began, worked = perf_counter(), machine.seconds
    within_32_bits(shape, max(VALUES, sample.shape[-1]))  # before any work
    memory.require_host(_on_host(shape, sample.shape[-1], sample.dtype.itemsize))
    analysis = analyse(machine, sample, **options.analysis)
    image, output = resample(machine, analysis, shape, options, seed, callback, keep)
    output.statistics.update(seconds=perf_counter() - began, device_seconds=device_seconds(machine, worked))
    return image, output


def resample(
    machine: Machine,
    analysis: Analysis,
    shape: tuple[int, int],
    options: Options,
    seed: int,
    callback: Callback | None = None,
    keep: Keep = NOTHING,
) -> tuple[NDArray[Any], Output]:
    """The second phase of the paper: SynthesizePyramid and CollapsePyramid, level by level.

    Parameters
    ----------
    machine : Machine
        What executes the steps.
    analysis : Analysis
        Of the sample, made with the same options.
    shape : (int, int)
        Rows and columns of the output.
    options : Options
    seed : int
        Key of every random number.
    callback : callable, optional
        Called with a `simdtex.run.Sampling` after every piece of a level.
    keep : Keep
        Keeps the state after every piece of a level.

    Returns
    -------
    image : (rows, cols, channels) array
        In the sample's type.
    output : simdtex.run.Output
        Source map, stages with their source maps and candidates, statistics.

    Notes
    -----
    A level is one step: no pixel depends on another of its level. Cost: for every four pixels at most the nodes above
    them, times the features; some thousandths of that at usual thresholds. Memory on the device, in bytes per output
    pixel: 20 + 5.3 channels, beside the analysis; on the host, where a CPU's device memory is too, 66 and 4 + n for
    each channel, n the bytes of a value of the sample (benchmarks/memory.py). Both are asked for first.
    """
    began, worked = perf_counter(), machine.seconds
    channels = len(analysis.sample.planes)
    within_32_bits(shape, max(VALUES, channels))
    shapes = [tiled(shape, analysis.shapes[0], own, 2**level) for level, own in enumerate(analysis.shapes)]
    on_device = pixels(shapes) * (12 + 4 * channels) + prod(shape) * 4 + _held(analysis)
    memory.require(machine, on_device, _on_host(shape, channels, analysis.sample.pixels.dtype.itemsize))
    kept = keep.found
    alpha = alpha_of(machine, analysis, options) if kept is None else kept["alpha"]
    structure = structure_of(machine, analysis, thresholds(analysis.levels, options, alpha))
    record = _Record(shapes, callback, kept and kept["seconds"])

    top = analysis.levels - 1
    sampled = copied(machine, shapes, analysis.shapes[top]) if kept is None else _restored(machine, shapes, kept)
    picture = None
    for level in reversed(range(analysis.levels)):  # Loop i from top level downto 0
        if level < top:
            done = _done(kept, level, shapes)
            for first, end in paced(pixels([shapes[level]]), first_launch(analysis, level), done):  # Loop x', y'
                match = options.parity == "match"
                sampled = candidates(machine, structure, sampled, level, first, end, match, seed)  # (9) to (12)
                machine.sync()
                record.tell(level, end)
                keep.offer(partial(_kept, machine, sampled, shapes, level, end, alpha, record))
        source, counts = read_sources(machine, sampled, shapes, level)
        picture = _collapsed(machine, analysis, level, source, picture, options.seams == "blend")  # CollapsePyramid
        image = analysis.sample.picture(machine.get(picture), source if level == 0 else None)
        given = analysis.place.ravel()[source].astype(np.int32) if level == 0 else source
        place, nodes = places(given, analysis.shapes[level][1]), pixels(analysis.shapes[level + 1 :])
        record.end(Stage(level, image, place, np.ascontiguousarray(counts[..., 0])), counts, nodes)

    used: dict[str, Any] = {"alpha": alpha, "levels": analysis.levels}
    if options.thresholds is not None:
        used["thresholds"] = np.asarray(options.thresholds).tolist()
    statistics = {
        "device": machine.name,
        "seed": seed,
        "options": vars(options) | used,
        "seconds": perf_counter() - began,
        "device_seconds": device_seconds(machine, worked),
        "levels": record.reports,
        "use": effective_use(place, analysis.shapes[0]).as_dict(),
    }
    return image, Output(place, None, record.stages, statistics)


def _kept(
    machine: Machine,
    sampled: Sampled,
    shapes: list[tuple[int, int]],
    level: int,
    end: int,
    alpha: float | None,
    record: _Record,
) -> dict[str, Any]:
    """The state of a run: what is sampled of this level, as far as it goes, and all of those above."""
    begin = pixels(shapes[:level])
    source, counts = machine.get(sampled.source[begin:]), machine.get(sampled.counts[begin:])
    told = {"alpha": alpha, "seconds": record.seconds}
    return {"level": level, "end": end, "source": source, "counts": counts, **told}


def _restored(machine: Machine, shapes: Sequence[tuple[int, int]], kept: dict[str, Any]) -> Sampled:
    """What `_kept` gave, on a machine."""
    more = pixels(shapes[: kept["level"]])
    source, counts = np.pad(kept["source"], (more, 0)), np.pad(kept["counts"], ((more, 0), (0, 0)))
    return Sampled(machine.put(source), machine.put(counts), machine.put(lattice(shapes, 0)))


def _done(kept: dict[str, Any] | None, level: int, shapes: Sequence[tuple[int, int]]) -> int:
    """How many pixels of a level a run that is gone on with has sampled."""
    if kept is None or level < kept["level"]:
        return 0
    return int(kept["end"]) if level == kept["level"] else pixels([shapes[level]])


class _Record:
    """The stages and reports of a run as it goes on, and what its callback is told of them.

    ``before`` are the seconds that levels took before the run was gone on with.
    """

    def __init__(
        self, shapes: list[tuple[int, int]], callback: Callback | None, before: list[float] | None = None
    ) -> None:
        self.stages: list[Stage] = []
        self.reports: list[dict[str, Any]] = []
        self._shapes, self._callback = shapes, callback
        self._before, self._began = before or [], perf_counter()

    @property
    def seconds(self) -> list[float]:
        """What each level took, and the present one so far."""
        return [*(report["seconds"] for report in self.reports), self._so_far()]

    def _so_far(self) -> float:
        before = self._before[len(self.reports)] if len(self.reports) < len(self._before) else 0.0
        return before + perf_counter() - self._began

    def tell(self, level: int, sampled: int, ended: bool = False) -> None:
        """So many pixels of a level are sampled. Pictures are those of the last stage, which has been read back."""
        if self._callback:
            share = (pixels(self._shapes[level + 1 :]) + sampled) / pixels(self._shapes)
            last = self.stages[-1]
            now: dict[str, Any] = {"level": level, "levels": len(self._shapes), "fraction": share}
            now |= {"image": lambda: last.image, "candidates": lambda: last.candidates}
            self._callback(Sampling(end_of_level=ended, **now))

    def end(self, stage: Stage, counts: NDArray[np.int32], nodes: int) -> None:
        """A level is done; counts (rows, cols, 2) are candidates and nodes compared, of so many nodes."""
        self.stages.append(stage)
        rows, cols = counts.shape[:2]
        mean, compared = (float(np.ascontiguousarray(counts[..., k]).mean()) for k in range(2))
        report = {
            "level": stage.level,
            "rows": rows,
            "cols": cols,
            "candidates": mean,
            "most": int(counts[..., 0].max()),
        }
        self.reports.append(report | {"nodes": nodes, "compared": compared, "seconds": self._so_far()})
        self._began = perf_counter()
        self.tell(stage.level, rows * cols, ended=True)


def tiled(shape: tuple[int, int], sample: tuple[int, int], own: tuple[int, int], spacing: int) -> tuple[int, int]:
    """Rows and columns of a level of the output, which is made of whole tiles and the beginning of one more.

    Parameters
    ----------
    shape, sample : (int, int)
        Rows and columns of the output and of the sample.
    own : (int, int)
        Of the sample's level.
    spacing : int
        2**level.
    """
    rows, cols = (n // m * k + -(-(n % m) // spacing) for n, m, k in zip(shape, sample, own, strict=True))
    return rows, cols


def _collapsed(
    machine: Machine, analysis: Analysis, level: int, source: NDArray[np.int32], coarse: Array | None, blend: bool
) -> Array:
    """G of a level of the output, from its source map and G of the level above."""
    band = analysis.bands[level]
    if coarse is None:
        residue = machine.get(band)
        return machine.put(np.ascontiguousarray(residue.reshape(len(residue), -1)[:, source]))
    collapse = laplacian_blend if blend else laplacian_collapse
    return collapse(machine, band, machine.put(source), coarse, analysis.torus)


def _on_host(shape: tuple[int, int], channels: int, itemsize: int) -> int:
    """Bytes on the host of an output with its stages."""
    return prod(shape) * (66 + channels * (4 + itemsize))


def _held(analysis: Analysis) -> int:
    """Bytes of an analysis on the device."""
    return 4 * (pixels(analysis.shapes) * len(analysis.sample.planes) + int(prod(analysis.features.shape)))
