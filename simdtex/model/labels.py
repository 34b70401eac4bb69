# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of labels, as files."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.io.image import Metadata, read, split_alpha, write
from simdtex.model.colours import label_colours

PathLike = str | os.PathLike[str]


def write_labels(path: PathLike, labels: NDArray[np.uint8]) -> None:
    """Write labels (rows, cols) as the values of a picture; PNG and BMP have them as indices of `label_colours`."""
    write(path, labels, Metadata(palette=label_colours(256).tobytes()))


def read_labels(path: PathLike, transparent: int = 0) -> NDArray[Any]:
    """Read a picture of labels, (rows, cols) of an integer type: its values or, with a palette, the indices.

    Where the picture is transparent, the label is ``transparent``. Raises ValueError if the file is no such picture.
    """
    pixels, gone = split_alpha(read(path, palette=True).pixels)
    if pixels.dtype.kind not in "iu" or (pixels.ndim == 3 and pixels.shape[2] > 1):
        raise ValueError(f"{os.fspath(path)} is no picture of labels; save it grey or with a palette, 0, 1, 2...")
    labels = pixels.reshape(pixels.shape[:2])
    return np.where(gone, transparent, labels) if gone.any() else labels
