# SPDX-License-Identifier: BSD-3-Clause
"""Grids of cells in file formats of geostatistics: the text of GSLIB and Geo-EAS, and the binary grids of SGeMS.

An array of values has the axes (z, y, x), each in ascending order of its coordinate: row 0 is the smallest y, as in the
files, where x varies fastest, then y, then z. The origin is the centre of the first cell.
"""

from __future__ import annotations

import os
import re
import struct
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from io import BufferedReader
from math import isfinite, prod
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex.io.files import BYTES, PathLike, atomic_path, check_size, check_target, explained, reading
from simdtex.io.image import cast
from simdtex.io.rasters import NETCDF, RASTERS, TIFF, Georeference, is_raster, read_cells, read_netcdf, write_cells
from simdtex.options import Brief, DataWarning, check_real, require, shown

__all__ = ["MISSING", "SUFFIXES", "CartesianGrid", "check_grid", "frame", "kind_of", "read_grid", "write_grid"]

Array = NDArray[Any]
Masked = np.ma.MaskedArray[Any, Any]

SUFFIXES = (".gslib", ".sgems", ".tif")
"""The suffixes for writing grids; files to read are recognised by their first lines."""

MISSING = (-99.0, -999.0, -999.25, -9999.0, -99999.0, -997799.0, -9966699.0, -9999999.0)
"""Codes of an unknown value: Petrel's, GSLIB's, that of LAS, those of maps, MPSlib's, SGeMS's, and DeeSse's."""

TRIMMED = 1e21
"""The size from which GSLIB takes a number as unknown, below and above 0."""

NO_DATA = -9966699
"""The number that is written for an unknown value, that of SGeMS."""

MAGIC = b"\xb2\x11\x17\x5d"

_BLOCKS = (b"\0\0\0\x0cRegionBlock\0", b"\0\0\0\x0bGroupBlock\0")
_WHOLE = (np.uint8, np.int16, np.int32)
_SIDES = re.compile(r"\(\s*([0-9]+)\s*x\s*([0-9]+)\s*x\s*([0-9]+)\s*\)\s*$")
_FAR = 1e30
"""The largest coordinate, far below the largest 32-bit float."""

_LINE = 2**14
"""The most bytes of a line of a header."""


class CellFrame(NamedTuple):
    """The position of cells: the centre of the first and the size of each, (x, y) or (x, y, z)."""

    origin: tuple[float, ...]
    cell: tuple[float, ...]

    @property
    def told(self) -> bool:
        """Whether it is a position: the origin 0 with cells of 1 only counts columns and rows."""
        return any(self.origin) or any(size != 1 for size in self.cell)


@dataclass(frozen=True, eq=False, repr=False)
class CartesianGrid(Brief):
    """A grid of cells with its variables.

    Attributes
    ----------
    values : dict of str to ndarray, (nz, ny, nx)
        The variables by name, in the order of the file. Integers have the smallest type of uint8, int16 and int32 that
        holds them; all other numbers are float64 from a text and float32 from SGeMS. NaN is unknown.
    origin : (x, y, z)
        The centre of the first cell.
    cell : (x, y, z)
        The size of a cell.
    crs : str
        The coordinate reference system as WKT; empty if unknown.
    about : dict of str to dict
        Attributes in CF of the axes ``x``, ``y`` and ``z`` and of variables, by name: ``long_name``, ``units``...
    """

    values: dict[str, Array]
    origin: tuple[float, ...]
    cell: tuple[float, ...]
    crs: str = ""
    about: dict[str, dict[str, str]] = field(default_factory=dict)

    @property
    def frame(self) -> CellFrame:
        """The position of its cells."""
        return CellFrame(self.origin, self.cell)

    @property
    def georeference(self) -> Georeference | None:
        """The georeference of a picture of a layer, north at the top; None if the grid has no position."""
        rows = next(iter(self.values.values())).shape[-2]
        return Georeference.of_cells(*self.frame, rows, self.crs) if self.frame.told else None


def frame(origin: Sequence[float] | None, cell: Sequence[float] | None) -> CellFrame:
    """Check the position of cells, and return it; None is 0 for the origin and 1 for the size of a cell."""
    first = None if origin is None else _numbers("origin", origin)
    size = None if cell is None else _numbers("cell", cell)
    axes = len(first or size or "xy")
    first, size = first or (0.0,) * axes, size or (1.0,) * axes
    if len(first) != len(size):
        raise ValueError(f"origin has {len(first)} numbers and cell {len(size)}; give as many")
    if min(size) < 1 / _FAR:
        raise ValueError(f"cell is {size}; give sizes above 0, from {1 / _FAR:g} on")
    if any(side < abs(at) * 2.0**-40 for at, side in zip(first, size, strict=True)):
        raise ValueError(f"cells of {size} cannot be told apart at {first}; give coordinates nearer to 0")
    return CellFrame(first, size)


def _numbers(name: str, values: Sequence[float]) -> tuple[float, ...]:
    try:
        numbers = tuple(float(value) for value in values)
    except (TypeError, ValueError):
        numbers = ()
    if len(numbers) not in (2, 3) or not all(abs(value) < _FAR for value in numbers):
        raise ValueError(f"{name} is {shown(values)}; give (x, y) or (x, y, z), numbers below {_FAR:g}")
    return numbers


def known_numbers(
    what: str, values: Array, missing: Iterable[float] = (), valid: tuple[float, float] | None = None
) -> Array:
    """Return values with NaN for ``missing`` ones and for codes outside of ``valid``, and warn of their number."""
    if not missing and (
        values.size == 0 or (np.fmin.reduce(values, None) > max(MISSING) and np.fmax.reduce(values, None) < TRIMMED)
    ):
        return values
    coded = np.isin(values, MISSING) | ((np.abs(values) >= TRIMMED) & np.isfinite(values))
    others = values[~(coded | np.isnan(values))]
    others = others if others.size else values[~(np.isin(values, MISSING) | np.isnan(values))]
    low, high = valid or ((others.min(), others.max()) if others.size else (np.inf, -np.inf))
    unknown = (coded & ~((values >= low) & (values <= high))) | np.isin(values, tuple(missing))
    if not unknown.any():
        return values
    codes = np.unique(values[unknown])
    shown = ", ".join(f"{code:.10g}" for code in codes[:3]) + ", ..." * (len(codes) > 3)
    warnings.warn(
        f"{what}: {np.count_nonzero(unknown)} of {values.size} values are {shown}, and are taken as unknown",
        DataWarning,
        stacklevel=2,
    )
    return np.where(unknown, values.dtype.type(np.nan) if values.dtype.kind == "f" else np.nan, values)


def kind_of(path: PathLike) -> str | None:
    """Return ``"grid"`` (GSLIB, geone, SGeMS), ``"points"`` (Geo-EAS), ``"netcdf"``, ``"raster"`` or None."""
    if not os.path.isfile(path):
        return None
    try:
        with open(path, "rb") as file:
            head = file.peek(5)[:5]
            if head.startswith(MAGIC) or "NX" in _geone_header(file):
                return "grid"
            if head.startswith(NETCDF):
                return "netcdf"
            if head.startswith(TIFF) and is_raster(file):
                return "raster"
            file.seek(0)
            title, second, third = (_text(file.readline(_LINE)) for _ in range(3))
    except OSError:
        return None
    if not title.startswith("#"):
        if (count := count_of(second, third)) is not None:
            return "grid" if count == 1 or _of_title(title) else "points"
        words, after = second.split(), third.split()
        table = len(after) == len(words) and _all_numbers(after)
        if len(words) in (4, 10, 11) and words[0].isdigit() and _all_numbers(words) and not table:
            return "grid"
    return "raster" if head.lower() == b"ncols" or _suffix(path) in RASTERS else None


def count_of(line: str, after: str = "") -> int | None:
    """Return the number of variables in the second line of Geo-EAS, or None; ``after`` is the third line."""
    words = line.split()
    if not words or not _is_count(words[0]):
        return None
    table = len(words) > 1 and (number_of(words[1].strip(",;") or 0) is not None or len(after.split()) == len(words))
    return None if table else int(words[0])


def _is_count(word: str) -> bool:
    return bool(re.fullmatch("[0-9]{1,9}", word)) and int(word) > 0


def read_grid(
    path: PathLike,
    *,
    variables: Iterable[str] | None = None,
    missing: Iterable[float] = (),
    valid: tuple[float, float] | None = None,
    max_pixels: int | None = None,
) -> CartesianGrid:
    """Return the grid in a file of GSLIB, geone, SGeMS, NetCDF, HDF5 or a raster of GDAL, recognised by its content.

    Parameters
    ----------
    path : path
        A text, see the notes; a Cartesian grid saved by SGeMS; a raster, such as a GeoTIFF or ESRI ASCII; or a NetCDF
        or HDF5 file.
    variables : iterable of str, optional
        The names of the variables to return; None: all.
    missing : iterable of float
        Further numbers that mean an unknown value; they become NaN.
    valid : (low, high), optional
        The range of possible values. A known code of an unknown value (`MISSING`, or 1e21 and above in size) outside
        of it becomes NaN. None: the range of the variable's values that are not such codes.
    max_pixels : int, optional
        The most values that are read; None: ``SIMDTEX_MAX_PIXELS``, else 2**27.

    Returns
    -------
    CartesianGrid
        Values (nz, ny, nx), the centre of the first cell, and the size of a cell.

    Warns
    -----
    simdtex.options.DataWarning
        Values are taken as unknown.

    Raises
    ------
    ValueError
        The file is missing, is not a grid, is too large, or its header and its length disagree. The length is compared
        before memory is allocated.

    Notes
    -----
    A text has a title, the number of variables, their names, each in a line, and a value of each variable for each
    cell, x fastest. It gives the number of cells in one of four ways:

    * the first line is ``nx ny nz``, or ``nx ny nz sx sy sz ox oy oz`` with sizes and the corner of the grid (DeeSse);
    * the second line is ``variables nx ny nz``, or ``variables nx ny nz xmn ymn zmn xsiz ysiz zsiz`` with the first
      centre and sizes (GSLIB); a last number is that of realisations, which follow each other;
    * the title ends in ``(NXxNYxNZ)`` (SGeMS);
    * the first lines begin with ``#`` and have ``NX``, ``SX``, ``OX`` and so on (geone); the next line has the names.

    Without these numbers the origin is 0 and the size of a cell 1. Regions and groups of SGeMS are ignored. NetCDF and
    HDF5 need the extra ``simulate``, rasters the extra ``rasters``.
    """
    with reading(path, "the grid", max_pixels) as most, open(path, "rb") as file:
        if library := _LIBRARIES.get(kind_of(path) or ""):
            with explained(os.fspath(path), "the grid", "a grid"):
                grid = CartesianGrid(*library(path, most))
        else:
            labels, columns, sides, place = (_sgems if file.peek().startswith(MAGIC) else _gslib)(file, most)
            grid = CartesianGrid(dict(zip(_apart(labels), columns.reshape(-1, *sides[::-1]), strict=True)), *place)
        names = list(grid.values) if variables is None else list(variables)
        if strange := [name for name in names if name not in grid.values]:
            raise ValueError(f"it has no variable {strange[0]!r}: give one of {', '.join(grid.values)}")
    values = {name: known_numbers(f"{path}, {name}", grid.values[name], missing, valid) for name in names}
    return replace(grid, values={name: array if library else _typed(array) for name, array in values.items()})


def is_grid(path: PathLike, rasters: bool = True) -> bool:
    """Return whether a file is a grid that `read_grid` reads; without ``rasters``, whether it is one but a raster."""
    return kind_of(path) in ("grid", "netcdf", *["raster"] * rasters)


_LIBRARIES = {"netcdf": read_netcdf, "raster": read_cells}
"""The readers of the kinds of grids that a library reads."""

Read = tuple[list[str], Array, tuple[int, ...], CellFrame]
"""The names of the variables, their values, nx ny nz, and the position of the cells."""


def _typed(column: Array) -> Array:
    """Return a column as integers if all its values are known integers of a small type."""
    for kind in _WHOLE:
        integers, wrong = cast(column, kind)
        if not wrong.any():
            return integers
    return column


def _gslib(file: BufferedReader, most: int) -> Read:
    """Return the variables of a grid's text."""
    about, gslib = _geone_header(file), []
    if about.get("SORTING", "+X+Y+Z") != "+X+Y+Z":
        raise ValueError(f"its cells are sorted as {about['SORTING']}: save it with SORTING +X+Y+Z")
    if about:
        numbers = [about.get(f"{key}{axis}", least) for key, least in zip("NSO", "110", strict=True) for axis in "XYZ"]
        names, line = _text(file.readline(_LINE)).split(), len(about) + 2
        if not names:
            raise ValueError(f"line {line - 1} has no names of variables: it is cut short, or write them there")
    else:
        title, second = (_text(file.readline(_LINE)) for _ in range(2))
        words, names = second.split(), []
        if not words or not _is_count(words[0]):
            raise ValueError(
                f"line 2 is {second.strip()[:40]!r} and not the number of variables: give a grid of GSLIB or SGeMS"
            )
        gslib = [] if count_of(second) else words[1:]
        numbers, line = gslib or _of_title(title), 3 + int(words[0])
        for index in range(3, line):
            names.append(_text(file.readline(_LINE)).strip())
            if not names[-1]:
                raise ValueError(f"line {index} has no name of a variable: it is cut short, or line 2 is wrong")
    if len(numbers) not in (3, 6, 9, 10) or not _all_numbers(numbers):
        raise ValueError("its first two lines do not say how many cells it has: begin with nx ny nz, as 250 250 1")
    if not all(map(_is_count, (*numbers[:3], *numbers[9:]))):
        raise ValueError(f"its header says {' x '.join(numbers[:3])} cells: give whole numbers of 1 or more")
    *sides, realisations = (int(word) for word in (*numbers[:3], *(numbers[9:] or "1")))
    at, size = (numbers[3:6], numbers[6:9]) if gslib else (numbers[6:9], numbers[3:6])
    if not gslib:  # a corner; in decimals, since a binary sum would change 0.1
        at = [str(Decimal(corner) + Decimal(width) / 2) for corner, width in zip(at, size, strict=False)]
    place = frame(tuple(map(float, at)) or (0.0,) * 3, tuple(map(float, size)) or (1.0,) * 3)
    variables = len(names)
    if realisations > 1:
        names = [f"{name}__real{k}" for k in range(realisations) for name in names]
    count = prod(sides) * len(names)
    check_size(count, BYTES * count, most)
    what = f"{' x '.join(map(str, sides))} cells of {len(names)} variable{'s' * (len(names) != 1)}, {count} values"
    if os.fstat(file.fileno()).st_size - file.tell() < 2 * count - 1:  # a digit for each, and blanks between them
        raise ValueError(f"it is too short for what its header says, {what}: get it again, or correct the header")
    blocks = _parsed(file, count, what, line).reshape(realisations, prod(sides), variables)
    return names, blocks.transpose(0, 2, 1), tuple(sides), place


def _geone_header(file: BufferedReader) -> dict[str, str]:
    """Return the fields of the lines with ``#`` that begin a text of geone, and read past them."""
    fields: dict[str, str] = {}
    while file.peek(1)[:1] == b"#":
        words = _text(file.readline(_LINE))[1:].split()
        fields[words[0] if len(words) == 2 else f"line {len(fields)}"] = words[-1] if words else ""
    return fields


def _of_title(title: str) -> list[str]:
    """Return the numbers of a grid in its title, at least nx ny nz, if there are any."""
    words = title.split()
    if len(words) in (3, 6, 9) and _all_numbers(words):
        return words
    match = _SIDES.search(title)
    return list(match.groups()) if match else []


def number_of(word: Any) -> float | None:
    """Return the number in a word, or None."""
    try:
        return float(word)
    except ValueError:
        return None


def _all_numbers(words: Iterable[Any]) -> bool:
    return all((value := number_of(word)) is not None and isfinite(value) for word in words)


def _parsed(file: BufferedReader, count: int, what: str, line: int) -> NDArray[np.float64]:
    """Return the ``count`` numbers of a text from here to its end; ``line`` is the number of the first line."""
    numbers, at, lines = np.empty(count), 0, [b"\n"]
    while more := file.readlines(2**20):
        lines, words = more, b"".join(more).split()
        if at + len(words) > count:
            raise ValueError(f"it has more values than its header says, {what}: correct the header")
        try:
            numbers[at : at + len(words)] = list(map(float, words))
        except ValueError:
            every = ((n, word) for n, row in enumerate(lines, line) for word in row.split())
            where, wrong = next(pair for pair in every if number_of(pair[1]) is None)
            raise ValueError(f"line {where} has {_text(wrong)[:40]!r}, not a number: correct it") from None
        at += len(words)
        line += len(lines)
    if at < count:
        raise ValueError(f"it has {at} values and its header says {what}: get it again, or correct the header")
    if not lines[-1][-1:].isspace():
        raise ValueError("it ends without the end of a line, as if cut short: get it again, or add the end of the line")
    return numbers


def _apart(names: list[str]) -> list[str]:
    """Return distinct names: a repeated name gets a number."""
    distinct: dict[str, None] = {}
    for k, name in enumerate(names):
        distinct[name if name not in distinct else f"{name}_{k}"] = None
    return list(distinct)


def _text(data: bytes) -> str:
    return data.decode("utf-8", "replace")


def _sgems(file: BufferedReader, most: int) -> Read:
    """Return the variables of a binary grid of SGeMS."""
    length = os.fstat(file.fileno()).st_size
    file.seek(len(MAGIC))

    def take(form: str) -> tuple[Any, ...]:
        size = struct.calcsize(form)
        if length - file.tell() < size:
            raise ValueError("it ends within its header: it is cut short; get it again")
        return struct.unpack(form, file.read(size))

    def word() -> str:
        (size,) = take(">I")
        return _text(take(f">{size}s")[0]).rstrip("\0")

    kind = word()
    if kind != "Cgrid":
        raise ValueError(f"it holds the object {kind[:40]!r} of SGeMS: save a Cartesian grid")
    word()  # the grid's name
    (version,) = take(">i")
    if version < 100:
        raise ValueError(f"it is of the version {version} of SGeMS's files: save it by a newer SGeMS")
    sides: tuple[int, ...] = take(">3I")
    size, origin = (tuple(float(str(np.float32(value))) for value in take(">3f")) for _ in range(2))
    (variables,) = take(">I")
    names = [word() for _ in range(variables)]
    if not prod(sides) * variables:
        raise ValueError(f"it has {' x '.join(map(str, sides))} cells and {variables} properties: save one with values")
    place, count = frame(origin, size), prod(sides) * variables
    check_size(count, 4 * count, most)
    if length - file.tell() < 4 * count:
        raise ValueError(
            f"it ends before the last of {count} values, {' x '.join(map(str, sides))} cells of {variables} "
            f"propert{'y' if variables == 1 else 'ies'}: it is cut short; get it again"
        )
    columns = np.frombuffer(file.read(4 * count), ">f4").astype(np.float32)
    rest = file.read(16)
    if rest and not rest.startswith(_BLOCKS):
        raise ValueError("it is longer than its header says: get it again, or save it again")
    return names, columns, sides, place


def write_grid(
    path: PathLike,
    values: Mapping[str, ArrayLike],
    *,
    origin: Sequence[float] | None = None,
    cell: Sequence[float] | None = None,
    crs: str = "",
) -> None:
    """Write a grid for GSLIB, MPSlib, DeeSse and others as a text, for SGeMS, or as a GeoTIFF, atomically.

    Parameters
    ----------
    path : path
        ``.gslib``, a text, ``.sgems``, or ``.tif``, which needs the extra ``rasters``. An existing file is replaced.
    values : mapping of str to array_like, (nz, ny, nx) or (ny, nx)
        The variables by name. NaN or masked is unknown, and is written as -9966699. A text keeps every digit; SGeMS has
        32-bit floats, to which longer floats are rounded. A GeoTIFF has a band for each variable, of one type, and one
        layer; unknown values are NaN or, of integers, -9999.
    origin : (x, y) or (x, y, z), optional
        The centre of the first cell. None is 0.
    cell : (x, y) or (x, y, z), optional
        The size of a cell. None is 1.
    crs : str
        The coordinate reference system as WKT or, for example, ``"EPSG:32633"``, for a GeoTIFF; empty if unknown.

    Raises
    ------
    TypeError
        The values are not real numbers.
    ValueError
        The path cannot be written, arrays differ in size, or the format cannot hold a value or the origin.

    Notes
    -----
    The first line of a text is ``nx ny nz sx sy sz ox oy oz`` with the corner of the grid, half a cell before the first
    centre, see `read_grid`.
    """
    arrays: dict[str, Masked] = {str(name): np.ma.asanyarray(array) for name, array in values.items()}
    place = check_grid(path, arrays.values(), origin, cell)
    shapes = {array.shape for array in arrays.values()}
    if len(shapes) != 1 or len(next(iter(shapes))) not in (2, 3):
        raise ValueError(f"the variables have the shapes {sorted(shapes)}; give (nz, ny, nx) or (ny, nx), one for all")
    for name in arrays:
        if not name.strip() or not name.isprintable():
            raise ValueError(f"a variable has the name {name!r}; give one of letters, digits and signs")
    sides = (1, *next(iter(shapes)))[-3:]
    place = CellFrame((*place.origin, 0.0)[:3], (*place.cell, 1.0)[:3])
    layers = {name: np.ma.MaskedArray(array, np.isnan(array.data)).reshape(sides) for name, array in arrays.items()}
    if _suffix(path) == ".tif":
        if sides[0] > 1:
            raise ValueError(f"{path} is a GeoTIFF, which has no layers: end its name in .gslib or .sgems")
        with atomic_path(path) as temporary:
            write_cells(temporary, layers, *place, crs)
        return
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        file.writelines((_sgems_parts if _suffix(path) == ".sgems" else _gslib_parts)(layers, sides[::-1], place))


def check_grid(
    path: PathLike, arrays: Iterable[Any], origin: Sequence[float] | None, cell: Sequence[float] | None
) -> CellFrame:
    """Check before a long run that such values and origin can be written; return the position of the cells."""
    target = Path(path)
    if _suffix(path) not in SUFFIXES:
        raise ValueError(f"{target} names no format of grids: end its name in one of {', '.join(SUFFIXES)}")
    check_target(target)
    place = frame(origin, cell)
    if _suffix(path) == ".tif":
        require("rasters", "rasterio")
        return place
    for array in arrays:
        _check_values(target, np.ma.asanyarray(array))
    if _suffix(path) == ".sgems":
        for axis, at, size in zip("xyz", *place, strict=False):
            if not abs(float(np.float32(at)) - at) <= size / 1000:
                raise ValueError(
                    f"{target} would hold {axis} = {at} as a 32-bit float, more than a thousandth of a cell beside it: "
                    "end its name in .gslib, or give coordinates nearer to 0"
                )
    return place


def _check_values(target: Path, array: Masked) -> None:
    """Raise unless the format can hold the values of ``array``."""
    check_real("the grid", array)
    known = array.compressed()
    if target.suffix.lower() == ".sgems":
        kept, wrong = cast(known, np.float32)
        if known.dtype.kind in "iu":
            wrong = kept.astype(np.float64) != known
        if wrong.any():
            what = f"{known[wrong][0]}, since SGeMS has 32-bit floats"
            raise ValueError(f"{target} cannot hold {what}: end its name in .gslib")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        wrong = np.isnan(known_numbers("", known)) & ~np.isnan(known)
    if wrong.any():
        what = f"{known[wrong][0]}, which is a code for an unknown value there"
        raise ValueError(f"{target} cannot hold {what}: give NaN for unknown values, or another number")


def _suffix(path: PathLike) -> str:
    return Path(path).suffix.lower()


def _gslib_parts(layers: Mapping[str, Any], sides: tuple[int, ...], place: CellFrame) -> Iterator[bytes]:
    """Yield the text of a grid."""
    sizes = [Decimal(repr(size)) for size in place.cell]
    corners = [Decimal(repr(at)) - size / 2 for at, size in zip(place.origin, sizes, strict=True)]
    yield f"{' '.join(map(str, (*sides, *sizes, *corners)))}\n{len(layers)}\n".encode()
    yield "".join(f"{name}\n" for name in layers).encode()
    for layer in range(sides[2]):
        for row in range(sides[1]):
            cells = zip(*(_words(array[layer, row]) for array in layers.values()), strict=True)
            yield "".join(" ".join(words) + "\n" for words in cells).encode()


def _words(row: Masked) -> list[str]:
    """Return each value as the shortest text that represents it."""
    data = row.data.astype(np.uint8) if row.dtype == bool else row.data
    words: list[str] = np.where(np.ma.getmaskarray(row), str(NO_DATA), data.astype(str)).tolist()
    return words


def _sgems_parts(layers: Mapping[str, Any], sides: tuple[int, ...], place: CellFrame) -> Iterator[bytes]:
    """Yield the parts of a binary grid of SGeMS."""

    def word(text: str) -> bytes:
        data = text.encode() + b"\0"
        return struct.pack(">I", len(data)) + data

    yield MAGIC + word("Cgrid") + word("grid") + struct.pack(">i", 100)
    yield struct.pack(">3I6fI", *sides, *place.cell, *place.origin, len(layers))
    yield b"".join(map(word, layers))
    for array in layers.values():
        yield array.astype(">f4").filled(NO_DATA).tobytes()
