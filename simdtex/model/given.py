# SPDX-License-Identifier: BSD-3-Clause
"""Sites whose values are given: hard data, the known part of a picture. They stay what they are.

A given site has the temperature 0 from the beginning, and nothing relaxes it. At a coarse level a datum that lies
between the sites stands for the nearest one, for that level only, as in multiple-point simulation (Strebelle 2002); of
several the nearest, and of those the first, row by row.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.model.guide import UNKNOWN, Colocated
from simdtex.model.lattice import Grid
from simdtex.model.sample import Sample


@dataclass(frozen=True, eq=False)
class Given:
    """What is given of an output.

    Parameters
    ----------
    values : (H, W, C) array
        Of the sample's type.
    known : (H, W, C) bool array
        Which of them are given. A site of which some variables are given and others are not relaxes, guided by those,
        and shows them in the end.
    place : (H, W, 2 or 3) int32 array, optional
        Where in the sample each given site is from: row, column and, of several pictures, its number; -1 where from
        nowhere. None: all from nowhere.
    suggests : bool
        Whether sites that are from the sample suggest how to go on. Where all that they could suggest is unknown
        itself, they are hard data instead, of which every channel is known.
    """

    values: NDArray[Any]
    known: NDArray[np.bool_]
    place: NDArray[np.int32] | None = None
    suggests: bool = True

    @cached_property
    def whole(self) -> NDArray[np.bool_]:
        """Sites of which everything is given, (H, W)."""
        return np.asarray(self.known.all(-1))

    @cached_property
    def partly(self) -> bool:
        """Whether there are sites of which some variables are given and others are not."""
        return bool((self.known.any(-1) & ~self.whole).any())

    def colocated(self, samples: tuple[NDArray[Any], ...]) -> Colocated:
        """Return the variables that are known at sites where others are not, as a guide for these."""
        return Colocated(samples, self.values, self.known & ~self.whole[..., None])

    def shown(self, picture: NDArray[Any], grid: Grid) -> NDArray[Any]:
        """Return the picture (rows, cols, C) of a level with the known values at its sites."""
        step = (slice(None, None, grid.spacing),) * 2
        found: NDArray[Any] = np.where(self.known[step], self.values[step], picture)
        return found


class Stand(NamedTuple):
    """Sites that stand for off-grid data at a level: ``site`` and ``datum``, (n,) pixel indices of the output."""

    site: NDArray[np.int64]
    datum: NDArray[np.int64]


NO_STAND_IN = Stand(np.zeros(0, np.int64), np.zeros(0, np.int64))


def stand_ins(known: NDArray[np.bool_], grid: Grid) -> Stand:
    """Return the sites of a level's lattice that stand in for off-grid data, in ascending order.

    ``known`` (H, W) are the data. A datum moves if none of the four sites around it is given itself.
    """
    step, (height, width) = grid.spacing, known.shape
    if step == 1:
        return NO_STAND_IN
    own = np.zeros((grid.rows, grid.cols), bool)
    own[:] = known[::step, ::step]
    row, col = np.nonzero(known)
    between = (row % step > 0) | (col % step > 0)
    row, col = row[between], col[between]

    def at(i: NDArray[np.intp], n: int) -> NDArray[np.intp]:
        return i % n if grid.torus else np.minimum(i, n - 1)

    above, left = row // step, col // step
    represented = np.zeros(row.size, bool)
    for down, right in ((0, 0), (0, 1), (1, 0), (1, 1)):
        needed = (row % step >= down) & (col % step >= right)  # a datum in a site's row has none above or below
        represented |= needed & own[at(above + down, grid.rows), at(left + right, grid.cols)]
    row, col = row[~represented], col[~represented]
    i, j = (row + step // 2) // step, (col + step // 2) // step
    if not grid.torus:
        i, j = np.minimum(i, grid.rows - 1), np.minimum(j, grid.cols - 1)
    apart = (np.minimum(i * step, height) - row) ** 2 + (np.minimum(j * step, width) - col) ** 2
    site = at(i, grid.rows) * step * width + at(j, grid.cols) * step
    datum = row * width + col
    order = np.lexsort((datum, apart, site))
    site, datum = site[order], datum[order]
    first = np.ones(site.size, bool)
    first[1:] = site[1:] != site[:-1]
    return Stand(site[first].astype(np.int64), datum[first].astype(np.int64))


class Planes(NamedTuple):
    """What is given as a run's field has it, on the host.

    ``values`` (C, H, W) uint16, `UNKNOWN` where a channel is not; ``source`` (H, W) int32, -1 where from nowhere;
    ``known`` (H, W) bool.
    """

    values: NDArray[np.uint16]
    source: NDArray[np.int32]
    known: NDArray[np.bool_]


def planes(given: Given, sample: Sample) -> Planes:
    """Return the known values in a sample's channels: all of them at sites that are from the sample."""
    shape = given.whole.shape
    values = np.full((sample.channels, *shape), UNKNOWN, np.uint16)
    source = np.full(shape, -1, np.int32) if given.place is None else sample.index(given.place)
    source = np.where(given.whole, source, np.int32(-1))
    known = given.values[given.whole]
    values[: sample.shown, given.whole] = sample.scale.levels(known)
    values[:, source >= 0] = sample.working[: sample.channels, source[source >= 0]]
    if not given.suggests:
        source[:] = -1
    return Planes(values, source, given.whole)
