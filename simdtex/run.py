# SPDX-License-Identifier: BSD-3-Clause
"""The progress that callbacks receive, and the additional output of a run: stages, source map and statistics."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.model.explanation import Explanation
from simdtex.options import Brief


@dataclass(frozen=True, kw_only=True, repr=False)
class Progress(Brief):
    """The progress of a run; a callback receives it several times a second.

    Attributes
    ----------
    level, levels : int
        The current level (0 is the finest, and the last) and the number of levels; 0 and 1 if there are none.
    fraction : float
        Estimated share of the work that is done, 0 to 1.
    doing : str
        Description of the current work.
    stage : str or None
        The name of the picture that is now complete, such as ``level0-sweep01``: at the end of a sweep, of a level
        without sweeps, of an iteration, or of a realisation. None otherwise.
    image : callable
        ``image()`` reads back the picture of the level, (rows, cols[, channels]) in the sample's type; that of the
        previous level if the method has no picture before the end of a level.
    solid : bool
        Whether the image is a block, (depth, rows, cols[, channels]).
    details : dict
        Numbers and texts that tell where the run is, by name. Each is an attribute, too: ``progress.sweep``. Those of
        each method are in :ref:`run-output`.
    maps : dict
        Functions by name that read back a map of the level, (rows, cols). Each is an attribute, too:
        ``progress.temperature()``.
    source : callable or None
        ``source()`` reads back the position in the sample of each site of the level, as `Output.source`: int32,
        (rows, cols, 2) or, with several samples, (rows, cols, 3). Only ``mrf``.
    explain : callable or None
        ``explain(row, col)``, or ``explain(layer, row, col)`` in a volume, returns a
        `simdtex.model.explanation.Explanation` of how that site of the level would relax now, with the random numbers
        of the current step. A call after the callback has returned uses the state of the run at that time. It changes
        nothing. Only ``mrf``.
    """

    level: int = 0
    levels: int = 1
    fraction: float
    doing: str
    stage: str | None = None
    image: Callable[[], NDArray[Any]]
    solid: bool = False
    details: dict[str, Any] = field(default_factory=dict)
    maps: dict[str, Callable[[], NDArray[Any]]] = field(default_factory=dict, repr=False)
    source: Callable[[], NDArray[np.int32]] | None = None
    explain: Callable[..., Explanation] | None = None

    def __getattr__(self, name: str) -> Any:
        """Return the detail or the map of this name."""
        known = {} if name[0] == "_" else self.details | self.maps  # an empty copy is asked for __setstate__
        if name in known:
            return known[name]
        raise AttributeError(f"this progress has no {name!r}; choose from its details and maps: {', '.join(known)}")

    def within(self, number: int, count: int, job: str) -> Progress:
        """Return the progress of ``count`` jobs while one, ``number`` from 0, runs; the detail ``job`` describes it."""
        return replace(self, fraction=(number + self.fraction) / count, details=self.details | {"job": job})


Callback = Callable[[Progress], Any]


@dataclass(frozen=True, repr=False)
class Stage(Brief):
    """The result of a level.

    Attributes
    ----------
    level : int
        0 is the finest.
    image : (rows, cols[, channels]) array
        In the sample's type.
    source : (rows, cols, 2) int32 array or None
        ``multires``: for every pixel of the level, the (row, column) in the sample's level that it was copied from;
        above the finest level, in that of the sample with repaired edges.
    candidates : (rows, cols) int32 array or None
        ``multires``: the number of candidates that each pixel was drawn from.
    """

    level: int
    image: NDArray[Any]
    source: NDArray[Any] | None = None
    candidates: NDArray[Any] | None = None


@dataclass(frozen=True, repr=False)
class Output:
    """The additional results of ``full_output=True``.

    Attributes
    ----------
    source : (rows, cols, 2) int32 array or None
        For every output pixel the (row, column) of its source pixel in the sample; with ``multires``, the source of
        its highest frequencies. With ``mrf`` and a finish, a pixel near a seam is the mean of its source pixel and of
        the pixels that continue its neighbours' sources. None with ``pyramid``, which takes no pixel from the sample.
    temperature : (rows, cols) float64 array or None
        ``mrf``: the remaining pixel temperatures, 0 to 1.
    stages : list of Stage
        The picture of each level at its end, the coarsest first; with ``mrf`` without the finish. ``pyramid`` has none;
        its callback sees every iteration.
    statistics : dict
        ``device``, ``seed``, ``options``, ``seconds``, ``device_seconds`` (of kernels; None unless the machine was
        opened with ``profile=True``, which also adds ``kernels``), ``light``, ``use`` if there is a source map, and
        ``levels``: one dict per level with ``level``, ``rows``, ``cols``, ``candidates`` and ``seconds``.
        :ref:`run-output` describes these and what each method adds.
    fit : (rows, cols, classes) float32 array or None
        `simdtex.classify`: the probability that a texture of each class differs from its samples as much as the picture
        does around each pixel, within its segment.
    probability : (rows, cols, classes) float32 array or None
        `simdtex.classify`: the probability of each class in the field of labels, given the labels around the pixel;
        the sum is 1.
    made : (rows, cols, channels) or (depth, rows, cols, channels) array or None
        The result with channels last, whatever the axes of the sample; notebooks show it.
    """

    source: NDArray[Any] | None
    temperature: NDArray[Any] | None = None
    stages: list[Stage] = field(default_factory=list)
    statistics: dict[str, Any] = field(default_factory=dict)
    fit: NDArray[np.float32] | None = None
    probability: NDArray[np.float32] | None = None
    made: NDArray[Any] | None = None

    def __repr__(self) -> str:
        """Return a line of text about the contents, since all arrays and figures would fill pages."""
        rows_cols = "x".join(map(str, self.made.shape[:-1])) if self.made is not None else ""
        has = [name for name in ("source", "temperature") if getattr(self, name) is not None]
        has += [f"{len(self.stages)} stages"] if self.stages else []
        told = {name: str(self.statistics[name]) for name in ("seed", "device") if name in self.statistics}
        has += [f"{name} {text.partition(' (')[0]}" for name, text in told.items()]
        has += [f"{self.statistics['seconds']:.2f} s"] if "seconds" in self.statistics else []
        return f"Output({', '.join([rows_cols] * bool(rows_cols) + has)})"

    def _repr_html_(self) -> str:
        """Return HTML for a notebook: the picture and its source map."""
        from simdtex.model.display import as_html

        return as_html(self.made, self.source, self.statistics)


@dataclass(frozen=True, repr=False)
class OutputWithSource(Output):
    """An `Output` whose ``source`` is an array: that of ``mrf`` and ``multires``."""

    source: NDArray[Any]


class Observer:
    """The observer of a run: it reports progress and keeps the stages and reports of levels; it changes nothing."""

    def __init__(self, run: Any, callback: Callback | None) -> None:
        self._run, self._callback = run, callback
        self.stages: list[Stage] = []
        self.reports: list[dict[str, Any]] = []
        self._began = time.perf_counter()  # of what the next report describes

    def part(self, *seen: Any) -> None:
        """Receive a part of a long step."""

    def step(self, state: Any, info: Any) -> None:
        """Receive a step: the state after it, and a description of its work."""

    def report(self, **counts: Any) -> None:
        """Keep a report, with the seconds since the last one."""
        now = time.perf_counter()
        self.reports.append(counts | {"seconds": now - self._began})
        self._began = now

    def statistics(self) -> dict[str, Any]:
        """Return what the observer adds to the statistics of the output."""
        return {}

    def save(self) -> dict[str, Any]:
        """Return everything received so far, as plain arrays and numbers."""
        stages = [tuple(vars(stage).values()) for stage in self.stages]
        return {"stages": stages, "reports": self.reports, "seconds": time.perf_counter() - self._began}

    def load(self, saved: dict[str, Any]) -> None:
        """Continue from the tree that `save` returned."""
        self.stages[:], self.reports[:] = [Stage(*stage) for stage in saved["stages"]], saved["reports"]
        self._began = time.perf_counter() - saved["seconds"]


def paced(count: int, least: int, first: int = 0) -> Iterator[tuple[int, int]]:
    """Yield ranges (first, end) of at least ``least`` that cover first..count; the loop's body takes 0.1 s for each."""
    size = least
    while first < count:
        end, began = min(count, first + size), time.perf_counter()
        yield first, end
        first, seconds = end, max(time.perf_counter() - began, 1e-3)
        size = max(least, int(size * min(4.0, 0.1 / seconds)))
