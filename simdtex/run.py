# SPDX-License-Identifier: BSD-3-Clause
"""Progress of a run for callbacks, and the rest of its output: stages, source map and statistics."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.model.explanation import Explanation


@dataclass(frozen=True, kw_only=True)
class Progress:
    """The progress of a run; a callback receives it several times a second.

    Attributes
    ----------
    level, levels : int
        The current level (0 is the finest, and the last) and the number of levels.
    fraction : float
        Estimated share of the work that is done, 0 to 1.
    image : callable
        ``image()`` reads back a picture, (rows, cols[, channels]) in the sample's type: that of the level, or of the
        level before if this one has none before its end.
    doing : str
        Description of the current work.
    stage : str or None
        The name of the picture that is complete now: the end of a sweep, of a level that has none, or of an iteration.
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
        """Return the picture of the stage: the image."""
        return self.image()

    def maps(self) -> dict[str, NDArray[np.float64]]:
        """Return further pictures of the stage: arrays (rows, cols), 0 to 1, by name."""
        return {}


@dataclass(frozen=True, kw_only=True)
class Relaxing(Progress):
    """The progress of the method ``mrf``, after every part of a step.

    Attributes
    ----------
    sweep : int
        The present sweep of the level, from 1.
    step : int
        The present step of the level, from 1: sites that relax together.
    phase : str
        ``"relax"`` while some temperature is above 0, then ``"free"``.
    temperature_left : float
        Mean temperature of the level, 0 to 1, at the beginning of the sweep.
    end_of_sweep : bool
        Whether the sweep ends with this piece.
    temperature : callable
        ``temperature()`` reads back the level's temperatures, (rows, cols), 0 to 1.
    source : callable
        ``source()`` reads back where in the sample each site of the level is from, (rows, cols, 2) or, of several
        samples, (rows, cols, 3) int32, as `Output.source`.
    explain : callable
        ``explain(row, col)``, of a volume ``explain(layer, row, col)``, returns a
        `simdtex.model.explanation.Explanation`: how that site of the level would relax now, with the random numbers of
        the present step. Called after the callback has returned, it uses the state that the run has then. It changes
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


@dataclass(frozen=True, kw_only=True)
class Sampling(Progress):
    """The progress of the method ``multires``, after every part of a level.

    Attributes
    ----------
    end_of_level : bool
        Whether the level ends with this piece.
    candidates : callable
        ``candidates()`` reads back among how many candidates each pixel of the level was drawn, (rows, cols) whole
        numbers, at the level's end.
    """

    end_of_level: bool
    candidates: Callable[[], NDArray[Any]]

    @property
    def stage(self) -> str | None:  # noqa: D102
        return f"level{self.level}" if self.end_of_level else None

    def maps(self) -> dict[str, NDArray[np.float64]]:
        """Return the candidates, on a logarithmic scale from 1 to the most that a pixel of the level has."""
        counts = self.candidates()
        return {"candidates": np.log(counts) / np.log(max(2, counts.max()))}


@dataclass(frozen=True, kw_only=True)
class Iterating(Progress):
    """The progress of the method ``pyramid``, after every channel's turn; of a solid, after every part of it.

    All is at level 0. The picture has the channels that have had their turn as of this iteration, the others as of the
    one before; of a solid it is the block, (depth, rows, cols[, channels]).

    Attributes
    ----------
    iteration, iterations : int
        The present one, from 1, and their number.
    end_of_iteration : bool
        Whether the iteration ends here.
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
        """Return the image; of a block the middle x-y slice."""
        image = self.image()
        return image[len(image) // 2] if self.solid else image


@dataclass(frozen=True, kw_only=True)
class Simulating(Progress):
    """The progress of `simdtex.simulate`, after every realisation.

    All is at level 0; the picture is the realisation.

    Attributes
    ----------
    realisation : int
        Its number.
    finished, realisations : int
        How many are finished, and how many are asked for.
    """

    realisation: int
    finished: int
    realisations: int

    @property
    def doing(self) -> str:  # noqa: D102
        return f"realisation {self.finished} of {self.realisations}"

    @property
    def stage(self) -> str | None:  # noqa: D102
        return f"realisation{self.realisation:04d}"


@dataclass(frozen=True, kw_only=True)
class Tiling(Progress):
    """The progress of `simdtex.distributed.synthesize`, after every tile.

    The image is every n-th site of the level as it was before the turn, about 1000 to the side: reading it takes long.

    Attributes
    ----------
    phase : str
        What is being done to every tile: ``"begin"`` a level; ``"whole"``, all of a level that is one tile;
        ``"sweep"``; or ``"show"``, write the picture.
    sweep : int
        The present sweep of the level, from 1.
    tile, tiles : int
        How many are done, and how many there are.
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


@dataclass(frozen=True, kw_only=True)
class Labelling(Progress):
    """The progress of `simdtex.classify`, after every step.

    All is at level 0; the picture has the labels so far, 1 the first class; 0 where nothing was compared yet.

    Attributes
    ----------
    work : str
        What was done last: rows compared with the classes, or a sweep of the field.
    """

    work: str

    @property
    def doing(self) -> str:  # noqa: D102
        return self.work


Callback = Callable[[Any], Any]


@dataclass(frozen=True)
class Stage:
    """A level at its end.

    Attributes
    ----------
    level : int
        0 is the finest.
    image : (rows, cols[, channels]) array
        In the sample's type.
    source : (rows, cols, 2) int32 array or None
        ``multires``: for every pixel of the level, the (row, column) of the sample's level that it was copied from; on
        the levels above the finest, of the sample with its edges mended.
    candidates : (rows, cols) int32 array or None
        ``multires``: among how many candidates each pixel was drawn.
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
        For every output pixel the (row, column) of its source pixel in the sample; with ``multires``, of the source of
        its highest frequencies. With ``mrf`` and a finish, pixels near seams are means of that pixel and of the pixels
        that continue their neighbours' sources. None with ``pyramid``, which takes no pixel from the sample.
    temperature : (rows, cols) float64 array or None
        ``mrf``: the remaining pixel temperatures, 0 to 1.
    stages : list of Stage
        Each level's picture at its end, the coarsest first; of ``mrf`` without the finish. None with ``pyramid``; its
        callback sees every iteration.
    statistics : dict
        ``device``, ``seed``, ``options``, ``seconds``, ``device_seconds`` (of kernels; None unless the machine was
        opened with ``profile=True``; then there are ``kernels`` too, as of `simdtex.machine.log.Log.take`), and
        ``levels``: one dict per level with ``level``, ``rows``, ``cols``, ``candidates``, ``seconds``, and what is
        particular to the method. If there is a source map, ``use`` says how
        evenly the sample is used, as in `simdtex.model.use.effective_use`: ``effective_share``, above 0, to 1, and
        ``most_used``, the piece of the sample of which most is taken: ``times_fair_share``, its first pixel
        (``row``, ``col``) and its size (``rows``, ``cols``), pixels. ``lattice`` of ``mrf`` is None unless the sample
        repeats: the two ``vectors`` of the output's lattice, (row, column) in pixels, the ``deformation`` that fits the
        sample's to the output, 0 if it is none, and ``fitting``, the rows and columns of an output that needs less.
    fit : (rows, cols, classes) float32 array or None
        `simdtex.classify`: the probability that a texture of each class differs from its samples as much as the picture
        does around each pixel, within its segment.
    probability : (rows, cols, classes) float32 array or None
        `simdtex.classify`: of each class by the field of labels, given the labels around; the sum is 1.
    made : (rows, cols, channels) or (depth, rows, cols, channels) array or None
        The result, channels last whatever axes the sample has; notebooks show it.

    Notes
    -----
    A level of ``mrf`` has ``sweeps``, ``steps``, ``relaxations``, ``fma`` (of equation (12)), ``skipped`` (those of
    them that a bound made needless; docs/concepts/search.rst), and ``equilibrium``: the ``sweeps``, ``steps`` and
    ``relaxations`` until no temperature was left, free sweeps not counted. Its statistics also have ``accounting`` if
    the option ``array`` is given, what the run costs on that processor array: ``array``, ``mapping``; ``layers``,
    virtual layers; ``shifts``, X-Net shifts of a word that bring every pixel of the finest level all its neighbours,
    for either mapping; ``steps``; ``passes``, SIMD steps: one for each virtual layer of a step that has an active site;
    ``active``, the mean number of active PEs per pass; ``utilisation``, that over all PEs; ``sites``, relaxations;
    ``moved``, words that each PE shifted; ``flop``, 32-bit operations in the distances; ``model_seconds``, the time of
    a MasPar MP-1 by the model of `simdtex.maspar.accounting.Account`; and ``launches``, kernels enqueued on the device.

    A level of ``multires`` has the mean number of ``candidates`` of a pixel and ``most`` of them; ``nodes``, pixels of
    the levels above in the sample's pyramid, and ``compared``, the mean number of them that a pixel was compared with
    until all its candidates were found.

    ``pyramid`` has ``iterations`` in place of ``levels``: one dict per iteration with ``iteration``, ``seconds`` and
    ``distances``: by name of the subband (and ``pixels``), how far the values were moved on average to match the
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
        """Return a line on the contents; arrays and figures would fill pages."""
        rows_cols = "x".join(map(str, self.made.shape[:-1])) if self.made is not None else ""
        has = [name for name in ("source", "temperature") if getattr(self, name) is not None]
        has += [f"{len(self.stages)} stages"] if self.stages else []
        has += [f"{name} {self.statistics[name]}" for name in ("seed", "device") if name in self.statistics]
        has += [f"{self.statistics['seconds']:.2f} s"] if "seconds" in self.statistics else []
        return f"Output({', '.join([rows_cols] * bool(rows_cols) + has)})"

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the picture and its arrangement."""
        from simdtex.model.display import as_html

        return as_html(self.made, self.source, self.statistics)


def paced(count: int, least: int, first: int = 0) -> Iterator[tuple[int, int]]:
    """Yield ranges (first, end) of first..count, for each of which the loop's body takes about a tenth of a second.

    `least` is the size of the first, and of the smallest.
    """
    size = least
    while first < count:
        end, began = min(count, first + size), time.perf_counter()
        yield first, end
        first, seconds = end, max(time.perf_counter() - began, 1e-3)
        size = max(least, int(size * min(4.0, 0.1 / seconds)))
