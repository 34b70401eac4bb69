# SPDX-License-Identifier: BSD-3-Clause
"""Figures of merit of an output: the public name of `simdtex.experiments.quality`."""

from simdtex.experiments.quality import *  # noqa: F403 - every public name, and no other
from simdtex.experiments.quality import __all__ as __all__
