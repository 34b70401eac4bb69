# SPDX-License-Identifier: BSD-3-Clause
"""The lattice on which a regular texture repeats, and the phases on it that guide an output.

A near-regular texture (Liu, Collins and Tsin 2004) looks alike at all points of a lattice. Every pixel of the sample
and of the output has two phases on that lattice; their cosines and sines are a guide, so that a candidate comes from
the same place within a cell. The lattice is computed from integers, and the guide's levels are rounded.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from math import sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.model.lattice import Grid
from simdtex.model.pictures import Pictures
from simdtex.model.scale import principal, stretch
from simdtex.options import shown

LEAST_SIDE = 32
"""The fewest rows and columns of a picture whose lattice is searched."""

SEEN = 0.55
"""The largest lag of the autocorrelation, as a share of the rows and of the columns."""

LEAST_PEAK, APART, MOST_PEAKS = 0.08, 4, 80
"""Peaks of the autocorrelation: the least height, the least distance from lag 0 in pixels, and the most peaks used."""

LEAST_CELL, MOST_BASES = 30, 48
"""The fewest pixels of a cell, and the most lattices that are followed through the autocorrelation."""

RISE, INSIDE = (0.08, 0.08, 0.05), (0.35, 0.5, 0.65)
"""The least rise of the autocorrelation to the ends of the three shortest vectors from these shares of each: excludes
stripes."""

CONTRAST, OF_GREATEST = 0.1, 0.5
"""The least rise of the mean autocorrelation from between the nodes of a lattice to the nodes, and as a share of the
greatest rise of all lattices: excludes lattices on the ridges of stripes and joints."""

ALIKE = 0.8
"""Share of the greatest height of peaks that those of a lattice need."""

ENOUGH, SMALLER = 0.87, 0.6
"""Share of the greatest strength that a lattice with a smaller cell needs, and the most of the cell that it may have: a
skewed lattice with nearly the same cell is no better."""

STRIPES = 0.8
"""The least mean autocorrelation over the nodes of a lattice of stripes, whose period along the stripes is any."""

LEAST_STRENGTH, SIGNIFICANT = 0.15, 5.0
"""The least mean autocorrelation over the nodes of a lattice, and the same in standard errors for a square cell.

That of a long cell is greater by the root of its sides' ratio: stripes that fork are regular across some periods."""

MOST_STRAIN = 0.15
"""The largest deformation of a lattice to fit a torus."""

NOTICED = 0.01
"""Deformation above which a message names a size that fits better."""

HARMONICS = ((0, 1), (1, 0), (1, 1), (1, -1))
"""Waves of a lattice by which the phases of two pictures are compared."""

STEPS = 64
"""Number of phases tried in a period."""

WAVES = 4
"""Channels of the guide: cosine and sine of each of two phases."""

ROUND, FINE = 2.0**20, 2.0**16
"""Cosines are rounded to 1 / ROUND, vectors to 1 / FINE of a pixel: libraries differ in their last bits by less."""

CACHED_ROWS = 32
"""Number of rows whose cosines are computed together, so that they stay in the processor's cache."""

SMALLEST = 4
"""The fewest pixels of a cell that the user gives."""

LATTICES = ("auto", "none")
"""The names of the option ``lattice``."""


class Lattice(NamedTuple):
    """A lattice of the plane: the points ``origin`` + i ``first`` + j ``second``, (row, column) in pixels."""

    first: tuple[float, float]
    second: tuple[float, float]
    origin: tuple[float, float] = (0.0, 0.0)

    @property
    def basis(self) -> NDArray[np.float64]:
        """The vectors of the lattice as the rows of a matrix (2, 2)."""
        return np.array([self.first, self.second])

    @property
    def cell(self) -> float:
        """Number of pixels of a cell."""
        return abs(self.first[0] * self.second[1] - self.first[1] * self.second[0])

    def phases(self, row: NDArray[Any], col: NDArray[Any]) -> NDArray[np.float64]:
        """Return both coordinates of pixels on the lattice, (2, ...), which are integers at its points."""
        (a, b), (c, d) = self.first, self.second
        y, x, area = row - self.origin[0], col - self.origin[1], a * d - b * c
        return np.stack([(y * d - x * c) / area, (x * a - y * b) / area])

    def moved(self, phases: NDArray[np.float64]) -> Lattice:
        """Return the lattice with its origin moved by (2,) phases."""
        (i, j), (top, left) = phases.tolist(), self.origin
        (a, b), (c, d) = self.first, self.second
        return self._replace(origin=(top + i * a + j * c, left + i * b + j * d))

    def halved(self) -> Lattice:
        """Return the lattice of a picture of half the size."""
        return Lattice(*((y / 2, x / 2) for y, x in self))

    def fitted(self, shape: tuple[int, int]) -> Lattice | None:
        """Return the lattice deformed so that a torus of ``shape`` pixels holds it; None beyond `MOST_STRAIN`."""
        size, basis = np.diag(shape).astype(np.float64), self.basis
        exact = size @ _inverse(basis)
        closest, least = None, MOST_STRAIN
        for more in product((-1, 0, 1), repeat=4):
            count = np.rint(exact) + np.array(more, np.float64).reshape(2, 2)
            if not round(float(_determinant(count))):
                continue
            deformed = _inverse(count) @ size
            if (strain := self.deformation(deformed)) < least:
                closest, least = deformed, strain
        return None if closest is None else _lattice(closest)._replace(origin=self.origin)

    def deformation(self, basis: NDArray[np.float64]) -> float:
        """Return the deformation to another basis (2, 2) of the same nodes: the norm of the strain of the plane."""
        return sqrt(float(((_inverse(self.basis) @ basis - np.eye(2)) ** 2).sum()))

    def fitting(self, shape: tuple[int, int]) -> tuple[int, int]:
        """Return rows and columns near ``shape`` of a torus that holds the lattice almost undeformed."""
        best = []
        for axis, wanted in enumerate(shape):
            sizes = np.arange(max(1, wanted - wanted // 4), wanted + wanted // 4 + 1)
            nodes = (sizes[:, None] * np.eye(2)[axis]) @ _inverse(self.basis)
            missed = np.sqrt((((np.rint(nodes) - nodes) @ self.basis) ** 2).sum(1))
            cost = missed / sizes + 0.05 * abs(sizes - wanted) / wanted  # 1 % deformed is as bad as 20 % larger
            best.append(int(sizes[np.argmin(np.where((np.rint(nodes) == 0).all(1), np.inf, cost))]))
        return best[0], best[1]


class Phases(NamedTuple):
    """The phases of the sample's pictures and of the output as a guide, by the lattices of these."""

    pictures: tuple[Lattice, ...]
    output: Lattice
    weight: float = 1.0  # the variance of the guide in units of the sample's

    def halved(self) -> Phases:
        """Return the phases of pictures and an output of half the size."""
        return Phases(tuple(lattice.halved() for lattice in self.pictures), self.output.halved(), self.weight)

    def waves(self, spread: float, top: int) -> Waves:
        """Return the guide in working levels 0..top; ``spread`` is the variance of the pixels, summed over channels."""
        # each of the cosines has the variance 1/2
        return Waves(*self, min(sqrt(2 * self.weight * spread / WAVES), top / 2))

    def statistics(self, shape: tuple[int, int]) -> dict[str, Any]:
        """Return the vectors of the output's lattice, the deformation to it, and a size that fits better or None."""
        sample = self.pictures[0]
        fitting = sample.fitting(shape)
        vectors = [list(self.output.first), list(self.output.second)]
        deformation = sample.deformation(self.output.basis)
        return {"vectors": vectors, "deformation": deformation, "fitting": None if fitting == shape else list(fitting)}


class Waves(NamedTuple):
    """The working levels of `Phases`: each wave is ``height`` (1 + cosine), rounded."""

    pictures: tuple[Lattice, ...]
    output: Lattice
    weight: float
    height: float

    def sample(self, picture: int, row: NDArray[Any], col: NDArray[Any]) -> NDArray[np.uint16]:
        """Return the guide (4, ...) at pixels of one of the sample's pictures."""
        return self._levels(self.pictures[picture], row, col)

    def at(self, grid: Grid) -> NDArray[np.uint16]:
        """Return the guide (4, rows, cols) of the output at the sites of a lattice or a window of it."""
        row, col = (line * grid.step for line in grid.lines())
        levels = np.empty((WAVES, grid.rows, grid.cols), np.uint16)
        for first in range(0, grid.rows, CACHED_ROWS):
            some = slice(first, first + CACHED_ROWS)
            levels[:, some] = self._levels(self.output, row[some, None], col[None, :])
        return levels

    @property
    def divisions(self) -> tuple[int, int]:
        """The numbers of phases along the vectors of the lattice: each is a pixel wide, and all fit in 16 bits."""
        return tuple(min(255, max(1, round(sqrt(y * y + x * x)))) for y, x in self.output[:2])  # type: ignore[return-value]

    def phase(self, picture: int, row: NDArray[Any], col: NDArray[Any]) -> NDArray[np.int32]:
        """Return the numbers of the phases of pixels of one of the sample's pictures."""
        return self._phase(self.pictures[picture], row, col)

    def phase_at(self, grid: Grid) -> NDArray[np.int32]:
        """Return the numbers (rows, cols) of the phases of the sites of a lattice or a window of it."""
        row, col = (line * grid.step for line in grid.lines())
        return self._phase(self.output, row[:, None], col[None, :])

    def _phase(self, lattice: Lattice, row: NDArray[Any], col: NDArray[Any]) -> NDArray[np.int32]:
        parts = np.array(self.divisions).reshape(2, *[1] * np.broadcast(row, col).ndim)
        along, across = np.floor(lattice.phases(row, col) * parts).astype(np.int64) % parts
        phase: NDArray[np.int32] = (along * self.divisions[1] + across).astype(np.int32)
        return phase

    def half(self, step: int) -> float:
        """Return the squared difference, in levels, of pixels half a step apart: the mean along rows and columns."""
        turns = self.output._replace(origin=(0.0, 0.0)).phases(*(np.eye(2) * step / 2))
        return float(np.rint((1 - np.cos(2 * np.pi * turns)).sum() * ROUND) / ROUND) * self.height**2

    def _levels(self, lattice: Lattice, row: NDArray[Any], col: NDArray[Any]) -> NDArray[np.uint16]:
        angles = 2 * np.pi * lattice.phases(row, col)
        waves = np.stack([wave(angle) for angle in angles for wave in (np.cos, np.sin)])
        levels: NDArray[np.uint16] = np.rint((1 + np.rint(waves * ROUND) / ROUND) * self.height).astype(np.uint16)
        return levels


def parse_lattice(value: Any) -> Lattice | str | None:
    """Return the lattice given by two vectors or by a text of four numbers, ``"auto"``, or None for ``"none"``."""
    if isinstance(value, str) and value in LATTICES:
        return None if value == "none" else value
    remedy = 'give "auto", "none", or two vectors in pixels: ((dy, dx), (dy, dx)), or the text "DY,DX,DY,DX"'
    parts: list[Any] = value.split(",") if isinstance(value, str) else []
    if isinstance(value, (tuple, list)):
        parts = [component for part in value for component in (part if isinstance(part, (tuple, list)) else (part,))]
    elif not isinstance(value, str):
        raise TypeError(f"lattice must be a text or two vectors, not {shown(value)}; {remedy}")
    try:
        a, b, c, d = (float(part) for part in parts)
    except (TypeError, ValueError):
        raise ValueError(f"lattice is {shown(value)}; {remedy}") from None
    lattice = Lattice((a, b), (c, d))
    if not (np.isfinite([a, b, c, d]).all() and lattice.cell >= SMALLEST):
        raise ValueError(f"the cell of the lattice {shown(value)} has {lattice.cell:g} pixels; give {SMALLEST} or more")
    return lattice


def phases(
    pictures: Pictures,
    shape: tuple[int, int],
    torus: bool,
    lattice: str | Lattice,
    known: tuple[NDArray[Any], NDArray[np.bool_], NDArray[np.int32] | None] | None = None,
) -> Phases | None:
    """Return the phases that guide an output; None if the sample has no lattice, or ``"auto"`` finds none that fits.

    ``lattice`` is that of the largest picture, or ``"auto"``. ``known`` are values (H, W, C) of the output, their mask
    (H, W), and their positions in the sample (H, W, 2 or 3), -1 or None from elsewhere, which fix the output's phases.
    """
    planes, masks = plain(pictures)
    largest = max(range(len(planes)), key=lambda picture: (planes[picture].size, -picture))
    base = regular(planes[largest], masks[largest]) if isinstance(lattice, str) else lattice
    if base is None:
        return None
    reference = harmonics(planes[largest], masks[largest], base)
    lattices = [
        base if picture == largest else aligned(base, reference, harmonics(plane, mask, base))
        for picture, (plane, mask) in enumerate(zip(planes, masks, strict=True))
    ]
    output = base.fitted(shape) if torus else base
    if output is None and not isinstance(lattice, str):
        rows, cols = base.fitting(shape)
        raise ValueError(
            f"the lattice fits a torus of {shape[0]}x{shape[1]} (rows x columns) only if deformed by more than "
            f'{MOST_STRAIN:.0%}; give the shape {rows}x{cols}, or boundary="open"'
        )
    if output is None:
        return None
    if known is not None:
        values, where, place = known
        from_sample = None if place is None else where & (place[..., 0] >= 0)
        if place is not None and from_sample is not None and from_sample.any():
            output = _continued(output, lattices, place, from_sample)
        else:
            theirs, _ = plain(Pictures((values,), weights=pictures.weights), like=pictures)
            output = aligned(output, reference, harmonics(theirs[0], where, output))
    return Phases(tuple(lattices), output)


def lattice_sentence(lattice: dict[str, Any] | None) -> str:
    """Return a sentence on the deformation of a regular sample and any size that fits better; "" up to 1 %."""
    if not lattice or lattice["deformation"] <= NOTICED:
        return ""
    better = "; {1}x{0} pixels fit it better".format(*lattice["fitting"]) if lattice["fitting"] else ""
    return f"The sample's pattern is deformed by {lattice['deformation']:.0%} to fit this size{better}."


def plain(pictures: Pictures, like: Pictures | None = None) -> tuple[list[NDArray[np.int64]], list[NDArray[np.bool_]]]:
    """Return the first principal component of pictures, scaled as ``like`` to 0..255, and masks of known pixels."""
    scale = like or pictures
    variables = [[p[..., v] for p in scale.pixels] for v in range(scale.pixels[0].shape[-1])]
    ends = [(min(p.min() for p in those), max(p.max() for p in those)) for those in variables]
    if not scale.weights:
        ends = [(min(low for low, _ in ends), max(high for _, high in ends))] * len(ends)

    def levels(picture: NDArray[Any]) -> NDArray[np.int64]:
        return np.stack([stretch(np.clip(picture[..., v], *end), 255, end)[0] for v, end in enumerate(ends)])

    theirs = [levels(p) for p in scale.pixels]
    by = principal(theirs)
    total = max(1, int(np.abs(by).sum()))
    planes = theirs if like is None else [levels(p) for p in pictures.pixels]
    masks = list(pictures.known or [np.ones(p.shape[:2], bool) for p in pictures.pixels])
    return [np.tensordot(by, plane, 1) // total for plane in planes], masks


def regular(picture: NDArray[np.int64], known: NDArray[np.bool_]) -> Lattice | None:
    """Return the lattice of a picture (rows, cols) of integers with the greatest mean autocorrelation, or None."""
    if min(picture.shape) < LEAST_SIDE or not known.any():
        return None
    correlation = autocorrelation(picture, known)
    lattices = followed(correlation, candidates(correlation))
    lattices = [fit for fit in lattices if fit.strength >= max(LEAST_STRENGTH, SIGNIFICANT * fit.error * fit.length)]
    least = max([CONTRAST, *(OF_GREATEST * each.contrast for each in lattices)])
    best = _best([each for each in lattices if each.contrast >= least])
    if best is None:
        best = _best(followed(correlation, candidates(correlation, sides=2)))
        if best is None or best.strength < STRIPES:
            return None
    return best.lattice


class Followed(NamedTuple):
    """A lattice that was followed through the autocorrelation."""

    lattice: Lattice
    strength: float  # the mean autocorrelation over all nodes but the origin
    error: float  # its standard error
    contrast: float  # the rise to it from the points between the nodes

    @property
    def length(self) -> float:
        """The root of the ratio of the longer vector to the shorter one."""
        lengths = [sqrt(y * y + x * x) for y, x in self.lattice[:2]]
        return sqrt(max(lengths) / min(lengths))


def _best(lattices: list[Followed]) -> Followed | None:
    """Return the strongest lattice, or a much smaller one that is nearly as strong."""
    best = max(lattices, key=_by_strength, default=None)
    limit = ENOUGH * best.strength if best else 0
    while best:
        smaller = [o for o in lattices if o.strength >= limit and o.lattice.cell <= SMALLER * best.lattice.cell]
        if not smaller:
            break
        best = max(smaller, key=_by_strength)
    return best


def _by_strength(candidate: Followed) -> tuple[float, float]:
    """Return the order of lattices: by strength, and of equals the one with the smaller cell."""
    return round(candidate.strength, 6), -round(candidate.lattice.cell, 6)


class Correlation(NamedTuple):
    """The autocorrelation of a picture."""

    values: NDArray[np.float64]  # (2 m + 1, 2 n + 1), with the lag (0, 0) in the middle
    around: NDArray[np.float64]  # the greatest of 3x3 lags
    length: NDArray[np.int64]  # the squared length of each lag
    pixels: int  # known ones

    @property
    def reach(self) -> tuple[int, int]:
        """The largest lags, m and n."""
        return self.values.shape[0] // 2, self.values.shape[1] // 2


def autocorrelation(picture: NDArray[np.int64], known: NDArray[np.bool_]) -> Correlation:
    """Return the autocorrelation of the known pixels of a picture (rows, cols), normalised by the overlap at each lag.

    The sums are integers below 2**50, and the error of the Fourier transform is far below one half, so the rounded sums
    are exact on every machine.
    """
    pixels = int(known.sum())
    mean = round(int(picture[known].sum()) / pixels)
    centred = np.where(known, picture - mean, 0)
    reach = tuple(int(SEEN * n) for n in picture.shape)
    size = tuple(n + m for n, m in zip(picture.shape, reach, strict=True))

    def sums(plane: NDArray[Any]) -> NDArray[np.float64]:
        power = np.abs(np.fft.rfft2(plane.astype(np.float64), size)) ** 2
        whole = np.rint(np.fft.irfft2(power, size))
        return np.roll(whole, reach, (0, 1))[: 2 * reach[0] + 1, : 2 * reach[1] + 1]

    products, overlap = sums(centred), sums(known)
    variance = products[reach] / overlap[reach]
    values = np.where(overlap > 0.2 * pixels, products / np.maximum(overlap, 1) / (variance or 1), 0.0)
    y, x = (np.arange(-n, n + 1) for n in reach)
    return Correlation(values, _greatest(values, 1), y[:, None] ** 2 + x**2, pixels)


def _greatest(values: NDArray[np.float64], radius: int) -> NDArray[np.float64]:
    """Return the greatest value in a square of ``radius`` around each value."""
    for axis in (0, 1):
        padded = np.pad(values, [(radius, radius) if a == axis else (0, 0) for a in (0, 1)], constant_values=-np.inf)
        n = values.shape[axis]
        values = np.maximum.reduce([np.take(padded, np.arange(k, k + n), axis) for k in range(2 * radius + 1)])
    return values


def candidates(correlation: Correlation, sides: int = 3) -> NDArray[np.int64]:
    """Return the reduced bases (n, 2, 2) of pairs of peaks, each once, if the values rise along ``sides`` vectors."""
    values, (m, n) = correlation.values, correlation.reach
    peak = (values == _greatest(values, 2)) & (values > LEAST_PEAK)
    peak[:2] = peak[-2:] = peak[:, :2] = peak[:, -2:] = False  # cut by the border
    y, x = np.nonzero(peak)
    height, y, x = values[peak], y - m, x - n
    use = ((y > 0) | ((y == 0) & (x > 0))) & (y * y + x * x >= APART**2)
    order = np.lexsort((x[use], y[use], -height[use]))[:MOST_PEAKS]
    vectors = np.stack([y[use], x[use]], 1)[order]
    first, other = np.triu_indices(len(vectors), 1)
    pairs = reduced(np.stack([vectors[first], vectors[other]], 1))
    if not len(pairs):
        return pairs
    reach = np.array([m, n])
    cell = np.abs(_determinant(pairs))
    inside = (np.abs(pairs) <= reach).all((1, 2)) & (cell >= LEAST_CELL)
    pairs, cell = pairs[inside], cell[inside]
    vectors = shortest(pairs)

    def at(plane: NDArray[np.float64], lags: NDArray[Any]) -> NDArray[np.float64]:
        lags = np.clip(np.rint(lags).astype(int), -reach, reach) + reach
        values: NDArray[np.float64] = plane[lags[..., 0], lags[..., 1]]
        return values

    ends = at(correlation.around, vectors)
    near = ends[:, :2].mean(1)
    rise = ends - np.maximum.reduce([at(values, vectors * part) for part in INSIDE])
    rising = ((rise >= np.array(RISE)) | (np.abs(vectors) > reach).any(2))[:, :sides].all(1)
    best = rising & (near >= ALIKE * near.max(initial=0, where=rising))
    return apart(pairs[best][np.argsort(cell[best], kind="stable")])


def shortest(bases: NDArray[Any]) -> NDArray[Any]:
    """Return the three shortest vectors (n, 3, 2) of lattices with reduced bases (n, 2, 2)."""
    first, second = bases[:, 0], bases[:, 1]
    sign = np.where((first * second).sum(1, keepdims=True) < 0, -1, 1)
    return np.stack([first, second, second - sign * first], 1)


def reduced(pairs: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return pairs of vectors (n, 2, 2) reduced by Gauss's algorithm, in one half of the plane, each pair once."""
    first, second = pairs[:, 0].copy(), pairs[:, 1].copy()
    while True:
        swap = (second**2).sum(1) < (first**2).sum(1)
        first[swap], second[swap] = second[swap], first[swap].copy()
        square = (first**2).sum(1)
        times = (2 * (first * second).sum(1) + square) // np.maximum(2 * square, 1)  # the nearest integer
        times[2 * np.abs((first * second).sum(1)) <= square] = 0
        if not times.any():
            break
        second -= times[:, None] * first
    bases = np.stack([first, second], 1)
    bases = bases[(bases**2).sum(2).all(1)]
    flip = (bases[..., 0] < 0) | ((bases[..., 0] == 0) & (bases[..., 1] < 0))
    bases[flip] *= -1
    unique: NDArray[np.int64] = np.unique(bases.reshape(-1, 4), axis=0).reshape(-1, 2, 2)
    return unique


def apart(pairs: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the first `MOST_BASES` of bases (n, 2, 2) that differ from all earlier ones by two pixels or more."""
    kept: list[NDArray[np.int64]] = []
    for pair in pairs:
        if not kept or (np.abs(np.array(kept) - pair).max((1, 2)) >= 2).all():
            kept.append(pair)
        if len(kept) == MOST_BASES:
            break
    return np.array(kept, np.int64).reshape(-1, 2, 2)


def followed(correlation: Correlation, pairs: NDArray[np.int64]) -> list[Followed]:
    """Return each lattice that has enough nodes with its vectors fitted to the peaks near them, and its strength."""
    bases, reach, away = pairs.astype(np.float64), np.array(correlation.reach), 1
    left = np.arange(len(pairs))
    while left.size:  # up to farther nodes as the vectors become exact
        owner, nodes, lags = _nodes(bases[left], reach, away)
        far = np.zeros(left.size)
        np.maximum.at(far, owner, np.abs(nodes).max(1))
        bases[left] = _least_squares(owner, nodes, summits(correlation.values, lags), left.size)
        left, away = left[(np.abs(_determinant(bases[left])) >= LEAST_CELL) & (away <= 2 * far)], 2 * away
    bases = bases[np.abs(_determinant(bases)) >= LEAST_CELL]
    owner, _, lags = _nodes(bases, reach, away)

    def mean(plane: NDArray[np.float64], lags: NDArray[np.float64]) -> NDArray[np.float64]:
        seen = (np.abs(lags) <= reach - 2).all(1)
        at = np.rint(lags[seen]).astype(int) + reach
        total, count = (np.bincount(owner[seen], weights, len(bases)) for weights in (plane[at[:, 0], at[:, 1]], None))
        return np.where(count, total / np.maximum(count, 1), -np.inf)

    strength, vectors = mean(correlation.around, lags), shortest(bases)
    between = [mean(correlation.values, lags + vectors[owner, k] * part) for k in range(3) for part in INSIDE]
    contrast = strength - np.max(between, 0)
    lattices = []
    for index, basis in enumerate(bases):
        core = correlation.values[correlation.length <= (basis**2).sum(1).min() / 4]
        error = sqrt(float((core**2).sum()) / correlation.pixels)
        lattice = _lattice(np.rint(basis * FINE) / FINE)
        lattices.append(Followed(lattice, float(strength[index]), error, float(contrast[index])))
    return lattices


def _nodes(
    bases: NDArray[np.float64], reach: NDArray[np.int64], away: int
) -> tuple[NDArray[np.intp], NDArray[np.float64], NDArray[np.float64]]:
    """Return the lattice (k,), the node (k, 2) and the lag (k, 2) of nodes within ``away`` steps, without origins."""
    corners = (np.abs(_inverse(bases)) * reach[:, None]).sum(1)  # of the window
    limits = np.minimum(away, np.ceil(corners)).astype(np.int64)
    sides = 2 * limits + 1
    sizes = sides.prod(1)
    owner = np.repeat(np.arange(len(bases)), sizes)
    at = np.arange(owner.size) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    nodes = (np.stack([at // sides[owner, 1], at % sides[owner, 1]], 1) - limits[owner]).astype(np.float64)
    lags = nodes[:, :1] * bases[owner, 0] + nodes[:, 1:] * bases[owner, 1]
    inside = (np.abs(lags) <= reach - 2).all(1) & nodes.any(1)
    return owner[inside], nodes[inside], lags[inside]


def summits(values: NDArray[np.float64], lags: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the peak nearest to each lag (n, 2), within two pixels, with subpixel accuracy, (n, 2)."""
    rows, cols = values.shape
    flat, (y, x) = values.ravel(), np.rint(lags).astype(np.int64).T
    y, x = y + rows // 2, x + cols // 2
    square = np.add.outer(np.arange(-1, 2) * cols, np.arange(-1, 2)).reshape(-1, 1)
    for _ in range(2):
        best = flat.take(y * cols + x + square).argmax(0)
        y, x = np.maximum(1, y + best // 3 - 1), np.maximum(1, x + best % 3 - 1)
        y, x = np.minimum(y, rows - 2), np.minimum(x, cols - 2)  # np.clip takes several times as long
    at = y * cols + x
    middle, summit = flat.take(at), np.stack([y, x], 1).astype(np.float64)
    for axis, step in enumerate((cols, 1)):
        low, high = flat.take(at - step), flat.take(at + step)
        bend = low - 2 * middle + high
        summit[:, axis] += np.where(bend < 0, np.clip((low - high) / np.where(bend < 0, 2 * bend, 1), -0.5, 0.5), 0)
    shifted: NDArray[np.float64] = summit - np.array([rows // 2, cols // 2])
    return shifted


def _least_squares(
    owner: NDArray[np.intp], nodes: NDArray[np.float64], peaks: NDArray[np.float64], count: int
) -> NDArray[np.float64]:
    """Return the bases (count, 2, 2) for which ``nodes @ basis`` is nearest to ``peaks``, 0 if not determined."""

    def sums(values: NDArray[np.float64]) -> NDArray[np.float64]:
        products: list[Any] = [np.bincount(owner, x * y, count) for x in nodes.T for y in values.T]
        return np.stack(products, 1).reshape(count, 2, 2)

    square, right = sums(nodes), sums(peaks)
    known = np.abs(_determinant(square)) >= 1e-9
    solution = np.zeros((count, 2, 2))
    solution[known] = _inverse(square[known]) @ right[known]
    return solution


def harmonics(picture: NDArray[np.int64], known: NDArray[np.bool_], lattice: Lattice) -> NDArray[np.complex128]:
    """Return the amplitudes of `HARMONICS` of a lattice in the known pixels of a picture, (4,)."""
    row, col = np.nonzero(known)
    values = picture[known].astype(np.float64)
    y, x = lattice.phases(row, col)
    return np.array([(np.exp(-2j * np.pi * (k * y + m * x)) * (values - values.mean())).sum() for k, m in HARMONICS])


def aligned(lattice: Lattice, wanted: NDArray[np.complex128], actual: NDArray[np.complex128]) -> Lattice:
    """Return the lattice moved so that a picture with harmonics ``actual`` has the phases of one with ``wanted``."""
    y, x = np.mgrid[:STEPS, :STEPS] / STEPS
    likeness = sum(
        (np.exp(2j * np.pi * (k * y + m * x)) * value * np.conj(other)).real
        for (k, m), value, other in zip(HARMONICS, actual, wanted, strict=True)
    )
    best = int(np.argmax(np.rint(likeness / (np.abs(likeness).max() or 1) * ROUND)))
    return lattice.moved(np.array(divmod(best, STEPS)) / STEPS)


def _continued(
    lattice: Lattice, pictures: Sequence[Lattice], place: NDArray[np.int32], known: NDArray[np.bool_]
) -> Lattice:
    """Return the lattice of an output moved so that its known sites have the phases of their sources."""
    row, col = np.nonzero(known)
    source = place[known].astype(np.float64)
    index = source[:, 2].astype(int) if source.shape[1] > 2 else np.zeros(len(source), int)
    apart = lattice.phases(row, col)
    for n, picture in enumerate(pictures):
        apart[:, index == n] -= picture.phases(source[index == n, 0], source[index == n, 1])
    turn = np.exp(2j * np.pi * apart).sum(1)
    return lattice.moved(np.rint(np.angle(turn) / (2 * np.pi) * 2**16) / 2**16)


def _determinant(matrix: NDArray[Any]) -> Any:
    return matrix[..., 0, 0] * matrix[..., 1, 1] - matrix[..., 0, 1] * matrix[..., 1, 0]


def _inverse(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the inverses of matrices (..., 2, 2), by Cramer's rule."""
    (a, b), (c, d) = np.moveaxis(matrix, (-2, -1), (0, 1))
    turned = np.stack([d, -b, -c, a], -1).reshape(matrix.shape)
    inverse: NDArray[np.float64] = turned / _determinant(matrix)[..., None, None]
    return inverse


def _lattice(basis: NDArray[np.float64]) -> Lattice:
    (a, b), (c, d) = basis.tolist()
    return Lattice((a, b), (c, d))
