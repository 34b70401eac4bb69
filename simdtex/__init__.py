# SPDX-License-Identifier: BSD-3-Clause
"""Texture synthesis from samples, by parallel relaxation on any OpenCL device."""

from __future__ import annotations

TYPE_CHECKING = False  # as type checkers know it by this name, without what importing typing takes
if TYPE_CHECKING:
    from typing import Any

    from simdtex.checkpoint import Checkpoint as Checkpoint
    from simdtex.experiments import quality as quality
    from simdtex.io.grids import read_grid as read_grid
    from simdtex.io.grids import write_grid as write_grid
    from simdtex.io.hard_data import place_hard_data as place_hard_data
    from simdtex.io.hard_data import read_hard_data as read_hard_data
    from simdtex.jobs.classification import TextureClassifier as TextureClassifier
    from simdtex.jobs.classification import classify as classify
    from simdtex.jobs.estimation import estimate as estimate
    from simdtex.jobs.filling import extend as extend
    from simdtex.jobs.filling import fill as fill
    from simdtex.jobs.simulation import simulate as simulate
    from simdtex.live.widget import Live as Live
    from simdtex.machine import open_machine as open_machine
    from simdtex.machine.devices import DeviceError as DeviceError
    from simdtex.machine.devices import devices as devices
    from simdtex.methods.pyramid.mixtures import mix as mix
    from simdtex.model.show import show as show
    from simdtex.run import Output as Output
    from simdtex.run import Progress as Progress
    from simdtex.synthesis import explain as explain
    from simdtex.synthesis import lcpdf as lcpdf
    from simdtex.synthesis import replay as replay
    from simdtex.synthesis import synthesize as synthesize
    from simdtex.synthesis import synthesize_solid as synthesize_solid

    __version__: str

_NAMES = {
    "simdtex.checkpoint": ("Checkpoint",),
    "simdtex.experiments": ("quality",),
    "simdtex.io.grids": ("read_grid", "write_grid"),
    "simdtex.io.hard_data": ("place_hard_data", "read_hard_data"),
    "simdtex.jobs.classification": ("TextureClassifier", "classify"),
    "simdtex.jobs.estimation": ("estimate",),
    "simdtex.jobs.filling": ("extend", "fill"),
    "simdtex.jobs.simulation": ("simulate",),
    "simdtex.live.widget": ("Live",),
    "simdtex.machine": ("open_machine",),
    "simdtex.machine.devices": ("DeviceError", "devices"),
    "simdtex.methods.pyramid.mixtures": ("mix",),
    "simdtex.model.show": ("show",),
    "simdtex.run": ("Output", "Progress"),
    "simdtex.synthesis": ("explain", "lcpdf", "replay", "synthesize", "synthesize_solid"),
}
"""The public names by their modules, each of which is loaded at its first use, so that the command line starts fast."""

_WORDS = {
    "fill": ("inpaint", "heal"),
    "extend": ("tile", "seamless", "expand", "outpaint"),
    "synthesize": ("synth", "generate", "texture"),
    "read_hard_data": ("read_csv", "read_table"),
}
"""Words of other programs for functions, by ours."""

__all__ = sorted(name for names in _NAMES.values() for name in names)


def __getattr__(name: str) -> Any:
    home = next((home for home, names in _NAMES.items() if name in names), None)
    if name == "__version__":
        from importlib.metadata import version

        found: Any = version("simdtex")
    elif home:
        from importlib import import_module

        found = import_module(f"{home}.{name}") if name == "quality" else getattr(import_module(home), name)
    else:
        from difflib import get_close_matches

        near = [ours for ours, theirs in _WORDS.items() if name in theirs] or get_close_matches(name, __all__, 1)
        meant = f"; did you mean {near[0]!r}?" if near else ""
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}{meant}")
    globals()[name] = found  # the next time it is found without this function
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, "__version__"})
