# SPDX-License-Identifier: BSD-3-Clause
"""The neighbourhoods of the sites to relax, weighted by confidence: the left half of equation (12)."""

from __future__ import annotations

from math import prod
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher, Operation, touching
from simdtex.model.lattice import Grid


class Field(NamedTuple):
    """The state of the relaxation: more than pixels.

    ``values`` (C, H, W) uint16 working grey levels; ``source`` (H, W) int32 pixel index in the sample;
    ``temperature`` (H, W) uint16 in 1/1024.
    """

    values: Array
    source: Array
    temperature: Array


class Neighbourhoods(NamedTuple):
    """``confidence`` (N, P) u = 1 - t_r; ``weighted`` (N, C, P) x_r u; ``sites`` S of the P columns."""

    confidence: Array
    weighted: Array
    sites: int


def _reference(sites: NDArray[np.int32], field: Field, offsets: NDArray[np.int32], grid: Grid) -> Neighbourhoods:
    r = grid.neighbours(sites, offsets)
    u = (1024 - field.temperature.ravel()[r].astype(np.float32)) / np.float32(1024)
    u = np.where(r < 0, np.float32(0), u)
    x = field.values.reshape(field.values.shape[0], -1)[:, r].astype(np.float32)
    return Neighbourhoods(u, np.moveaxis(x * u, 0, 1), sites.size)


def _launch(machine: Launcher, sites: Array, field: Field, offsets: Array, grid: Grid) -> Neighbourhoods:
    count, neighbours, channels = sites.size, offsets.shape[0], field.values.shape[0]
    padded = -(-count // machine.vector) * machine.vector
    confidence = machine.empty((neighbours, padded), np.float32)
    weighted = machine.empty((neighbours, channels, padded), np.float32)
    machine.launch_sites(
        ("neighbourhood", "neighbourhood"),
        (padded, neighbours),
        *(sites, np.int32(count), np.int32(padded), field.values, field.temperature),
        *(np.int32(channels), np.int32(prod(field.values.shape[1:])), offsets, np.int32(neighbours), grid.struct),
        *(confidence, weighted),
        work=touching(sites, confidence, weighted),
    )
    return Neighbourhoods(confidence, weighted, count)


neighbourhood = Operation("neighbourhood", _reference, _launch)
