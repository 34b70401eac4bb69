# SPDX-License-Identifier: BSD-3-Clause
"""Texture synthesis from samples, by parallel relaxation on any OpenCL device."""

from __future__ import annotations

_NAMES = {
    "simdtex.checkpoint": ("Checkpoint",),
    "simdtex.io.grids": ("read_grid", "write_grid"),
    "simdtex.io.hard_data": ("place_hard_data", "read_hard_data"),
    "simdtex.jobs.classification.job": ("TextureClassifier", "classify"),
    "simdtex.jobs.filling.job": ("extend", "fill"),
    "simdtex.jobs.mixes.job": ("mix", "synthesize_solid"),
    "simdtex.jobs.simulation": ("ensemble",),
    "simdtex.jobs.simulation.job": ("estimate", "simulate"),
    "simdtex.jobs.studies": ("quality",),
    "simdtex.jobs.synthesis.job": ("lcpdf", "synthesize"),
    "simdtex.jobs.tiles.job": ("TileStore",),
    "simdtex.jobs.tilesets.job": ("tileset",),
    "simdtex.jobs.why.job": ("explain", "replay"),
    "simdtex.live.widget": ("Live",),
    "simdtex.machine": ("open_machine",),
    "simdtex.machine.devices": ("DeviceError", "devices"),
    "simdtex.figures.show": ("show",),
    "simdtex.run": ("Output", "Progress"),
}
"""The public names by their modules, each of which is loaded at its first use, so that the command line starts fast."""

_MODULES = ("ensemble", "quality")
"""The public names that are modules."""

_WORDS = {
    "fill": ("inpaint", "heal"),
    "extend": ("tile", "seamless", "expand", "outpaint"),
    "synthesize": ("synth", "generate", "texture"),
    "read_hard_data": ("read_csv", "read_table"),
}
"""Words of other programs for functions, by ours."""

__all__ = sorted(name for names in _NAMES.values() for name in names)


def __getattr__(name: str) -> object:
    home = next((home for home, names in _NAMES.items() if name in names), None)
    if name == "__version__":
        from importlib.metadata import version

        value: object = version("simdtex")
    elif home:
        from importlib import import_module

        value = import_module(f"{home}.{name}") if name in _MODULES else getattr(import_module(home), name)
    else:
        from difflib import get_close_matches

        near = [ours for ours, theirs in _WORDS.items() if name in theirs] or get_close_matches(name, __all__, 1)
        meant = f"; did you mean {near[0]!r}?" if near else ""
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}{meant}")
    globals()[name] = value  # the next time it is found without this function
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, "__version__"})
