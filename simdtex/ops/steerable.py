# SPDX-License-Identifier: BSD-3-Clause
"""The steerable pyramid of Simoncelli and Freeman in integers: its filters, and their transposes.

Pictures are (planes, rows, cols) int32, bands (bands, planes, rows, cols) int32, and taps (bands, side, side) float32
with an odd side, from `simdtex.ops.steerable_filters`. Sums are float32, over terms, bands, tap rows and tap columns in
this order, each step an fma. They are rounded to integers at the end, and must fit 32 bits. Taps are multiples of
2**-24, so each step of the twin is exact in double precision if sums stay below 2**28.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.ops.laplacian import within

PADDED = 2**24
"""The most float32 values that are padded together; fewer if the machine's scratch memory is smaller."""

ROWS = {1: 4, 2: 4, 4: 2, 6: 2}
"""Rows of a work-item by the number of its bands, so that its sums fit registers."""


def _around(picture: NDArray[np.int32], reach: int, torus: bool) -> NDArray[np.float64]:
    """Return the pictures, rounded to float32, with ``reach`` pixels beyond the border on each side."""
    row, col = (within(np.arange(-reach, n + reach), n, torus) for n in picture.shape[1:])
    return picture[:, row[:, None], col].astype(np.float32).astype(np.float64)


def _fma(tap: Any, x: NDArray[np.float64], total: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return a product plus a sum, exact in double precision and rounded once."""
    result: NDArray[np.float32] = (tap.astype(np.float64) * x + total).astype(np.float32)
    return result


def _up(n: int, unit: int) -> int:
    """Return n rounded up to a multiple of ``unit``."""
    return -(-n // unit) * unit


def _pieces(machine: Launcher, planes: int, rows: int, line: int, extra: int, unit: int) -> Iterator[tuple[int, ...]]:
    """Yield planes, or rows of a plane, that fit in scratch memory: first plane, planes, first row, rows.

    A row takes ``line`` values, and a piece ``extra`` rows in addition to its own, whose number is a multiple of
    ``unit``.
    """
    most = min(PADDED, machine.scratch // 4)
    together = max(1, most // ((_up(rows, unit) + extra) * line))
    strip = rows if together > 1 else max(unit, (most // line - extra) // unit * unit)
    for first in range(0, planes, together):
        for first_row in range(0, rows, strip):
            yield first, min(together, planes - first), first_row, min(strip, rows - first_row)


@Operation
def steerable_split(machine: Launcher | None, picture: Array, taps: Array, torus: bool, step: int) -> Array:
    """Return the picture correlated with each of the filters, at every step-th row and column from 0.

    The result is (bands, planes, rows, cols) int32, with sizes rounded up; ``step`` is 1 or 2. The picture continues
    beyond its border as a ``torus`` or as its mirror image. Cost: side**2 multiply-adds per value.
    """
    planes, *size = picture.shape
    count, side, _ = taps.shape
    if machine is None:
        around, (rows, cols) = _around(picture, side // 2, torus), size
        found = np.zeros((count, *picture[:, ::step, ::step].shape), np.float32)
        for a, b in np.ndindex(side, side):
            found = _fma(taps[:, a, b, None, None, None], around[:, a : a + rows : step, b : b + cols : step], found)
        return np.rint(found).astype(np.int32)
    rows, cols = (-(-n // step) for n in size)
    bands = machine.empty((count, planes, rows, cols), np.int32)
    v, unit = machine.vector, ROWS.get(count, 1)
    across = _up(cols, v)
    pitch = _up(across + (side - 1) // step, v)
    padded = None
    for first, together, first_row, some in _pieces(machine, planes, rows, step * step * pitch, side, unit):
        height = step * (_up(some, unit) - 1) + side
        if padded is None:  # the first piece is the largest
            padded = machine.empty(together * height * step * pitch, np.float32)
        machine.launch(
            "steerable_pad",
            (height * step * pitch // v, together),
            *(picture, *size, torus, side // 2, 1, planes, first, step * first_row, together, height, pitch, padded),
            defines={"V": v, "SPREAD": 1, "APART": step},
        )
        machine.launch(
            "steerable_split",
            (_up(some, unit) // unit * across // v, together),
            *(padded, together, height, pitch, taps, side, planes, rows, cols, first, first_row, some, bands),
            defines={"V": v, "APART": step, "BANDS": count, "ROWS": unit},
        )
    return bands


@Operation
def steerable_join(
    machine: Launcher | None, terms: Sequence[tuple[Array, Array, int]], shape: tuple[int, int], torus: bool
) -> Array:
    """Return the sum over all bands of all terms, (planes, rows, cols) int32.

    ``terms`` are (bands, taps, step): a band is spread over ``shape``, (rows, cols), with zeros between if the step is
    2, and correlated with its filter turned by 180 degrees. Cost: side**2 multiply-adds per pixel and band; half as
    many for a step of 2, except on a torus with an odd number of rows.
    """
    planes, (rows, cols) = terms[0][0].shape[1], shape
    if machine is None:
        sums = np.zeros((planes, rows, cols), np.float32)
        for bands, taps, step in terms:
            for band, f in zip(bands, taps[:, ::-1, ::-1], strict=True):
                spread = np.zeros(sums.shape, np.int32)
                spread[:, ::step, ::step] = band
                around = _around(spread, taps.shape[1] // 2, torus)
                for a, b in np.ndindex(f.shape):
                    sums = _fma(f[a, b], around[:, a : a + rows, b : b + cols], sums)
        return np.rint(sums).astype(np.int32)
    picture = machine.empty((planes, rows, cols), np.int32)
    v, unit = machine.vector, 2 * ROWS[1]
    across = _up(cols, v)
    side = max(taps.shape[1] for _, taps, _ in terms)
    pitch = _up(across + side - 1, v)
    most = max(bands.shape[0] for bands, _, _ in terms)
    padded = total = None
    for first, together, first_row, some in _pieces(machine, planes, rows, most * pitch, side, unit):
        height = _up(some, unit) + side - 1
        if padded is None:  # the first piece is the largest
            padded = machine.empty(most * together * height * pitch, np.float32)
            total = padded if len(terms) == 1 else machine.empty(together * some * across, np.float32)
        for number, (bands, taps, step) in enumerate(terms):
            count, own = taps.shape[:2]
            # Every other row is zero, unless rows repeat after an odd number, where even rows meet odd ones.
            skip = 1 if rows == 1 or (torus and rows % 2) else step
            machine.launch(
                "steerable_pad",
                (height * pitch // v, count * together),
                *(bands, rows, cols, torus, own // 2, count, planes, first, first_row, together, height, pitch, padded),
                defines={"V": v, "SPREAD": step, "APART": 1},
            )
            machine.launch(
                "steerable_join",
                (_up(some, ROWS[1] * skip) // ROWS[1] * across // v, together),
                *(padded, together, height, pitch, taps, count, own, skip),
                *(number == 0, number == len(terms) - 1, total, rows, cols, first, first_row, some, picture),
                defines={"V": v, "ROWS": ROWS[1]},
            )
    return picture
