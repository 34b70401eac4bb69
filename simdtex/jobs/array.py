# SPDX-License-Identifier: BSD-3-Clause
"""Synthesis on the processor array of 1998, `simdtex.maspar.synthesize`: the paper's program with its options."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex.checkpoint import Checkpointing
from simdtex.driver import check_shape, execute
from simdtex.jobs.inputs import check_inputs
from simdtex.machine import Machine
from simdtex.maspar.algorithm import Level, Problem, Program, Step
from simdtex.maspar.array import MAPPINGS, parse_array
from simdtex.maspar.machine import MP1
from simdtex.methods import mrf
from simdtex.methods.mrf.level import Lattices
from simdtex.methods.mrf.plan import plan
from simdtex.methods.mrf.record import expected_work, fraction_done
from simdtex.options import one_of, resolve
from simdtex.run import Callback, Output, Progress, Stage

MEMORY = {"16K": 2**14, "64K": 2**16}
"""Bytes of memory of a PE, in the two sizes that were sold."""

EXECUTED = ("order", "levels", "boundary", "bandwidth", "xi", "pixel", "phases", "edges", "overview")
"""The options that the program executes; all others have their values of the preset ``paper``."""


def problem(run: Lattices) -> Problem:
    """Return the input of the program."""
    source = run.sample.places(np.zeros((1, 2), np.int32), 1).positions
    first = np.concatenate([source[None], run.sample.working[:, source].astype(np.int32)])
    xi = min(-1, round(run.options.xi * 1024))
    return Problem(first, run.offsets, run.options.order, xi, run.seed)


def level(run: Lattices, number: int) -> Level:
    """Return the constants of a level of the program."""
    places, working = run.places(number), run.sample.working.astype(np.float32)
    source = places.positions
    around = np.moveaxis(working[:, places.reach[:, None] + source], 1, 0)
    return Level(number, run.grid(number), run.choice(number), source, working[:, source], around)
