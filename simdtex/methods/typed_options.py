# SPDX-License-Identifier: BSD-3-Clause
"""The types of ``**options`` for editors and type checkers (PEP 692), from the tables of options.

``python tests/test_typed_options.py`` writes this file.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, Literal, Required, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from simdtex.checkpoint import Checkpoint
from simdtex.io.hard_data import HardData
from simdtex.machine import Machine
from simdtex.run import Callback
from simdtex.schedules import Schedule

ScheduleName = Literal[
    "coloring", "coloring-fixed", "luby", "checkerboard", "synchronous", "random-subset", "raster", "random-scan",
    "block"
]  # fmt: skip


class Common(TypedDict, total=False):
    """What the public functions have in common."""

    channel_axis: int | None
    rng: int | np.random.Generator | None
    device: str | Machine | None
    callback: Callback | None
    checkpoint: str | os.PathLike[str] | Checkpoint | None


class MrfOptions(TypedDict, total=False):
    """The options of the method ``mrf``."""

    preset: Literal["default", "paper"]
    order: int
    structure: float
    lattice: Literal["auto", "none"] | tuple[tuple[float, float], tuple[float, float]]
    coherence: float
    balance: float
    novelty: float
    finish: float | None
    overview: int
    levels: int | None
    boundary: Literal["torus", "open"]
    edges: Literal["auto", "reflect", "whole"]
    phases: Literal["all", "decimated"]
    search: Literal["auto", "exact", "coherent"]
    chance: int
    coarse_chance: int
    relaxation: Literal["icm", "gibbs"]
    bandwidth: float
    xi: float
    free_sweeps: int
    pixel: Literal["source", "density"]
    schedule: ScheduleName | Schedule
    array: str | None
    categorical: bool | tuple[int, ...]
    weights: tuple[float, ...] | list[float] | None
    shares: tuple[float, ...] | list[float] | None
    proportions: tuple[float, ...] | list[float] | None
    data_weight: float
    soft_weight: float
    guide_weight: float
    labels: bool | None


class MultiresSynth(Common, total=False):
    """The options of the method ``multires``."""

    method: Required[Literal["multires"]]
    preset: Literal["default", "paper"]
    alpha: float
    beta: float
    seams: Literal["blend", "cut"]
    parity: Literal["match", "free"]
    levels: int | None
    boundary: Literal["torus", "open"]
    edges: Literal["mend", "keep"]
    orientations: int


class PyramidOptions(TypedDict, total=False):
    """The options of the method ``pyramid``."""

    preset: Literal["default", "paper"]
    pyramid: Literal["steerable", "laplacian"]
    iterations: int
    match: Literal["rank", "lookup"]
    color: Literal["decorrelate", "channels"]
    start: ArrayLike | None
    levels: int | None
    edges: Literal["reflect", "wrap"]
    orientations: int


class PyramidSynth(Common, PyramidOptions, total=False):
    """The options of the method ``pyramid``."""

    method: Required[Literal["pyramid"]]


class SolidSynth(Common, PyramidOptions, total=False):
    """The options of the method ``pyramid.solid``."""

    solids: Literal["turns", "average"]
    slices: Literal["each", "together"]


class ClassifierOptions(TypedDict, total=False):
    """The options of the method ``classifier``."""

    order: int
    levels: int
    exemplars: int
    typical: float
    coupling: float
    weight: float
    sweeps: int
    schedule: ScheduleName | Schedule
    unknown: float
    window: float


class MrfSynth(Common, MrfOptions, total=False):
    """The options of `simdtex.synthesize`."""

    method: Literal["mrf"]
    mask: ArrayLike | Sequence[ArrayLike] | None
    known: ArrayLike | HardData | str | os.PathLike[str] | None
    known_source: ArrayLike | None
    guide: tuple[Any, Any] | None


class FillOptions(Common, MrfOptions, total=False):
    """The options of `simdtex.fill`."""

    sample: ArrayLike | None
    reach: int | None
    grow: int
    feather: int


class ExtendOptions(Common, MrfOptions, total=False):
    """The options of `simdtex.extend`."""

    top: int
    bottom: int
    left: int
    right: int
    seamless: bool | Literal["x", "y"]
    band: int | None


class SimulateOptions(MrfOptions, total=False):
    """The options of `simdtex.simulate`."""

    shape: tuple[int, ...] | None
    known: ArrayLike | HardData | str | os.PathLike[str] | None
    several: Literal["refuse", "mean", "most"]
    outside: Literal["refuse", "skip"]
    origin: Sequence[float] | None
    cell: Sequence[float] | None
    guide: tuple[Any, Any] | None
    mask: ArrayLike | None
    region: ArrayLike | None
    probabilities: ArrayLike | HardData | str | os.PathLike[str] | None
    image_map: ArrayLike | None
    rotation: ArrayLike | None
    scale: ArrayLike | None
    first: int
    jobs: int | None
    channel_axis: int | None
    rng: int | np.random.Generator | None
    device: str | None
    callback: Callback | None
    checkpoint: str | os.PathLike[str] | Checkpoint | None


class MixOptions(Common, PyramidOptions, total=False):
    """The options of `simdtex.mix`."""

    palette: int | None
    pattern: int | None
    average: Sequence[float] | None
    low: int | None
    high: int | None
    split: int | None


class ClassifyOptions(Common, ClassifierOptions, total=False):
    """The options of `simdtex.classify`."""

    masks: Mapping[str, Any] | None
    validation: Mapping[str, ArrayLike | Sequence[ArrayLike]] | None
