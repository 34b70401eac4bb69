# SPDX-License-Identifier: BSD-3-Clause
"""A plan as plain arrays and JSON, so that a worker, or a later process, lays out the same run."""

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
from simdtex.model.sample import Sample
from simdtex.model.scale import Scale


@dataclass(frozen=True)
class Ready:
    """The sample's side of a guide, in working levels (G, rows, cols) for each picture."""

    samples: list[NDArray[np.uint16]]

    @property
    def channels(self) -> int:
        """Number of planes."""
        return len(self.samples[0])

    def planes(self, scale: Scale, spread: float, top: int) -> Planes:
        """Return them as they are, and nothing of the output."""
        return Planes(self.samples, np.zeros((self.channels, 1, 1), np.uint16))


def described(plan: Plan) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Return what `restored` needs: JSON, and arrays by name. Conditioning data of the output are not part of it."""
    pictures = plan.sample.pictures
    text = {
        **{"shape": list(plan.shape), "levels": plan.levels, "pictures": len(pictures.pixels)},
        **{"options": asdict(plan.options), "layout": plan.sample.layout},
    }
    parts = {"pixels": pictures.pixels, "unknown": pictures.unknown, "usable": pictures.usable}
    arrays = {f"{name}{k}": one for name, those in parts.items() for k, one in enumerate(those or ())}
    return text, arrays | {f"guide{k}": one for k, one in enumerate(plan.sample.guided)}


def restored(text: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> Plan:
    """Return the plan that was described, without conditioning data of the output."""
    chosen: dict[str, Any] = {
        name: tuple(one) if isinstance(one, list) else one for name, one in text["options"].items()
    }
    options = Options(**chosen)

    def those(name: str) -> tuple[NDArray[Any], ...] | None:
        return tuple(arrays[f"{name}{k}"] for k in range(text["pictures"])) if f"{name}0" in arrays else None

    pixels, guided = those("pixels"), those("guide")
    assert pixels is not None
    pictures = options.of(Pictures(pixels, those("unknown"), those("usable")))
    sample = Sample(pictures, **text["layout"], guides=[Ready(list(guided))] if guided else [])
    shape, offsets = (text["shape"][0], text["shape"][1]), neighbourhood_offsets(options.order)
    return Plan(sample, shape, offsets, options, schedules.get(options.schedule), text["levels"])
