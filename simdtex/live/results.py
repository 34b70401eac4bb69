# SPDX-License-Identifier: BSD-3-Clause
"""What was made for a page: results that it looks at again and takes away."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator
from functools import cached_property
from math import isfinite
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from numpy.typing import NDArray

from simdtex.experiments.quality import measure
from simdtex.io import image as pictures
from simdtex.live import planes
from simdtex.live.looking import Look, Plane, seen
from simdtex.live.recipe import Step, script, shell
from simdtex.model.source_map import apply_source_map, save_source_map
from simdtex.options import one_of

KEPT = 24
"""Results that a page goes back to, at most."""

HELD = 2**29
"""Bytes of their pictures and maps, at most; the latest is held whatever its size."""

THUMB = 96
"""The longest side of a thumbnail, pixels."""

MEASURED = 384
"""Figures of quality are those of the middle of a result, of so many rows and columns at most."""

FIGURES = {
    "effective_use": {
        "effective_share": ("Effective share of the sample", "1 uses all of it alike"),
        "most_used": ("Most used piece, times its fair share", "1 is fair"),
    },
    "seam": {"seam": ("Seam where the result tiles", "1 does not show")},
    "repeats": {
        "repeats": ("Repeats in the result", "0 has none"),
        "own_repeats": ("Repeats in the sample", "for comparison"),
    },
    "plausibility": {"plausibility": ("Distance of its patches from the sample's", "0 is best")},
    "coverage": {"coverage": ("Distance of the sample's patches from its own", "0 is best")},
    "copying": {"copying": ("Share of patches that are copied whole", "1 is a copy")},
}
"""The figures of `simdtex.quality` that a page shows, in the order in which they are computed, and in plain words."""


class Result:
    """A result.

    Parameters
    ----------
    number : int
        From 1.
    asked : dict
        The message that asked for it.
    image : array
    output : simdtex.run.Output
    sample : array
        What its pixels are from.
    maps : dict
        Other maps of that, by name.
    steps : tuple of Step
        How it is made elsewhere.
    seconds : float
        What it took here, with what was shown meanwhile.
    """

    def __init__(
        self,
        number: int,
        asked: dict[str, Any],
        image: NDArray[Any],
        output: Any,
        sample: NDArray[Any],
        maps: dict[str, NDArray[Any]],
        steps: tuple[Step, ...],
        seconds: float,
    ) -> None:
        self.number, self.image, self.sample, self.steps = number, image, sample, steps
        self.source, self.temperature, self.seconds = output.source, output.temperature, seconds
        self._carries = self.source is not None and bool((self.source[..., 0] >= 0).all())
        self.maps = {name: apply_source_map(output.source, one) for name, one in maps.items()} if self._carries else {}
        self.figures: list[dict[str, Any]] = []
        self._asked, self._device = asked, output.statistics["device"]
        job = asked.get("job", "synth")
        able = job == "synth" and min(*image.shape[:2], *sample.shape[:2]) >= 48
        skipped = () if self._carries else ("effective_use",)
        self._open = [name for name in FIGURES if able and name not in skipped]

    @property
    def size(self) -> int:
        """Bytes of its arrays."""
        held = [self.image, self.source, self.temperature, *self.maps.values()]
        return sum(one.nbytes for one in held if one is not None)

    @property
    def layers(self) -> list[str]:
        """What can be looked at."""
        found = ["picture", "sample"]
        found += ["arrangement", "use"] if self._carries else []
        found += ["temperature"] if self.temperature is not None else []
        return found + [f"map {name}" for name in self.maps]

    @cached_property
    def thumbnail(self) -> bytes:
        """A small picture, RGBA; its size is in `told`."""
        return seen(planes.picture(self.image, self.sample), self._small).pixels

    @cached_property
    def _use(self) -> Plane:
        return planes.use(self.source, self.sample)

    @property
    def _small(self) -> Look:
        rows, cols = self.image.shape[:2]
        step = -(-max(rows, cols) // THUMB)
        return Look(width=-(-cols // step), height=-(-rows // step), step=step)

    def told(self) -> dict[str, Any]:
        """What a page is told of it."""
        rows, cols = self.image.shape[:2]
        return {
            **{"result": self.number, "width": cols, "height": rows, "seconds": self.seconds, "device": self._device},
            **{"layers": self.layers, "maps": list(self.maps), "thumbnail": [self._small.width, self._small.height]},
            **{"asked": self._asked, "command": shell(self.steps), "python": script(self.steps)},
            **{"figures": self.figures, "arrangement": self.source is not None},
        }

    def plane(self, layer: str, whole: NDArray[Any] | None) -> tuple[str, Plane]:
        """What is looked at, and its name; the picture, where the layer is not there."""
        if layer == "sample":
            return layer, planes.picture(self.sample if whole is None else whole, self.sample)
        if layer in self.layers:
            if layer == "arrangement":
                return layer, planes.arrangement(self.source, self.sample)
            if layer == "use":
                return layer, self._use
            if layer == "temperature":
                return layer, planes.temperature(self.temperature)
            if layer.startswith("map "):
                values = self.maps[layer.removeprefix("map ")]
                return layer, planes.picture(values, values)
        return "picture", planes.picture(self.image, self.sample)

    # -- to take away ---------------------------------------------------------------------------------------------

    def file(self, what: str) -> tuple[str, bytes]:
        """A file: its name and its bytes.

        ``what`` is ``"picture"``, ``"tif"``, ``"arrangement"``, a map as ``"map NAME"``, or ``"all"``: a zip file of
        these, of all that is read to make them again, and of the lines that do so.
        """
        last = self.steps[-1]
        if what == "picture":
            return last.output, encoded(last.output, self.image)
        if what == "tif":
            name = f"{last.output.rpartition('.')[0]}.tif"
            return name, encoded(name, self.image)
        if what == "arrangement" and self.source is not None:
            return "arrangement.npz", self._arrangement()
        if what.startswith("map ") and what.removeprefix("map ") in self.maps:
            name = what.removeprefix("map ")
            return last.maps[name], encoded(last.maps[name], self.maps[name])
        one_of("what to take away", what, ["all"])
        return f"{last.output.rpartition('.')[0]}.zip", self._everything()

    def _arrangement(self) -> bytes:
        with TemporaryDirectory() as folder:
            path = Path(folder) / "arrangement.npz"
            save_source_map(path, self.source)
            return path.read_bytes()

    def _everything(self) -> bytes:
        last = self.steps[-1]
        files: dict[str, bytes] = {}
        for step in self.steps:
            files |= {name: encoded(name, pixels) for name, pixels in step.files.items()}
        files[last.output] = encoded(last.output, self.image)
        files |= {last.maps[name]: encoded(last.maps[name], one) for name, one in self.maps.items()}
        files |= {"arrangement.npz": self._arrangement()} if self.source is not None else {}
        files |= {"again.txt": shell(self.steps).encode(), "again.py": script(self.steps).encode()}
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w") as archive:
            for name, data in files.items():
                archive.writestr(name, data)
        return packed.getvalue()

    # -- quality --------------------------------------------------------------------------------------------------

    @property
    def unmeasured(self) -> bool:
        """Whether there are figures to compute."""
        return bool(self._open)

    def measure(self) -> None:
        """Compute the next figures."""
        name = self._open.pop(0)
        whole = name in ("seam", "effective_use")  # of edges, and quick
        shown, sample = (self.image, self.sample) if whole else (_middle(self.image), _middle(self.sample))
        found = measure(sample, shown, self.source if name == "effective_use" else None, figures=(name,))
        for key, (label, hint) in FIGURES[name].items():
            value = getattr(found, key)
            known = value is not None and isfinite(value)
            self.figures.append({"label": label, "hint": hint, "value": float(value) if known else None})


class Results:
    """The results of a page, the oldest let go where they are many."""

    def __init__(self) -> None:
        self._all: dict[int, Result] = {}
        self._count = 0
        self.gone: list[int] = []

    def __iter__(self) -> Iterator[Result]:
        return iter(list(self._all.values()))  # others may be added meanwhile

    @property
    def latest(self) -> Result | None:
        """The last one."""
        return self._all[max(self._all)] if self._all else None

    def add(self, *what: Any) -> Result:
        """Add a result; what is given is that of `Result` without its number."""
        self._count += 1
        result = Result(self._count, *what)
        self._all[self._count] = result
        while len(self._all) > KEPT or (len(self._all) > 1 and sum(one.size for one in self) > HELD):
            self.gone.append(min(self._all))
            del self._all[self.gone[-1]]
        return result

    def get(self, number: int) -> Result:
        """The result of a number; raises ValueError where it is gone."""
        if number not in self._all:
            raise ValueError(f"result {number} is no longer there; make it again with its command line")
        return self._all[number]


def encoded(name: str, pixels: NDArray[Any]) -> bytes:
    """The bytes of a picture's file, as ``simdtex.io.image.write`` writes it."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / name
        pictures.write(path, pixels)
        return path.read_bytes()


def _middle(pixels: NDArray[Any]) -> NDArray[Any]:
    top, left = (max(0, (side - MEASURED) // 2) for side in pixels.shape[:2])
    return pixels[top : top + MEASURED, left : left + MEASURED]
