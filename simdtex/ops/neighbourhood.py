# SPDX-License-Identifier: BSD-3-Clause
"""The neighbourhoods of the sites to relax, weighted by confidence: the left half of equation (12)."""

from __future__ import annotations

from math import prod
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.model.guide import UNKNOWN
from simdtex.model.lattice import Grid


class Field(NamedTuple):
    """The arrays over sites of the relaxation.

    ``values`` (C, H, W) uint16, working grey levels; ``source`` (H, W) int32, pixel indices in the sample;
    ``temperature`` (H, W) uint16 in 1/1024.
    """

    values: Array
    source: Array
    temperature: Array


class Confidences(NamedTuple):
    """The number of guides, and the confidences of values: kernels/common/confidence.h.

    ``guides``, the number of guide channels, which are the last; ``own``, whether each value has its own confidence, as
    for guides and unknown values; ``centre``, the confidence of a guide at the site itself; ``hard``, that of hard
    data, which are not taken from the sample.
    """

    guides: int = 0
    own: bool = False
    centre: np.float32 = np.float32(1)
    hard: np.float32 = np.float32(1)

    @property
    def defines(self) -> dict[str, int]:
        """-D constants of kernels."""
        return ({"G": self.guides} if self.guides else {}) | ({"OWN": 1} if self.own else {})


USUAL = Confidences()


class Neighbourhoods(NamedTuple):
    """Neighbourhoods: ``confidence`` (N, P), u = 1 - t_r; ``weighted`` (N, C, P), x_r u; ``sites``, S of the P columns.

    If each value has its own confidence, ``confidence`` is (N, C, P); with guides, the site itself is the last of
    N + 1.
    """

    confidence: Array
    weighted: Array
    sites: int


def gathered(
    sites: NDArray[np.int32], r: NDArray[np.int32], field: Field, confidences: Confidences
) -> tuple[NDArray[np.uint16], NDArray[np.float32]]:
    """Return values (terms, C, S) and confidences (terms, C or 1, S) of neighbours r (N, S), and of guides at sites."""
    u = (1024 - field.temperature.ravel()[r].astype(np.float32)) / np.float32(1024)
    if confidences.own:
        u = np.where((r >= 0) & (field.source.ravel()[r] < 0), u * confidences.hard, u)
    u = np.where(r < 0, np.float32(0), u)[:, None]
    channels = len(field.values)
    if confidences.guides:
        r = np.concatenate([r, sites[None]])
        u = np.concatenate([u, np.zeros_like(u[:1])])
    x = np.moveaxis(field.values.reshape(channels, -1)[:, r], 0, 1)
    if confidences.own:
        u = np.repeat(u, channels, 1)
        if confidences.guides:
            u[:, -confidences.guides :] = (r >= 0)[:, None]
            u[-1, -confidences.guides :] = confidences.centre
        u = np.where(x == UNKNOWN, np.float32(0), u)
    return x, u


@Operation
def neighbourhood(
    machine: Launcher | None, sites: Array, field: Field, offsets: Array, grid: Grid, confidences: Confidences = USUAL
) -> Neighbourhoods:
    """Return the neighbourhoods of sites."""
    if machine is None:
        x, u = gathered(sites, grid.neighbours(sites, offsets), field, confidences)
        return Neighbourhoods(u if confidences.own else u[:, 0], x.astype(np.float32) * u, sites.size)
    count, neighbours, channels = sites.size, offsets.shape[0], field.values.shape[0]
    padded, terms = -(-count // machine.vector) * machine.vector, neighbours + bool(confidences.guides)
    confidence = machine.empty((terms, channels, padded) if confidences.own else (terms, padded), np.float32)
    weighted = machine.empty((terms, channels, padded), np.float32)
    machine.launch(
        "neighbourhood",
        (padded, terms),
        *(sites, count, padded, field.values, field.temperature, field.source, confidences.hard),
        *(channels, channels - confidences.guides, prod(field.values.shape[1:]), offsets),
        *(neighbours, terms, confidences.centre, grid.struct, confidence, weighted),
        defines={"OWN": 1} if confidences.own else {},
    )
    return Neighbourhoods(confidence, weighted, count)
