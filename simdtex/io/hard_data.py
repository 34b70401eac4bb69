# SPDX-License-Identifier: BSD-3-Clause
"""Hard data: known values at points, read from a table and placed in the cells of a grid or the pixels of a picture.

x grows with the column, y with the row, and z with the layer. Without an origin and a size of cells they are in pixels:
(0, 0) is the centre of the first pixel, in row 0. NaN is an unknown value.
"""

from __future__ import annotations

import csv
import gzip
import os
import re
import warnings
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from io import BufferedReader, BytesIO
from math import isnan, prod
from operator import index
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from simdtex.io.files import BYTES, Refused, check_size, explained, needs, read_npy, reading
from simdtex.io.grids import CellFrame, count_of, frame, known_numbers, number_of
from simdtex.io.image import cast
from simdtex.io.rasters import axis_of
from simdtex.options import Brief, DataWarning, check_real, one_of

Floats = NDArray[np.float64]

SEVERAL = ("refuse", "mean", "most")
"""The treatments of different data in one cell."""

OUTSIDE = ("refuse", "skip")
"""The treatments of data outside the grid."""

ROLES = ("x", "y", "z", "value")
"""What a column of a table can be."""

_DIGITS = frozenset("+-.0123456789")
_COMMA = re.compile(r"[+-]?[0-9]*,[0-9]+(e[+-]?[0-9]+)?", re.IGNORECASE)
_GROUPED = re.compile("[+-]?[1-9][0-9]{0,2},[0-9]{3}")
"""A number with a decimal comma; and one whose comma may be between thousands."""

LIBRARIES = {".xlsx": "openpyxl", ".xlsm": "openpyxl", ".parquet": "pyarrow"}
"""The libraries with which pandas reads tables."""

SUFFIXES = (".csv", ".tsv", ".txt", ".dat", ".xyz", ".gz", *LIBRARIES, ".las", ".xls", ".ods")
"""How the name of a table of known values ends; the last are not read."""

_UNKNOWN = ("", "nan", "na", "n/a", "#n/a", "null", "none", "-")
"""Cells of an unknown value, in lower case."""


@dataclass(frozen=True, eq=False, repr=False)
class HardData(Brief):
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
        The line of each datum in the text, in the sheet or in the CSV of a DataFrame, counted from 1; None of an array.
    from_top : bool
        Whether y is the number of a row, from a column called row, which in a picture counts from the top.
    name : str
        What messages call the table: its file, if it has one.
    """

    points: Floats
    values: Floats
    names: tuple[str, ...]
    lines: tuple[int, ...] | None = None
    from_top: bool = False
    name: str = field(default="the hard data", repr=False)

    def __len__(self) -> int:
        return len(self.points)

    def where(self, row: int) -> str:
        """Return words for a datum: its line in the file, or its row, counted from 0."""
        return f"row {row}" if self.lines is None else f"line {self.lines[row]}"

    def upside_down(self, rows: int, lies: CellFrame | None = None) -> HardData:
        """Return a table in cells with y counted from the other edge of a grid of so many rows, as coordinates."""
        points = self.points.copy()
        points[:, 1] = rows - 1 - np.floor(points[:, 1] + 0.5)  # the centre of its cell
        if lies:
            points = np.array([at + size * line for at, size, line in zip(*lies, points.T, strict=False)]).T
        return replace(self, points=points, from_top=not self.from_top)


def read_hard_data(
    table: Any,
    *,
    columns: Mapping[str, str | Sequence[str]] | None = None,
    categories: Mapping[str, float] | None = None,
    missing: Iterable[float] = (),
    valid: tuple[float, float] | None = None,
    max_pixels: int | None = None,
) -> HardData:
    """Return the table of known values in a file, or in a DataFrame of pandas.

    Parameters
    ----------
    table : path or pandas.DataFrame
        A text with a datum in each line: x, y and a value, or one value for each of several variables. The first of
        semicolons, tabs, commas and blanks that occurs in the first line separates columns, or that of a first line
        ``sep=;``. Numbers have a decimal point, or all a decimal comma. A first line with fewer than two numbers is a
        header, which units may follow; without one, a comment before the data that names an axis is. An empty cell,
        NaN, NA and the like are unknown values. A comment begins with ``#``. A first column without a name is left out.
        It may be compressed (``.gz``), the first sheet of ``.xlsx``, or ``.parquet``, with ``simdtex[tables]``.

        Or a point set of Geo-EAS: a title, the number of columns, their names, each in a line, and a datum in each
        line. Or a NumPy ``.npy`` of real numbers, (data, 3 or more), with the columns x, y and values.
    columns : mapping, optional
        The names of the columns ``"x"``, ``"y"``, ``"z"`` and ``"value"``, which may be a list for several variables,
        or empty. A text that is no name is the number of a column: ``"1"`` is the first. By default names that mean an
        axis are that axis, in any order, as Xcoord, Easting, lon or column; z only if another column is left for the
        value. Without a header x and y are the first two columns. All other columns are values.
    categories : mapping of str to float, optional
        The number of each category that the table gives as a text, for example ``{"sand": 1, "shale": 0}``.
    missing : iterable of float
        Further numbers that mean an unknown value.
    valid : (low, high), optional
        The range of possible values: codes of an unknown value (`simdtex.io.grids.MISSING`, or 1e21 and above in size)
        outside of it are unknown. None: the range of the variable's values that are not such codes.
    max_pixels : int, optional
        The most cells, or bytes of a text, to read; None: ``SIMDTEX_MAX_PIXELS``, else 2**27.

    Returns
    -------
    HardData
        The data in the order of the file. Variables without a name are ``value``, or ``value 1`` and so on.

    Warns
    -----
    simdtex.options.DataWarning
        Values are taken as unknown, or columns of text, sheets or rows after ``#`` are left out.

    Raises
    ------
    ValueError
        The file is missing, no table, too large, names no columns x and y, or has an invalid row, whose line is named.
    """
    if isinstance(table, (str, os.PathLike)):
        name, suffix = os.fspath(table), Path(table).suffix.lower()
        each = BYTES if suffix in (".npy", *LIBRARIES) else 1
        with reading(table, "the hard data", max_pixels, each=each) as most, open(name, "rb") as file:
            if suffix == ".npy":
                data = _table(read_npy(file, os.fstat(file.fileno()).st_size, most))
            else:
                data = _parsed(*_text(file, suffix, most), columns, categories)
    else:
        name, data = HardData.name, _parsed(*_text_of(table), columns, categories)
    for variable, values in zip(data.names, data.values.T, strict=True):
        values[:] = known_numbers(f"{name}, column {variable}", values, missing, valid)
    return replace(data, name=name)


def _text(file: BufferedReader, suffix: str, most: int) -> tuple[str, bool]:
    """Return the text of a table, and whether its first line is a header in any case."""
    if suffix in SUFFIXES[-3:]:
        raise Refused(f"ends in {suffix}, which is not read: write x, y and values into a table (.csv)")
    if suffix not in LIBRARIES:
        data = file.read()
        if data.startswith(b"\x1f\x8b"):
            with explained(file.name, "the hard data", "a compressed table"), gzip.open(BytesIO(data)) as unpacked:
                data = unpacked.read(most + 1)
            check_size(0, len(data), most, 1)
        try:
            return data.decode("utf-8-sig"), False
        except UnicodeDecodeError:
            raise ValueError("the table is no text in UTF-8: save it as CSV in UTF-8") from None
    for library in ("pandas", LIBRARIES[suffix]):
        needs(library, "tables", f"a table in {suffix}")
    import pandas

    with explained(file.name, "the hard data", "a table"):
        if suffix == ".parquet":
            from pyarrow.parquet import read_metadata

            about = read_metadata(file)
            check_size(about.num_rows * about.num_columns, 0, most)
            return _text_of(pandas.read_parquet(file))
        with zipfile.ZipFile(file) as archive:
            check_size(0, sum(part.file_size for part in archive.infolist()), most)
        sheets = pandas.read_excel(file, sheet_name=None, header=None, dtype=object, na_filter=False)
    (name, sheet), *more = ((name, page) for name, page in sheets.items() if len(sheets) < 2 or not page.empty)
    if more:
        warnings.warn(f"{file.name}: only the first of its sheets, {name}, is read", DataWarning, stacklevel=2)
    return sheet.to_csv(index=False, header=False), False


def _text_of(frame: Any) -> tuple[str, bool]:
    """Return the text of a DataFrame, and that it has a header; an index without names is left out."""
    return frame.to_csv(index=any(name is not None for name in frame.index.names), quoting=csv.QUOTE_NONNUMERIC), True


def _parsed(text: str, header: bool, columns: Any, categories: Any) -> HardData:
    """Return the data in the text of a table or of a point set; without ``header`` its first line may have numbers."""
    lines = text.splitlines()
    said = re.fullmatch('"?sep=(.)"?', lines[0]) if lines else None  # Excel's
    width = count_of(lines[1]) if len(lines) > 1 and not (said or header) else None
    begin = 2 + width if width else bool(said)
    names = [re.split(r"\t|\s\s", line.strip())[0] for line in lines[2:begin]]  # units may follow
    kept = {at: line.strip(" ") for at, line in enumerate(lines[begin:], begin + 1) if line.strip(' \t,;"')}
    comments = {at: kept.pop(at).strip("# ") for at in [*kept] if kept[at].startswith("#")}
    if not kept:
        what = f"the point set has no line after the names of {width} columns" if width else "the table is empty"
        raise ValueError(f"{what}: give a line with x, y and a value for each datum")
    first, line = next(iter(kept.items()))
    delimiter = said[1] if said else next((sign for sign in ";\t," if sign in line.partition(" #")[0]), None)
    count = width or len(_cells(line, first, delimiter))
    rows = {at: _cells(line, at, delimiter, count) for at, line in kept.items()}
    if (cells := len(rows[first])) < 3 and not (cells == 2 and columns and columns.get("value") == []):
        raise ValueError(
            f"line {first} has {cells} cell{'s' * (cells != 1)}: give x, y and one value or more, "
            "with commas, semicolons, tabs or blanks between them"
        )
    for at, line in comments.items():
        if at > first and line.count(delimiter or "#") == count - 1:
            warnings.warn(f"line {at} begins with #, and is left out as a comment", DataWarning, stacklevel=2)
    for at, row in rows.items():
        if len(row) != count:
            raise ValueError(f"line {at} has {len(row)} cells and those before it {count}: give as many in all")
    if not width and (header or sum(cell[:1] in _DIGITS for cell in rows[first] if cell) < 2):
        names = rows.pop(first)
        units = next(iter(rows), 0)
        if rows and all(number_of(cell.replace(",", ".")) is None for cell in rows[units]):
            del rows[units]
        if not rows:
            raise ValueError("the table has a header and no rows: give a line with x, y and a value for each datum")
    elif not width and (above := [line for at, line in comments.items() if at < first]):  # numpy.savetxt
        words = _cells(above[-1], first, delimiter), re.split(r"[\s,;]+", above[-1])
        names = next((some for some in words if len(some) == count and any(map(axis_of, some))), [])
    return _of_columns(list(zip(*rows.values(), strict=True)), names, tuple(rows), columns, categories)


def _cells(line: str, at: int, delimiter: str | None, count: int = 0) -> list[str]:
    """Return the cells of a line, without a comment after ``#`` if they are then ``count``, or with 0 three or more."""
    before, *comment = re.split(r"\s#", line, maxsplit=1)
    if comment and (count or 3) <= len(before.split(delimiter)) <= (count or np.inf):
        line = before
    if delimiter is None:
        return line.split()
    try:
        cells = next(csv.reader([line], delimiter=delimiter, strict=True, skipinitialspace=True))
    except csv.Error as error:
        raise ValueError(f"line {at} cannot be split into cells ({error}): check its quotation marks") from None
    return [cell.strip() for cell in cells]


def _of_columns(
    cells: Sequence[Sequence[str]], names: list[str], lines: tuple[int, ...], columns: Any, categories: Any
) -> HardData:
    """Return the data of columns of texts; ``names`` are those of a header, ``lines`` the numbers of the rows."""
    listed = dict(enumerate(names or map(str, range(1, len(cells) + 1))))
    if names and (not names[0] or names[0].startswith("Unnamed: 0")):  # the index of pandas
        del listed[0]
    points, values = _roles(listed, bool(names), columns or {})
    codes = {str(text).strip().lower(): float(code) for text, code in (categories or {}).items()}
    codes |= dict.fromkeys(_UNKNOWN, np.nan)
    used = [cell for k in (*points, *values) for cell in cells[k]]
    if commas := [cell for cell in used if "," in cell and _COMMA.fullmatch(cell)]:
        if all(map(_GROUPED.fullmatch, commas)) or any("." in cell and number_of(cell) is not None for cell in used):
            raise ValueError(f"the comma of {commas[0]!r} may be one of thousands: write numbers with a decimal point")
        cells = [[cell.replace(",", ".") if _COMMA.fullmatch(cell) else cell for cell in column] for column in cells]
    numbers = {k: [number_of(cell) for cell in cells[k]] for k in points}
    numbers |= {k: [codes.get(cell.lower(), number_of(cell)) for cell in cells[k]] for k in values}
    if not categories and not (columns and "value" in columns):  # without names of wells
        left = [k for k in values if all(value is None or isnan(value) for value in numbers[k])]
        if 0 < len(left) < len(values):
            values = [k for k in values if k not in left]
            shown = ", ".join(listed[k] for k in left)
            warnings.warn(f"left out, because they hold text: the columns {shown}", DataWarning, stacklevel=2)
    labels = tuple((names and names[k]) or name for k, name in zip(values, _plain(len(values)), strict=True))
    at, measured = (np.array([numbers[k] for k in some], np.float64).T.copy() for some in (points, values))
    data = HardData(at, measured, labels, lines, listed[points[1]].strip().lower() == "row")
    for k in (*points, *values):
        if None in numbers[k]:
            row = numbers[k].index(None)
            remedy = "write numbers with a decimal point"
            if k in values:
                remedy += ", leave the cell of an unknown value empty, or give the numbers of categories (--categories)"
            what = f"{cells[k][row][:40]!r} in column {k + 1}, which is no number"
            raise ValueError(f"{data.where(row)} has {what}: {remedy}")
    return data


def _plain(count: int) -> tuple[str, ...]:
    """Return the names of variables without names."""
    return ("value",) if count == 1 else tuple(f"value {k + 1}" for k in range(count))


def _roles(names: dict[int, str], named: bool, columns: Mapping[str, Any]) -> tuple[list[int], list[int]]:
    """Return the columns of coordinates, and those of values; without a header ``names`` are numbers."""
    listed = {str(k + 1): k for k in names} | {name: k for k, name in names.items()}
    shown = ", ".join(map(repr, names.values()))
    chosen: dict[str, list[int]] = {} if named else {"x": [0], "y": [1]}
    for role, wanted in columns.items():
        chosen[role] = []
        for name in [wanted] if isinstance(wanted, (str, int)) else wanted:
            if role not in ROLES or name not in listed:
                remedy = f"name x, y, z, value of {shown}, or count them from '1' on"
                raise ValueError(f"there is no column {name!r} for {role!r}: {remedy}")
            chosen[role].append(listed[name])
    taken = [k for some in chosen.values() for k in some]
    for axis in "xyz":
        of_axis = [k for k, name in names.items() if k not in taken and axis_of(name) == axis]
        last = axis == "z" and "value" not in chosen and len(names) - len(taken) < 2
        if axis in chosen or not of_axis or last:
            continue
        if len(of_axis) > 1:
            several = " and ".join(repr(names[k]) for k in of_axis)
            raise ValueError(f"the columns {several} mean {axis}: choose one, {_example(axis, of_axis[0])}")
        chosen[axis] = of_axis
        taken += of_axis
    if lacking := [axis for axis in "xy" if axis not in chosen]:
        what = f"no column of {shown} is called {lacking[0]}, or a word for it"
        raise ValueError(f"{what}: choose columns by name or number, {_example(lacking[0], next(iter(names)))}")
    values = chosen.get("value", [k for k in names if k not in taken])
    if not values and "value" not in chosen:
        raise ValueError("the table has coordinates and no values: give x, y and one value or more")
    if twice := [names[k] for k in (*taken, *values) if list(names.values()).count(names[k]) > 1 and names[k]]:
        raise ValueError(f"two columns are called {twice[0]}: rename one")
    return [chosen[axis][0] for axis in "xyz" if axis in chosen], values


def _example(role: str, column: int) -> str:
    number = column + 1
    return f"as {{{role!r}: '{number}', ...}} in Python or --columns {role}={number},... on the command line"


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
    rows: Floats = np.array(np.ma.filled(numbers.astype(np.float64), np.nan))
    return HardData(rows[:, :2], rows[:, 2:], _plain(rows.shape[1] - 2))


def place_hard_data(
    table: HardData | ArrayLike,
    shape: Sequence[int],
    dtype: DTypeLike | None = None,
    *,
    origin: Sequence[float] | None = None,
    cell: Sequence[float] | None = None,
    several: Literal["refuse", "mean", "most"] = "refuse",
    outside: Literal["refuse", "skip"] = "refuse",
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
    outside : {"refuse", "skip"}
        Data outside the grid: an error; or they are left out, with a warning of their number.

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
        A datum is outside of the grid, two data of one cell have different values, the type cannot hold a value, or
        nothing is known; the message names the row.

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
    one_of("outside", outside, OUTSIDE)
    if not len(data):
        raise ValueError("the hard data has no rows: give x, y and a value for each datum")
    sites, inside = sites_of(data, sides, outside == "skip", origin, cell)
    if not inside.all():
        lines = data.lines and tuple(np.array(data.lines)[inside].tolist())
        data = replace(data, points=data.points[inside], values=data.values[inside], lines=lines)
    values = _cast(data, kind)
    known = ~np.isnan(data.values)
    if not known.any():
        raise ValueError(f"{data.name} has no known value in the picture: give a number for one datum at least")
    variables = data.values.shape[1]
    placed = np.zeros((prod(sides), variables), dtype=kind)
    mask = np.ones((prod(sides), variables), dtype=bool)
    for k in range(variables):
        rows = np.flatnonzero(known[:, k])
        here, counted = sites[rows], values[rows, k]
        if several != "refuse":
            here, counted = (_mean if several == "mean" else _most)(here, counted)
        placed[here, k], mask[here, k] = counted, False
        wrong = np.flatnonzero(placed[here, k] != counted)
        if len(wrong):
            first = int(rows[wrong[0]])
            other = int(rows[(here == sites[first]) & (counted != values[first, k])][0])
            *layer, i, j = np.unravel_index(sites[first], sides)
            raise ValueError(
                f"{data.where(first)} and {data.where(other)} of {data.name} are both at "
                f"{''.join(f'layer {z}, ' for z in layer)}row {i}, column {j} of the picture and have "
                f"{values[first, k]} and {values[other, k]} for {data.names[k]}: keep one of them, or take their "
                'mean or the most frequent, several="mean" or "most" (--several)'
            )
    form = sides if variables == 1 else (*sides, variables)
    unknown = np.nan if kind.kind == "f" else 0
    return np.ma.MaskedArray(placed.reshape(form), mask=mask.reshape(form), fill_value=unknown)


def _mean(sites: NDArray[np.intp], values: NDArray[Any]) -> tuple[NDArray[np.intp], NDArray[Any]]:
    """Return each site once, with the mean of its values."""
    each, inverse, counts = np.unique(sites, return_inverse=True, return_counts=True)
    means = np.bincount(inverse, values / 2.0**64) / counts * 2.0**64  # no sum of doubles overflows
    return each, (means if values.dtype.kind == "f" else np.floor(means + 0.5)).astype(values.dtype)


def _most(sites: NDArray[np.intp], values: NDArray[Any]) -> tuple[NDArray[np.intp], NDArray[Any]]:
    """Return each site once, with the most frequent of its values; the first of equally frequent ones."""
    _, kinds = np.unique(values, return_inverse=True)
    pairs, first, counts = np.unique(sites * len(values) + kinds, return_index=True, return_counts=True)
    order = np.lexsort((first, -counts, pairs // len(values)))
    each, chosen = np.unique(pairs[order] // len(values), return_index=True)
    return each, values[first[order][chosen]]


def sites_of(
    data: HardData, shape: tuple[int, ...], skip: bool, origin: Any = None, cell: Any = None
) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Return the index, row by row, of the site of each datum inside of the grid, and which data are inside."""
    lies, axes = frame(origin, cell), data.points.shape[1]
    if len(shape) > axes:
        raise ValueError(f"shape is {shape!r}: give (rows, cols), or {data.name} with a column z (--columns z=NAME)")
    at, size = np.array(((*lies.origin, 0.0)[:axes], (*lies.cell, 1.0)[:axes]))
    sides = (1, *shape)[: -axes - 1 : -1]  # along x, y and, of such data, z
    with np.errstate(invalid="ignore", over="ignore"):  # infinity is outside
        cells = (data.points - at) / size
        low = np.floor(cells)
        nearest = low + (cells - low >= 0.5)  # not floor(x + 0.5), which rounds the sum first
    inside = ((nearest >= 0) & (nearest < sides)).all(axis=1)  # not of NaN
    if skip and not inside.all():
        skipped = f"{np.count_nonzero(~inside)} of {len(data)} data are outside of the grid and are left out"
        warnings.warn(skipped, DataWarning, stacklevel=3)
    elif not inside.all():
        row = int(inside.argmin())
        there = ", ".join(f"{axis} {x}" for axis, x in zip("xyz", data.points[row], strict=False))
        ends = at - size / 2, at + (np.array(sides) - 0.5) * size
        reach = np.fmin.reduce(data.points), np.fmax.reduce(data.points)
        ranges = map("{} {:.12g} to {:.12g} (all points {:.12g} to {:.12g})".format, "xyz", *ends, *reach)
        raise ValueError(
            f"{data.where(row)} of {data.name} is at {there}, outside of a picture of {' x '.join(map(str, sides))} "
            f"pixels (width x height{' x depth' * (len(sides) > 2)}), {', '.join(ranges)}: give `simulate` the centre "
            "of the first cell, origin=(x, y) (--origin X,Y), and the size of a cell, cell=(dx, dy) (--cell DX,DY), in "
            'the units of the table, or leave such points out with outside="skip" (--outside skip)'
        )
    return np.ravel_multi_index(tuple(nearest[inside].T.astype(np.intp)), sides, order="F"), inside


def _cast(data: HardData, kind: np.dtype[Any]) -> NDArray[Any]:
    """Return the values in the type ``kind``; unknown values are 0."""
    values = np.where(np.isnan(data.values), 0.0, data.values)
    kept, wrong = cast(values, kind)
    wrong |= np.isinf(values)
    if kind.kind in "iu":
        wrong |= np.abs(values) >= 2**53  # the float64 of the table may have rounded these
    if wrong.any():
        row, variable = (int(k) for k in np.argwhere(wrong)[0])
        remedy = "finite values" if kind.kind == "f" else "0 and 1" if kind.kind == "b" else "integers below 2**53"
        raise ValueError(
            f"{data.where(row)} of {data.name} has {values[row, variable]} for {data.names[variable]}, which {kind} "
            f"cannot hold: give {remedy} within its range, or a dtype (of the training image) that holds it"
        )
    return kept
