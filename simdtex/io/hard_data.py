# SPDX-License-Identifier: BSD-3-Clause
"""Hard data: known values at points, read from a table and placed in the cells of a grid or the pixels of a picture.

x grows with the column, y with the row, and z with the layer. Without an origin and a size of cells they are in pixels:
(0, 0) is the centre of the first pixel, in row 0. NaN is an unknown value.
"""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import chain, islice
from math import prod
from operator import index
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from simdtex.io.grids import MISSING, frame, number_of
from simdtex.io.image import cast
from simdtex.io.limits import BYTES, read_npy, reading
from simdtex.options import check_real, one_of

PathLike = str | os.PathLike[str]
Floats = NDArray[np.float64]

SEVERAL = ("refuse", "mean", "most")
"""The treatments of different data in one cell."""

_AXES = tuple(re.compile(rf"{axis}(?:$|[^a-z]|loc|coord)", re.IGNORECASE) for axis in "xyz")
"""The names of columns of coordinates: x, Xlocation, X_coord, x (m), but not Zn."""


@dataclass(frozen=True, eq=False)
class HardData:
    """A table of known values with a row for each datum; `len` is the number of data.

    Attributes
    ----------
    points : ndarray of float64, (data, 2) or (data, 3)
        x and y, or x, y and z, of each datum, in the units of the file.
    values : ndarray of float64, (data, variables)
        The values of each datum, NaN if unknown.
    names : tuple of str
        The name of each variable.
    lines : tuple of int, or None
        The line of each datum in the file, counted from 1; None if it is not from a text.
    """

    points: Floats
    values: Floats
    names: tuple[str, ...]
    lines: tuple[int, ...] | None = None

    def __len__(self) -> int:
        return len(self.points)

    def where(self, row: int) -> str:
        """Return words for a datum: its line in the file, or its row, counted from 0."""
        return f"row {row}" if self.lines is None else f"line {self.lines[row]}"


def read_hard_data(path: PathLike, *, max_pixels: int | None = None) -> HardData:
    """Return the table of known values in a file.

    Parameters
    ----------
    path : path
        A text with a datum in each line: x, y and a value, or one value for each of several variables. Columns are
        separated by semicolons, tabs, commas or blanks: the first of these, in this order, that occurs in the first
        line. Numbers have a decimal point. An empty cell, or NaN, is an unknown value. A first line with names for x
        and y is a header, which names the variables; if the third of four or more columns is called z, it is the third
        coordinate. A comment extends from ``#`` to the end of the line.

        Or a point set of Geo-EAS, recognised by a second line of one number: a title, the number of columns, their
        names, each in a line, and a datum in each line, with blanks between numbers. The first columns are x and y and,
        if its name is z, z; a number of `simdtex.io.grids.MISSING` is an unknown value.

        Or a NumPy ``.npy`` of real numbers, (data, 3 or more), with the columns x, y and values.
    max_pixels : int, optional
        The most cells, or bytes of a text, to read. None: ``SIMDTEX_MAX_PIXELS`` of the environment, else 2**27.

    Returns
    -------
    HardData
        The data in the order of the file. Variables without a name are ``value``, or ``value 1`` and so on.

    Raises
    ------
    ValueError
        The file is missing, not a table, too large, has no rows, or has an invalid row; the message names the line.

    Notes
    -----
    Cost: about 8 s for a million rows of text.
    """
    binary = Path(path).suffix.lower() == ".npy"
    with reading(path, "the hard data", max_pixels, each=BYTES if binary else 1) as most:
        if binary:
            with open(path, "rb") as file:
                return _table(read_npy(file, os.fstat(file.fileno()).st_size, most))
        with open(path, encoding="utf-8-sig") as text:
            try:
                return _parsed(text)
            except UnicodeDecodeError:
                raise ValueError("the table is no text in UTF-8: save it as CSV in UTF-8") from None


def _parsed(text: Iterable[str]) -> HardData:
    """Return the data in the lines of a table or of a point set."""
    lines = iter(text)
    first = list(islice(lines, 2))
    if len(first) == 2 and re.fullmatch(r"\s*[0-9]{1,9}\s*", first[1]):
        return _point_set(int(first[1]), lines)
    stripped = ((number, line.partition("#")[0].strip("\r\n ")) for number, line in enumerate(chain(first, lines), 1))
    kept = [(number, line) for number, line in stripped if line.strip()]
    if not kept:
        raise ValueError("the table is empty: give a line with x, y and a value for each datum")
    delimiter = next((one for one in ";\t," if one in kept[0][1]), None)
    rows = [(number, _cells(line, number, delimiter)) for number, line in kept]
    columns, names = len(rows[0][1]), None
    if columns < 3:
        raise ValueError(
            f"line {rows[0][0]} has {columns} cell{'s' * (columns != 1)}: give x, y and one value or more, with "
            "commas, semicolons, tabs or blanks between them"
        )
    if all(cell[:1].isalpha() and number_of(cell) is None for cell in rows[0][1][:2]):
        names = rows.pop(0)[1]
        _check_order(names)
    if not rows:
        raise ValueError("the table has a header and no rows: give a line with x, y and a value for each datum")
    return _of_rows(rows, columns, names)


def _point_set(columns: int, lines: Iterable[str]) -> HardData:
    """Return the data of a point set of Geo-EAS, parsed from its third line on."""
    numbered = enumerate(lines, 3)
    names = [line.strip() for _, line in islice(numbered, columns)]
    if columns < 3:
        raise ValueError(f"the point set has {columns} column{'s' * (columns != 1)}: give x, y and one value or more")
    rows = [(number, cells) for number, line in numbered if (cells := line.split())]
    if not rows:
        raise ValueError(f"the point set has no line after the names of its {columns} columns: get the file again")
    if not all(axis.match(name) for axis, name in zip(_AXES[:2], names, strict=False)):
        raise ValueError(f"the first columns are {names[0]!r} and {names[1]!r}: put x and y there, and call them so")
    data = _of_rows(rows, columns, names)
    data.values[np.isin(data.values, MISSING)] = np.nan
    return data


def _of_rows(rows: Sequence[tuple[int, list[str]]], columns: int, names: Sequence[str] | None) -> HardData:
    """Return the data of numbered rows of cells."""
    axes = 3 if names and columns > 3 and _AXES[2].match(names[2]) else 2
    for number, cells in rows:
        if len(cells) != columns:
            raise ValueError(f"line {number} has {len(cells)} cells and those before it {columns}: give as many in all")
    table = np.empty((len(rows), columns))
    for k, (number, cells) in enumerate(rows):
        for column, cell in enumerate(cells):
            value = np.nan if not cell and column >= axes else number_of(cell)
            if value is None:
                raise ValueError(
                    f"line {number} has {cell[:40]!r} in column {column + 1}, which is no number: write numbers with a "
                    "decimal point" + (", and leave the cell of an unknown value empty" if column >= axes else "")
                )
            table[k, column] = value
    values = _names(columns - axes, names and names[axes:])
    return HardData(table[:, :axes], table[:, axes:], values, tuple(number for number, _ in rows))


def _cells(line: str, number: int, delimiter: str | None) -> list[str]:
    if delimiter is None:
        return line.split()
    try:
        cells = next(csv.reader([line], delimiter=delimiter, strict=True, skipinitialspace=True))
    except csv.Error as error:
        raise ValueError(f"line {number} cannot be split into cells ({error}): check its quotation marks") from None
    return [cell.strip() for cell in cells]


def _check_order(header: Sequence[str]) -> None:
    """Raise unless x and y are the first columns of a header that names both."""
    names = [name.lower() for name in header]
    if ("x" in names and names[0] != "x") or ("y" in names and names[1] != "y") or names[0] in ("row", "rows"):
        raise ValueError(
            f"the columns are {', '.join(header)}: put them in the order x (the column), y (the row), and the values"
        )


def _names(variables: int, header: Sequence[str] | None = None) -> tuple[str, ...]:
    plain = ["value"] if variables == 1 else [f"value {k + 1}" for k in range(variables)]
    return tuple(given or name for given, name in zip(header or plain, plain, strict=True))


def _table(array: Any) -> HardData:
    """Return the data of an array of rows."""
    try:
        numbers = np.ma.asarray(array)
    except ValueError:
        raise ValueError("the rows of hard data are of unequal length: give x, y and the same values in each") from None
    if numbers.size == 0:
        raise ValueError("the hard data has no rows: give x, y and a value for each datum")
    check_real("the hard data", numbers)
    if numbers.ndim != 2 or numbers.shape[1] < 3:
        raise ValueError(f"the hard data has the shape {numbers.shape}: give (data, 3) of x, y, value, or more values")
    found = np.where(np.ma.getmaskarray(numbers), np.nan, numbers.data).astype(np.float64)
    return HardData(found[:, :2], found[:, 2:], _names(numbers.shape[1] - 2))


def place_hard_data(
    table: HardData | ArrayLike,
    shape: Sequence[int],
    dtype: DTypeLike | None = None,
    *,
    origin: Sequence[float] | None = None,
    cell: Sequence[float] | None = None,
    several: str = "refuse",
) -> np.ma.MaskedArray:
    """Return known values placed in the cells of a grid, or in the pixels of a picture.

    Parameters
    ----------
    table : HardData or array_like, (data, 3 or more)
        x, y and the value of each datum, or one value for each of several variables; NaN is unknown. x grows with the
        column, y with the row and z with the layer. A datum belongs to the cell that contains it; on the border of two
        cells, to the cell with the larger coordinate (without `origin` and `cell`, 1.5 goes to 2, -0.5 to 0).
    shape : (rows, cols) or (layers, rows, cols)
        The size of the grid. With two numbers, z of the data, if any, must be in the only layer.
    dtype : dtype, optional
        The type of the values, which must be the training image's; None is float64. Integers must be exact; floats
        are rounded to the type.
    origin : (x, y) or (x, y, z), optional
        The centre of the first cell, in the units of the data. None is 0.
    cell : (x, y) or (x, y, z), optional
        The size of a cell. None is 1: coordinates are in pixels.
    several : {"refuse", "mean", "most"}
        Value for different data in one cell: an error; their mean, rounded to the nearest integer (halves up) unless
        the type is a float; or the most frequent value, the first in the table if several are equally frequent. Each
        variable is treated separately.

    Returns
    -------
    MaskedArray of `shape`, with a last axis for several variables
        The known values; unknown ones are masked. ``filled()`` replaces unknown values by NaN, or by 0 if the type is
        not a float.

    Raises
    ------
    TypeError
        The table or the type is not of real numbers.
    ValueError
        A coordinate is not finite, a datum is outside of the grid, two data of one cell have different values and
        `several` is ``"refuse"``, the type cannot hold a value, or nothing is known; the message names the row.

    Examples
    --------
    >>> known = place_hard_data([[0, 1, 7], [2.4, 0.6, 9]], (2, 3), "uint8")
    >>> print(known)
    [[-- -- --]
     [7 -- 9]]
    >>> wells = [[1005, 2012, 7], [1029, 2013, 9], [1021, 2011, 10]]
    >>> print(place_hard_data(wells, (2, 3), "uint8", origin=(1005, 2005), cell=(10, 10), several="mean"))
    [[-- -- --]
     [7 -- 10]]
    """
    data = table if isinstance(table, HardData) else _table(table)
    try:
        sides = tuple(index(side) for side in shape)
    except (TypeError, ValueError):
        sides = ()
    if len(sides) not in (2, 3) or min(sides) < 1:
        raise ValueError(f"shape is {shape!r}: give (rows, cols) of the picture, integers of 1 or more")
    kind = np.dtype(np.float64 if dtype is None else dtype).newbyteorder("=")
    if kind.kind not in "buif":
        raise TypeError(f"dtype is {kind}: give bool, or a type of integers or real floats")
    one_of("several", several, SEVERAL)
    if not len(data):
        raise ValueError("the hard data has no rows: give x, y and a value for each datum")
    if len(sides) > data.points.shape[1]:
        raise ValueError(f"shape is {shape!r}: give (rows, cols), or hard data with a column z after x and y")
    sites = _sites(data, sides, origin, cell)
    values = _cast(data, kind)
    known = ~np.isnan(data.values)
    if not known.any():
        raise ValueError("the hard data has no known value: give a number for one datum at least")
    variables = data.values.shape[1]
    placed = np.zeros((prod(sides), variables), dtype=kind)
    mask = np.ones((prod(sides), variables), dtype=bool)
    for k in range(variables):
        rows_known = np.flatnonzero(known[:, k])
        here, found = sites[rows_known], values[rows_known, k]
        if several != "refuse":
            here, found = (_mean if several == "mean" else _most)(here, found)
        placed[here, k], mask[here, k] = found, False
        wrong = np.flatnonzero(placed[here, k] != found)
        if len(wrong):
            one = int(rows_known[wrong[0]])
            other = int(rows_known[(here == sites[one]) & (found != values[one, k])][0])
            *layer, i, j = np.unravel_index(sites[one], sides)
            raise ValueError(
                f"{data.where(one)} and {data.where(other)} of the hard data are both at "
                f"{''.join(f'layer {z}, ' for z in layer)}row {i}, column {j} of the picture and have "
                f"{values[one, k]} and {values[other, k]} for {data.names[k]}: keep one of them, or let `several` say "
                "that their mean or the most frequent counts"
            )
    form = sides if variables == 1 else (*sides, variables)
    unknown = np.nan if kind.kind == "f" else 0
    return np.ma.MaskedArray(placed.reshape(form), mask=mask.reshape(form), fill_value=unknown)


def _mean(sites: NDArray[np.intp], values: NDArray[Any]) -> tuple[NDArray[np.intp], NDArray[Any]]:
    """Return each site once, with the mean of its values."""
    found, inverse, counts = np.unique(sites, return_inverse=True, return_counts=True)
    means = np.bincount(inverse, values / 2.0**64) / counts * 2.0**64  # no sum of doubles overflows
    return found, (means if values.dtype.kind == "f" else np.floor(means + 0.5)).astype(values.dtype)


def _most(sites: NDArray[np.intp], values: NDArray[Any]) -> tuple[NDArray[np.intp], NDArray[Any]]:
    """Return each site once, with the most frequent of its values; the first of equally frequent ones."""
    _, kinds = np.unique(values, return_inverse=True)
    pairs, first, counts = np.unique(sites * len(values) + kinds, return_index=True, return_counts=True)
    order = np.lexsort((first, -counts, pairs // len(values)))
    found, chosen = np.unique(pairs[order] // len(values), return_index=True)
    return found, values[first[order][chosen]]


def _sites(
    data: HardData, shape: tuple[int, ...], origin: Sequence[float] | None, cell: Sequence[float] | None
) -> NDArray[np.intp]:
    """Return the index of each datum's site, row by row."""
    axes = data.points.shape[1]
    lies = frame(origin, cell)
    at, size = np.array(((*lies.origin, 0.0)[:axes], (*lies.cell, 1.0)[:axes]))
    sides = np.array((1, *shape)[: -axes - 1 : -1])  # along x, y and z
    with np.errstate(invalid="ignore", over="ignore"):  # infinity is outside
        cells = (data.points - at) / size
        low = np.floor(cells)
        nearest = low + (cells - low >= 0.5)  # not floor(x + 0.5), which rounds the sum first
    outside = ~((nearest >= 0) & (nearest < sides)).all(axis=1)  # NaN too
    if outside.any():
        row = int(outside.argmax())
        there = ", ".join(f"{axis} {x}" for axis, x in zip("xyz", data.points[row], strict=False))
        first, last = at - size / 2, at + (sides - 0.5) * size
        ranges = ", ".join(f"{axis} from {a} to below {b}" for axis, a, b in zip("xyz", first, last, strict=False))
        raise ValueError(
            f"{data.where(row)} of the hard data is at {there}, outside of a picture of "
            f"{' x '.join(map(str, sides))} pixels (width x height{' x depth' * (axes > 2)}): give {ranges}, or tell "
            "`simulate` the origin and the size of its cells"
        )
    found: NDArray[np.intp] = np.zeros(len(data), np.intp)
    for axis in range(axes)[::-1]:
        found = found * sides[axis] + nearest[:, axis].astype(np.intp)
    return found


def _cast(data: HardData, kind: np.dtype[Any]) -> NDArray[Any]:
    """Return the values in the type ``kind``; unknown values are 0."""
    values = np.where(np.isnan(data.values), 0.0, data.values)
    found, wrong = cast(values, kind)
    wrong |= np.isinf(values)
    if kind.kind in "iu":
        wrong |= np.abs(values) >= 2**53  # the float64 of the table may have rounded these
    if wrong.any():
        row, variable = (int(k) for k in np.argwhere(wrong)[0])
        remedy = "finite values" if kind.kind == "f" else "0 and 1" if kind.kind == "b" else "integers below 2**53"
        raise ValueError(
            f"{data.where(row)} of the hard data has {values[row, variable]} for {data.names[variable]}, which {kind} "
            f"cannot hold: give {remedy} within its range, or a dtype that holds it"
        )
    return found
