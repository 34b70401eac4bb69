# SPDX-License-Identifier: BSD-3-Clause
"""The results of a page: what it shows of them, their files, and their figures of quality."""

from __future__ import annotations

from functools import cached_property, partial
from math import isfinite
from pathlib import Path
from shutil import make_archive
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.experiments.quality import measure
from simdtex.io.image import write
from simdtex.live import frames
from simdtex.live.job import Job
from simdtex.model.source_map import apply_source_map, save_source_map
from simdtex.options import one_of, whole
from simdtex.run import Output

MAX_RESULTS = 24
"""Results that are kept, at most."""

MAX_BYTES = 2**29
"""Bytes of their arrays, at most; the latest is kept whatever its size."""

THUMBNAIL = 96
"""The longest side of a thumbnail, pixels."""

ARRANGEMENT, ARCHIVE = "arrangement.npz", "texture.zip"

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
"""The figures of `simdtex.quality` that the page shows, in the order of computation, with labels and hints."""


class Result:
    """A result: its ``number``, from 1, its job, what the job returned, and the duration of the run with its frames."""

    def __init__(self, number: int, job: Job, image: NDArray[Any], output: Output, seconds: float) -> None:
        self.number, self.job, self.image, self.seconds = number, job, image, seconds
        self.source, self.temperature = output.source, output.temperature
        self.device = output.statistics["device"]
        complete = self.source is not None and bool((self.source[..., 0] >= 0).all())  # every pixel has a source
        source: Any = self.source if complete else None
        self.maps = {name: apply_source_map(source, one) for name, one in job.maps.items() if complete}
        self.figures: list[dict[str, Any]] = []
        measurable = job.kind == "synth" and min(*image.shape[:2], *job.sample.shape[:2]) >= 48
        self.unmeasured = [name for name in FIGURES if measurable and (complete or name != "effective_use")]
        arrays = [None if one is None else partial(np.asarray, one) for one in (source, self.temperature)]
        self.layers = frames.layers(job.sample, job.shape, lambda: image, *arrays)
        for name, one in self.maps.items():
            self.layers[f"map {name}"] = partial(frames.picture, one, one)

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        arrays = [self.image, self.source, self.temperature, *self.maps.values()]
        return sum(one.nbytes for one in arrays if one is not None)

    @cached_property
    def thumbnail(self) -> frames.Frame:
        """The picture, small."""
        return frames.thumbnail(self.layers["picture"](), THUMBNAIL)

    def describe(self) -> dict[str, Any]:
        """Return the message to the page."""
        return {
            **{"result": self.number, "width": self.job.shape[1], "height": self.job.shape[0]},
            **{"seconds": self.seconds, "device": self.device, "settings": self.job.message},
            **{"layers": ["sample", *self.layers], "files": self.files},
            **{"command": self.job.command, "python": self.job.python, "figures": self.figures},
            "thumbnail": [self.thumbnail.width, self.thumbnail.height],
        }

    @property
    def _pictures(self) -> dict[str, NDArray[Any]]:
        """The picture and the maps, by file name."""
        return {self.job.output: self.image} | {self.job.carried[name]: one for name, one in self.maps.items()}

    @property
    def files(self) -> list[str]:
        """The names of its files; the last is an archive of the others, the files that the job reads, and its lines."""
        return [*self._pictures, *[ARRANGEMENT] * (self.source is not None), ARCHIVE]

    def file(self, name: str) -> bytes:
        """Return the bytes of a file; raises ValueError if there is none of that name."""
        one_of("file", name, self.files)
        with TemporaryDirectory() as temporary:
            folder = Path(temporary) / "files"
            folder.mkdir()
            wanted = self._pictures | self.job.files
            for each in wanted if name == ARCHIVE else wanted.keys() & {name}:
                write(folder / each, wanted[each])
            if self.source is not None and name in (ARRANGEMENT, ARCHIVE):
                save_source_map(folder / ARRANGEMENT, self.source)
            if name != ARCHIVE:
                return (folder / name).read_bytes()
            (folder / "again.txt").write_text(self.job.command, encoding="utf-8")
            (folder / "again.py").write_text(self.job.python, encoding="utf-8")
            return Path(make_archive(str(folder), "zip", folder)).read_bytes()

    def measure(self) -> None:
        """Compute the next figures of quality."""
        name = self.unmeasured.pop(0)
        sample, image, source = self.job.sample, self.image, self.source if name == "effective_use" else None
        if name not in ("seam", "effective_use"):  # which are of edges, or quick
            sample, image = _middle(sample), _middle(image)
        found = measure(sample, image, source, figures=(name,))
        for key, (label, hint) in FIGURES[name].items():
            value = getattr(found, key)
            known = value is not None and isfinite(value)
            self.figures.append({"label": label, "hint": hint, "value": float(value) if known else None})


class Results(dict[int, Result]):
    """The results of a page by number; the oldest are dropped when they are many or large."""

    def __init__(self) -> None:
        super().__init__()
        self.dropped: list[int] = []

    def add(self, job: Job, image: NDArray[Any], output: Output, seconds: float) -> Result:
        """Add a result."""
        number = 1 + max(self, default=0)
        result = self[number] = Result(number, job, image, output, seconds)
        while len(self) > MAX_RESULTS or (len(self) > 1 and sum(one.nbytes for one in self.values()) > MAX_BYTES):
            self.dropped.append(min(self))
            del self[self.dropped[-1]]
        return result

    def find(self, number: Any) -> Result:
        """Return the result of a number; raises ValueError or TypeError if there is none."""
        whole("the result", number, 1)
        if number not in self:
            raise ValueError(f"result {number} is no longer kept; make it again with its command line")
        return self[number]


def _middle(pixels: NDArray[Any]) -> NDArray[Any]:
    top, left = (max(0, (side - MEASURED) // 2) for side in pixels.shape[:2])
    return pixels[top : top + MEASURED, left : left + MEASURED]
