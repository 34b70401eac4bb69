# SPDX-License-Identifier: BSD-3-Clause
"""The arrays over sites, the confidences of their values, and neighbourhoods: the left half of equation (12)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array
from simdtex.model.guide import UNKNOWN
from simdtex.model.lattice import Grid, gathered


class Field(NamedTuple):
    """The arrays over sites of the relaxation.

    ``values`` (C, H, W) uint16, working grey levels; ``source`` (H, W) int32, pixel indices in the sample;
    ``temperature`` (H, W) uint16 in 1/1024.
    """

    values: Array
    source: Array
    temperature: Array


class Confidences(NamedTuple):
    """The number of guides, and the confidences of values: kernels/mrf/confidence.h.

    ``guides``, the number of guide channels, which are the last; ``own``, whether each value has its own confidence, as
    for guides and unknown values; ``centre``, the confidence of a guide at the site itself; ``hard``, that of hard
    data, which are not taken from the sample; ``known``, the number of guide channels that are known variables, which
    are the last and as certain as hard data; ``centre_known``, the confidence of these at the site itself.
    """

    guides: int = 0
    own: bool = False
    centre: np.float32 = np.float32(1)
    hard: np.float32 = np.float32(1)
    known: int = 0
    centre_known: np.float32 = np.float32(1)

    @property
    def defines(self) -> dict[str, int]:
        """-D constants of kernels."""
        return {"G": self.guides, "KNOWN": self.known, "OWN": int(self.own)}


USUAL = Confidences()


class Near(NamedTuple):
    """The neighbourhoods of ``sites`` (S,), in NumPy.

    ``values`` (terms, C, S) uint16 and ``confidence`` (terms, C or 1, S) of the N neighbours, and of the site itself if
    there are guides; ``source`` (N, S), the pixel index of each neighbour's source, -1 without a neighbour or if no
    relaxation has touched it; ``own`` (S,), the source of each site.
    """

    sites: NDArray[np.int32]
    values: NDArray[np.uint16]
    confidence: NDArray[np.float32]
    source: NDArray[np.int32]
    own: NDArray[np.int32]


def near(
    sites: NDArray[np.int32], field: Field, offsets: NDArray[np.int32], grid: Grid, confidences: Confidences
) -> Near:
    """Return the neighbourhoods of sites."""
    r = grid.neighbours(sites, offsets)
    source, t = gathered(field.source.ravel(), r, -1), gathered(field.temperature.ravel(), r, 1024)
    touched = np.where(t < 1024, source, np.int32(-1))
    u = (1024 - t.astype(np.float32)) / np.float32(1024)
    if confidences.own:
        u = np.where(source < 0, u * confidences.hard, u)
    u, channels = u[:, None], len(field.values)
    if confidences.guides:
        r = np.concatenate([r, sites[None]])
        u = np.concatenate([u, np.zeros_like(u[:1])])
    x = np.moveaxis(gathered(field.values.reshape(channels, -1), r, 0), 0, 1)
    if confidences.own:
        u = np.repeat(u, channels, 1)
        guides, known, here = confidences.guides, confidences.known, (r >= 0).astype(np.float32)[:, None]
        if guides:
            u[:, -guides:] = here
            u[-1, -guides:] = confidences.centre
        if known:
            u[:, -known:] = here * confidences.hard
            u[-1, -known:] = confidences.centre_known
        u = np.where(x == UNKNOWN, np.float32(0), u)
    return Near(sites, x, u, touched, field.source.ravel()[sites])
