# SPDX-License-Identifier: BSD-3-Clause
"""The source map: for every output pixel, the sample position it was taken from.

It carries the arrangement of one synthesis over to any other map of the same material, and shows which parts are
copies. It is an integer array (rows, cols, 2) of (row, column) or, with several samples, (rows, cols, 3) of (row,
column, sample), counted from 0. A pixel that was given and not taken from any sample has no source: its row and column
are -1.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex.io.atomic import atomic_path
from simdtex.io.image import as_array, check_writable, read, write
from simdtex.io.limits import read_npz, reading
from simdtex.model.use import SourceMap, checked
from simdtex.options import unmasked

__all__ = ["SOURCE_SUFFIXES", "apply_source_map", "load_source_map", "save_source_map"]

PathLike = str | os.PathLike[str]
SOURCE_SUFFIXES = (".npz", ".npy", ".png")


def apply_source_map(
    source: ArrayLike,
    other_map: ArrayLike | Sequence[ArrayLike],
    sample_shape: tuple[int, ...] | Sequence[tuple[int, ...]] | None = None,
) -> NDArray[Any]:
    """Return another map of the material in the arrangement of the output, pixel for pixel.

    Parameters
    ----------
    source : array_like of int, (rows, cols, 2) or (rows, cols, 3)
        The (row, column) in the sample of every output pixel, or (row, column, sample) of several samples; row and
        column are -1 where a pixel has no source.
    other_map : array_like, (sample rows, sample cols) or (sample rows, sample cols, channels)
        A normal, height or other map of the sample; any type, any number of channels. For a source map of several
        samples, a list or tuple of such maps, one for each sample, all of one type and number of channels.
    sample_shape : (rows, cols), optional
        The size of the sample; a list of sizes if `other_map` is a list. None checks only that every position lies
        within `other_map`.

    Returns
    -------
    ndarray, (rows, cols) or (rows, cols, channels)
        An array of the type of `other_map` with its values unchanged; the vectors of a normal map are not turned, since
        pixels are moved and never turned.

    Raises
    ------
    ValueError
        The size of `other_map` is not that of the sample, the numbers of maps and samples differ, a pixel has no
        source, or an argument has the wrong shape.
    """
    positions = checked(source)
    maps, shapes = _maps(positions, other_map, sample_shape)
    none = np.argwhere(positions[..., 0] < 0)
    if len(none):
        what = f"{len(none)} pixel{'s have' if len(none) > 1 else ' has'} no source"
        raise ValueError(
            f"{what}, the first at row {none[0, 0]}, column {none[0, 1]}: carry over maps of a run without known pixels"
        )
    of = positions[..., 2] if positions.shape[2] == 3 else np.zeros(positions.shape[:2], dtype=np.int32)
    carried = np.empty((*of.shape, *maps[0].shape[2:]), dtype=maps[0].dtype)
    for k, (values, shape) in enumerate(zip(maps, shapes, strict=True)):
        places = positions[of == k]
        _check_size("the other map" if len(maps) == 1 else f"the other map of sample {k}", values, places, shape)
        carried[of == k] = values[places[:, 0], places[:, 1]]
    return carried


def _maps(
    positions: SourceMap, other_map: Any, sample_shape: Any
) -> tuple[list[NDArray[Any]], list[tuple[int, ...] | None]]:
    """Return the map of each sample and the sample's size, None if unknown."""
    shapes: list[tuple[int, ...] | None] = [sample_shape]
    several = positions.shape[2] == 3 and isinstance(other_map, (list, tuple))
    maps = [as_array("the other map", one) for one in (other_map if several else [other_map])]
    for one in maps:
        unmasked("the other map", one)
    if several:
        shapes = [None] * len(maps) if sample_shape is None else list(sample_shape)
    wanted = 1 + (int(positions[..., 2].max(initial=0)) if positions.shape[2] == 3 else 0)
    if len(maps) < wanted:
        raise ValueError(
            f"the source map has pixels of sample {wanted - 1}, counted from 0, and the number of other maps is "
            f"{len(maps)}: give a list with one for each sample"
        )
    if len(shapes) != len(maps) or any(shape is not None and np.ndim(shape) != 1 for shape in shapes):
        raise ValueError(
            f"sample_shape is {sample_shape!r}: give a list with (rows, cols) for each of {len(maps)} maps"
        )
    for values in maps:
        if values.ndim not in (2, 3):
            raise ValueError(f"the other map is {values.ndim}-dimensional: give (rows, cols) or (rows, cols, channels)")
    kinds = {(values.dtype, values.shape[2:]) for values in maps}
    if len(kinds) > 1:
        named = sorted(f"{dtype} with {channels[0] if channels else 'no'} channels" for dtype, channels in kinds)
        raise ValueError(f"the other maps are {' and '.join(named)}: bring them to one type and number of channels")
    return maps, shapes


def _check_size(name: str, values: NDArray[Any], places: SourceMap, shape: tuple[int, ...] | None) -> None:
    rows, cols = values.shape[:2]
    if shape is not None and (rows, cols) != tuple(shape[:2]):
        raise ValueError(
            f"{name} is {cols} x {rows} pixels (width x height) and the sample "
            f"{shape[1]} x {shape[0]}: bring it to the sample's size"
        )
    last_row, last_col = (int(v) for v in places[:, :2].max(axis=0, initial=-1))
    if last_row >= rows or last_col >= cols:
        raise ValueError(
            f"{name} is {cols} x {rows} pixels (width x height) and the sample at least "
            f"{last_col + 1} x {last_row + 1}: bring it to the sample's size"
        )


def save_source_map(path: PathLike, source: ArrayLike) -> None:
    """Write a source map to a file, which is complete or not written at all.

    Parameters
    ----------
    path : path
        ``.npz`` (compressed, under the name ``source``), ``.npy``, or ``.png`` (16-bit colour: red the row, green the
        column, blue the sample, or 0; for samples up to 65536 pixels a side, where every pixel has a source).
    source : array_like of int, (rows, cols, 2) or (rows, cols, 3)

    Raises
    ------
    ValueError
        The path cannot be written, `source` is not a source map, or a PNG cannot hold it.
    """
    check_writable(path, suffixes=SOURCE_SUFFIXES)
    positions = checked(source)
    suffix = Path(path).suffix.lower()
    if suffix == ".npy":
        write(path, positions)
    elif suffix == ".npz":
        with atomic_path(path) as temporary, temporary.open("wb") as file:
            np.savez_compressed(file, source=positions)
    else:
        if positions.min() < 0:
            raise ValueError(f"{os.fspath(path)} cannot hold pixels without a source: use .npz")
        if positions.max() > 65535:
            raise ValueError(f"{os.fspath(path)} cannot hold positions over 65535: use .npz")
        colours = np.zeros((*positions.shape[:2], 3), dtype=np.uint16)
        colours[..., : positions.shape[2]] = positions
        write(path, colours)


def load_source_map(path: PathLike, *, max_pixels: int | None = None) -> SourceMap:
    """Return the source map of a file that `save_source_map` wrote.

    Parameters
    ----------
    path : path
        ``.npz``, ``.npy`` or ``.png``.
    max_pixels : int, optional
        The most pixels to read. None: ``SIMDTEX_MAX_PIXELS`` of the environment, else 2**27.

    Returns
    -------
    ndarray of int32, (rows, cols, 2) or (rows, cols, 3)
        A ``.png`` with blue 0 everywhere has one sample, (rows, cols, 2).

    Raises
    ------
    ValueError
        The file is missing, damaged, or holds no source map.
    """
    name = os.fspath(path)
    if Path(path).suffix.lower() != ".npz":
        pixels = read(path, max_pixels=max_pixels).pixels
        if pixels.dtype.kind == "u" and pixels.shape[2:] == (3,) and not pixels[..., 2].any():
            pixels = pixels[..., :2]
        elif pixels.dtype == np.uint8:
            raise ValueError(f"{name} is a picture of 8 bits and holds no source map: give one saved by simdtex")
    else:
        with reading(path, "the source map", max_pixels, kind="a source map of simdtex") as most:
            pixels = read_npz(path, "source", most)
    try:
        return checked(pixels)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None
