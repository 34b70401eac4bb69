# SPDX-License-Identifier: BSD-3-Clause
"""Rasters of GDAL with their georeference and no-data, by rasterio; and grids of NetCDF and HDF5, by xarray.

The extra ``rasters`` installs rasterio, and the extra ``simulate`` xarray and its readers.
"""

from __future__ import annotations

import os
import re
import struct
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from itertools import product
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.io.files import Refused, check_array, check_beside, needs, quiet
from simdtex.options import DataWarning, require

Array = NDArray[Any]
PathLike = str | os.PathLike[str]

DRIVERS = (
    *("GTiff", "AAIGrid", "HFA", "EHdr", "ENVI", "GSAG", "GSBG", "GS7BG"),
    *("SRTMHGT", "USGSDEM", "SAGA", "RST", "ILWIS"),
)
"""The drivers of GDAL in use, since some others read further files or the network, for example VRT."""

RASTERS = (".asc", ".img", ".bil", ".grd", ".hgt", ".dem", ".sdat", ".rst", ".mpr", ".flt")
"""Suffixes of rasters that are not recognised by their first bytes."""

NETCDF = (b"\x89HDF", b"CDF\x01", b"CDF\x02", b"CDF\x05")
"""How NetCDF and HDF5 files begin."""

TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
"""How TIFF files begin."""

MOST_PAGES = 2**16
"""The most pages of a TIFF, with smaller copies of each."""

_TAGS = (33550, 33922, 34264, 34735, 42113)
"""TIFF tags of georeference and no-data."""


_NAMED = {"x": "east(ing)?|lon(g|gitude)?|col(umn)?", "y": "north(ing)?|lat(itude)?|row", "z": "lev(el)?|layer"}
"""Names of an axis that do not have its letter."""

_CF = ("long_name", "standard_name", "units", "positive")
"""Attributes of a coordinate or a variable in the CF conventions that realisations keep."""

Library = tuple[dict[str, Array], tuple[float, ...], tuple[float, ...], str, dict[str, dict[str, str]]]
"""What a library reads of a grid: the members of `simdtex.io.grids.CartesianGrid`."""


class Georeference(NamedTuple):
    """Where the pixels of a raster lie.

    Attributes
    ----------
    crs : str
        The coordinate reference system as WKT; empty if unknown.
    transform : tuple of float
        a, b, c, d, e, f: the corner of the pixel in column i, row j, is at x = a i + b j + c, y = d i + e j + f.
    nodata : float, optional
        The number that marks an unknown value in the file.
    """

    crs: str
    transform: tuple[float, float, float, float, float, float]
    nodata: float | None = None

    def moved(self, left: int, top: int) -> Georeference:
        """Return the georeference of a raster with this many more columns at the left and rows at the top."""
        a, b, c, d, e, f = self.transform
        return self._replace(transform=(a, b, c - a * left - b * top, d, e, f - d * left - e * top))


def axis_of(name: str) -> str | None:
    """Return the axis that the name of a column or of a dimension means, ``"x"``, ``"y"``, ``"z"``, or None.

    Examples
    --------
    >>> [axis_of(name) for name in ("X", "Ycoord", "Northing (m)", "lon", "UTM_X", "z_loc", "Zn", "depth")]
    ['x', 'y', 'y', 'x', 'x', 'z', None, None]
    """
    word = re.sub(r"\(.*|\[.*|[^a-z]", "", name.lower())
    around = "(utm|point|coord|loc|pos)?", "(m|km|ft|utm|(coord|loc|pos)[a-z]*)?"
    return next((axis for axis, own in _NAMED.items() if re.fullmatch(f"{axis.join(around)}|({own})m?", word)), None)


@contextmanager
def open_tiff(file: Any) -> Iterator[Any]:
    """Open a TIFF; raise Refused if its directories are more than `MOST_PAGES`, or lead back to an earlier one."""
    import tifffile

    with tifffile.TiffFile(file, _multifile=False) as tiff:
        form, data, at, count, seen = tiff.tiff, tiff.filehandle, tiff.pages.first.offset, 0, set[int]()
        with suppress(struct.error):  # a damaged directory after the first, at which all readers stop
            while at:
                seen.add(at)
                data.seek(at)
                (tags,) = struct.unpack(form.tagnoformat, data.read(form.tagnosize))
                entries = data.read(tags * form.tagsize)
                (at,) = struct.unpack(form.offsetformat, data.read(form.offsetsize))
                count += 1
                for k in range(0, len(entries), form.tagsize):
                    if struct.unpack_from(form.tagformat1, entries, k)[0] == 330:  # SubIFDs
                        count += struct.unpack_from(form.tagformat2, entries, k + 4)[0]
                if at in seen or count > MOST_PAGES:
                    raise Refused(f"has more than {MOST_PAGES} pages, or a page twice: save the picture alone")
        yield tiff


def is_raster(file: BinaryIO) -> bool:
    """Return whether a TIFF has georeference, no-data or a mask, which the reader of pictures would not heed."""
    file.seek(0)
    try:
        with quiet(), open_tiff(file) as tiff:
            return any(tag in tiff.pages.first.tags for tag in _TAGS) or any(
                page.subfiletype & 4 for page in tiff.pages
            )
    except Exception:  # the reader of pictures reports the error
        return False


def read_raster(source: PathLike | bytes, most: int) -> tuple[Array, Georeference, list[str]]:
    """Return the pixels of a raster of at most ``most`` pixels, its georeference, and the names of its bands.

    Pixels are (rows, cols) or (rows, cols, bands) in the file's type. Unknown ones are NaN in floats, and masked in
    integers; a band of alpha is a band. The first row is that of the file, most often the northern one.
    """
    needs("rasterio", "rasters", "a raster with georeference or no-data")
    import rasterio
    from rasterio.enums import ColorInterp
    from rasterio.io import DatasetReader, MemoryFile

    with warnings.catch_warnings(), rasterio.Env(), ExitStack() as closing:
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        in_memory = isinstance(source, bytes)
        where = closing.enter_context(MemoryFile(source)).name if in_memory else os.fspath(source)
        raster = closing.enter_context(DatasetReader(where, driver=list(DRIVERS)))
        if not isinstance(source, bytes):
            own = [Path(source).with_suffix(".mp#")] * (raster.driver == "ILWIS")
            check_beside(source, [*raster.files, *own])
            if own and re.search(rb"(?im)^\s*type\s*=\s*maplist", Path(source).read_bytes()):
                raise Refused("is a list of maps of ILWIS: give one of its maps")
        itemsize = max(np.dtype(kind).itemsize for kind in raster.dtypes)
        check_array((raster.height, raster.width, raster.count), itemsize, most)
        pixels = raster.read(masked=ColorInterp.alpha not in raster.colorinterp)
        crs = raster.crs.to_wkt() if raster.crs else ""
        geo = Georeference(crs, tuple(raster.transform)[:6], raster.nodata)
        names = [name or f"band {k + 1}" for k, name in enumerate(raster.descriptions)]
        scaled = set(raster.scales) != {1.0} or set(raster.offsets) != {0.0}
    if scaled:
        warnings.warn("scale and offset of the raster are not applied to its numbers", DataWarning, stacklevel=2)
    pixels = np.moveaxis(pixels, 0, -1)
    if not np.ma.is_masked(pixels):
        pixels = np.ma.getdata(pixels)
    elif pixels.dtype.kind == "f":
        pixels = pixels.filled(np.nan)
    return (pixels[..., 0] if len(names) == 1 else pixels), geo, names


def read_cells(path: PathLike, most: int) -> Library:
    """Return a raster as a grid: its bands as variables, rows in ascending order of y, unknown values NaN."""
    pixels, geo, names = read_raster(path, most)
    a, b, c, d, e, f = geo.transform
    if b or d:
        raise Refused("has rows that are not parallel to the x axis: warp it to north up first, as by gdalwarp")
    planes: Any = pixels.reshape(*pixels.shape[:2], -1)
    if np.ma.isMaskedArray(planes):
        planes = np.ma.filled(planes.astype(np.float64), np.nan)
    rows, cols = planes.shape[:2]
    values = {name: planes[None, :: -1 if e < 0 else 1, :: -1 if a < 0 else 1, k] for k, name in enumerate(names)}
    first = min(c, c + a * cols) + abs(a) / 2, min(f, f + e * rows) + abs(e) / 2, 0.0
    return values, first, (abs(a), abs(e), 1.0), geo.crs, {}


def write_cells(
    path: Path, layers: Mapping[str, Any], origin: Sequence[float], cell: Sequence[float], crs: str
) -> None:
    """Write variables (1, ny, nx), masked or NaN if unknown, as the bands of a GeoTIFF with the north at the top."""
    bands: Any = np.ma.concatenate(  # type: ignore[no-untyped-call]
        [one[:, ::-1] for one in layers.values()]
    )
    nodata = float("nan") if bands.dtype.kind == "f" else None
    if np.ma.is_masked(bands) and nodata is None:
        bands, nodata = bands.astype(np.result_type(bands.dtype, np.int16)), -9999.0
    west, north = origin[0] - cell[0] / 2, origin[1] + cell[1] * (bands.shape[1] - 0.5)
    geo = Georeference(crs, (cell[0], 0.0, west, 0.0, -cell[1], north), nodata)
    write_raster(path, bands if nodata is None else bands.filled(nodata), geo, list(layers))


def write_raster(path: Path, bands: Array, geo: Georeference, names: Sequence[str] = ()) -> None:
    """Write bands (bands, rows, cols) as a GeoTIFF, over an existing file."""
    require("rasters", "rasterio")
    import rasterio
    from rasterio.io import MemoryFile

    bands = bands.astype({"float16": np.float32, "bool": np.uint8}.get(bands.dtype.name, bands.dtype))
    about = {"count": len(bands), "height": bands.shape[1], "width": bands.shape[2], "dtype": bands.dtype.name}
    if not names and len(bands) in (3, 4) and bands.dtype.kind == "u":
        about |= {"photometric": "RGB", "alpha": "YES" if len(bands) == 4 else "NO"}
    about |= {"crs": geo.crs or None, "transform": rasterio.Affine(*geo.transform), "nodata": geo.nodata}
    with MemoryFile() as memory:  # GDAL does not report every full disk
        with memory.open(driver="GTiff", compress="deflate", **about) as raster:
            raster.write(np.ascontiguousarray(bands))
            for k, name in enumerate(names, 1):
                raster.set_band_description(k, name)
        path.write_bytes(memory.read())


def read_netcdf(path: PathLike, most: int) -> Library:
    """Return the variables of a NetCDF or HDF5 file that have the axes y and x, or z, y and x, as a grid.

    All variables with the axes of the first such variable are read, in ascending order of the coordinates, unknown
    values NaN. CF conventions and names such as lon, lat and northing tell the axes; without names of dimensions they
    are (z, y, x) by position. A variable with further axes, for example time, gives one variable ``NAME[k]`` for each
    of their steps.
    """
    for library in ("xarray", "cf_xarray", "h5netcdf", "h5py"):
        needs(library, "simulate", "a NetCDF or HDF5 file")
    import cf_xarray  # noqa: F401 - the accessor cf
    import xarray

    with open(path, "rb") as file:
        classic = file.read(3) == b"CDF"
    if not classic:
        _check_own(path)
    how: dict[str, Any] = {"engine": "scipy"} if classic else {"engine": "h5netcdf", "phony_dims": "access"}
    with xarray.open_dataset(os.fspath(path), decode_times=False, **how) as data:
        guessed = data.cf.guess_coord_axis().cf
        means = {"x": ("X", "longitude"), "y": ("Y", "latitude"), "z": ("Z", "vertical")}
        known = {**guessed.coordinates, **guessed.axes}
        axes = {name: axis for axis, keys in means.items() for key in keys for name in known.get(key, ())}
        found: dict[str, Any] = {}
        for name, one in data.data_vars.items():
            dims = [str(dim) for dim in one.dims]
            if all(dim.startswith("phony_dim") for dim in dims) and len(dims) in (2, 3):
                one = one.rename(dict(zip(dims, "zyx"[-len(dims) :], strict=True)))
            else:
                named = {dim: axes.get(dim) or axis_of(dim) for dim in dims}
                one = one.rename({dim: axis for dim, axis in named.items() if axis and axis != dim})
            if {"x", "y"} <= set(one.dims):
                found |= _steps(str(name), one)
        if not found:
            raise Refused("has no variable with the axes y and x, or z, y and x: rename its dimensions")
        first = next(iter(found.values()))
        found = {name: one for name, one in found.items() if one.sizes == first.sizes}
        for one in found.values():
            check_array(one.shape, one.dtype.itemsize, most // len(found))
        arrays = {name: _ascending(one).load() for name, one in found.items()}
        mapping = data.get(str(first.encoding.get("grid_mapping", "")))
        about: Mapping[Any, Any] = {} if mapping is None else mapping.attrs
    first = next(iter(arrays.values()))
    origin, cell = zip(*(axis_place(first, axis) for axis in "xyz"), strict=True)
    told = {name: cf_attributes(one) for name, one in arrays.items()} | axis_attributes(first)
    values = {name: one.values.reshape(-1, *one.shape[-2:]) for name, one in arrays.items()}
    return values, origin, cell, str(about.get("crs_wkt", about.get("spatial_ref", ""))), told


def _check_own(path: PathLike) -> None:
    """Raise Refused if a link or the values of a dataset of HDF5 are in another file."""
    import h5py

    with h5py.File(path) as file:

        def found(name: str, link: Any) -> str | None:  # an error here would be lost in h5py
            one: Any = file[name] if isinstance(link, h5py.HardLink) else link
            parts = one.virtual_sources() if getattr(one, "is_virtual", False) else ()
            other = isinstance(one, h5py.ExternalLink) or any(part.file_name != "." for part in parts)
            return name if other or getattr(one, "external", None) else None

        if (name := file.visititems_links(found)) is not None:
            raise Refused(f"takes {name[:100]} from another file: save all values in one file")


def cf_attributes(array: Any) -> dict[str, str]:
    """Return the names and units of an array of xarray that its attributes give."""
    return {name: str(array.attrs[name]) for name in _CF if name in array.attrs}


def axis_attributes(array: Any) -> dict[str, dict[str, str]]:
    """Return the names and units of the coordinates of an array of xarray, by axis: x, y and z."""
    return {axis: cf_attributes(array.coords[dim]) for dim in array.coords if (axis := axis_of(str(dim)))}


def _steps(name: str, array: Any) -> dict[str, Any]:
    """Return a variable without axes other than z, y and x: one for each of their steps, with its number."""
    others = [dim for dim in array.dims if dim not in ("x", "y", "z")]
    whole = all(array.sizes[dim] == 1 for dim in others)
    steps = product(*(range(array.sizes[dim]) for dim in others))
    return {
        name if whole else f"{name}[{','.join(map(str, step))}]": array.isel(dict(zip(others, step, strict=True)))
        for step in steps
    }


def _ascending(array: Any) -> Any:
    """Return an array (z, y, x) in ascending order of its coordinates."""
    down = [dim for dim in array.dims if dim in array.coords and array[dim].size > 1 and array[dim][0] > array[dim][-1]]
    return array.isel({dim: slice(None, None, -1) for dim in down}).transpose(..., "y", "x")


def axis_place(array: Any, axis: str) -> tuple[float, float]:
    """Return the first coordinate along an axis, and the size of a cell, which is that of the attribute, if any."""
    if axis not in array.coords:
        return 0.0, float(array.attrs.get(f"cell_{axis}", 1.0))
    values = np.atleast_1d(np.asarray(array.coords[axis].values, np.float64))
    between = (values[-1] - values[0]) / (len(values) - 1) if len(values) > 1 else 1.0
    size = float(array.attrs.get(f"cell_{axis}", between))
    off = np.abs(values - (values[0] + size * np.arange(len(values))))
    if not (size > 0 and (off <= size / 1000).all()):  # NaN too
        raise ValueError(f"the coordinate {axis} is not evenly spaced in ascending order, as those of a grid are")
    return float(values[0]), size
