# SPDX-License-Identifier: BSD-3-Clause
"""Figures of merit: how well a synthesised texture represents its sample.

No single figure suffices. An output that repeats one patch is plausible and covers nothing; a copy of the whole sample
is perfect in both, and only its copying shows it. Pictures are arrays (rows, cols) or (rows, cols, channels) in any
one unit; "sample standard deviation" is everywhere the square root of the sample's variance averaged over its channels,
at full resolution (1 if the sample is constant).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import gcd
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray
from scipy.stats import wasserstein_distance

from simdtex.io.image import check_sample
from simdtex.model.pictures import Pictures
from simdtex.model.regularity import Lattice, plain, regular
from simdtex.model.scale import smoothed, surroundings
from simdtex.model.source_map import MostUsed, Use, effective_use
from simdtex.options import moderate

Array = NDArray[Any]
Planes = NDArray[np.float32]
Indices = NDArray[np.intp]

BLOCK_ROWS = 4096  # patches looked up at once
BLOCK_BYTES = 48 << 20  # of one block of patches, and of one block of squared distances


def as_planes(array: ArrayLike) -> Array:
    """Return a picture as (rows, cols, channels), checked."""
    planes = check_sample(array, None if np.ndim(array) == 2 else -1)
    moderate("a picture", planes)
    return planes


def as_pair(sample: ArrayLike, output: ArrayLike, side: int) -> tuple[Array, Array]:
    """Return both pictures as (rows, cols, channels); raise unless their channels agree and each side is long enough.

    Values keep their type.
    """
    first, second = as_planes(sample), as_planes(output)
    if first.shape[2] != second.shape[2]:
        raise ValueError(
            f"the sample has {first.shape[2]} channels and the output {second.shape[2]}: "
            "compare pictures of the same number of channels"
        )
    for name, planes in (("sample", first), ("output", second)):
        if min(planes.shape[:2]) < side:
            raise ValueError(
                f"the {name} is {planes.shape[0]} x {planes.shape[1]} pixels: give at least {side} x {side}"
            )
    return first, second


def spread(planes: Array) -> float:
    """Return the square root of the variance averaged over the channels; 0 if the picture is constant."""
    return float(np.sqrt(planes.var(axis=(0, 1), dtype=np.float64).mean()))


def deviation(planes: Array) -> float:
    """Return the sample standard deviation: `spread`, or 1 if the sample is constant."""
    return spread(planes) or 1.0


def in_deviations(sample: Array, *pictures: Array) -> list[Planes]:
    """Return pictures less the sample's mean, in sample standard deviations, in single precision."""
    centre, scale = sample.mean(dtype=np.float64), deviation(sample)
    # centred, so that the squared norms are small and their rounding with them
    return [((planes.astype(np.float64) - centre) / scale).astype(np.float32) for planes in pictures]


def halved(planes: Planes) -> Planes:
    """Return the means of 2 x 2 blocks; an odd last row or column is left out."""
    even = planes[: planes.shape[0] // 2 * 2, : planes.shape[1] // 2 * 2]
    quarters = even[::2, ::2] + even[1::2, ::2] + even[::2, 1::2] + even[1::2, 1::2]
    return np.asarray(quarters / np.float32(4), dtype=np.float32)


def nearest(queries: Planes, asked: Indices, candidates: Planes, side: int, apart: int = 0) -> NDArray[np.float64]:
    """Return the distances (n,) of the patches ``asked`` of a picture from the nearest of all patches of another.

    ``asked`` (n,) are the numbers of first pixels in raster order. Distances are the root of the mean squared
    difference over the side^2 x channels values, infinite without a candidate. A candidate counts only if its row or
    its column differs from the query's by at least ``apart`` pixels. Memory: under 200 MB beyond the pictures, for any
    size.
    """
    size = side * side * queries.shape[2]
    step = max(1, min(BLOCK_ROWS, BLOCK_BYTES // (4 * size)))
    width = max(1, BLOCK_BYTES // (4 * max(step, size)))
    distance = np.empty(len(asked))
    for start in range(0, len(asked), step):
        part = asked[start : start + step]
        wanted = _patches(queries, part, side)
        least = np.full(len(part), np.inf, dtype=np.float32)
        where = np.zeros(len(part), dtype=np.intp)
        for first in range(0, count(candidates, side), width):
            block = np.arange(first, min(first + width, count(candidates, side)))
            offered = _patches(candidates, block, side)
            # |a|^2 is the same for all candidates of one query, so |b|^2 - 2ab ranks them
            score = wanted @ offered.T
            score *= -2.0
            score += np.einsum("ij,ij->i", offered, offered)
            if apart:
                away = [
                    np.abs(here[:, np.newaxis] - there)
                    for here, there in zip(_places(queries, part, side), _places(candidates, block, side), strict=True)
                ]
                score[(away[0] < apart) & (away[1] < apart)] = np.inf
            best = score.argmin(axis=1)
            lowest = score[np.arange(len(part)), best]
            closer = lowest < least
            least[closer], where[closer] = lowest[closer], block[best[closer]]
        # the distance itself without the cancellation of the product form
        difference = wanted - _patches(candidates, where, side)
        squares = np.einsum("ij,ij->i", difference, difference, dtype=np.float64)
        distance[start : start + step] = np.where(np.isinf(least), np.inf, np.sqrt(squares / size))
    return distance


def count(planes: Planes, side: int) -> int:
    """Return the number of patches of a picture."""
    rows, cols = planes.shape[:2]
    return int((rows - side + 1) * (cols - side + 1))


def hashes(numbers: NDArray[np.integer], side: int) -> NDArray[np.uint64]:
    """Return a hash of each patch of integers (rows, cols, channels), (rows - side + 1, cols - side + 1).

    It is the sum of its numbers modulo 2**64, each times an odd random weight of its row, one of its column and one of
    its channel. Of n different patches and m others, about n m / 2**64 have the same hash by chance.
    """
    weights = np.random.default_rng(0).integers(1, 2**64, (3, max(side, numbers.shape[2])), np.uint64) | 1
    sums: NDArray[np.uint64] = numbers.astype(np.uint64) @ weights[2, : numbers.shape[2]]
    for axis in (0, 1):
        sums = sliding_window_view(sums, side, axis) @ weights[axis, :side]
    return sums


def _places(planes: Planes, indices: Indices, side: int) -> tuple[Indices, Indices]:
    """Return rows and columns of the first pixels of patches."""
    return np.divmod(indices, planes.shape[1] - side + 1)


def _patches(planes: Planes, indices: Indices, side: int) -> Planes:
    windows = sliding_window_view(planes, (side, side), axis=(0, 1))
    return windows[_places(planes, indices, side)].reshape(len(indices), -1)


PATCH = 7  # side of the patches, pixels
SCALES = 3  # full size, 1/2 and 1/4
QUERIES = 4096  # patches looked up per scale, at most
COPIED_PATCH = 9  # side of the patches, pixels


def plausibility(sample: ArrayLike, output: ArrayLike) -> float:
    """Return the mean distance from a 7 x 7 patch of the output to the nearest patch of the sample.

    The distance is the root of the mean squared difference over the 49 x channels values, in sample standard
    deviations; the mean is over patches, then over three scales (full size, 1/2 and 1/4 by means of 2 x 2 blocks). A
    scale at which a picture has no 7 x 7 patch is left out.

    Parameters
    ----------
    sample, output : array_like, (rows, cols) or (rows, cols, channels)
        At least 7 x 7 pixels each, with the same number of channels.

    Returns
    -------
    float
        0 if every patch looked up occurs in the sample.

    Notes
    -----
    About 4096 evenly spaced patches are looked up at each scale. The nearest one is exact, by comparison with all.
    Blocks begin at even pixels, so pieces of the sample moved by multiples of four pixels score lower than others.
    Cost: queries x candidates x 98 x channels operations in single precision; memory under 200 MB beyond the pictures,
    for any size.
    """
    return _mean_nearest(sample, output, of_output=True)


def coverage(sample: ArrayLike, output: ArrayLike) -> float:
    """Return the mean distance from a 7 x 7 patch of the sample to the nearest patch of the output.

    It is `plausibility` with the pictures exchanged, and grows with every part of the sample that the output lacks.
    Parameters, units and cost are those of `plausibility`.
    """
    return _mean_nearest(sample, output, of_output=False)


def _mean_nearest(sample: ArrayLike, output: ArrayLike, *, of_output: bool) -> float:
    first, second = as_pair(sample, output, PATCH)
    pair = in_deviations(first, first, second)
    means = []
    for _ in range(SCALES):
        if min(side for planes in pair for side in planes.shape[:2]) < PATCH:
            break
        candidates, queries = pair if of_output else pair[::-1]
        means.append(float(nearest(queries, _every(queries), candidates, PATCH).mean()))
        pair = [halved(planes) for planes in pair]
    return float(np.mean(means))


def _every(planes: Planes) -> Indices:
    """Return the numbers of the patches of a picture to look up."""
    total = count(planes, PATCH)
    stride = -(-total // QUERIES)
    # no common divisor with a row of patches, or the queries would line up in columns
    while gcd(stride, planes.shape[1] - PATCH + 1) > 1:
        stride += 1
    return np.arange(0, total, stride)


def copying(sample: ArrayLike, output: ArrayLike) -> float:
    """Return the share of the 9 x 9 patches of the output that occur unchanged in the sample.

    Parameters
    ----------
    sample, output : array_like, (rows, cols) or (rows, cols, channels)
        At least 9 x 9 pixels each, with the same number of channels.

    Returns
    -------
    float
        0 to 1. Flat parts count as copied, since the same flat patch occurs in the sample.

    Notes
    -----
    Patches are compared by their `simdtex.jobs.studies.quality.hashes`.
    """
    first, second = as_pair(sample, output, COPIED_PATCH)
    numbers = np.unique(np.concatenate([first.ravel(), second.ravel()]), return_inverse=True)[1]
    known = numbers[: first.size].reshape(first.shape)
    made = numbers[first.size :].reshape(second.shape)
    return float(np.isin(hashes(made, COPIED_PATCH), hashes(known, COPIED_PATCH)).mean())


def histogram_distance(sample: ArrayLike, output: ArrayLike) -> float:
    """Return the earth mover's distance between the marginal histograms, mean over channels.

    Parameters
    ----------
    sample, output : array_like, (rows, cols) or (rows, cols, channels)
        Any sizes, the same number of channels.

    Returns
    -------
    float
        In sample standard deviations; 0 if the histograms agree.
    """
    first, second = as_pair(sample, output, 1)
    channels = range(first.shape[2])
    moved = [wasserstein_distance(first[..., k].ravel(), second[..., k].ravel()) for k in channels]
    return float(np.mean(moved) / deviation(first))


def seam(output: ArrayLike) -> float:
    """Return the visibility of the seam between copies of the output side by side.

    It is the mean absolute difference between the last and the first row, divided by that between neighbouring inner
    rows, the same for columns, and the mean of the two.

    Parameters
    ----------
    output : array_like, (rows, cols) or (rows, cols, channels)
        At least 2 x 2 pixels.

    Returns
    -------
    float
        About 1 for a picture that tiles (and for a constant one), larger if the seam is an edge; infinite if it is
        the only edge.
    """
    planes = as_planes(output).astype(np.float64)
    if min(planes.shape[:2]) < 2:
        raise ValueError("the output is less than 2 pixels wide or high: give at least 2 x 2")
    return float(np.mean([_seam_along(planes, axis) for axis in (0, 1)]))


def _seam_along(planes: Array, axis: int) -> float:
    inside = float(np.abs(np.diff(planes, axis=axis)).mean())
    across = float(np.abs(planes.take(0, axis) - planes.take(-1, axis)).mean())
    if inside == 0.0:
        return 1.0 if across == 0.0 else float("inf")
    return across / inside


OVERTONES = 3
"""Highest multiple of each wave of a lattice that determines the phase."""

PHASES = 16
"""Number of compared phases in a period."""

OFF = 1 / 8
"""The largest allowed displacement of a cell, as a share of the cell."""

FAINT = 0.25
"""Share of the sample's usual likeness to its own mean cell, below which the cell is lost."""

OWN = 0.25
"""Share of faults in the sample itself, from which its lattice is meaningless."""

SITES = 6
"""Number of sites along the side of a cell at which its phase is determined."""

BORDER = 8
"""Pixels from the border of a picture within which stripes may end."""

AREA = 10_000
"""Pixels for which ends are counted."""


def lattice_faults(sample: ArrayLike, output: ArrayLike) -> float | None:
    """Return the share of an output that is out of place on the sample's lattice, 0 to 1, see `lattice_fault_map`.

    None if the sample has no lattice, or does not fit it.
    """
    faults = lattice_fault_map(sample, output)
    return None if faults is None else float(faults.mean())


def lattice_fault_map(sample: ArrayLike, output: ArrayLike) -> NDArray[np.bool_] | None:
    """Return the mask of sites of an output (rows, cols) that are out of place on the sample's lattice.

    None if the sample has no lattice, or if a quarter or more of the sample itself is out of place, as with stripes.

    Parameters
    ----------
    sample, output : array_like, (rows, cols) or (rows, cols, channels)
        At least 9 x 9 pixels each.

    Notes
    -----
    The waves of the lattice in the output, weighted by those of the sample's mean cell and by a Gaussian as wide as
    half a cell, give the likeness of the surroundings of a site to a cell, for every phase. A site is out of place if a
    phase more than an eighth of a cell away has a greater likeness than all near ones, or if no phase has any. The
    lattice is that of the sample or, if this gives fewer faults, the same fitted to an output that wraps around; the
    output determines its origin. Cost: about 0.5 s for 256 x 256 pixels.
    """
    first, second = as_pair(sample, output, 9)
    pictures = Pictures((first,))
    (here,), (known,) = plain(pictures)
    lattice = regular(here, known)
    if lattice is None:
        return None
    (there,), _ = plain(Pictures((second,)), like=pictures)
    cell = _waves(here, lattice).reshape(len(ORDERS), -1).mean(1)
    likeness = _likeness(here, lattice, cell, False)
    usual, maps = float(np.median(likeness.max((0, 1)))), []
    if _out_of_place(likeness, usual).mean() >= OWN:
        return None
    for other, torus in ((lattice, False), (lattice.fitted(there.shape), True)):
        if other is not None:
            maps.append(_out_of_place(_likeness(there, other, cell, torus), usual))
    step = _step(lattice)
    faults = min(maps, key=lambda faulty: faulty.mean()).repeat(step, 0).repeat(step, 1)
    return faults[: there.shape[0], : there.shape[1]]


ORDERS = np.array([(k, m) for k in range(OVERTONES + 1) for m in range(-OVERTONES, OVERTONES + 1) if k > 0 or m > 0])
"""Waves (n, 2) of a lattice, one of each pair of opposites."""


def _step(lattice: Lattice) -> int:
    return max(1, int(lattice.cell**0.5 / SITES + 0.5))


def _waves(picture: NDArray[np.int64], lattice: Lattice) -> NDArray[np.complex128]:
    """Return a picture minus its mean, times the waves of a lattice, (n, rows, cols)."""
    phases = lattice.phases(*np.indices(picture.shape))
    turned = np.exp(-2j * np.pi * np.tensordot(ORDERS, phases, 1))
    waves: NDArray[np.complex128] = turned * (picture - picture.mean())
    return waves


def _likeness(
    picture: NDArray[np.int64], lattice: Lattice, cell: NDArray[np.complex128], torus: bool
) -> NDArray[np.float64]:
    """Return the likeness of the surroundings of sites to a cell of each phase, (`PHASES`, `PHASES`, rows, cols)."""
    from scipy.ndimage import gaussian_filter

    step, width, mode = _step(lattice), lattice.cell**0.5 / 2, "wrap" if torus else "constant"
    weights = gaussian_filter(np.ones(picture.shape), width, mode=mode)
    local = np.stack(
        [
            (gaussian_filter(wave.real, width, mode=mode) + 1j * gaussian_filter(wave.imag, width, mode=mode)) / weights
            for wave in _waves(picture, lattice)
        ]
    )[:, ::step, ::step]
    shifts = np.exp(2j * np.pi * np.tensordot(ORDERS, np.indices((PHASES, PHASES)) / PHASES, 1))
    likeness: NDArray[np.float64] = np.einsum("k,kij,kyx->ijyx", cell.conj(), shifts, local, optimize=True).real
    return likeness


def _out_of_place(likeness: NDArray[np.float64], usual: float) -> NDArray[np.bool_]:
    """Return the mask of sites that look more like a cell of another phase than of the output's, or like none."""
    phase = np.unravel_index(likeness.mean((2, 3)).argmax(), likeness.shape[:2])
    apart = (np.indices(likeness.shape[:2]).T - phase + PHASES // 2) % PHASES - PHASES // 2
    near = (np.abs(apart.T) <= OFF * PHASES).all(0)
    placed, elsewhere = likeness[near].max(0), likeness[~near].max(0)
    faulty: NDArray[np.bool_] = (elsewhere > placed) | (placed < FAINT * usual)
    return faulty


class Ends(NamedTuple):
    """The ends of stripes: ``bright`` and ``dark`` (n, 2), rows and columns of the ends of either kind."""

    bright: NDArray[np.intp]
    dark: NDArray[np.intp]


def cut_ends(sample: ArrayLike, output: ArrayLike) -> float:
    """Return the excess of ends of stripes in an output over its sample, in 10,000 pixels; negative for fewer ends.

    See `cut_end_places`.
    """
    first, second = as_pair(sample, output, 9)
    return _rate(first, second) - _rate(first, first)


def _rate(sample: NDArray[Any], output: NDArray[Any]) -> float:
    rows, cols = (max(1, side - 2 * BORDER) for side in output.shape[:2])
    bright, dark = cut_end_places(sample, output)
    return float(AREA * (len(bright) + len(dark)) / (rows * cols))


def cut_end_places(sample: ArrayLike, output: ArrayLike) -> Ends:
    """Return the ends of bright and dark stripes of an output.

    Parameters
    ----------
    sample, output : array_like, (rows, cols) or (rows, cols, channels)
        At least 9 x 9 pixels each.

    Notes
    -----
    Bright and dark parts are those of the structure channel (`simdtex.model.scale`), by the sample's principal
    component. Each is thinned to lines, and an end is a pixel of a line with one neighbour. Ends within 8 pixels of the
    border do not count.
    """
    from skimage.morphology import skeletonize

    first, second = as_pair(sample, output, 9)
    pictures = Pictures((first,))
    planes, _ = plain(Pictures((second,)), like=pictures)
    tone = smoothed(planes[0])
    around, total = surroundings(tone)
    bright = tone * total > around
    thin: Any = skeletonize  # which has no types
    return Ends(_ends(thin(bright)), _ends(thin(~bright)))


def _ends(lines: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return the ends (n, 2) of thin lines (rows, cols) that are not near the border."""
    from scipy.ndimage import convolve

    neighbours = convolve(lines.astype(np.int8), np.ones((3, 3), np.int8), mode="constant")
    ends = lines & (neighbours == 2)  # the pixel itself and one more
    ends[:BORDER] = ends[-BORDER:] = ends[:, :BORDER] = ends[:, -BORDER:] = False
    return np.argwhere(ends)


__all__ = [
    "COPIED_PATCH",
    "Ends",
    "MostUsed",
    "Quality",
    "Use",
    "copying",
    "coverage",
    "cut_end_places",
    "cut_ends",
    "effective_use",
    "histogram_distance",
    "lattice_fault_map",
    "lattice_faults",
    "measure",
    "plausibility",
    "seam",
]


@dataclass(frozen=True)
class Quality:
    """The figures of one output, see the functions of the same names.

    Attributes
    ----------
    plausibility, coverage, histogram_distance : float
        In sample standard deviations; 0 is best.
    copying : float
        Share of the output's patches, 0 to 1.
    seam : float
        Ratio; 1 is an invisible seam.
    lattice_faults : float or None
        Share of the output, 0 to 1, that is out of place on the sample's lattice; None if it has no lattice.
    cut_ends : float
        Ends of stripes in 10,000 pixels, minus those of the sample; negative if the sample has more.
    effective_share, most_used : float or None
        `effective_use`: a share above 0, to 1, and the use of the most used piece over its fair share; None without a
        source map.
    """

    plausibility: float
    coverage: float
    copying: float
    histogram_distance: float
    seam: float
    lattice_faults: float | None
    cut_ends: float
    effective_share: float | None = None
    most_used: float | None = None


def measure(sample: ArrayLike, output: ArrayLike, source: ArrayLike | None = None) -> Quality:
    """Return the figures of merit of one output.

    Parameters
    ----------
    sample, output : array_like, (rows, cols) or (rows, cols, channels)
        At least 9 x 9 pixels each, with the same number of channels.
    source : array_like of int, (rows, cols, 2), optional
        The output's source map.

    Returns
    -------
    Quality

    Raises
    ------
    ValueError
        The pictures are too small, or have different channels.

    Notes
    -----
    Cost: about 1.5 s on two CPU cores for a 128 x 128 sample and a 256 x 256 output in colour, most of it for
    plausibility and coverage.
    """
    quality = Quality(
        copying=copying(sample, output),
        plausibility=plausibility(sample, output),
        coverage=coverage(sample, output),
        histogram_distance=histogram_distance(sample, output),
        seam=seam(output),
        lattice_faults=lattice_faults(sample, output),
        cut_ends=cut_ends(sample, output),
    )
    if source is None:
        return quality
    rows, cols = np.shape(sample)[:2]
    use = effective_use(source, (rows, cols))
    return replace(quality, effective_share=use.effective_share, most_used=use.most_used.times_fair_share)
