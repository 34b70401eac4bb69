# SPDX-License-Identifier: BSD-3-Clause
"""The end of a step: what the relaxed sites have become goes into the field, all at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.ops.lcpdf import Relaxed
from simdtex.ops.neighbourhood import Field


def _reference(field: Field, sites: NDArray[np.int32], relaxed: Relaxed, cooled: NDArray[np.uint16]) -> Field:
    made = len(relaxed.values)
    field.values.reshape(len(field.values), -1)[:made, sites] = relaxed.values
    field.source.ravel()[sites] = relaxed.choice
    field.temperature.ravel()[sites] = cooled
    return field


def _launch(machine: Launcher, field: Field, sites: Array, relaxed: Relaxed, cooled: Array) -> Field:
    (channels, _), (_, height, width) = relaxed.values.shape, field.values.shape
    machine.launch(
        machine.kernel("commit", "commit"),
        (sites.size,),
        *(sites, np.int32(sites.size), np.int32(channels), np.int32(height * width)),
        *(relaxed.values, relaxed.choice, cooled, *field),
    )
    return field


commit = Operation("commit", _reference, _launch)
