# SPDX-License-Identifier: BSD-3-Clause
"""The types of ``**options`` for editors and type checkers (PEP 692), from the tables of options.

``python tests/test_typed_options.py`` writes this file.
"""

from __future__ import annotations

from os import PathLike
from typing import TypedDict

import numpy as np
from numpy.typing import ArrayLike

from simdtex.checkpoint import Checkpoint
from simdtex.machine import Machine
from simdtex.run import Callback
from simdtex.schedules import Schedule


class Common(TypedDict, total=False):
    """What the public functions have in common."""

    channel_axis: int | None
    rng: int | np.random.Generator | None
    device: str | Machine | None
    callback: Callback | None
    checkpoint: str | PathLike[str] | Checkpoint | None


class MrfOptions(Common, total=False):
    """The options of the method ``mrf``."""

    preset: str
    order: int
    structure: float
    lattice: str | tuple[tuple[float, float], tuple[float, float]]
    coherence: float
    balance: float
    novelty: float
    finish: float | None
    overview: int
    levels: int | None
    boundary: str
    edges: str
    phases: str
    search: str
    chance: int
    coarse_chance: int
    relaxation: str
    bandwidth: float
    xi: float
    free_sweeps: int
    pixel: str
    schedule: str | Schedule
    array: str | None
    categorical: bool | tuple[int, ...]
    weights: tuple[float, ...] | list[float] | None
    shares: tuple[float, ...] | list[float] | None
    proportions: tuple[float, ...] | list[float] | None
    data_weight: float
    soft_weight: float
    guide_weight: float
    labels: bool | None


class MultiresOptions(Common, total=False):
    """The options of the method ``multires``."""

    preset: str
    alpha: float
    beta: float
    seams: str
    parity: str
    levels: int | None
    boundary: str
    edges: str
    orientations: int


class PyramidOptions(Common, total=False):
    """The options of the method ``pyramid``."""

    preset: str
    pyramid: str
    iterations: int
    match: str
    color: str
    start: ArrayLike | None
    levels: int | None
    edges: str
    orientations: int


class SolidOptions(PyramidOptions, total=False):
    """The options of the method ``pyramid.solid``."""

    solids: str
    slices: str


class ClassifierOptions(Common, total=False):
    """The options of the method ``classifier``."""

    order: int
    levels: int
    exemplars: int
    typical: float
    coupling: float
    weight: float
    sweeps: int
    schedule: str | Schedule
    unknown: float
    window: float


class AnyOptions(MrfOptions, MultiresOptions, PyramidOptions, total=False):
    """The options of all methods."""
