# SPDX-License-Identifier: BSD-3-Clause
"""The end of a step: the new values of all relaxed sites are written into the field together."""

from __future__ import annotations

from math import prod

from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.methods.mrf.lcpdf import Relaxed
from simdtex.methods.mrf.neighbourhood import Field


@Operation
def commit(machine: Launcher | None, field: Field, sites: Array, relaxed: Relaxed, cooled: Array) -> Field:
    """Write the new values and temperatures of sites into the field, in place, and return it."""
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
