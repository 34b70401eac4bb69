# SPDX-License-Identifier: BSD-3-Clause
"""The source map: for every output pixel, the sample position it was taken from.

With it the arrangement of one synthesis carries over to any other map of the same material, and
it shows what was copied from where. It is an integer array (rows, cols, 2) of (row, column).
"""

from __future__ import annotations

import os
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex.io.image import atomic_path, check_writable, read, write

__all__ = ["SOURCE_SUFFIXES", "apply_source_map", "load_source_map", "save_source_map"]

PathLike = str | os.PathLike[str]
SourceMap = NDArray[np.int32]

SOURCE_SUFFIXES = (".npz", ".npy", ".png")


def apply_source_map(
    source: ArrayLike, other_map: ArrayLike, sample_shape: tuple[int, ...] | None = None
) -> NDArray[Any]:
    """Arrange another map of the material as the sample was arranged, pixel for pixel.

    Parameters
    ----------
    source : array_like of int, (rows, cols, 2)
        The (row, column) in the sample of every output pixel.
    other_map : array_like, (sample rows, sample cols) or (sample rows, sample cols, channels)
        A normal, height or other map laid over the sample; any type, any number of channels.
    sample_shape : (rows, cols), optional
        The size of the sample. Without it, only that every position lies within `other_map` is
        checked.

    Returns
    -------
    ndarray, (rows, cols) or (rows, cols, channels)
        The type of `other_map`; its values unchanged (a normal map's vectors are not turned, for
        pixels are moved and never turned).

    Raises
    ------
    ValueError
        `other_map` is not as large as the sample, or an argument has another shape.
    """
    positions = _checked(source)
    values = np.asarray(other_map)
    if values.ndim not in (2, 3):
        raise ValueError(f"the other map is {values.ndim}-dimensional: give (rows, cols) or (rows, cols, channels)")
    rows, cols = values.shape[:2]
    if sample_shape is not None and (rows, cols) != tuple(sample_shape[:2]):
        raise ValueError(
            f"the other map is {cols} x {rows} pixels (width x height) and the sample "
            f"{sample_shape[1]} x {sample_shape[0]}: bring it to the sample's size"
        )
    last_row, last_col = (int(v) for v in positions.max(axis=(0, 1)))
    if last_row >= rows or last_col >= cols:
        raise ValueError(
            f"the other map is {cols} x {rows} pixels (width x height) and the sample at least "
            f"{last_col + 1} x {last_row + 1}: bring it to the sample's size"
        )
    return values[positions[..., 0], positions[..., 1]]


def save_source_map(path: PathLike, source: ArrayLike) -> None:
    """Write a source map, whole or not at all.

    Parameters
    ----------
    path : path
        ``.npz`` (compressed, under the name ``source``), ``.npy``, or ``.png`` (16-bit colour:
        red the row, green the column, blue 0; for samples up to 65536 pixels a side).
    source : array_like of int, (rows, cols, 2)

    Raises
    ------
    ValueError
        The path cannot be written, `source` is no source map, or a PNG cannot hold it.
    """
    check_writable(path, suffixes=SOURCE_SUFFIXES)
    positions = _checked(source)
    suffix = Path(path).suffix.lower()
    if suffix == ".npy":
        write(path, positions)
    elif suffix == ".npz":
        with atomic_path(path) as temporary, temporary.open("wb") as file:
            np.savez_compressed(file, source=positions)
    else:
        if positions.max() > 65535:
            raise ValueError(f"{os.fspath(path)} cannot hold positions over 65535: use .npz")
        colours = np.zeros((*positions.shape[:2], 3), dtype=np.uint16)
        colours[..., :2] = positions
        write(path, colours)


def load_source_map(path: PathLike) -> SourceMap:
    """Read a source map that `save_source_map` wrote.

    Parameters
    ----------
    path : path
        ``.npz``, ``.npy`` or ``.png``.

    Returns
    -------
    ndarray of int32, (rows, cols, 2)

    Raises
    ------
    ValueError
        The file is missing, damaged, or holds no source map.
    """
    name = os.fspath(path)
    if Path(path).suffix.lower() != ".npz" or not Path(path).is_file():
        pixels = read(path).pixels
        if pixels.ndim == 3 and pixels.shape[2] == 3 and not pixels[..., 2].any():
            pixels = pixels[..., :2]
    else:
        try:
            with open(path, "rb") as file, np.load(file, allow_pickle=False) as archive:
                pixels = archive["source"]
        except (KeyError, OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error):
            raise ValueError(f"{name} holds no source map: give one saved by simdtex") from None
    try:
        return _checked(pixels)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def _checked(source: ArrayLike) -> SourceMap:
    positions = np.asarray(source)
    if positions.ndim != 3 or positions.shape[2] != 2 or positions.size == 0 or positions.dtype.kind not in "iu":
        raise ValueError(
            f"a source map is (rows, cols, 2) integers, not {positions.shape} of "
            f"{positions.dtype}: pass the one of a run"
        )
    low, high = int(positions.min()), int(positions.max())
    if low < 0 or high > np.iinfo(np.int32).max:
        wrong = low if low < 0 else high
        raise ValueError(f"the source map has the position {wrong}: pass the one of a finished run")
    return np.ascontiguousarray(positions, dtype=np.int32)
