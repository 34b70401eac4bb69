# SPDX-License-Identifier: BSD-3-Clause
"""The steerable pyramid of Simoncelli and Freeman in integers: its filters, and their transposes.

Pictures are (planes, rows, cols) int32, bands (bands, planes, rows, cols) int32, and taps (bands, side, side) float32
with an odd side, from `simdtex.methods.pyramid.steerable`. Sums are float32, over terms, bands, tap rows and tap
columns in this order, each step an fma. They are rounded to integers at the end, and must fit 32 bits. Taps are
multiples of 2**-24, so each step of the twin is exact in double precision if sums stay below 2**28.

The spatial filters, for 1, 2, 4 and 6 orientations, were designed by the method of Karasaridis and Simoncelli, *A
filter design technique for steerable pyramid image transforms* (1996), for the transform of Simoncelli and Freeman,
*The steerable pyramid* (1995). The numbers are those distributed with pyrtools as sp0, sp1, sp3 and sp5.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simdtex.machine.interface import Array, Launcher, Operation
from simdtex.methods.pyramid.laplacian import within

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
        total = np.zeros((count, *picture[:, ::step, ::step].shape), np.float32)
        for a, b in np.ndindex(side, side):
            total = _fma(taps[:, a, b, None, None, None], around[:, a : a + rows : step, b : b + cols : step], total)
        return np.rint(total).astype(np.int32)
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
        for index, (bands, taps, step) in enumerate(terms):
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
                *(index == 0, index == len(terms) - 1, total, rows, cols, first, first_row, some, picture),
                defines={"V": v, "ROWS": ROWS[1]},
            )
    return picture


ORIENTATIONS = (1, 2, 4, 6)
"""The possible numbers of orientations."""

UNIT = 2**24
"""Taps are rounded to multiples of 2**-24, see `simdtex.methods.pyramid.steerable`."""


@dataclass(frozen=True)
class Filters:
    """The filters of a bank, float32, for correlation with a picture.

    Attributes
    ----------
    high : (a, a) array
        H0, whose output is finer than the first level.
    low : (b, b) array
        L0, whose output is the input of the levels. Its taps add up to 1, with six orientations to 0.99918.
    down : (c, c) array
        L1, between a level and the next, which has half the rows and columns. Its taps add up to 1, so numbers keep
        their range; those of pyrtools are twice as large, so its level k and its residue are 2**k times ours.
    bands : (orientations, d, d) array
        B_i. Orientation i of n has the angle pi i / n, counter-clockwise from the column axis as pictures are seen, so
        towards lower row numbers. It responds to waves along its angle: 0 to changes along a row, so to vertical lines.
        All are odd (their sign changes when turned by 180 degrees), except that the filter of a single orientation is
        even and has no direction. Signs are those of pyrtools.
    """

    high: NDArray[np.float32]
    low: NDArray[np.float32]
    down: NDArray[np.float32]
    bands: NDArray[np.float32]


@cache
def filters(orientations: int) -> Filters:
    """Return the bank with ``orientations`` orientations: 1, 2, 4 or 6.

    Raises
    ------
    ValueError
        There is no bank with that number of orientations.
    """
    if orientations not in ORIENTATIONS:
        raise ValueError(f"orientations is {orientations}; give one of {', '.join(map(str, ORIENTATIONS))}")
    high, low, down, *bands = (np.array(text.split(), float) / 1e6 for text in _BANKS[orientations])
    if orientations == 1:
        upright = [_even(bands[0])]
    else:  # the second half is the first half turned by 90 degrees
        first = [_odd(half) for half in bands]
        if orientations == 6:
            first.append(-first[1].T)
        upright = first + [np.rot90(band) for band in first]
    taps = [_even(high), _even(low), _even(down) / 2, np.array(upright)]
    single = [np.ascontiguousarray(np.rint(a * UNIT) / UNIT, dtype=np.float32) for a in taps]
    for a in single:
        a.flags.writeable = False
    return Filters(*single)


def _even(octant: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a filter with all mirror symmetries, from its taps at 0 <= x <= y, row by row from the centre."""
    reach = int(np.sqrt(2 * octant.size)) - 1
    y, x = abs(np.mgrid[-reach : reach + 1, -reach : reach + 1])
    far, near = np.maximum(y, x), np.minimum(y, x)
    taps: NDArray[np.float64] = octant[far * (far + 1) // 2 + near]
    return taps


def _odd(half: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a filter whose sign changes when turned by 180 degrees, from its taps before the centre, in rows."""
    side = int(np.sqrt(2 * half.size + 1))
    return np.concatenate([half, [0.0], -half[::-1]]).reshape(side, side)


_BANKS = {
    1: (
        # H0
        """
        855489.3 -96235.94 -63009.23 -24201.38 -14373.58 -1616.65 -373.21 145.97 492.71 126.31 -240.66 -332.56
        -332.49 -60.68 599.72
        """,
        # L0
        """
        315301.7 152493.5 64414.88 -7563.2 -13441.6 -6119.52 -3743.86 -372.58 -113.71 -451.4
        """,
        # L1, twice `down`
        """
        157650.8 134899.9 111638.8 76246.74 63062.62 32207.44 24496 17220.78 3938.62 -5260.02 -3781.6 -5236.18
        -6720.8 -6401 -3059.76 -6948.9 -7006.74 -4596.42 -2449.06 -190.38 1417.62 -1871.92 -1031.64 -186.28 874.14
        -56.86 -806.44 -225.7
        """,
        # B_0
        """
        946419.5 -31586.05 -17304.66 -34870.08 -24356.62 -21295.4 -9091.95 -7623.41 -7272.54 -4625.15 -10094.73
        -7889.39 -4942.5 -1738.64 -90.66
        """,
    ),
    2: (
        # H0
        """
        728259.3 -156282.7 -78413.7 -5897.78 10948.66 17063.47 10980.12 9156.42 899.86 -4317.53 -1166.81 -874.26
        -1424.72 -242.41 -957
        """,
        # L0
        """
        437625 181160.3 43813.2 -32971.37 -37694.87 -7061.29 1107.62 8224.42 7522.72 2921.58 2524.01 -503.37
        -1601.26 -1354.28 -87.01
        """,
        # L1, twice `down`
        """
        212037.4 177365.1 144550 90580.14 68065.84 21906.6 14385.12 3955.66 -11091.7 -20229.38 -16485.68 -17508.18
        -18847.44 -12604.2 -3530.64 -9637.22 -9056.92 -7431.7 -1777.48 3184.68 3175.78 553.82 2221.22 4112.2 3080.98
        3761.36 2160.54 1460.78 5589.4 4287.28 2889.86 2325.54 -136.88 562.16 -581.46 446.06 1262 -420.2 -251.68
        -1597.04 -800.64 -124.34 -677.14 120.78 -43.5
        """,
        # B_0
        """
        -6125.88 12874.16 5641.53 8957.26 0 -8957.26 -5641.53 -12874.16 6125.88 8052.6 9611.52 -4168.4 1751.17 0
        -1751.17 4168.4 -9611.52 -8052.6 21037.14 -10235.69 23821.8 18369.09 0 -18369.09 -23821.8 10235.69 -21037.14
        15368.9 -6009.45 53753.24 -126565.5 0 126565.5 -53753.24 6009.45 -15368.9 18514.66 -1872.62 20760.86
        -299616.8
        """,
    ),
    4: (
        # H0
        """
        730386.6 -155414.16 -79501.64 -9381.22 7804.63 13962.36 7303.26 5363.22 -2755.6 -6322.27 -5101.45 -4575.18
        -3129.53 -492.74 1296.1 -833.69 335.78 2114.53 2225.34 1405.1 1179.32 1975.51 2289.22 2562.65 2175.07
        1587.44 774.35 -327.35 2089.87 2068.75 1923.6 1545.08 883.87 -37.83 -625.96 -404.84
        """,
        # L0
        """
        437625 181160.301 43813.2 -32971.37 -37694.87 -7061.29 1107.62 8224.42 7522.72 2921.58 2524.01 -503.37
        -1601.26 -1354.28 -87.01
        """,
        # L1, twice `down`
        """
        212037.44 177365.12 144549.98 90580.14 68065.84 21906.6 14385.12 3955.66 -11091.7 -20229.38 -16485.68
        -17508.18 -18847.44 -12604.2 -3530.64 -9637.22 -9056.92 -7431.7 -1777.48 3184.68 3175.78 553.82 2221.22
        4112.2 3080.98 3761.36 2160.54 1460.78 5589.4 4287.28 2889.86 2325.54 -136.88 562.16 -581.46 446.06 1262
        -420.2 -251.68 -1597.04 -800.64 -124.34 -677.14 120.78 -43.5
        """,
        # B_0
        """
        -811.25 3910.35 1346.27 747.01 0 -747.01 -1346.27 -3910.35 811.25 4445.16 4456.54 -3774.07 -365.22 0 365.22
        3774.07 -4456.54 -4445.16 12316.98 -5872.43 8258.16 -22522.68 0 22522.68 -8258.16 5872.43 -12316.98 13955.88
        -2876.08 39442.28 -110569.07 0 110569.07 -39442.28 2876.08 -13955.88 14179.45 8526.76 53605.64 -176841.93
        """,
        # B_1
        """
        0 828.47 57.11 -40.11 -4667.09 -8087.19 -14807.61 -8620.44 3122.15 -828.47 0 974.8 6971.9 2086.56 -2329.88
        4481.49 -14917.5 -8620.44 -57.11 -974.8 0 12145.54 24427.29 -50797.06 -32785.87 4481.49 -14807.61 40.11
        -6971.9 -12145.54 0 151055.56 82495.5 -50797.06 -2329.88 -8087.19 4667.09 -2086.56 -24427.29 -151055.56
        """,
    ),
    6: (
        # H0
        """
        813802 -114358.63 -70276.79 -9810.51 -6734.82 -2900.81 12612.27 6316.53 -2438.12 -3500.17 -806.39 -1335.42
        -1714.84 -1130.93 -334.29
        """,
        # L0
        """
        403041.48 159255.7 55869.82 -38482.15 -15512.46 3416.14
        """,
        # L1, twice `down`
        """
        201930.8 163392.36 128526.66 79627.86 65540.76 27934.92 20059.76 8212 -13222.34 -10465.62 -19241.08
        -18888.64 -7756.24 -4898.34 1708.08
        """,
        # B_0
        """
        2776.43 -9869.04 -10218.52 0 10218.52 9869.04 -2776.43 4961.94 -8930.64 -30753.56 0 30753.56 8930.64
        -4961.94 10266.99 11898.59 -82264.45 0 82264.45 -11898.59 -10266.99 14553.99 27551.55 -117322.97
        """,
        # B_1
        """
        -3432.49 -3584.61 10477.17 7904.07 4590.34 -1280 -11669.82 -6408.15 -19775.07 14863.05 44356.47 -8539.65
        -11611.95 -2857.23 -731.41 -40842.11 -48190.57 94542.02 53941.39 -39305.73 -1820.78 11243.21 -2282.19
        -122272.3
        """,
    ),
}
"""H0, L0, L1 and the bands without their turned copies, in millionths: `_even` and `_odd` unfold them."""
