# SPDX-License-Identifier: BSD-3-Clause
"""A plan as a tree of plain arrays and numbers, from which a worker or a later process restores the plan."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex import schedules
from simdtex.methods.mrf.options import Options
from simdtex.methods.mrf.plan import Plan
from simdtex.model.guide import Planes
from simdtex.model.lattice import neighbourhood_offsets
from simdtex.model.pictures import Pictures
from simdtex.model.regularity import Lattice, Phases
from simdtex.model.sample import Sample
from simdtex.model.scale import Scale
from simdtex.options import resolve


@dataclass(frozen=True)
class Ready:
    """The planes of a guide for the sample, in working levels (G, rows, cols) for each picture."""

    samples: list[NDArray[np.uint16]]

    @property
    def channels(self) -> int:
        """Number of planes."""
        return len(self.samples[0])

    def planes(self, scale: Scale, spread: float, top: int) -> Planes:
        """Return the planes unchanged, and no planes of the output."""
        return Planes(self.samples, np.zeros((self.channels, 1, 1), np.uint16))


def described(plan: Plan) -> dict[str, Any]:
    """Return a plan as a tree for `simdtex.checkpoint.pack`, without conditioning data of the output."""
    pictures = plan.sample.pictures
    arrays = {"pixels": pictures.pixels, "unknown": pictures.unknown, "usable": pictures.usable}
    sample = {"layout": plan.sample.layout, "guides": list(plan.sample.guided), "phases": plan.sample.phases}
    return {"shape": plan.shape, "levels": plan.levels, "options": asdict(plan.options), **arrays, **sample}


def restored(tree: dict[str, Any]) -> Plan:
    """Return the plan of a tree from `described`, without conditioning data of the output."""
    options = resolve(Options, "synth", tree["options"])
    unknown, usable = ((one and tuple(one)) for one in (tree["unknown"], tree["usable"]))
    pictures = options.of(Pictures(tuple(tree["pixels"]), unknown, usable))
    guides = [Ready(tree["guides"])] if tree["guides"] else []
    phases = tree["phases"] and Phases(tuple(Lattice(*one) for one in tree["phases"][0]), Lattice(*tree["phases"][1]))
    sample = Sample(pictures, **tree["layout"], guides=guides, phases=phases)
    schedule, offsets = schedules.get(options.schedule), neighbourhood_offsets(options.order)
    return Plan(sample, tuple(tree["shape"]), offsets, options, schedule, tree["levels"])
