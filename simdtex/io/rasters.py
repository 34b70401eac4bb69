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
from copy import deepcopy
from itertools import product
from pathlib import Path
from types import MappingProxyType
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.io.files import PathLike, Refused, check_array, check_beside, needs, quiet
from simdtex.options import DataWarning, require

Array = NDArray[Any]

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

NOWHERE = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
"""The transform of a raster without georeference."""

MOST_PAGES = 2**16
"""The most pages of a TIFF, with smaller copies of each."""

_TAGS = (33550, 33922, 34264, 34735, 42112, 42113, 50844)
"""TIFF tags of georeference, of what GDAL says of bands, of no-data, and of rational polynomials."""

_NAMED = {"x": "east(ing)?|lon(g|gitude)?|col(umn)?", "y": "north(ing)?|lat(itude)?|row", "z": "lev(el)?|layer"}
"""Names of an axis that do not have its letter."""

_COUNTED = {"x": "n?i|xi_.+|west_east.*|n_?lon", "y": "n?j|eta_.+|south_north.*|n_?lat", "z": "n?k|s_.+|bottom_top.*"}
"""Names of dimensions that count cells: of ocean models, ROMS and WRF."""

_OF_BANDS = ("descriptions", "scales", "offsets", "units", "colorinterp")
"""What rasterio says of each band, in the order in which it is written."""

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
    points : sequence of rasterio.control.GroundControlPoint
        Ground control points, in the reference system ``crs``; a raster that has them has no transform.
    polynomials : rasterio.rpc.RPC, optional
        The rational polynomials of a sensor.
    about : mapping
        What the file says of its bands and of itself, as `write_raster` writes it: `_OF_BANDS`, ``tags``, of the file
        first, and ``colours``, the colour table of the first band.
    """

    crs: str
    transform: tuple[float, float, float, float, float, float]
    nodata: float | None = None
    points: Sequence[Any] = ()
    polynomials: Any = None
    about: Mapping[str, Any] = MappingProxyType({})

    @classmethod
    def of_cells(cls, origin: Sequence[float], cell: Sequence[float], rows: int, crs: str) -> Georeference:
        """Return the georeference of a picture, north at the top, of cells whose first is at `origin`."""
        west, north = origin[0] - cell[0] / 2, origin[1] + cell[1] * (rows - 0.5)
        return cls(crs, (cell[0], 0.0, west, 0.0, -cell[1], north))

    def moved(self, left: int, top: int) -> Georeference:
        """Return the georeference of a raster with this many more columns at the left and rows at the top."""
        a, b, c, d, e, f = self.transform
        points, polynomials = deepcopy((self.points, self.polynomials))
        for point in points:
            point.col, point.row = point.col + left, point.row + top
        if polynomials:
            polynomials.samp_off, polynomials.line_off = polynomials.samp_off + left, polynomials.line_off + top
        place = (a, b, c - a * left - b * top, d, e, f - d * left - e * top)
        place = place if self.transform != NOWHERE else NOWHERE
        return self._replace(transform=place, points=points, polynomials=polynomials)

    def place(self) -> Georeference:
        """Return the georeference of other values at the same place."""
        return self._replace(nodata=None, about={})

    def values(self) -> Georeference | None:
        """Return what is said of the values, for a raster at no place; None if they are plain numbers without names."""
        about = {name: self.about.get(name, ()) for name in _OF_BANDS}
        told = [*about["descriptions"], *about["units"], *about["offsets"], *(scale != 1 for scale in about["scales"])]
        return Georeference("", NOWHERE, about=about) if any(told) else None

    @property
    def alpha(self) -> bool:
        """Whether the file says that the last band is alpha."""
        return bool(self.about["colorinterp"]) and self.about["colorinterp"][-1].name == "alpha"


def axis_of(name: str) -> str | None:
    """Return the axis that the name of a column or of a dimension means, ``"x"``, ``"y"``, ``"z"``, or None."""
    word = re.sub(r"\(.*|\[.*|[^a-z]", "", name.lower())
    around = "(utm|point|coord|loc|pos)?", "(m|km|ft|utm|(coord|loc|pos)[a-z]*)?"
    return next((axis for axis, form in _NAMED.items() if re.fullmatch(f"{axis.join(around)}|({form})m?", word)), None)


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


def read_raster(source: PathLike | bytes, most: int) -> tuple[Array, Georeference]:
    """Return the pixels of a raster, (rows, cols) or (rows, cols, bands), and its georeference.

    Unknown pixels are NaN in floats, and masked in integers. The first row is the northern one and the first column the
    western one, unless the raster is rotated or has rational polynomials.
    """
    needs("rasterio", "rasters", "a raster with georeference, no-data or descriptions of bands")
    import rasterio
    from rasterio.io import DatasetReader, MemoryFile

    with warnings.catch_warnings(), rasterio.Env(), ExitStack() as closing:
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        in_memory = isinstance(source, bytes)
        where = closing.enter_context(MemoryFile(source)).name if in_memory else os.fspath(source)
        raster = closing.enter_context(DatasetReader(where, driver=list(DRIVERS)))
        if not isinstance(source, bytes):
            beside = [Path(source).with_suffix(".mp#")] * (raster.driver == "ILWIS")
            check_beside(source, [*raster.files, *beside])
            if beside and re.search(rb"(?im)^\s*type\s*=\s*maplist", Path(source).read_bytes()):
                raise Refused("is a list of maps of ILWIS: give one of its maps")
        itemsize = max(np.dtype(kind).itemsize for kind in raster.dtypes)
        check_array((raster.height, raster.width, raster.count), itemsize, most)
        points, crs = raster.gcps if raster.gcps[0] else ((), raster.crs)
        about = {name: getattr(raster, name) for name in _OF_BANDS}
        about["tags"] = [raster.tags(k) for k in (0, *raster.indexes)]
        if about["colorinterp"][0].name == "palette":
            about["colours"] = raster.colormap(1)
        geo = Georeference(
            crs.to_wkt() if crs else "", tuple(raster.transform)[:6], raster.nodata, points, raster.rpcs, about
        )
        pixels = raster.read(masked=not geo.alpha)
        if geo.alpha and raster.count not in (2, 4):
            gone = np.broadcast_to(pixels[-1] == 0, pixels[:-1].shape)
            pixels = np.ma.MaskedArray(pixels[:-1], gone)
    pixels = np.moveaxis(pixels, 0, -1)
    if not np.ma.is_masked(pixels):
        pixels = np.ma.getdata(pixels)
    elif pixels.dtype.kind == "f":
        pixels = pixels.filled(np.nan)
    a, b, c, d, e, f = geo.transform
    if not (b or d or geo.polynomials) and geo.transform != NOWHERE:
        rows, cols = pixels.shape[:2]
        pixels = pixels[:: -1 if e > 0 else 1, :: -1 if a < 0 else 1]
        geo = geo._replace(transform=(abs(a), b, min(c, c + a * cols), d, -abs(e), max(f, f + e * rows)))
    return (pixels[..., 0] if pixels.shape[-1] == 1 else pixels), geo


def read_cells(path: PathLike, most: int) -> Library:
    """Return a raster as a grid, its bands as variables in physical units: their scale and offset are applied."""
    pixels, geo = read_raster(path, most)
    names = [name or f"band {k}" for k, name in enumerate(geo.about["descriptions"], 1)]
    a, b, c, d, e, f = geo.transform
    if geo.points:
        raise Refused("has ground control points and no rows of a grid: warp it to north up first, as by gdalwarp")
    if b or d:
        raise Refused("has rows that are not parallel to the x axis: warp it to north up first, as by gdalwarp")
    planes: Any = pixels.reshape(*pixels.shape[:2], -1)
    if np.ma.isMaskedArray(planes):
        planes = np.ma.filled(planes.astype(np.float64), np.nan)
    scales, offsets = (np.array(geo.about[name][: planes.shape[-1]]) for name in ("scales", "offsets"))
    if (scales != 1).any() or offsets.any():
        planes = planes * scales + offsets
    values = {name: planes[None, ::-1, :, k] for k, name in enumerate(names[: planes.shape[-1]])}
    units = zip(names, geo.about["units"], strict=True)
    first = (0.0,) * 3 if geo.transform == NOWHERE else (c + a / 2, f + e * len(planes) - e / 2, 0.0)
    return values, first, (a, abs(e), 1.0), geo.crs, {n: {"units": u} for n, u in units if u}


def write_cells(
    path: Path, layers: Mapping[str, Any], origin: Sequence[float], cell: Sequence[float], crs: str
) -> None:
    """Write variables (1, ny, nx), masked or NaN if unknown, as the bands of a GeoTIFF with the north at the top."""
    bands: Any = np.ma.concatenate([layer[:, ::-1] for layer in layers.values()])  # type: ignore[no-untyped-call]
    nodata = float("nan") if bands.dtype.kind == "f" else None
    if np.ma.is_masked(bands) and nodata is None:
        bands, nodata = bands.astype(np.result_type(bands.dtype, np.int16)), -9999.0
    geo = Georeference.of_cells(origin, cell, bands.shape[1], crs)
    geo = geo._replace(nodata=nodata, about={"descriptions": list(layers)})
    write_raster(path, bands if nodata is None else bands.filled(nodata), geo)


def write_raster(path: Path, bands: Array, geo: Georeference) -> None:
    """Write bands (bands, rows, cols) as a GeoTIFF, over an existing file, with what is said of as many of them."""
    require("rasters", "rasterio")
    import rasterio
    from rasterio.io import MemoryFile

    bands = bands.astype({"float16": np.float32, "bool": np.uint8}.get(bands.dtype.name, bands.dtype))
    how = {"count": len(bands), "height": bands.shape[1], "width": bands.shape[2], "dtype": bands.dtype.name}
    shown = [colour.name for colour in geo.about.get("colorinterp", ())][: len(bands)]
    if shown[:3] == ["red", "green", "blue"] and bands.dtype.kind == "u":
        how |= {"photometric": "RGB", "alpha": "YES" if shown[3:] == ["alpha"] else "NO"}
    how |= {"gcps": geo.points} if geo.points else {"transform": rasterio.Affine(*geo.transform)}
    how |= {"crs": geo.crs or None, "nodata": geo.nodata, "rpcs": geo.polynomials}
    with warnings.catch_warnings(), MemoryFile() as memory:  # GDAL does not report every full disk
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        with memory.open(driver="GTiff", compress="deflate", BIGTIFF="IF_SAFER", **how) as raster:
            for name in _OF_BANDS:
                if name in geo.about:
                    setattr(raster, name, geo.about[name][: len(bands)])
            for k, tags in enumerate(geo.about.get("tags", ())[: len(bands) + 1]):
                raster.update_tags(k, **{name: text for name, text in tags.items() if "STATISTICS_" not in name})
            if "colours" in geo.about:
                raster.write_colormap(1, geo.about["colours"])
            raster.write(np.ascontiguousarray(bands))
        path.write_bytes(memory.read())


def read_netcdf(path: PathLike, most: int) -> Library:
    """Return the variables of a NetCDF or HDF5 file with the axes of the first that has y and x, or z, y and x.

    CF conventions and names such as lon, lat and northing tell the axes, else their position. A variable with further
    axes, for example time, gives one variable ``NAME[k]`` for each of their steps.
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
        variables: dict[str, Any] = {}
        notes: dict[str, str] = {}
        for name, variable in data.data_vars.items():
            dims = [str(dim) for dim in variable.dims]
            if all(dim.startswith("phony_dim") for dim in dims) and len(dims) in (2, 3):
                named = dict(zip(dims, "zyx"[-len(dims) :], strict=True))
            else:
                every = {dim: axes.get(dim) or axis_of(dim) or _counted(dim) for dim in dims}
                named = {dim: axis for dim, axis in every.items() if axis}
            if not {"x", "y"} <= {*named.values()} or len({*named.values()}) < len(named):
                continue
            notes |= {dim: f"{dim} counts cells of {axis}" for dim, axis in named.items() if _counted(dim)}
            variable = ascending(variable, named)
            try:
                place = [(*axis_place(variable, axis), variable.sizes.get(axis)) for axis in "xyz"]
            except ValueError as error:
                notes[str(name)] = f"{name} is left out, since {error}"
                continue
            if not variables:
                first, of_first = variable, place
            if place == of_first:
                variables |= _steps(str(name), variable)
        if not variables:
            if notes:
                raise Refused(f"has no even grid ({', '.join(notes.values())}): interpolate it first")
            raise Refused("has no variable with the axes y and x, or z, y and x: rename its dimensions")
        for variable in variables.values():
            check_array(variable.shape, variable.dtype.itemsize, most // len(variables))
        arrays = {name: _valid(variable.load()) for name, variable in variables.items()}
        mapping = data.get(str({**first.attrs, **first.encoding}.get("grid_mapping", "")).partition(":")[0])
        crs = "" if mapping is None else _wkt(mapping.attrs)
    if notes:
        warnings.warn(f"{os.fspath(path)}: {', '.join(notes.values())}", DataWarning, stacklevel=2)
    origin, cell, _ = zip(*of_first, strict=True)
    told = {name: cf_attributes(array) for name, array in arrays.items()}
    values = {name: array.values.reshape(-1, *array.shape[-2:]) for name, array in arrays.items()}
    return values, origin, cell, crs, told | axis_attributes(next(iter(arrays.values())))


def _counted(name: str) -> str | None:
    """Return the axis along which a dimension counts cells by its name, or None."""
    return next((axis for axis, pattern in _COUNTED.items() if re.fullmatch(pattern, name.lower())), None)


def _wkt(about: Mapping[Any, Any]) -> str:
    """Return the reference system of the attributes of a grid mapping as WKT, empty if they do not say it."""
    if told := about.get("crs_wkt", about.get("spatial_ref")):
        return str(told)
    try:
        from pyproj import CRS

        return str(CRS.from_cf(dict(about)).to_wkt())
    except Exception as error:  # without pyproj, too
        text = f"the reference system of the grid mapping is not known ({error}): install simdtex[rasters] to read it"
        warnings.warn(text, DataWarning, stacklevel=3)
        return ""


def _valid(array: Any) -> Any:
    """Return an array with NaN for values outside of its valid range, which may be that of its packed values."""
    low, high = np.ravel(array.attrs.get("valid_range", (-np.inf, np.inf)))
    limits = np.ravel([array.attrs.get("valid_min", low), array.attrs.get("valid_max", high)])
    told = next((array.attrs[name] for name in ("valid_range", "valid_min", "valid_max") if name in array.attrs), 0.0)
    packed, kind = array.encoding, np.asarray(told).dtype
    if kind.kind == "i" and packed.get("_Unsigned") == "true":
        limits = np.where(limits < 0, limits + 256.0**kind.itemsize, limits)
    if packed.keys() & {"scale_factor", "add_offset"} and kind == packed["dtype"]:
        limits = np.add(limits, (-0.5, 0.5))  # of a packed value, since both are rounded
        limits = np.sort(limits * packed.get("scale_factor", 1) + packed.get("add_offset", 0))
    outside = (array.values < limits[0]) | (array.values > limits[1])
    return array.where(~outside) if outside.any() else array


def _check_own(path: PathLike) -> None:
    """Raise Refused if a link or the values of a dataset of HDF5 are in another file."""
    import h5py

    with h5py.File(path) as file:

        def outside(name: str, link: Any) -> str | None:  # an error here would be lost in h5py
            target: Any = file[name] if isinstance(link, h5py.HardLink) else link
            parts = target.virtual_sources() if getattr(target, "is_virtual", False) else ()
            other = isinstance(target, h5py.ExternalLink) or any(part.file_name != "." for part in parts)
            return name if other or getattr(target, "external", None) else None

        if (name := file.visititems_links(outside)) is not None:
            raise Refused(f"takes {name[:100]} from another file: save all values in one file")


def cf_attributes(array: Any) -> dict[str, str]:
    """Return the names and units of an array of xarray that its attributes give."""
    return {name: str(array.attrs[name]) for name in _CF if name in array.attrs}


def axis_attributes(array: Any) -> dict[str, dict[str, str]]:
    """Return the names and units of the coordinates of the axes of an array of xarray, by axis: x, y and z."""
    dims = sorted((dim for dim, at in array.coords.items() if at.dims in ((), (dim,))), key=array.dims.__contains__)
    return {axis: cf_attributes(array.coords[dim]) for dim in dims if (axis := axis_of(str(dim)))}


def _steps(name: str, array: Any) -> dict[str, Any]:
    """Return a variable without axes other than z, y and x: one for each of their steps, with its number."""
    others = [dim for dim in array.dims if dim not in ("x", "y", "z")]
    whole = all(array.sizes[dim] == 1 for dim in others)
    steps = product(*(range(array.sizes[dim]) for dim in others))
    return {
        name if whole else f"{name}[{','.join(map(str, step))}]": array.isel(dict(zip(others, step, strict=True)))
        for step in steps
    }


def ascending(array: Any, named: Mapping[Any, str]) -> Any:
    """Return an array of xarray with the axes z, y and x that its dimensions mean, in ascending order."""
    # a coordinate of several axes, such as the longitude of each cell, is none of a grid
    array = array.drop_vars([key for key, at in array.coords.items() if at.ndim and at.dims != (key,)])
    array = array.rename({dim: axis for dim, axis in named.items() if axis != dim})
    down = [axis for axis in named.values() if axis in array.coords and array[axis][0] > array[axis][-1]]
    in_order = iter(sorted(named.values(), reverse=True))
    order = [next(in_order) if dim in named.values() else dim for dim in array.dims]
    return array.isel(dict.fromkeys(down, slice(None, None, -1))).transpose(*order)


def axis_place(array: Any, axis: str) -> tuple[float, float]:
    """Return the first coordinate along an axis, and the size of a cell, which is that of the attribute, if any."""
    if axis not in array.coords:
        return 0.0, float(array.attrs.get(f"cell_{axis}", 1.0))
    values = np.atleast_1d(np.asarray(array.coords[axis].values, np.float64))
    between = (values[-1] - values[0]) / (len(values) - 1) if len(values) > 1 else 1.0
    size = float(array.attrs.get(f"cell_{axis}", between))
    off = np.abs(values - (values[0] + size * np.arange(len(values))))
    single = (values == values.astype(np.float32)).all()  # rounded to that type, if not whole numbers
    rounding = min(size / 2, np.abs(values).max() * float(np.finfo(np.float32).eps)) if single else 0.0
    if not (size > 0 and (off <= max(size / 1000, rounding)).all()):  # NaN too
        raise ValueError(f"the coordinate {axis} is not evenly spaced in ascending order, as those of a grid are")
    return float(values[0]), size
