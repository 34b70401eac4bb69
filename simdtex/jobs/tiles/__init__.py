# SPDX-License-Identifier: BSD-3-Clause
"""Outputs larger than one machine: in tiles, by any number of workers, with the bytes of an output without tiles.

The extra ``distributed`` brings the libraries: ``pip install 'simdtex[distributed]'``.
"""

from simdtex.jobs.tiles.job import finished, plan, resume, synthesize
from simdtex.jobs.tiles.layout import Layout

__all__ = ["Layout", "finished", "plan", "resume", "synthesize"]
