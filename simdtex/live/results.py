# SPDX-License-Identifier: BSD-3-Clause
"""The results of a page: what it shows of them, their files, and their figures of quality."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable
from functools import cached_property, partial
from math import isfinite
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.experiments.quality import measure
from simdtex.io.image import write
from simdtex.live import frames
from simdtex.live.job import Job
from simdtex.model.source_map import apply_source_map
from simdtex.options import one_of, whole
from simdtex.run import Output

MAX_RESULTS = 24
"""Results that are kept, at most."""

MAX_BYTES = 2**29
"""Bytes of their arrays, at most; the latest is kept whatever its size."""

THUMBNAIL = 96
"""The longest side of a thumbnail, pixels."""

ARCHIVE = "texture.zip"

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
    """A result.

    Parameters
    ----------
    number : int
        From 1.
    job : Job
        What it was made by.
    image : array
    output : simdtex.run.Output
    seconds : float
        The duration of the run, with the frames.
    """

    def __init__(self, number: int, job: Job, image: NDArray[Any], output: Output, seconds: float) -> None:
        self.number, self.job, self.image, self.seconds = number, job, image, seconds
        self.source, self.temperature = output.source, output.temperature
        self.device = output.statistics["device"]
        complete = None  # the source map, if every pixel has a source
        if self.source is not None and (self.source[..., 0] >= 0).all():
            complete = self.source
        self.maps = (
            {} if complete is None else {name: apply_source_map(complete, one) for name, one in job.maps.items()}
        )
        self.figures: list[dict[str, Any]] = []
        measurable = job.kind == "synth" and min(*image.shape[:2], *job.sample.shape[:2]) >= 48
        left_out = ("effective_use",) if complete is None else ()
        self.unmeasured = [name for name in FIGURES if measurable and name not in left_out]
        arrays = [None if one is None else partial(np.asarray, one) for one in (complete, self.temperature)]
        self.layers = frames.layers(job.sample, job.shape, lambda: image, *arrays)
        for name, one in self.maps.items():
            self.layers[f"map {name}"] = partial(frames.picture, one, one)

    @property
    def nbytes(self) -> int:
        """Bytes of its arrays."""
        arrays = [self.image, self.source, self.temperature, *self.maps.values()]
        return sum(one.nbytes for one in arrays if one is not None)

    @cached_property
    def thumbnail(self) -> frames.Frame:
        """The picture, small."""
        return frames.thumbnail(self.layers["picture"](), THUMBNAIL)

    def describe(self) -> dict[str, Any]:
        """Return what the page is told of it."""
        return {
            **{"result": self.number, "width": self.job.shape[1], "height": self.job.shape[0]},
            **{"seconds": self.seconds, "device": self.device, "settings": self.job.message},
            **{"layers": ["sample", *self.layers], "files": [*self._files, ARCHIVE]},
            **{"command": self.job.command, "python": self.job.python, "figures": self.figures},
            "thumbnail": [self.thumbnail.width, self.thumbnail.height],
        }

    @property
    def _files(self) -> dict[str, Callable[[], bytes]]:
        """Functions that make its files, by name."""
        arrays = {self.job.output: self.image} | {self.job.carried[name]: one for name, one in self.maps.items()}
        found: dict[str, Callable[[], bytes]] = {name: partial(encode, name, one) for name, one in arrays.items()}
        return found if self.source is None else found | {"arrangement.npz": partial(encode_source, self.source)}

    def file(self, name: str) -> bytes:
        """Return the bytes of a file; ``texture.zip`` has all others, the files that the job reads, and its lines.

        Raises
        ------
        ValueError
            There is no such file.
        """
        files = self._files
        one_of("file", name, [*files, ARCHIVE])
        if name != ARCHIVE:
            return files[name]()
        found = {each: encode(each, pixels) for each, pixels in self.job.files.items()}
        found |= {each: make() for each, make in files.items()}
        found |= {"again.txt": self.job.command.encode(), "again.py": self.job.python.encode()}
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w") as archive:
            for each, data in found.items():
                archive.writestr(each, data)
        return buffer.getvalue()

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


def encode(name: str, pixels: NDArray[Any]) -> bytes:
    """Return the bytes of a picture's file, as `simdtex.io.image.write` writes it."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / name
        write(path, pixels)
        return path.read_bytes()


def encode_source(source: NDArray[np.int32]) -> bytes:
    """Return the bytes of a source map's file, as `simdtex.model.source_map.save_source_map` writes it."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, source=source)
    return buffer.getvalue()


def _middle(pixels: NDArray[Any]) -> NDArray[Any]:
    top, left = (max(0, (side - MEASURED) // 2) for side in pixels.shape[:2])
    return pixels[top : top + MEASURED, left : left + MEASURED]
