# SPDX-License-Identifier: BSD-3-Clause
"""Hard data: values known at points, read from a table and placed on the sites of a picture.

x is the column and y the row, in pixels: (0, 0) is the centre of the first pixel and row 0 is at the top. NaN is an
unknown value.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from operator import index
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from simdtex.io.image import cast
from simdtex.io.limits import BYTES, TooLarge, check_file, max_pixels_or_default, read_npy

PathLike = str | os.PathLike[str]
Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class HardData:
    """A table of known values, a row for each datum; `len` is the number of data.

    Attributes
    ----------
    points : ndarray of float64, (data, 2)
        x and y of each datum, pixels.
    values : ndarray of float64, (data, variables)
        NaN if a variable is unknown.
    names : tuple of str
        The name of each variable.
    lines : tuple of int, or None
        The line of the file that each datum is from, counted from 1; None if it is from no text.
    """

    points: Floats
    values: Floats
    names: tuple[str, ...]
    lines: tuple[int, ...] | None = None

    def __len__(self) -> int:
        return len(self.points)

    def where(self, row: int) -> str:
        """Name a datum by its line in the file, or by its row, counted from 0."""
        return f"row {row}" if self.lines is None else f"line {self.lines[row]}"


def read_hard_data(path: PathLike, *, max_pixels: int | None = None) -> HardData:
    """Read a table of known values.

    Parameters
    ----------
    path : path
        A text with a datum in each line: x, y and a value, or one value for each of several variables. Cells are
        separated by semicolons, tabs, commas or blanks: the first of these, in this order, that is in the first line.
        Numbers have a decimal point. An empty cell, or NaN, is an unknown value. A first line with names for x and y
        is a header, which names the variables. From ``#`` to the end of a line is a comment. Or a NumPy ``.npy`` of
        real numbers, (data, 3 or more), with the same columns.
    max_pixels : int, optional
        The most cells, or bytes of a text, that are read. None: ``SIMDTEX_MAX_PIXELS`` of the environment, else 2**27.

    Returns
    -------
    HardData
        The rows in the order of the file. Variables without a name are ``value``, or ``value 1`` and so on.

    Raises
    ------
    ValueError
        The file is missing, no table, too large, has no rows, or a row is wrong; the message names the line.

    Notes
    -----
    About 8 s for a million rows of text.
    """
    name = os.fspath(path)
    most = max_pixels_or_default(max_pixels)
    binary = Path(path).suffix.lower() == ".npy"
    check_file(path, "the hard data", most if binary else -(-most // BYTES))
    try:
        if binary:
            with open(path, "rb") as file:
                return _table(read_npy(file, os.fstat(file.fileno()).st_size, most))
        with open(path, encoding="utf-8-sig") as text:
            return _parsed(text)
    except TooLarge as error:
        raise ValueError(f"{name} {error}") from None
    except UnicodeDecodeError:
        raise ValueError(f"{name} is no text in UTF-8: save the table as CSV in UTF-8") from None
    except OSError as error:
        raise ValueError(f"{name} cannot be read ({error.strerror}): check the path") from None
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name}: {error}") from None


def _parsed(text: Iterable[str]) -> HardData:
    """Parse the lines of a table."""
    stripped = ((number, line.partition("#")[0].strip("\r\n ")) for number, line in enumerate(text, 1))
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
    if all(cell[:1].isalpha() and _number(cell) is None for cell in rows[0][1][:2]):
        names = rows.pop(0)[1]
        _check_order(names)
    if not rows:
        raise ValueError("the table has a header and no rows: give a line with x, y and a value for each datum")
    for number, cells in rows:
        if len(cells) != columns:
            raise ValueError(f"line {number} has {len(cells)} cells and those before it {columns}: give as many in all")
    table = np.empty((len(rows), columns))
    for k, (number, cells) in enumerate(rows):
        for column, cell in enumerate(cells):
            value = np.nan if not cell and column >= 2 else _number(cell)
            if value is None:
                raise ValueError(
                    f"line {number} has {cell[:40]!r} in column {column + 1}, which is no number: write numbers with a "
                    "decimal point" + (", and leave the cell of an unknown value empty" if column >= 2 else "")
                )
            table[k, column] = value
    return HardData(table[:, :2], table[:, 2:], _names(columns - 2, names), tuple(number for number, _ in rows))


def _cells(line: str, number: int, delimiter: str | None) -> list[str]:
    if delimiter is None:
        return line.split()
    try:
        cells = next(csv.reader([line], delimiter=delimiter, strict=True, skipinitialspace=True))
    except csv.Error as error:
        raise ValueError(f"line {number} cannot be split into cells ({error}): check its quotation marks") from None
    return [cell.strip() for cell in cells]


def _number(cell: str) -> float | None:
    try:
        return float(cell)
    except ValueError:
        return None


def _check_order(header: Sequence[str]) -> None:
    """Raise unless a header that names x and y has them in front."""
    names = [name.lower() for name in header]
    if ("x" in names and names[0] != "x") or ("y" in names and names[1] != "y") or names[0] in ("row", "rows"):
        raise ValueError(
            f"the columns are {', '.join(header)}: put them in the order x (the column), y (the row), and the values"
        )


def _names(variables: int, header: Sequence[str] | None = None) -> tuple[str, ...]:
    plain = ["value"] if variables == 1 else [f"value {k + 1}" for k in range(variables)]
    return tuple(given or name for given, name in zip(header[2:] if header else plain, plain, strict=True))


def _table(array: Any) -> HardData:
    """Convert an array of rows."""
    try:
        numbers = np.ma.asarray(array)
    except ValueError:
        raise ValueError("the rows of hard data are of unequal length: give x, y and the same values in each") from None
    if numbers.size == 0:
        raise ValueError("the hard data has no rows: give x, y and a value for each datum")
    if numbers.dtype.kind not in "buif":
        raise TypeError(f"the hard data holds {numbers.dtype} values: give real numbers")
    if numbers.ndim != 2 or numbers.shape[1] < 3:
        raise ValueError(f"the hard data has the shape {numbers.shape}: give (data, 3) of x, y, value, or more values")
    found = np.where(np.ma.getmaskarray(numbers), np.nan, numbers.data).astype(np.float64)
    return HardData(found[:, :2], found[:, 2:], _names(numbers.shape[1] - 2))


def place_hard_data(
    table: HardData | ArrayLike, shape: Sequence[int], dtype: DTypeLike | None = None
) -> np.ma.MaskedArray:
    """Place known values on the sites of a picture.

    Parameters
    ----------
    table : HardData or array_like, (data, 3 or more)
        x, y and the value of each datum, or one value for each of several variables; NaN is unknown. x is the column
        and y the row, in pixels: (0, 0) is the centre of the first pixel, and row 0 is at the top. A datum belongs to
        the nearest site; halfway between two, to the one at the right or below (1.5 goes to 2, -0.5 to 0).
    shape : (rows, cols)
        The size of the picture.
    dtype : dtype, optional
        The type of the values, which must be the training image's; None is float64. Integers must be exact; floats
        are rounded to the type.

    Returns
    -------
    MaskedArray, (rows, cols) or (rows, cols, variables)
        The known values; unknown ones are masked. A single variable has no last axis. ``filled()`` replaces unknown
        values by NaN, or by 0 if the type is not of floats.

    Raises
    ------
    TypeError
        The table or the type is not of real numbers.
    ValueError
        A coordinate is not finite, a datum is outside of the picture, two data at one site have different values, the
        type cannot hold a value, or nothing is known; the message names the row.

    Examples
    --------
    >>> known = place_hard_data([[0, 1, 7], [2.4, 0.6, 9]], (2, 3), "uint8")
    >>> print(known)
    [[-- -- --]
     [7 -- 9]]
    """
    data = table if isinstance(table, HardData) else _table(table)
    try:
        rows, cols = (index(side) for side in shape)
    except (TypeError, ValueError):
        rows = cols = 0
    if rows < 1 or cols < 1:
        raise ValueError(f"shape is {shape!r}: give (rows, cols) of the picture, integers of 1 or more")
    kind = np.dtype(np.float64 if dtype is None else dtype).newbyteorder("=")
    if kind.kind not in "buif":
        raise TypeError(f"dtype is {kind}: give bool, or a type of integers or real floats")
    if not len(data):
        raise ValueError("the hard data has no rows: give x, y and a value for each datum")
    sites = _sites(data, rows, cols)
    values = _cast(data, kind)
    known = ~np.isnan(data.values)
    if not known.any():
        raise ValueError("the hard data has no known value: give a number for one datum at least")
    variables = data.values.shape[1]
    placed = np.zeros((rows * cols, variables), dtype=kind)
    mask = np.ones((rows * cols, variables), dtype=bool)
    for k in range(variables):
        rows_known = np.flatnonzero(known[:, k])
        here = sites[rows_known]
        placed[here, k], mask[here, k] = values[rows_known, k], False
        wrong = np.flatnonzero(placed[here, k] != values[rows_known, k])
        if len(wrong):
            one = int(rows_known[wrong[0]])
            other = int(rows_known[(here == sites[one]) & (values[rows_known, k] != values[one, k])][0])
            i, j = divmod(int(sites[one]), cols)
            raise ValueError(
                f"{data.where(one)} and {data.where(other)} of the hard data are both at row {i}, column {j} of the "
                f"picture and have {values[one, k]} and {values[other, k]} for {data.names[k]}: keep one of them"
            )
    form = (rows, cols) if variables == 1 else (rows, cols, variables)
    unknown = np.nan if kind.kind == "f" else 0
    return np.ma.MaskedArray(placed.reshape(form), mask=mask.reshape(form), fill_value=unknown)


def _sites(data: HardData, rows: int, cols: int) -> NDArray[np.intp]:
    """Return the index of each datum's site, row by row."""
    low = np.floor(data.points)
    with np.errstate(invalid="ignore"):  # infinity is outside
        nearest = low + (data.points - low >= 0.5)  # not floor(x + 0.5), which rounds the sum first
    outside = ~((nearest >= 0) & (nearest <= (cols - 1, rows - 1))).all(axis=1)  # NaN too
    if outside.any():
        row = int(outside.argmax())
        x, y = data.points[row]
        raise ValueError(
            f"{data.where(row)} of the hard data is at x {x}, y {y}, outside of a picture of {cols} x {rows} pixels "
            f"(width x height): give x from -0.5 to below {cols - 0.5}, y from -0.5 to below {rows - 0.5}"
        )
    sites: NDArray[np.intp] = (nearest[:, 1] * cols + nearest[:, 0]).astype(np.intp)
    return sites


def _cast(data: HardData, kind: np.dtype[Any]) -> NDArray[Any]:
    """Return the values in another type; unknown ones are 0."""
    values = np.where(np.isnan(data.values), 0.0, data.values)
    found, wrong = cast(values, kind)
    wrong |= np.isinf(values)
    if kind.kind in "iu":
        wrong |= np.abs(values) >= 2**53  # float64, which the table was read as, may have rounded these
    if wrong.any():
        row, variable = (int(k) for k in np.argwhere(wrong)[0])
        remedy = "finite values" if kind.kind == "f" else "0 and 1" if kind.kind == "b" else "integers below 2**53"
        raise ValueError(
            f"{data.where(row)} of the hard data has {values[row, variable]} for {data.names[variable]}, which {kind} "
            f"cannot hold: give {remedy} within its range, or a dtype that holds it"
        )
    return found
