# SPDX-License-Identifier: BSD-3-Clause
"""A run's outline as plain arrays and JSON, so that a worker, or a later process, lays out the same run."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex import schedules
from simdtex.methods.mrf.options import Options
from simdtex.methods.mrf.outline import Kit, Outline
from simdtex.model.guide import Planes
from simdtex.model.lattice import neighbourhood_offsets
from simdtex.model.pictures import Pictures
from simdtex.model.scale import Scale


@dataclass(frozen=True)
class Ready:
    """A guide of which only the sample's side is at hand, in working levels (G, rows, cols) for each picture."""

    samples: list[NDArray[np.uint16]]

    @property
    def channels(self) -> int:
        """As the planes have."""
        return len(self.samples[0])

    def planes(self, scale: Scale, spread: float, top: int) -> Planes:
        """As they are; of the output nothing."""
        return Planes(self.samples, np.zeros((self.channels, 1, 1), np.uint16))


def described(outline: Outline) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """What `restored` needs: JSON, and arrays by name. What is given of the output is not part of it."""
    pictures = outline.sample.pictures
    text = {
        "shape": list(outline.shape),
        "seed": outline.seed,
        "levels": outline.levels,
        "options": asdict(outline.options),
        "kit": outline.kit._asdict(),
        "pictures": len(pictures.pixels),
    }
    parts = {"pixels": pictures.pixels, "unknown": pictures.unknown, "usable": pictures.usable}
    arrays = {f"{name}{k}": one for name, those in parts.items() for k, one in enumerate(those or ())}
    return text, arrays | {f"guide{k}": one for k, one in enumerate(outline.sample.guided)}


def restored(text: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> Outline:
    """The outline that was described, without what is given of the output."""
    chosen: dict[str, Any] = {
        name: tuple(one) if isinstance(one, list) else one for name, one in text["options"].items()
    }
    options = Options(**chosen)

    def those(name: str) -> tuple[NDArray[Any], ...] | None:
        return tuple(arrays[f"{name}{k}"] for k in range(text["pictures"])) if f"{name}0" in arrays else None

    pixels, guided, kit = those("pixels"), those("guide"), Kit(**text["kit"])
    assert pixels is not None
    pictures = options.of(Pictures(pixels, those("unknown"), those("usable")))
    return Outline(
        sample=kit.sample(pictures, [Ready(list(guided))] if guided else []),
        kit=kit,
        shape=(text["shape"][0], text["shape"][1]),
        offsets=neighbourhood_offsets(options.order),
        options=options,
        schedule=schedules.get(options.schedule),
        seed=text["seed"],
        levels=text["levels"],
    )
