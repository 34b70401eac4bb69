# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of labels, as files."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image
from numpy.typing import NDArray

from simdtex.io.atomic import atomic_path
from simdtex.io.image import check_writable, pillow_bytes, read, write
from simdtex.model.colours import label_colours

PathLike = str | os.PathLike[str]


def write_labels(path: PathLike, labels: NDArray[np.uint8]) -> None:
    """Write labels (rows, cols) as the values of a picture; a PNG has them as indices of `label_colours`."""
    if Path(path).suffix.lower() != ".png":
        write(path, labels)
        return
    check_writable(path)
    picture = PIL.Image.fromarray(labels)
    picture.putpalette(label_colours(256).tobytes())
    content = pillow_bytes(picture, "PNG")
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)


def read_labels(path: PathLike) -> NDArray[Any]:
    """Read a picture of labels, (rows, cols) of an integer type: its values or, with a palette, the indices.

    Raises ValueError if the file is no such picture.
    """
    pixels = read(path).pixels  # first, since it rejects too large and damaged files
    with suppress(OSError, ValueError), PIL.Image.open(path) as picture:
        if picture.mode == "P":
            return np.asarray(picture)
    if pixels.dtype.kind not in "iu" or (pixels.ndim == 3 and pixels.shape[2] > 1):
        raise ValueError(f"{os.fspath(path)} is no picture of labels; save it grey or with a palette, 0, 1, 2...")
    return pixels.reshape(pixels.shape[:2])
