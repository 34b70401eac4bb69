# SPDX-License-Identifier: BSD-3-Clause
"""The types of ``**options`` for editors and type checkers (PEP 692), from the tables of options.

``python tests/test_typed_options.py`` writes this file.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from simdtex.checkpoint import Checkpoint
from simdtex.io.hard_data import HardData
from simdtex.machine import Machine
from simdtex.run import Callback
from simdtex.schedules import Schedule


class Common(TypedDict, total=False):
    """What the public functions have in common."""

    channel_axis: int | None
    rng: int | np.random.Generator | None
    device: str | Machine | None
    callback: Callback | None
    checkpoint: str | os.PathLike[str] | Checkpoint | None


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


class SynthOptions(MrfOptions, MultiresOptions, PyramidOptions, total=False):
    """The options of `simdtex.synthesize`."""

    method: str
    mask: ArrayLike | Sequence[ArrayLike] | None
    known: ArrayLike | HardData | str | os.PathLike[str] | None
    known_source: ArrayLike | None
    guide: tuple[Any, Any] | None


class FillOptions(MrfOptions, total=False):
    """The options of `simdtex.fill`."""

    sample: ArrayLike | None
    reach: int | None
    grow: int
    feather: int


class ExtendOptions(MrfOptions, total=False):
    """The options of `simdtex.extend`."""

    top: int
    bottom: int
    left: int
    right: int
    seamless: bool | str
    band: int | None


class MixOptions(PyramidOptions, total=False):
    """The options of `simdtex.mix`."""

    palette: int | None
    pattern: int | None
    average: Sequence[float] | None
    low: int | None
    high: int | None
    split: int | None


class ClassifyOptions(ClassifierOptions, total=False):
    """The options of `simdtex.classify`."""

    masks: Mapping[str, Any] | None
    validation: Mapping[str, ArrayLike | Sequence[ArrayLike]] | None
