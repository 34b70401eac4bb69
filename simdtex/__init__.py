# SPDX-License-Identifier: BSD-3-Clause
"""More of a texture from a sample of it, by parallel relaxation on any OpenCL device."""

from importlib.metadata import version

from simdtex.machine import open_machine
from simdtex.machine.devices import DeviceError, devices
from simdtex.methods.pyramid.mixtures import mix
from simdtex.run import Output, Progress
from simdtex.synthesis import lcpdf, suggest_alpha, synthesize, synthesize_solid

__version__ = version("simdtex")

__all__ = [
    "DeviceError",
    "Output",
    "Progress",
    "devices",
    "lcpdf",
    "mix",
    "open_machine",
    "suggest_alpha",
    "synthesize",
    "synthesize_solid",
]
