# SPDX-License-Identifier: BSD-3-Clause
# ruff: noqa: E501
# fmt: off
"""The types of the public names for editors and type checkers; ``python docs/stubs.py`` writes this file."""

import os
from collections.abc import Mapping, Sequence
from typing import Any, Literal, TypedDict, Unpack, overload

import dask.array
import xarray
from numpy.typing import ArrayLike, NDArray

from simdtex.checkpoint import Checkpoint as Checkpoint
from simdtex.driver import Device, Kept, Seed
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
from simdtex.jobs.tiles.job import TileStore as TileStore
from simdtex.jobs.tilesets.job import tileset as tileset
from simdtex.jobs.why.replay import Replay
from simdtex.live.widget import Live as Live
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
    scores: bool
    shares: tuple[float, ...] | list[float] | None
    proportions: tuple[float, ...] | list[float] | None
    share_spread: float
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

class ClassificationOptions(TypedDict, total=False):
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

@overload
def synthesize(sample: ArrayLike | Sequence[ArrayLike], shape: tuple[int, int], *, full_output: Literal[True], method: Literal["mrf"] = ..., mask: ArrayLike | Sequence[ArrayLike] | None = ..., known: ArrayLike | HardData | str | os.PathLike[str] | None = ..., known_source: ArrayLike | None = ..., guide: tuple[Any, Any] | None = ..., light: Literal["keep", "even"] = ..., channel_axis: int | None = ..., rng: Seed = ..., device: Device = ..., callback: Callback | None = ..., checkpoint: Kept = ..., store: None = ..., **options: Unpack[MrfOptions]) -> tuple[NDArray[Any], OutputWithSource]: ...
@overload
def synthesize(sample: ArrayLike | Sequence[ArrayLike], shape: tuple[int, int], *, full_output: Literal[False] = ..., method: Literal["mrf"] = ..., mask: ArrayLike | Sequence[ArrayLike] | None = ..., known: ArrayLike | HardData | str | os.PathLike[str] | None = ..., known_source: ArrayLike | None = ..., guide: tuple[Any, Any] | None = ..., light: Literal["keep", "even"] = ..., channel_axis: int | None = ..., rng: Seed = ..., device: Device = ..., callback: Callback | None = ..., checkpoint: Kept = ..., store: None = ..., **options: Unpack[MrfOptions]) -> NDArray[Any]: ...
@overload
def synthesize(sample: ArrayLike | Sequence[ArrayLike], shape: tuple[int, int], *, method: Literal["mrf"] = ..., mask: ArrayLike | Sequence[ArrayLike] | None = ..., known: ArrayLike | HardData | str | os.PathLike[str] | None = ..., known_source: ArrayLike | None = ..., guide: tuple[Any, Any] | None = ..., light: Literal["keep", "even"] = ..., channel_axis: int | None = ..., rng: Seed = ..., device: Device = ..., callback: Callback | None = ..., checkpoint: None = ..., store: TileStore, full_output: Literal[False] = ..., **options: Unpack[MrfOptions]) -> dask.array.Array: ...
@overload
def synthesize(sample: ArrayLike | Sequence[ArrayLike], shape: tuple[int, int], *, full_output: Literal[True], method: Literal["multires"], light: Literal["keep", "even"] = ..., channel_axis: int | None = ..., rng: Seed = ..., device: Device = ..., callback: Callback | None = ..., checkpoint: Kept = ..., **options: Unpack[MultiresOptions]) -> tuple[NDArray[Any], OutputWithSource]: ...
@overload
def synthesize(sample: ArrayLike | Sequence[ArrayLike], shape: tuple[int, int], *, full_output: Literal[False] = ..., method: Literal["multires"], light: Literal["keep", "even"] = ..., channel_axis: int | None = ..., rng: Seed = ..., device: Device = ..., callback: Callback | None = ..., checkpoint: Kept = ..., **options: Unpack[MultiresOptions]) -> NDArray[Any]: ...
@overload
def synthesize(sample: ArrayLike | Sequence[ArrayLike], shape: tuple[int, int], *, full_output: Literal[True], method: Literal["pyramid"], light: Literal["keep", "even"] = ..., channel_axis: int | None = ..., rng: Seed = ..., device: Device = ..., callback: Callback | None = ..., checkpoint: Kept = ..., **options: Unpack[PyramidOptions]) -> tuple[NDArray[Any], Output]: ...
@overload
def synthesize(sample: ArrayLike | Sequence[ArrayLike], shape: tuple[int, int], *, full_output: Literal[False] = ..., method: Literal["pyramid"], light: Literal["keep", "even"] = ..., channel_axis: int | None = ..., rng: Seed = ..., device: Device = ..., callback: Callback | None = ..., checkpoint: Kept = ..., **options: Unpack[PyramidOptions]) -> NDArray[Any]: ...
@overload
def synthesize_solid(sample: ArrayLike, shape: tuple[int, int, int], *, full_output: Literal[True], channel_axis: int | None = ..., rng: Seed = ..., device: Device = ..., callback: Callback | None = ..., checkpoint: Kept = ..., **options: Unpack[SolidOptions]) -> tuple[NDArray[Any], Output]: ...
@overload
def synthesize_solid(sample: ArrayLike, shape: tuple[int, int, int], *, full_output: Literal[False] = ..., channel_axis: int | None = ..., rng: Seed = ..., device: Device = ..., callback: Callback | None = ..., checkpoint: Kept = ..., **options: Unpack[SolidOptions]) -> NDArray[Any]: ...
@overload
def fill(image: ArrayLike, mask: ArrayLike | None = ..., *, full_output: Literal[True], grow: int = ..., feather: int = ..., light: Literal["keep", "even"] | None = ..., sample: ArrayLike | Sequence[ArrayLike] | None = ..., reach: int | None = ..., channel_axis: int | None = ..., rng: Seed = ..., device: Device = ..., callback: Callback | None = ..., checkpoint: Kept = ..., **options: Unpack[MrfOptions]) -> tuple[NDArray[Any], OutputWithSource]: ...
@overload
def fill(image: ArrayLike, mask: ArrayLike | None = ..., *, full_output: Literal[False] = ..., grow: int = ..., feather: int = ..., light: Literal["keep", "even"] | None = ..., sample: ArrayLike | Sequence[ArrayLike] | None = ..., reach: int | None = ..., channel_axis: int | None = ..., rng: Seed = ..., device: Device = ..., callback: Callback | None = ..., checkpoint: Kept = ..., **options: Unpack[MrfOptions]) -> NDArray[Any]: ...
@overload
def extend(image: ArrayLike, *, full_output: Literal[True], left: int = ..., right: int = ..., top: int = ..., bottom: int = ..., seamless: bool | Literal["x", "y"] = ..., band: int | None = ..., light: Literal["keep", "even"] = ..., channel_axis: int | None = ..., rng: Seed = ..., device: Device = ..., callback: Callback | None = ..., checkpoint: Kept = ..., **options: Unpack[MrfOptions]) -> tuple[NDArray[Any], OutputWithSource]: ...
@overload
def extend(image: ArrayLike, *, full_output: Literal[False] = ..., left: int = ..., right: int = ..., top: int = ..., bottom: int = ..., seamless: bool | Literal["x", "y"] = ..., band: int | None = ..., light: Literal["keep", "even"] = ..., channel_axis: int | None = ..., rng: Seed = ..., device: Device = ..., callback: Callback | None = ..., checkpoint: Kept = ..., **options: Unpack[MrfOptions]) -> NDArray[Any]: ...
@overload
def mix(samples: Sequence[ArrayLike], shape: tuple[int, int], *, full_output: Literal[True], palette: int | None = ..., pattern: int | None = ..., average: Sequence[float] | None = ..., low: int | None = ..., high: int | None = ..., split: int | None = ..., channel_axis: int | None = ..., rng: Seed = ..., device: Device = ..., callback: Callback | None = ..., checkpoint: Kept = ..., **options: Unpack[PyramidOptions]) -> tuple[NDArray[Any], Output]: ...
@overload
def mix(samples: Sequence[ArrayLike], shape: tuple[int, int], *, full_output: Literal[False] = ..., palette: int | None = ..., pattern: int | None = ..., average: Sequence[float] | None = ..., low: int | None = ..., high: int | None = ..., split: int | None = ..., channel_axis: int | None = ..., rng: Seed = ..., device: Device = ..., callback: Callback | None = ..., checkpoint: Kept = ..., **options: Unpack[PyramidOptions]) -> NDArray[Any]: ...
@overload
def classify(image: ArrayLike, textures: Mapping[str, ArrayLike | Sequence[ArrayLike]] | ArrayLike, *, full_output: Literal[True], masks: Mapping[str, Any] | None = ..., validation: Mapping[str, ArrayLike | Sequence[ArrayLike]] | None = ..., channel_axis: int | None = ..., rng: Seed = ..., device: Device = ..., callback: Callback | None = ..., checkpoint: Kept = ..., **options: Unpack[ClassificationOptions]) -> tuple[NDArray[Any], Output]: ...
@overload
def classify(image: ArrayLike, textures: Mapping[str, ArrayLike | Sequence[ArrayLike]] | ArrayLike, *, full_output: Literal[False] = ..., masks: Mapping[str, Any] | None = ..., validation: Mapping[str, ArrayLike | Sequence[ArrayLike]] | None = ..., channel_axis: int | None = ..., rng: Seed = ..., device: Device = ..., callback: Callback | None = ..., checkpoint: Kept = ..., **options: Unpack[ClassificationOptions]) -> NDArray[Any]: ...
@overload
def simulate(training: ArrayLike | Sequence[ArrayLike], n: int, *, source: Literal[True], mask: ArrayLike | Sequence[ArrayLike] | None = ..., known: ArrayLike | HardData | str | os.PathLike[str] | None = ..., origin: Sequence[float] | None = ..., cell: Sequence[float] | None = ..., like: Any = ..., several: Literal["refuse", "mean", "most"] = ..., outside: Literal["refuse", "skip"] = ..., guide: tuple[Any, Any] | None = ..., first: int = ..., shape: tuple[int, ...] | None = ..., region: ArrayLike | None = ..., probabilities: ArrayLike | HardData | str | os.PathLike[str] | None = ..., image_map: ArrayLike | None = ..., rotation: ArrayLike | None = ..., scale: ArrayLike | None = ..., jobs: int | None = ..., channel_axis: int | None = ..., rng: Seed = ..., device: Device = ..., callback: Callback | None = ..., checkpoint: Kept = ..., **options: Unpack[MrfOptions]) -> xarray.Dataset: ...
@overload
def simulate(training: ArrayLike | Sequence[ArrayLike], n: int, *, source: Literal[False] = ..., mask: ArrayLike | Sequence[ArrayLike] | None = ..., known: ArrayLike | HardData | str | os.PathLike[str] | None = ..., origin: Sequence[float] | None = ..., cell: Sequence[float] | None = ..., like: Any = ..., several: Literal["refuse", "mean", "most"] = ..., outside: Literal["refuse", "skip"] = ..., guide: tuple[Any, Any] | None = ..., first: int = ..., shape: tuple[int, ...] | None = ..., region: ArrayLike | None = ..., probabilities: ArrayLike | HardData | str | os.PathLike[str] | None = ..., image_map: ArrayLike | None = ..., rotation: ArrayLike | None = ..., scale: ArrayLike | None = ..., jobs: int | None = ..., channel_axis: int | None = ..., rng: Seed = ..., device: Device = ..., callback: Callback | None = ..., checkpoint: Kept = ..., **options: Unpack[MrfOptions]) -> xarray.DataArray: ...
def estimate(training: ArrayLike | Sequence[ArrayLike], *, mask: ArrayLike | Sequence[ArrayLike] | None = ..., known: ArrayLike | HardData | str | os.PathLike[str] | None = ..., origin: Sequence[float] | None = ..., cell: Sequence[float] | None = ..., like: Any = ..., several: Literal["refuse", "mean", "most"] = ..., outside: Literal["refuse", "skip"] = ..., shape: tuple[int, ...] | None = ..., categorical: bool = ..., nearest: int = ..., reach: int | None = ..., bandwidth: float = ..., device: Device = ..., callback: Callback | None = ...) -> xarray.Dataset: ...
def explain(sample: ArrayLike | Sequence[ArrayLike], shape: tuple[int, int], site: tuple[int, int], *, level: int = ..., sweep: int | None = ..., mask: ArrayLike | Sequence[ArrayLike] | None = ..., known: ArrayLike | HardData | str | os.PathLike[str] | None = ..., known_source: ArrayLike | None = ..., guide: tuple[Any, Any] | None = ..., light: Literal["keep", "even"] = ..., channel_axis: int | None = ..., rng: Seed = ..., device: Device = ..., **options: Unpack[MrfOptions]) -> Explanation: ...
def replay(sample: ArrayLike | Sequence[ArrayLike], shape: tuple[int, int], *, mask: ArrayLike | Sequence[ArrayLike] | None = ..., known: ArrayLike | HardData | str | os.PathLike[str] | None = ..., known_source: ArrayLike | None = ..., guide: tuple[Any, Any] | None = ..., light: Literal["keep", "even"] = ..., channel_axis: int | None = ..., rng: Seed = ..., device: Device = ..., **options: Unpack[MrfOptions]) -> Replay: ...
