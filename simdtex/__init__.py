# SPDX-License-Identifier: BSD-3-Clause
"""Texture synthesis from samples, by parallel relaxation on any OpenCL device."""

from __future__ import annotations

TYPE_CHECKING = False  # as type checkers know it by this name, without what importing typing takes
if TYPE_CHECKING:
    from typing import Any

    from simdtex.checkpoint import Checkpoint
    from simdtex.experiments import quality
    from simdtex.io.grids import read_grid, write_grid
    from simdtex.io.hard_data import place_hard_data, read_hard_data
    from simdtex.jobs.classification import TextureClassifier, classify
    from simdtex.jobs.estimation import estimate
    from simdtex.jobs.filling import extend, fill
    from simdtex.jobs.simulation import simulate
    from simdtex.live.widget import Live
    from simdtex.machine import open_machine
    from simdtex.machine.devices import DeviceError, devices
    from simdtex.methods.pyramid.mixtures import mix
    from simdtex.run import Output, Progress
    from simdtex.synthesis import explain, lcpdf, replay, synthesize, synthesize_solid

    __version__: str

__all__ = [
    "Checkpoint",
    "DeviceError",
    "Live",
    "Output",
    "Progress",
    "TextureClassifier",
    "classify",
    "devices",
    "estimate",
    "explain",
    "extend",
    "fill",
    "lcpdf",
    "mix",
    "open_machine",
    "place_hard_data",
    "quality",
    "read_grid",
    "read_hard_data",
    "replay",
    "simulate",
    "synthesize",
    "synthesize_solid",
    "write_grid",
]

_HOMES = {
    "Checkpoint": "simdtex.checkpoint",
    "DeviceError": "simdtex.machine.devices",
    "Live": "simdtex.live.widget",
    "Output": "simdtex.run",
    "Progress": "simdtex.run",
    "TextureClassifier": "simdtex.jobs.classification",
    "classify": "simdtex.jobs.classification",
    "devices": "simdtex.machine.devices",
    "estimate": "simdtex.jobs.estimation",
    "explain": "simdtex.synthesis",
    "extend": "simdtex.jobs.filling",
    "fill": "simdtex.jobs.filling",
    "lcpdf": "simdtex.synthesis",
    "mix": "simdtex.methods.pyramid.mixtures",
    "open_machine": "simdtex.machine",
    "place_hard_data": "simdtex.io.hard_data",
    "read_grid": "simdtex.io.grids",
    "read_hard_data": "simdtex.io.hard_data",
    "replay": "simdtex.synthesis",
    "simulate": "simdtex.jobs.simulation",
    "synthesize": "simdtex.synthesis",
    "synthesize_solid": "simdtex.synthesis",
    "write_grid": "simdtex.io.grids",
}
"""Where the public names live; each is loaded when it is asked for first, so that the command line starts at once."""

_MODULES = {"quality": "simdtex.experiments.quality"}
"""The public names that are modules themselves."""


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        found: Any = version("simdtex")
    elif name in _HOMES or name in _MODULES:
        from importlib import import_module

        found = getattr(import_module(_HOMES[name]), name) if name in _HOMES else import_module(_MODULES[name])
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = found  # the next time it is found without this function
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, "__version__"})
