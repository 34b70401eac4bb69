# SPDX-License-Identifier: BSD-3-Clause
"""Multiresolution sampling: the procedure of De Bonet (1997).

`analyse` (analysis.py) is the first phase; `resample` is the second, his SynthesizePyramid and CollapsePyramid level by
level. Numbers in parentheses are the paper's equations. Level 0 is the finest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from math import inf, prod
from numbers import Real
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex.checkpoints.keep import NOTHING, Keep
from simdtex.machine import Machine, memory
from simdtex.machine.interface import Array
from simdtex.methods.multires.analysis import Analysis, analyse
from simdtex.model.use import effective_use
from simdtex.ops.candidates import Sampled, Structure, candidates
from simdtex.ops.laplacian import beside, laplacian_blend, laplacian_collapse, within
from simdtex.options import build, check, integer, number_of, real, shown, unmasked, within_32_bits, words
from simdtex.run import Callback, Output, Sampling, Stage, device_seconds, paced

ANY = 2**32 - 1
"""The threshold that every difference passes."""

VALUES = 4
"""Values for each pixel of an output that kernels number: two counts, all levels together."""

LAUNCH = 4e8
"""Comparisons that the first launch of a level may take if no node fails."""

WIDEST = 100
"""The largest sigma; a filter of one far narrower does not know it from a larger one."""

DIRECTIONS, FILTER = 64, 101
"""The most orientations, and the largest filters: any more are alike, or larger than the levels they are for."""

STEPS, MOST = 100, 4
"""`suggest_alpha` tries the multiples of 1/100 up to 4 for a target."""

FREEST = 0.4
"""The largest alpha of the paper's figures, and the largest that is suggested for a strain."""

COARSENED = 6
"""Bits that strains leave out of a band, so that the sums of squares fit 64."""

STRETCHES, STRETCH = 16, 256
"""Of pixels, in each level, that `suggest_alpha` counts the candidates of."""


@dataclass(frozen=True)
class Options:
    """The options of the method ``multires``.

    Parameters
    ----------
    alpha : float or "auto"
        Of T = alpha / k**beta (13), 0 or more: 0 tiles the sample (but for parts that are equal to the bit), infinity
        samples every band on its own. ``"auto"`` takes what `simdtex.suggest_alpha` finds for ``strain`` or ``target``.
    beta : float
        Of the same, 0 or more. k counts levels from the lowest frequency upward.
    strain : float
        With ``alpha="auto"``, how much pieces that meet may differ from what either would go on with: 0, nothing, to 1,
        as much as strangers. See `simdtex.methods.multires.strain`.
    target : float, optional
        With ``alpha="auto"``, in place of the strain: candidates that a pixel of the coarser levels is to have on
        average.
    thresholds : array, optional
        T itself, in place of alpha and beta: one row for each level but the finest, the lowest frequency first; one
        column for all features or one for each.
    orientations : int
        Of the first and of the second derivatives of a Gaussian in the filter bank (7), 64 or fewer; 0 leaves the bands
        alone.
    sigma : float
        Of that Gaussian, in pixels; 0.2 to 100.
    filter_size : int
        Rows and columns of the filters; odd, 3 to 101. A level smaller than that has no responses.
    features : {"luminance", "channels"}
        Whether features are made of the luminance or of every channel. Bands are copied with all their channels.
    levels : int, optional
        Of the pyramids. None: down to a single pixel.
    parity : {"match", "free"}
        Whether a candidate must stand in an even or odd row and column as the pixel does. ``"free"`` is the paper's
        text.
    boundary : {"torus", "open"}
        Whether pyramids wrap around, or continue as in a mirror.
    edges : {"mend", "keep"}
        Whether the edges of a sample that does not wrap around are first covered with a piece of itself, so that it
        does; see `simdtex.methods.multires.mend.mend`.
    seams : {"blend", "cut"}
        Whether the bands of pieces that meet fade into each other, over a pixel of each level, or end where they meet.
        ``"cut"`` is the paper's text.
    """

    alpha: float | str = 0.3
    beta: float = number_of(0.0, 0)
    strain: float = number_of(0.05, 0)
    target: float | None = number_of(None, 1, 2**31)
    thresholds: ArrayLike | None = None
    orientations: int = integer(4, 0, DIRECTIONS)
    sigma: float = number_of(0.7, 0.2, WIDEST)
    filter_size: int = integer(3, 3, FILTER)
    features: str = words("luminance", "luminance", "channels")
    levels: int | None = integer(None, 1)
    parity: str = words("match", "match", "free")
    boundary: str = words("torus", "torus", "open")
    edges: str = words("mend", "mend", "keep")
    seams: str = words("blend", "blend", "cut")

    def __post_init__(self) -> None:
        """Check every value."""
        if isinstance(self.alpha, str):
            if self.alpha != "auto":
                raise ValueError(f"alpha is {shown(self.alpha)}; give a number of at least 0, or 'auto'")
        elif not (isinstance(self.alpha, Real) and self.alpha == inf):
            real("alpha", self.alpha, 0, inf)
        check(self)
        if self.filter_size % 2 == 0:
            raise ValueError(f"filter_size is {self.filter_size}; give an odd number, 3 or 5")
        if self.thresholds is not None:
            _check_thresholds(self.thresholds)

    @property
    def analysis(self) -> dict[str, Any]:
        """Those that bear on the analysis."""
        names = ("orientations", "sigma", "filter_size", "features", "levels", "boundary", "edges")
        return {name: vars(self)[name] for name in names}


def make_options(**given: Any) -> Options:
    """Options from what the user gave; unknown names are a TypeError that lists the valid ones."""
    return build(Options, "multires", given)


# -- thresholds -----------------------------------------------------------------------------------------------


def _alpha(machine: Machine, analysis: Analysis, options: Options) -> float | None:
    """The alpha of a run, None where a table stands in its place."""
    if options.thresholds is not None:
        return None
    return suggest_alpha(machine, analysis, options) if isinstance(options.alpha, str) else float(options.alpha)


def thresholds(levels: int, options: Options, alpha: float | None) -> NDArray[np.float64]:
    """T of every level (levels, 1 or M), the finest first: alpha / k**beta (13), or the user's table without alpha."""
    if alpha is not None:
        k = np.arange(levels, 0, -1, dtype=np.float64)[:, None]  # 1 at the top
        with np.errstate(over="ignore"):
            divisor = (k ** float(options.beta)).astype(np.float32)  # so that the last bit of a libm does not show
        return np.full_like(k, inf) if alpha == inf else float(alpha) / divisor.astype(np.float64)
    table = np.asarray(options.thresholds, np.float64)
    table = table if table.ndim == 2 else table[:, None]
    if len(table) != levels - 1:
        fewer = f", or levels={len(table) + 1}" if len(table) < levels - 1 else ""
        raise ValueError(
            f"thresholds has {len(table)} rows; give {levels - 1}, one for each level but the finest{fewer}"
        )
    return np.concatenate([np.zeros((1, table.shape[1])), table[::-1]])


def differences(analysis: Analysis, table: NDArray[np.float64]) -> NDArray[np.uint32]:
    """The largest difference of each feature (levels, M) whose square, divided by Z, is not above T, (9) to (11)."""
    if table.shape[1] not in (1, analysis.energy.shape[1]):
        raise ValueError(
            f"thresholds has {table.shape[1]} columns; give 1, or {analysis.energy.shape[1]}, one for each feature"
        )
    with np.errstate(invalid="ignore", over="ignore"):
        largest = np.sqrt(table * analysis.energy)
    return np.where(np.isinf(table), ANY, np.minimum(largest, ANY)).astype(np.uint32)


def suggest_alpha(machine: Machine, analysis: Analysis, options: Options) -> float:
    """The freest alpha at which seams do not show, or that at which pixels have `Options.target` candidates.

    Parameters
    ----------
    machine : Machine
    analysis : Analysis
    options : Options
        Of which ``strain``, ``target``, ``beta`` and ``parity`` matter, beside those of the analysis.

    Returns
    -------
    float
        Without a target, the largest multiple of 1/100 up to 0.4 at which a texture as large as the sample has no more
        than this `strain`; 0 where there is none.

        With a target, the least multiple of 1/100 at which the candidates of the sample's own pixels, averaged over
        each level of the coarser half and then over these levels, reach it; 4 where none below does.

    Notes
    -----
    Cost: six textures of the sample's size without their pictures; for a target, eight or nine scans, without draws, of
    at most 4096 pixels of each of these levels. Both bisect: candidates never fall as alpha grows, and a strain hardly.
    """
    if options.target is not None:
        return _alpha_of_target(machine, analysis, options, options.target)
    low, high = 0, 1 + round(FREEST * STEPS)
    while high - low > 1:
        middle = (low + high) // 2
        passes = strain(machine, analysis, options, middle / STEPS) <= options.strain
        low, high = (middle, high) if passes else (low, middle)
    return low / STEPS


def strain(machine: Machine, analysis: Analysis, options: Options, alpha: float) -> float:
    """How much pieces of the sample that meet in a texture differ from what each would go on with.

    Of a texture as large as the sample, for each level of the finer half and each pair of neighbours p and q, where q
    is to the right of p or below, and s says which pixel of the band L each was copied from, this is ::

        mean of |L(s(p) + q - p) - L(s(q))|**2 / (2 mean of |L|**2)

    averaged over these levels. Neighbours that are neighbours in the sample add nothing, and strangers add 1. Coarser
    levels do not count: what is smooth shows no line.

    Parameters
    ----------
    machine : Machine
    analysis : Analysis
    options : Options
        As for `suggest_alpha`.
    alpha : float
        In place of that of the options.

    Returns
    -------
    float
        0 and more. The seed is always 0, and sums are of integers, so it is the same on every device.

    Notes
    -----
    Cost: a texture as large as the sample, without its picture. Memory: as `resample` takes.
    """
    structure = _structure(machine, analysis, thresholds(analysis.levels, options, alpha))
    top, shapes = analysis.levels - 1, analysis.shapes
    sampled = _copied(machine, shapes, shapes[top])
    strains = []
    for level in reversed(range(top)):
        for first, end in paced(pixels([shapes[level]]), _first_launch(analysis, level)):
            sampled = candidates(machine, structure, sampled, level, first, end, options.parity == "match", 0)
            machine.sync()
        if level < max(1, top // 2):
            band = np.moveaxis(machine.get(analysis.bands[level]) >> COARSENED, 0, -1).astype(np.int64)
            strains.append(_strain(band, _read(machine, sampled, shapes, level)[0], analysis.torus))
    return float(np.mean(strains)) if strains else 0.0


def _strain(band: NDArray[np.int64], source: NDArray[np.int32], torus: bool) -> float:
    """Of one level: its band (rows, cols, channels) and the source of its pixels (rows, cols)."""
    squares = int((band * band).sum())
    if not squares:
        return 0.0
    place, differences = _place(source, source.shape[1]), 0
    for axis, n in enumerate(source.shape):
        near, by = beside(n, 1, torus)
        other, own = place.take(near, axis), place.copy()
        moved = own[..., axis] + by.reshape((-1, 1) if axis == 0 else -1)
        own[..., axis] = within(moved, n, torus)
        apart = band[own[..., 0], own[..., 1]] - band[other[..., 0], other[..., 1]]
        differences += int((apart * apart).sum())
    return differences / (4 * squares)  # of two directions


def _alpha_of_target(machine: Machine, analysis: Analysis, options: Options, target: float) -> float:
    """The alpha of a target, counted on the sample itself."""
    itself = _sampled(
        machine, analysis.shapes, [np.arange(pixels([shape]), dtype=np.int32) for shape in analysis.shapes]
    )
    low, high = 0, MOST * STEPS
    while high - low > 1:  # candidates only grow with alpha
        middle = (low + high) // 2
        reached = _mean_candidates(machine, analysis, itself, options, middle / STEPS) >= target
        low, high = (low, middle) if reached else (middle, high)
    return high / STEPS


def _mean_candidates(machine: Machine, analysis: Analysis, itself: Sampled, options: Options, alpha: float) -> float:
    structure = _structure(machine, analysis, thresholds(analysis.levels, options, alpha))
    means = []
    for level in range((analysis.levels - 1) // 2, analysis.levels - 1):
        begin, n = pixels(analysis.shapes[:level]), pixels(analysis.shapes[level : level + 1])
        few = n <= STRETCHES * STRETCH
        counts = []
        for first in [0] if few else [i * n // STRETCHES for i in range(STRETCHES)]:
            end = n if few else first + STRETCH
            candidates(machine, structure, itself, level, first, end, options.parity == "match", 0, draw=False)
            counts.append(machine.get(itself.counts[begin + first : begin + end])[:, 0])
        means.append(float(np.concatenate(counts).mean()))
    return float(np.mean(means)) if means else inf


# -- the second phase: synthesis ------------------------------------------------------------------------------


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
    alpha = _alpha(machine, analysis, options) if kept is None else kept["alpha"]
    structure = _structure(machine, analysis, thresholds(analysis.levels, options, alpha))
    record = _Record(shapes, callback, kept and kept["seconds"])

    top = analysis.levels - 1
    sampled = _copied(machine, shapes, analysis.shapes[top]) if kept is None else _restored(machine, shapes, kept)
    picture = None
    for level in reversed(range(analysis.levels)):  # Loop i from top level downto 0
        if level < top:
            done = _done(kept, level, shapes)
            for first, end in paced(pixels([shapes[level]]), _first_launch(analysis, level), done):  # Loop x', y'
                match = options.parity == "match"
                sampled = candidates(machine, structure, sampled, level, first, end, match, seed)  # (9) to (12)
                machine.sync()
                record.tell(level, end)
                keep.offer(partial(_kept, machine, sampled, shapes, level, end, alpha, record))
        source, counts = _read(machine, sampled, shapes, level)
        picture = _collapsed(machine, analysis, level, source, picture, options.seams == "blend")  # CollapsePyramid
        image = analysis.sample.picture(machine.get(picture), source if level == 0 else None)
        given = analysis.place.ravel()[source].astype(np.int32) if level == 0 else source
        place, nodes = _place(given, analysis.shapes[level][1]), pixels(analysis.shapes[level + 1 :])
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
    return Sampled(machine.put(source), machine.put(counts), machine.put(_lattice(shapes, 0)))


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


def pixels(shapes: Sequence[tuple[int, int]]) -> int:
    """Of some levels together."""
    return sum(rows * cols for rows, cols in shapes)


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


def _first_launch(analysis: Analysis, level: int) -> int:
    """Pixels of a level in its first launch."""
    return 1 + int(LAUNCH / (pixels(analysis.shapes[level + 1 :]) * analysis.features.shape[1]))


def _lattice(shapes: Sequence[tuple[int, int]], first: int) -> NDArray[np.int32]:
    """Lattices as of `Structure` and `Sampled`, where levels stand one after another, from one of them on."""
    begins = np.cumsum([0, *(rows * cols * (level >= first) for level, (rows, cols) in enumerate(shapes))])
    ragged = [sum((n % 2**level > 0) << axis for axis, n in enumerate(shapes[0])) for level in range(len(shapes))]
    return np.array([(*shape, *rest) for shape, *rest in zip(shapes, begins, ragged, strict=False)], np.int32)


def _structure(machine: Machine, analysis: Analysis, table: NDArray[np.float64]) -> Structure:
    most, lattice = machine.put(differences(analysis, table)), machine.put(_lattice(analysis.shapes, 1))
    return Structure(analysis.features, most, lattice)


def _sampled(machine: Machine, shapes: Sequence[tuple[int, int]], source: Sequence[NDArray[np.int32]]) -> Sampled:
    together = np.concatenate(source)
    counts = np.zeros((together.size, 2), np.int32)
    counts[-pixels(shapes[-1:]) :, 0] = 1  # of the top; the others are to be counted
    return Sampled(machine.put(together), machine.put(counts), machine.put(_lattice(shapes, 0)))


def _copied(machine: Machine, shapes: Sequence[tuple[int, int]], own: tuple[int, int]) -> Sampled:
    """The top level, copied and repeated to fill; nothing yet below it."""
    row, col = np.indices(shapes[-1], np.int32)
    source = row % np.int32(own[0]) * np.int32(own[1]) + col % np.int32(own[1])
    return _sampled(machine, shapes, [np.zeros(pixels(shapes[:-1]), np.int32), source.ravel()])


def _read(
    machine: Machine, sampled: Sampled, shapes: Sequence[tuple[int, int]], level: int
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """A level's source (rows, cols) and counts (rows, cols, 2)."""
    begin, end = pixels(shapes[:level]), pixels(shapes[: level + 1])
    source, counts = machine.get(sampled.source[begin:end]), machine.get(sampled.counts[begin:end])
    return source.reshape(shapes[level]), counts.reshape(*shapes[level], 2)


def _place(source: NDArray[np.int32], cols: int) -> NDArray[np.int32]:
    """(row, column) of pixels on a last axis."""
    place = np.empty((*source.shape, 2), np.int32)
    place[..., 0] = row = source // np.int32(cols)
    place[..., 1] = source - row * np.int32(cols)  # quicker than divmod
    return place


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


def _check_thresholds(table: ArrayLike) -> None:
    unmasked("thresholds", table)
    try:
        values = np.asarray(table)
    except ValueError:
        raise ValueError("thresholds is ragged; give rows of equal length") from None
    if values.dtype.kind not in "iuf":
        raise TypeError(f"thresholds must be an array of numbers, not of {values.dtype}")
    if values.ndim not in (1, 2) or not values.size:
        raise ValueError(f"thresholds has shape {values.shape}; give one row for each level but the finest")
    if not (values >= 0).all():
        raise ValueError("thresholds must be numbers of at least 0")


def _on_host(shape: tuple[int, int], channels: int, itemsize: int) -> int:
    """Bytes on the host of an output with its stages."""
    return prod(shape) * (66 + channels * (4 + itemsize))


def _held(analysis: Analysis) -> int:
    """Bytes of an analysis on the device."""
    return 4 * (pixels(analysis.shapes) * len(analysis.sample.planes) + int(prod(analysis.features.shape)))
