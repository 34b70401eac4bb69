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
        Numbers and texts that tell where the run is, by name: see Notes. Each is an attribute, too: ``progress.sweep``.
    maps : dict
        Functions by name that read back a map of the level, (rows, cols): see Notes. Each is an attribute, too:
        ``progress.temperature()``.
    source : callable or None
        ``source()`` reads back the position in the sample of each site of the level, as `Output.source`: int32,
        (rows, cols, 2) or, with several samples, (rows, cols, 3). Only ``mrf``.
    explain : callable or None
        ``explain(row, col)``, or ``explain(layer, row, col)`` in a volume, returns a
        `simdtex.model.explanation.Explanation` of how that site of the level would relax now, with the random numbers
        of the current step. A call after the callback has returned uses the state of the run at that time. It changes
        nothing. Only ``mrf``.

    Notes
    -----
    ``mrf``, after every part of a step, has ``sweep`` and ``step`` of the level, from 1 (the sites of a step relax
    together); ``phase``, ``"relax"`` while some temperature is above 0, then ``"free"``; ``temperature_left``, the mean
    temperature of the level, 0 to 1, at the beginning of the sweep; and the map ``temperature``, 0 to 1.

    ``multires``, after every part of a level, has the map ``candidates``, the number of candidates that each pixel of
    the last complete level was drawn from, integers.

    ``pyramid``, after every channel or, for a solid, after every part of a channel, has ``iteration``, from 1, and
    ``iterations``. In the picture, channels that are not yet done in this iteration are those of the previous one.

    `simdtex.simulate`, after every part of a step of a realisation, and at its end, has ``realisation``, the number of
    that whose picture it is, and the numbers of ``finished`` and of all ``realisations``; before its end also the map
    ``temperature``.

    `simdtex.classify`, after every step, has a picture of the labels so far: 1 is the first class, and 0 a pixel not
    yet compared.

    `simdtex.synthesize` with a store, after every tile, has the current turn as ``phase``: ``"begin"`` a level;
    ``"whole"``, all sweeps of a level of one tile; ``"sweep"``; or ``"show"``, write the picture. ``sweep`` is that of
    the level, from 1; ``tile`` and ``tiles`` are the numbers of finished tiles and of all. The image has every n-th
    site of the level before the turn, about 1000 on a side. Reading it is slow.
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
        opened with ``profile=True``, which also adds ``kernels``, see `simdtex.machine.reference.Log.take`), and
        ``levels``: one dict per level with ``level``, ``rows``, ``cols``, ``candidates``, ``seconds``, and the entries
        of the method below. If there is a source map, ``use`` shows how evenly the sample is used, as
        `simdtex.model.source_map.effective_use`: ``effective_share``, above 0, to 1, and ``most_used``, the most used
        piece of the sample: ``times_fair_share``, its first pixel (``row``, ``col``), and its size (``rows``,
        ``cols``) in pixels.
        ``lattice`` of ``mrf`` is None unless the sample repeats. It has the two ``vectors`` of the output's lattice,
        (row, column) in pixels, the ``deformation`` that fits the sample's lattice to the output, 0 if none, and
        ``fitting``, the rows and columns of an output that needs less deformation, None if this one needs the least.
        ``light`` has the value of the option ``light`` and, but for ``fill``, how uneven the light of the sample is:
        ``smooth`` and ``share``, see `simdtex.model.light.unevenness`.
    fit : (rows, cols, classes) float32 array or None
        `simdtex.classify`: the probability that a texture of each class differs from its samples as much as the picture
        does around each pixel, within its segment.
    probability : (rows, cols, classes) float32 array or None
        `simdtex.classify`: the probability of each class in the field of labels, given the labels around the pixel;
        the sum is 1.
    made : (rows, cols, channels) or (depth, rows, cols, channels) array or None
        The result with channels last, whatever the axes of the sample; notebooks show it.

    Notes
    -----
    A level of ``mrf`` has ``sweeps``, ``steps``, ``relaxations``, ``fma`` (of equation (12)), ``skipped`` (the fma that
    a bound made unnecessary; docs/concepts/search.rst), and ``equilibrium``: the ``sweeps``, ``steps`` and
    ``relaxations`` until all temperatures were 0, without free sweeps. With the option ``array`` the statistics also
    have ``accounting``, the cost of the run on that processor array: ``array``, ``mapping``; ``layers``,
    virtual layers; ``shifts``, X-Net shifts of a word that bring every pixel of the finest level all its neighbours,
    for either mapping; ``steps``; ``passes``, SIMD steps: one for each virtual layer of a step that has an active site;
    ``active``, the mean number of active PEs per pass; ``utilisation``, its ratio to all PEs; ``sites``, relaxations;
    ``flop``, 32-bit operations in the distances; ``moved`` and ``routed``, words that each PE got through the X-Net and
    the router; ``instructions`` by kind, see `simdtex.maspar.machine`; ``model_seconds``, their time on a MasPar MP-1;
    and ``launches``, kernels enqueued on the device.

    A level of ``multires`` has the mean number of ``candidates`` of a pixel, and the largest, ``most``; ``nodes``, the
    pixels of the levels above in the sample's pyramid, and ``compared``, the mean number of nodes that a pixel was
    compared with until all its candidates were found.

    ``pyramid`` has ``iterations`` in place of ``levels``: one dict per iteration with ``iteration``, ``seconds`` and
    ``distances``: by name of the subband (and ``pixels``), the mean distance by which values were moved to match the
    histogram, in standard deviations of the sample's subband, which is the Wasserstein distance of the two histograms;
    the mean over orientations and channels.
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
    """Yield ranges (first, end) that cover first..count; the loop's body takes about 0.1 s for each.

    ``least`` is the size of the first range, and the smallest size of the others.
    """
    size = least
    while first < count:
        end, began = min(count, first + size), time.perf_counter()
        yield first, end
        first, seconds = end, max(time.perf_counter() - began, 1e-3)
        size = max(least, int(size * min(4.0, 0.1 / seconds)))
