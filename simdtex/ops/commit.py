# SPDX-License-Identifier: BSD-3-Clause
"""The end of a step: the new values of the sites that have relaxed go into the field, all at once."""

from __future__ import annotations

from math import prod

from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.ops.lcpdf import Relaxed
from simdtex.ops.neighbourhood import Field


@Operation
def commit(machine: Launcher | None, field: Field, sites: Array, relaxed: Relaxed, cooled: Array) -> Field:
    """Write what sites have become into the field, in place."""
    channels = len(relaxed.values)
    if machine is None:
        field.values.reshape(len(field.values), -1)[:channels, sites] = relaxed.values
        field.source.ravel()[sites] = relaxed.choice
        field.temperature.ravel()[sites] = cooled
        return field
    machine.launch(
        "commit",
        (sites.size,),
        *(sites, sites.size, channels, prod(field.values.shape[1:])),
        *(relaxed.values, relaxed.choice, cooled, *field),
    )
    return field
