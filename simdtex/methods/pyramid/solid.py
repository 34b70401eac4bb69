# SPDX-License-Identifier: BSD-3-Clause
"""Solid textures: section 4 of Heeger and Bergen (1995).

The program is that of `simdtex.methods.pyramid.algorithm`; only the pyramids differ. The 3-D Laplacian pyramid of a
block is matched with a 2-D Laplacian pyramid of the sample, and the steerable pyramids of all slices with that of the
sample.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from math import prod
from typing import Any

from numpy.typing import NDArray

from simdtex.machine import Machine, memory
from simdtex.machine.interface import Array
from simdtex.methods.pyramid import options as pyramid
from simdtex.methods.pyramid.algorithm import (
    VALUES,
    PyramidRun,
    analyse,
    check_memory,
    match_subbands,
    number_of_levels,
    transform,
)
from simdtex.methods.pyramid.matcher import Matcher, Wanted
from simdtex.methods.pyramid.operations_solid import solid_band, solid_collapse, solid_mean, solid_reduce, solid_turn
from simdtex.options import Choice, documented, option, within_32_bits

FAMILIES = {"x-y": ((0, 1, 2), (0, 1, 2)), "x-z": ((1, 0, 2), (1, 0, 2)), "y-z": ((2, 0, 1), (1, 2, 0))}
"""Slices by name: the axes in the order slice, row, column, and the order that reverses this."""


MEMORY = 240
"""The most bytes per voxel on the device (benchmarks/memory.py)."""


@documented
@dataclass(frozen=True)
class Options(pyramid.Options):
    """The options of solid textures: those of the method ``pyramid``, and two more."""

    solids: str = option(
        "turns",
        Choice(("turns", "average")),
        "Match the families of slices one after another (turns), or match each in the same block and average the "
        "blocks (average)",
        more='This matters with ``pyramid="steerable"``: the Laplacian pyramid of the block comes first.',
        paper="average",
        group="Appearance",
    )
    slices: str = option(
        "together",
        Choice(("each", "together")),
        "Match the histograms of a family's slices together (together), or of each slice separately (each)",
        paper="each",
        group="Appearance",
    )


@dataclass(frozen=True)
class SolidPlan:
    """A solid texture, (depth, rows, cols), before it has a machine and a seed."""

    sample: NDArray[Any]
    shape: tuple[int, int, int]
    options: Options

    def on(self, machine: Machine, seed: int) -> PyramidRun:
        """Return the run on a machine, with the sample analysed; raise if the memory does not suffice.

        Cost: 5000 multiply-adds and 25 sorted values for every voxel, channel and iteration, with four orientations.
        """
        sample, shape, options = self.sample, self.shape, self.options
        within_32_bits(shape, max(VALUES, sample.shape[-1]))
        memory.require(machine, prod(shape) * MEMORY)  # before any work
        levels, oriented = number_of_levels(options, *shape, *sample.shape[:2]), options.pyramid == "steerable"
        wrap = options.edges == "wrap"
        flat = transform(machine, replace(options, pyramid="laplacian"), levels, wrap)
        steerable = [transform(machine, options, levels, wrap)] if oriented else []
        texture = analyse(machine, sample, options, flat, *steerable)
        check_memory(machine, shape, texture, MEMORY)
        slices = transform(machine, options, levels, torus=True)

        def turn(block: Array, wanted: list[Wanted], matcher: Matcher, tell: Callable[[float], None]) -> Array:
            block, of_block, of_slices = block.reshape(shape), wanted[: levels + 1], wanted[levels + 1 :]
            solids = [_matched_block(machine, block, of_block, matcher)]
            for index, (name, (axes, back)) in enumerate(FAMILIES.items() if oriented else ()):
                machine.sync()
                tell((1 + index) / (1 + len(FAMILIES)))
                before = solids[-1] if options.solids == "turns" else block
                synthesis_pyr = slices.make(solid_turn(machine, before, axes))
                names = [f"{name} {band}" for band in slices.names]
                matched = match_subbands(matcher, names, synthesis_pyr, of_slices, options.slices == "together")
                solids.append(solid_turn(machine, slices.collapse(matched), back))
                if options.solids == "turns":
                    del solids[0]
            return solid_mean(machine, solids) if len(solids) > 1 else solids[0]

        return PyramidRun(machine, texture, shape, turn, options, levels, seed)


def _matched_block(machine: Machine, block: Array, wanted: list[Wanted], matcher: Matcher) -> Array:
    """Return a block with its 3-D Laplacian pyramid matched and collapsed."""
    gaussian = [block]
    while len(gaussian) < len(wanted):
        gaussian.append(solid_reduce(machine, gaussian[-1]))
    bands = [solid_band(machine, fine, coarse) for fine, coarse in pairwise(gaussian)]
    names = [*(f"solid level {level}" for level in range(len(bands))), "solid low"]
    synthesis_pyr = [band.reshape((1, 1, *band.shape)) for band in [*bands, gaussian[-1]]]
    matched = match_subbands(matcher, names, synthesis_pyr, wanted)
    *fine, collapsed = (band.reshape(band.shape[2:]) for band in matched)
    for band in reversed(fine):
        collapsed = solid_collapse(machine, band, collapsed)
    return collapsed
