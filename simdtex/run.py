# SPDX-License-Identifier: BSD-3-Clause
"""The progress that callbacks receive, and the additional output of a run: stages, source map and statistics."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
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
        The current level (0 is the finest, and the last) and the number of levels.
    fraction : float
        Estimated share of the work that is done, 0 to 1.
    image : callable
        ``image()`` reads back the picture of the level, (rows, cols[, channels]) in the sample's type; that of the
        previous level if the method has no picture before the end of a level.
    doing : str
        Description of the current work.
    stage : str or None
        The name of the picture that is now complete: at the end of a sweep, of a level without sweeps, or of an
        iteration. None otherwise.
    """

    level: int
    levels: int
    fraction: float
    image: Callable[[], NDArray[Any]]

    @property
    def doing(self) -> str:  # noqa: D102
        return f"level {self.level}"

    @property
    def stage(self) -> str | None:  # noqa: D102
        return None

    def picture(self) -> NDArray[Any]:
        """Return the picture of the stage, which is the image."""
        return self.image()

    def maps(self) -> dict[str, NDArray[np.float64]]:
        """Return further pictures of the stage by name: arrays (rows, cols), 0 to 1."""
        return {}


@dataclass(frozen=True, kw_only=True, repr=False)
class Relaxing(Progress):
    """The progress of the method ``mrf``, after every part of a step.

    Attributes
    ----------
    sweep : int
        The current sweep of the level, from 1.
    step : int
        The current step of the level, from 1. The sites of a step relax together.
    phase : str
        ``"relax"`` while some temperature is above 0, then ``"free"``.
    temperature_left : float
        Mean temperature of the level, 0 to 1, at the beginning of the sweep.
    end_of_sweep : bool
        Whether the sweep ends with this part.
    temperature : callable
        ``temperature()`` reads back the level's temperatures, (rows, cols), 0 to 1.
    source : callable
        ``source()`` reads back the position in the sample of each site of the level, as `Output.source`: int32,
        (rows, cols, 2) or, with several samples, (rows, cols, 3).
    explain : callable
        ``explain(row, col)``, or ``explain(layer, row, col)`` in a volume, returns a
        `simdtex.model.explanation.Explanation` of how that site of the level would relax now, with the random numbers
        of the current step. A call after the callback has returned uses the state of the run at that time. It changes
        nothing.
    """

    sweep: int
    step: int
    phase: str
    temperature_left: float
    end_of_sweep: bool
    temperature: Callable[[], NDArray[Any]]
    source: Callable[[], NDArray[np.int32]]
    explain: Callable[..., Explanation]

    @property
    def doing(self) -> str:  # noqa: D102
        return f"level {self.level}, sweep {self.sweep}, temperature {self.temperature_left:.3f}"

    @property
    def stage(self) -> str | None:  # noqa: D102
        return f"level{self.level}-sweep{self.sweep:02d}" if self.end_of_sweep else None

    def maps(self) -> dict[str, NDArray[np.float64]]:
        """Return the temperatures."""
        return {"temperature": self.temperature()}


@dataclass(frozen=True, kw_only=True, repr=False)
class Sampling(Progress):
    """The progress of the method ``multires``, after every part of a level.

    Attributes
    ----------
    end_of_level : bool
        Whether the level ends with this part.
    candidates : callable
        ``candidates()`` reads back the number of candidates that each pixel of the level was drawn from, (rows, cols)
        integers, at the end of the level.
    """

    end_of_level: bool
    candidates: Callable[[], NDArray[Any]]

    @property
    def stage(self) -> str | None:  # noqa: D102
        return f"level{self.level}" if self.end_of_level else None

    def maps(self) -> dict[str, NDArray[np.float64]]:
        """Return the number of candidates of each pixel, on a logarithmic scale from 1 to the maximum of the level."""
        counts = self.candidates()
        return {"candidates": np.log(counts) / np.log(max(2, counts.max()))}


@dataclass(frozen=True, kw_only=True, repr=False)
class Iterating(Progress):
    """The progress of the method ``pyramid``, after every channel or, for a solid, after every part of a channel.

    The level is always 0. In the picture, channels that are not yet done in this iteration are those of the previous
    one. The picture of a solid is the block, (depth, rows, cols[, channels]).

    Attributes
    ----------
    iteration, iterations : int
        The current iteration, from 1, and the number of iterations.
    end_of_iteration : bool
        Whether the iteration ends with this part.
    solid : bool
        Whether the image is a block.
    """

    iteration: int
    iterations: int
    end_of_iteration: bool
    solid: bool = False

    @property
    def doing(self) -> str:  # noqa: D102
        return f"iteration {self.iteration} of {self.iterations}"

    @property
    def stage(self) -> str | None:  # noqa: D102
        return f"iteration{self.iteration:02d}" if self.end_of_iteration else None

    def picture(self) -> NDArray[Any]:
        """Return the image, or the middle x-y slice of a block."""
        image = self.image()
        return image[len(image) // 2] if self.solid else image


@dataclass(frozen=True, kw_only=True, repr=False)
class Simulating(Progress):
    """The progress of `simdtex.simulate`, after every part of a step of a realisation, and at its end.

    Attributes
    ----------
    realisation : int
        The number of the realisation, whose picture it is.
    complete : bool
        Whether this realisation is finished.
    finished, realisations : int
        The number of finished realisations, and of all.
    """

    realisation: int
    complete: bool
    finished: int
    realisations: int

    @property
    def doing(self) -> str:  # noqa: D102
        return f"{self.finished} of {self.realisations} realisations finished"

    @property
    def stage(self) -> str | None:  # noqa: D102
        return f"realisation{self.realisation:04d}" if self.complete else None


@dataclass(frozen=True, kw_only=True, repr=False)
class Tiling(Progress):
    """The progress of `simdtex.distributed.synthesize`, after every tile.

    The image has every n-th site of the level before the turn, about 1000 on a side. Reading it is slow.

    Attributes
    ----------
    phase : str
        The current turn: ``"begin"`` a level; ``"whole"``, all sweeps of a level of one tile; ``"sweep"``; or
        ``"show"``, write the picture.
    sweep : int
        The current sweep of the level, from 1.
    tile, tiles : int
        The number of finished tiles, and of all.
    """

    phase: str
    sweep: int
    tile: int
    tiles: int

    @property
    def doing(self) -> str:  # noqa: D102
        sweep = f", sweep {self.sweep}" if self.phase == "sweep" else ""
        what = "writing the picture" if self.phase == "show" else f"level {self.level}{sweep}"
        return f"{what}, tile {self.tile} of {self.tiles}"


@dataclass(frozen=True, kw_only=True, repr=False)
class Labelling(Progress):
    """The progress of `simdtex.classify`, after every step.

    The level is always 0. The picture has the labels so far: 1 is the first class, and 0 a pixel not yet compared.

    Attributes
    ----------
    work : str
        The last work done, in words: rows compared with the classes, or a sweep of the field.
    """

    work: str

    @property
    def doing(self) -> str:  # noqa: D102
        return self.work


Callback = Callable[[Any], Any]


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
        ``fitting``, the rows and columns of an output that needs less deformation.
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
