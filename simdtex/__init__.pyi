# SPDX-License-Identifier: BSD-3-Clause
# ruff: noqa: E501
# fmt: off
"""The types of the public names for editors and type checkers; ``python docs/stubs.py`` writes this file."""

import os
from collections.abc import Mapping, Sequence
from typing import Any, Literal, Required, TypedDict, Unpack, overload

import numpy as np
import xarray
from numpy.typing import ArrayLike, NDArray

from simdtex.checkpoint import Checkpoint as Checkpoint
from simdtex.figures.show import show as show
from simdtex.io.grids import read_grid as read_grid
from simdtex.io.grids import write_grid as write_grid
from simdtex.io.hard_data import HardData
from simdtex.io.hard_data import place_hard_data as place_hard_data
from simdtex.io.hard_data import read_hard_data as read_hard_data
from simdtex.jobs.classification.job import TextureClassifier as TextureClassifier
from simdtex.jobs.simulation import ensemble as ensemble
from simdtex.jobs.studies import quality as quality
from simdtex.jobs.synthesis.job import lcpdf as lcpdf
from simdtex.jobs.tilesets.job import tileset as tileset
from simdtex.jobs.why.replay import Replay
from simdtex.live.widget import Live as Live
from simdtex.machine import Machine
from simdtex.machine import open_machine as open_machine
from simdtex.machine.devices import DeviceError as DeviceError
from simdtex.machine.devices import devices as devices
from simdtex.model.explanation import Explanation
from simdtex.run import Callback, OutputWithSource
from simdtex.run import Output as Output
from simdtex.run import Progress as Progress
from simdtex.schedules import Schedule

__version__: str

ScheduleName = Literal[
    "coloring", "coloring-fixed", "luby", "checkerboard", "synchronous", "random-subset", "raster", "random-scan",
    "block"
]

class MrfOptions(TypedDict, total=False):
    preset: Literal["default", "paper"]
    order: int | None
    structure: float
    lattice: Literal["auto", "none"] | tuple[tuple[float, float], tuple[float, float]]
    coherence: float
    balance: float
    novelty: float
    finish: float | None
    overview: int
    levels: int | None
    reduction: int | None
    boundary: Literal["torus", "open"]
    edges: Literal["auto", "reflect", "whole"]
    phases: int
    search: Literal["auto", "exact", "coherent"]
    chance: int
    coarse_chance: int
    relaxation: Literal["icm", "gibbs"]
    bandwidth: float
    xi: float
    free_sweeps: int
    free_sites: Literal["all", "kept"]
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

class MultiresOptions(TypedDict, total=False):
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
    preset: Literal["default", "paper"]
    pyramid: Literal["steerable", "laplacian"]
    iterations: int
    match: Literal["rank", "lookup"]
    color: Literal["decorrelate", "channels"]
    start: ArrayLike | None
    levels: int | None
    edges: Literal["reflect", "wrap"]
    orientations: int

class SolidOptions(PyramidOptions, total=False):
    solids: Literal["turns", "average"]
    slices: Literal["each", "together"]

class ClassifierOptions(TypedDict, total=False):
    order: int
    levels: int
    exemplars: int
    typical: float
    smoothing: float
    coupling: float
    weight: float
    sweeps: int
    schedule: ScheduleName | Schedule
    unknown: float
    window: float

class SynthesizeKeywords(MrfOptions, total=False):
    mask: ArrayLike | Sequence[ArrayLike] | None
    known: ArrayLike | HardData | str | os.PathLike[str] | None
    guide: tuple[Any, Any] | None
    light: Literal["keep", "even"]
    method: Literal["mrf"]
    known_source: ArrayLike | None
    device: str | Machine | None
    callback: Callback | None
    channel_axis: int | None
    rng: int | np.random.Generator | None
    checkpoint: str | os.PathLike[str] | Checkpoint | None

class SynthesizeMultiresKeywords(MultiresOptions, total=False):
    light: Literal["keep", "even"]
    method: Required[Literal["multires"]]
    device: str | Machine | None
    callback: Callback | None
    channel_axis: int | None
    rng: int | np.random.Generator | None
    checkpoint: str | os.PathLike[str] | Checkpoint | None

class SynthesizePyramidKeywords(PyramidOptions, total=False):
    light: Literal["keep", "even"]
    method: Required[Literal["pyramid"]]
    device: str | Machine | None
    callback: Callback | None
    channel_axis: int | None
    rng: int | np.random.Generator | None
    checkpoint: str | os.PathLike[str] | Checkpoint | None

class SynthesizeSolidKeywords(SolidOptions, total=False):
    device: str | Machine | None
    callback: Callback | None
    channel_axis: int | None
    rng: int | np.random.Generator | None
    checkpoint: str | os.PathLike[str] | Checkpoint | None

class FillKeywords(MrfOptions, total=False):
    grow: int
    feather: int
    light: Literal["keep", "even"] | None
    sample: ArrayLike | None
    reach: int | None
    device: str | Machine | None
    callback: Callback | None
    channel_axis: int | None
    rng: int | np.random.Generator | None
    checkpoint: str | os.PathLike[str] | Checkpoint | None

class ExtendKeywords(MrfOptions, total=False):
    light: Literal["keep", "even"]
    left: int
    right: int
    top: int
    bottom: int
    seamless: bool | Literal["x", "y"]
    band: int | None
    device: str | Machine | None
    callback: Callback | None
    channel_axis: int | None
    rng: int | np.random.Generator | None
    checkpoint: str | os.PathLike[str] | Checkpoint | None

class MixKeywords(PyramidOptions, total=False):
    palette: int | None
    pattern: int | None
    average: Sequence[float] | None
    low: int | None
    high: int | None
    split: int | None
    device: str | Machine | None
    callback: Callback | None
    channel_axis: int | None
    rng: int | np.random.Generator | None
    checkpoint: str | os.PathLike[str] | Checkpoint | None

class ClassifyKeywords(ClassifierOptions, total=False):
    masks: Mapping[str, Any] | None
    validation: Mapping[str, ArrayLike | Sequence[ArrayLike]] | None
    device: str | Machine | None
    callback: Callback | None
    channel_axis: int | None
    rng: int | np.random.Generator | None
    checkpoint: str | os.PathLike[str] | Checkpoint | None

class SimulateKeywords(MrfOptions, total=False):
    mask: ArrayLike | Sequence[ArrayLike] | None
    known: ArrayLike | HardData | str | os.PathLike[str] | None
    origin: Sequence[float] | None
    cell: Sequence[float] | None
    like: Any
    several: Literal["refuse", "mean", "most"]
    outside: Literal["refuse", "skip"]
    guide: tuple[Any, Any] | None
    first: int
    shape: tuple[int, ...] | None
    region: ArrayLike | None
    probabilities: ArrayLike | HardData | str | os.PathLike[str] | None
    image_map: ArrayLike | None
    rotation: ArrayLike | None
    scale: ArrayLike | None
    jobs: int | None
    device: str | Machine | None
    callback: Callback | None
    channel_axis: int | None
    rng: int | np.random.Generator | None
    checkpoint: str | os.PathLike[str] | Checkpoint | None

class EstimateKeywords(TypedDict, total=False):
    mask: ArrayLike | Sequence[ArrayLike] | None
    known: ArrayLike | HardData | str | os.PathLike[str] | None
    origin: Sequence[float] | None
    cell: Sequence[float] | None
    like: Any
    several: Literal["refuse", "mean", "most"]
    outside: Literal["refuse", "skip"]
    shape: tuple[int, ...] | None
    categorical: bool
    nearest: int
    reach: int | None
    bandwidth: float
    device: str | Machine | None
    callback: Callback | None

class ReplayKeywords(MrfOptions, total=False):
    mask: ArrayLike | Sequence[ArrayLike] | None
    known: ArrayLike | HardData | str | os.PathLike[str] | None
    guide: tuple[Any, Any] | None
    light: Literal["keep", "even"]
    known_source: ArrayLike | None
    device: str | Machine | None
    channel_axis: int | None
    rng: int | np.random.Generator | None

@overload
def synthesize(sample: ArrayLike, shape: tuple[int, int], *, full_output: Literal[True], **options: Unpack[SynthesizeKeywords]) -> tuple[NDArray[Any], OutputWithSource]: ...
@overload
def synthesize(sample: ArrayLike, shape: tuple[int, int], *, full_output: Literal[False] = ..., **options: Unpack[SynthesizeKeywords]) -> NDArray[Any]: ...
@overload
def synthesize(sample: ArrayLike, shape: tuple[int, int], *, full_output: Literal[True], **options: Unpack[SynthesizeMultiresKeywords]) -> tuple[NDArray[Any], OutputWithSource]: ...
@overload
def synthesize(sample: ArrayLike, shape: tuple[int, int], *, full_output: Literal[False] = ..., **options: Unpack[SynthesizeMultiresKeywords]) -> NDArray[Any]: ...
@overload
def synthesize(sample: ArrayLike, shape: tuple[int, int], *, full_output: Literal[True], **options: Unpack[SynthesizePyramidKeywords]) -> tuple[NDArray[Any], Output]: ...
@overload
def synthesize(sample: ArrayLike, shape: tuple[int, int], *, full_output: Literal[False] = ..., **options: Unpack[SynthesizePyramidKeywords]) -> NDArray[Any]: ...
@overload
def synthesize_solid(sample: ArrayLike, shape: tuple[int, int, int], *, full_output: Literal[True], **options: Unpack[SynthesizeSolidKeywords]) -> tuple[NDArray[Any], Output]: ...
@overload
def synthesize_solid(sample: ArrayLike, shape: tuple[int, int, int], *, full_output: Literal[False] = ..., **options: Unpack[SynthesizeSolidKeywords]) -> NDArray[Any]: ...
@overload
def fill(image: ArrayLike, mask: ArrayLike | None = ..., *, full_output: Literal[True], **options: Unpack[FillKeywords]) -> tuple[NDArray[Any], OutputWithSource]: ...
@overload
def fill(image: ArrayLike, mask: ArrayLike | None = ..., *, full_output: Literal[False] = ..., **options: Unpack[FillKeywords]) -> NDArray[Any]: ...
@overload
def extend(image: ArrayLike, *, full_output: Literal[True], **options: Unpack[ExtendKeywords]) -> tuple[NDArray[Any], OutputWithSource]: ...
@overload
def extend(image: ArrayLike, *, full_output: Literal[False] = ..., **options: Unpack[ExtendKeywords]) -> NDArray[Any]: ...
@overload
def mix(samples: Sequence[ArrayLike], shape: tuple[int, int], *, full_output: Literal[True], **options: Unpack[MixKeywords]) -> tuple[NDArray[Any], Output]: ...
@overload
def mix(samples: Sequence[ArrayLike], shape: tuple[int, int], *, full_output: Literal[False] = ..., **options: Unpack[MixKeywords]) -> NDArray[Any]: ...
@overload
def classify(image: ArrayLike, textures: Mapping[str, ArrayLike | Sequence[ArrayLike]] | ArrayLike, *, full_output: Literal[True], **options: Unpack[ClassifyKeywords]) -> tuple[NDArray[Any], Output]: ...
@overload
def classify(image: ArrayLike, textures: Mapping[str, ArrayLike | Sequence[ArrayLike]] | ArrayLike, *, full_output: Literal[False] = ..., **options: Unpack[ClassifyKeywords]) -> NDArray[Any]: ...
@overload
def simulate(training: ArrayLike, n: int, *, source: Literal[True], **options: Unpack[SimulateKeywords]) -> xarray.Dataset: ...
@overload
def simulate(training: ArrayLike, n: int, *, source: Literal[False] = ..., **options: Unpack[SimulateKeywords]) -> xarray.DataArray: ...
def estimate(training: ArrayLike, **options: Unpack[EstimateKeywords]) -> xarray.Dataset: ...
def replay(sample: ArrayLike, shape: tuple[int, int], **options: Unpack[ReplayKeywords]) -> Replay: ...
def explain(
    sample: ArrayLike, shape: tuple[int, int], site: tuple[int, int], *, level: int = ..., sweep: int | None = ...,
    **options: Unpack[ReplayKeywords],
) -> Explanation: ...
