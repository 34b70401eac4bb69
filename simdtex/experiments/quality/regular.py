# SPDX-License-Identifier: BSD-3-Clause
"""Faults of regular and of striped textures: cells that are out of place, and stripes that end."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex.experiments.quality.patches import as_pair
from simdtex.model.pictures import Pictures
from simdtex.model.regularity import Lattice, plain, regular
from simdtex.model.structure import smoothed, surroundings

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
    own = _likeness(here, lattice, cell, False)
    usual, found = float(np.median(own.max((0, 1)))), []
    if _out_of_place(own, usual).mean() >= OWN:
        return None
    for other, torus in ((lattice, False), (lattice.fitted(there.shape), True)):
        if other is not None:
            found.append(_out_of_place(_likeness(there, other, cell, torus), usual))
    step = _step(lattice)
    faults = min(found, key=lambda one: one.mean()).repeat(step, 0).repeat(step, 1)
    return faults[: there.shape[0], : there.shape[1]]


ORDERS = np.array([(k, m) for k in range(OVERTONES + 1) for m in range(-OVERTONES, OVERTONES + 1) if k > 0 or m > 0])
"""Waves (n, 2) of a lattice, one of each pair of opposites."""


def _step(lattice: Lattice) -> int:
    return max(1, int(lattice.cell**0.5 / SITES + 0.5))


def _waves(picture: NDArray[np.int64], lattice: Lattice) -> NDArray[np.complex128]:
    """Return a picture minus its mean, times the waves of a lattice, (n, rows, cols)."""
    phases = lattice.phases(*np.indices(picture.shape))
    turned = np.exp(-2j * np.pi * np.tensordot(ORDERS, phases, 1))
    found: NDArray[np.complex128] = turned * (picture - picture.mean())
    return found


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
    found: NDArray[np.float64] = np.einsum("k,kij,kyx->ijyx", cell.conj(), shifts, local, optimize=True).real
    return found


def _out_of_place(likeness: NDArray[np.float64], usual: float) -> NDArray[np.bool_]:
    """Return the mask of sites that look more like a cell of another phase than of the output's, or like none."""
    own = np.unravel_index(likeness.mean((2, 3)).argmax(), likeness.shape[:2])
    apart = (np.indices(likeness.shape[:2]).T - own + PHASES // 2) % PHASES - PHASES // 2
    near = (np.abs(apart.T) <= OFF * PHASES).all(0)
    placed, elsewhere = likeness[near].max(0), likeness[~near].max(0)
    found: NDArray[np.bool_] = (elsewhere > placed) | (placed < FAINT * usual)
    return found


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
    Bright and dark parts are those of the structure channel (`simdtex.model.structure`), by the sample's principal
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
