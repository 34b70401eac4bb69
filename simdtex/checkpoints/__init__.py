# SPDX-License-Identifier: BSD-3-Clause
"""Runs that can be stopped and gone on with: `checkpoint`, and what methods are handed to keep their state in."""

from simdtex.checkpoints.keep import NOTHING, Keep
from simdtex.checkpoints.keeper import Keeper, checkpoint

__all__ = ["NOTHING", "Keep", "Keeper", "checkpoint"]
