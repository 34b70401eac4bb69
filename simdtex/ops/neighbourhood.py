# SPDX-License-Identifier: BSD-3-Clause
"""The neighbourhoods of the sites to relax, weighted by confidence: the left half of equation (12)."""

from __future__ import annotations

from math import prod
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher, Operation, touching
from simdtex.model.guide import UNKNOWN
from simdtex.model.lattice import Grid

UNTOUCHED = 1024
"""t = 1 in 1/1024: no relaxation has touched the site."""


class Field(NamedTuple):
    """The state of the relaxation: more than pixels.

    ``values`` (C, H, W) uint16 working grey levels; ``source`` (H, W) int32 pixel index in the sample;
    ``temperature`` (H, W) uint16 in 1/1024.
    """

    values: Array
    source: Array
    temperature: Array


class Beside(NamedTuple):
    """Which channels stand beside those of the pixels: kernels/common/beside.h.

    ``guides`` how many, the last ones; ``own`` whether each value has a confidence of its own, as guides have and where
    values may be unknown; ``centre`` that of a guide at the site itself; ``hard`` that of hard data, which are from
    nowhere in the sample.
    """

    guides: int = 0
    own: bool = False
    centre: np.float32 = np.float32(1)
    hard: np.float32 = np.float32(1)

    @property
    def defines(self) -> dict[str, int]:
        """-D constants of kernels."""
        return ({"G": self.guides} if self.guides else {}) | ({"OWN": 1} if self.own else {})


NOTHING = Beside()


class Neighbourhoods(NamedTuple):
    """``confidence`` (N, P) u = 1 - t_r; ``weighted`` (N, C, P) x_r u; ``sites`` S of the P columns.

    Where each value has a confidence of its own, ``confidence`` is (N, C, P); where there are guides, the site itself
    is the last of N + 1.
    """

    confidence: Array
    weighted: Array
    sites: int


def gathered(
    sites: NDArray[np.int32], r: NDArray[np.int32], field: Field, beside: Beside
) -> tuple[NDArray[np.uint16], NDArray[np.float32]]:
    """Values (terms, C, S) and their confidences (terms, C or 1, S): of neighbours r (N, S), and of a guide's site."""
    u = (1024 - field.temperature.ravel()[r].astype(np.float32)) / np.float32(1024)
    if beside.own:
        u = np.where((r >= 0) & (field.source.ravel()[r] < 0), u * beside.hard, u)
    u = np.where(r < 0, np.float32(0), u)[:, None]
    channels = len(field.values)
    if beside.guides:
        r = np.concatenate([r, sites[None]])
        u = np.concatenate([u, np.zeros_like(u[:1])])
    x = np.moveaxis(field.values.reshape(channels, -1)[:, r], 0, 1)
    if beside.own:
        u = np.repeat(u, channels, 1)
        if beside.guides:
            u[:, -beside.guides :] = (r >= 0)[:, None]
            u[-1, -beside.guides :] = beside.centre
        u = np.where(x == UNKNOWN, np.float32(0), u)
    return x, u


def _reference(
    sites: NDArray[np.int32], field: Field, offsets: NDArray[np.int32], grid: Grid, beside: Beside = NOTHING
) -> Neighbourhoods:
    x, u = gathered(sites, grid.neighbours(sites, offsets), field, beside)
    return Neighbourhoods(u if beside.own else u[:, 0], x.astype(np.float32) * u, sites.size)


def _launch(
    machine: Launcher, sites: Array, field: Field, offsets: Array, grid: Grid, beside: Beside = NOTHING
) -> Neighbourhoods:
    count, neighbours, channels = sites.size, offsets.shape[0], field.values.shape[0]
    padded, terms = -(-count // machine.vector) * machine.vector, neighbours + bool(beside.guides)
    confidence = machine.empty((terms, channels, padded) if beside.own else (terms, padded), np.float32)
    weighted = machine.empty((terms, channels, padded), np.float32)
    machine.launch(
        machine.kernel("neighbourhood", "neighbourhood", **({"OWN": 1} if beside.own else {})),
        (padded, terms),
        *(sites, np.int32(count), np.int32(padded), field.values, field.temperature, field.source, beside.hard),
        *(np.int32(channels), np.int32(channels - beside.guides), np.int32(prod(field.values.shape[1:])), offsets),
        *(np.int32(neighbours), np.int32(terms), beside.centre, grid.struct, confidence, weighted),
        work=touching(sites, confidence, weighted),
    )
    return Neighbourhoods(confidence, weighted, count)


neighbourhood = Operation("neighbourhood", _reference, _launch)
