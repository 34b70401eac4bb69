# SPDX-License-Identifier: BSD-3-Clause
"""Reading and writing of volumes, without a change of any value, and writing of realisations.

A volume is an array (depth, rows, cols) or (depth, rows, cols, channels): x-y slices one behind the other, each like a
picture. Realisations are an `xarray.DataArray`, as `simdtex.simulate` returns; the extra ``simulate`` installs xarray.
"""

from __future__ import annotations

import bz2
import csv
import io
import json
import os
import re
import warnings
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import suppress
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from simdtex.io import image
from simdtex.io.decode import decode, is_stack, native, read_stack
from simdtex.io.files import (
    PathLike,
    Refused,
    atomic_folder,
    atomic_path,
    check_beside,
    check_folder_writable,
    check_size,
    check_target,
    earlier_files,
    explained,
    max_pixels_or_default,
    needs,
    quiet,
    read_npy,
    read_npz,
    reading,
)
from simdtex.io.grids import SUFFIXES, CartesianGrid, frame, write_grid
from simdtex.io.image import FLOATS, INTEGERS, Format, check_holds
from simdtex.io.rasters import axis_place
from simdtex.options import require

if TYPE_CHECKING:
    from xarray import DataArray, Dataset


Array = NDArray[Any]

# "" means a folder of slices
_FORMATS = {
    ".npz": Format(),
    ".npy": Format(),
    ".tif": Format(INTEGERS | FLOATS),
    ".tiff": Format(INTEGERS | FLOATS),
    ".nrrd": Format(INTEGERS | {"float32", "float64"}),
    "": Format(frozenset({"uint8", "uint16"}), (1, 2, 3, 4)),
}
_SLICE = re.compile(r"slice-([0-9]{3,})\.png")
_NUMBERED = re.compile(r"(.*?)([0-9]{1,9})(\.\w+)")
_RAW = re.compile(r".*_([0-9]{1,9})x([0-9]{1,9})x([0-9]{1,9})_(u?int(?:8|16|32)|float32|float64)\.raw", re.IGNORECASE)
_COUNTS = re.compile(rb'NumberOfComponents="([0-9]+)|^\S+ ([0-9]+) ([0-9]+) \w+\s*$', re.MULTILINE)
"""What headers of VTK say of the variables of a cell, and, in the older format, of the size of an array."""


def check_writable(path: PathLike, dtype: DTypeLike | None = None, channels: int | None = None) -> None:
    """Raise ValueError before a long run unless such values can be written, without creating a file.

    A folder is only replaced if it contains only slices.
    """
    target = Path(path)
    suffix = target.suffix.lower()
    if suffix not in _FORMATS:
        raise ValueError(
            f"{target} ends in {target.suffix}: end its name in one of {', '.join(sorted(filter(None, _FORMATS)))}, "
            "or give a name without suffix for a folder of PNG slices"
        )
    if suffix == ".nrrd":
        require("volumes", "nrrd")
    if suffix:
        check_target(target)
    else:
        earlier_files(target, "the slices", lambda name: bool(_SLICE.fullmatch(name)))
        check_folder_writable(target)
    other = next(suffix for suffix in (".nrrd", ".tif", ".npz") if _FORMATS[suffix].holds(dtype, channels))
    check_holds(target, _FORMATS, dtype, channels, other)


def is_volume(path: PathLike, channels: bool = False) -> bool:
    """Return whether a path holds a volume; with ``channels`` an ``.npy`` of three axes is a picture."""
    suffix = Path(path).suffix.lower()
    if os.path.isdir(path) or suffix not in (".tif", ".tiff", ".npy"):
        return os.path.isdir(path) or suffix in _READERS
    with suppress(Exception):  # the reader of pictures reports the error
        if os.path.isfile(path) and suffix == ".npy":
            return int(np.load(path, mmap_mode="r", allow_pickle=False).ndim) > 2 + channels
        return os.path.isfile(path) and is_stack(path)
    return False


def read(path: PathLike, *, max_pixels: int | None = None, ascending: bool = False) -> CartesianGrid:
    """Return the volume in a file, or in a folder of slices.

    Parameters
    ----------
    path : path
        What `write` writes; ``.nrrd`` ``.nhdr``, and ``.mha`` ``.mhd`` of MetaImage, with attached data or a file in
        the same folder; a TIFF whose pages are layers, or layers and channels; ``.vti``, and ``.vtk`` of structured
        points, with ``simdtex[volumes]``; ``.raw``, little-endian, x fastest, whose name says its size and type, as
        ``bonsai_256x256x256_uint8.raw``; or a folder of pictures whose names differ in a number.
    max_pixels : int, optional
        The most values that are read, with 8 bytes for each; None: ``SIMDTEX_MAX_PIXELS``, else 2**27.
    ascending : bool
        Whether pictures, whose first row is the northern edge, are turned so that row 0 is the smallest y.

    Returns
    -------
    CartesianGrid
        The variables (nz, ny, nx), the centre of the first cell, and the size of a cell, in the units of the file. An
        axis whose coordinates descend is reversed. Of rotated axes only the size of a cell is kept, and the origin is
        0. White is the largest value, as in pictures.

    Raises
    ------
    ValueError
        The file is missing, no regular file, damaged, not a volume, or too large, or a library is not installed.
    """
    name, target = os.fspath(path), Path(path)
    if target.is_dir():
        with explained(name, "the volume"):
            values, georeference = _slices(target, max_pixels_or_default(max_pixels))
    else:
        with reading(path, "the volume", max_pixels, kind="a volume") as most, quiet():
            values, georeference = _READERS[target.suffix.lower()](target, most)
    variables: dict[str, Array] = {}
    pictures = ascending and (target.is_dir() or target.suffix.lower() in (".tif", ".tiff"))
    for key, array in values.items():
        if array.ndim not in (3, 4) or array.size == 0 or array.dtype.kind not in "buif":
            what = f"the shape {array.shape} and the type {array.dtype}"
            raise ValueError(f"{name} has {what}: give numbers of three axes")
        array = array[:, ::-1] if pictures else array
        parts = [array] if array.ndim == 3 else np.moveaxis(array, -1, 0)
        variables |= {key if len(parts) == 1 else f"{key}_{k}": native(part) for k, part in enumerate(parts)}
    return CartesianGrid(variables, *georeference)


_Read = tuple[dict[str, Array], tuple[tuple[float, ...], tuple[float, ...]]]
"""Arrays (layers, rows, cols) or (layers, rows, cols, variables) by name, and the origin and the size of cells."""

_PLAIN = ((0.0,) * 3, (1.0,) * 3)
"""Origin and size of cells of a file that has none."""


def _array(path: Path, most: int) -> _Read:
    """Read ``.npy``, or the array ``"volume"`` of ``.npz``, or the only one."""
    if path.suffix.lower() == ".npy":
        with path.open("rb") as file:
            return {"value": read_npy(file, os.fstat(file.fileno()).st_size, most)}, _PLAIN
    with zipfile.ZipFile(path) as archive:
        names = [name.removesuffix(".npy") for name in archive.namelist()]
    if len(names) > 1 and "volume" not in names:
        raise Refused(f"has the arrays {', '.join(names)[:100]}: name one of them volume")
    return {"value": read_npz(path, "volume" if "volume" in names else names[0], most)}, _PLAIN


def _slices(folder: Path, most: int) -> _Read:
    """Return the pictures of a folder, by the number in their names, as layers."""
    names = sorted(path.name for path in folder.iterdir() if path.name[0] != ".")
    numbered = [match for name in names if (match := _NUMBERED.fullmatch(name))]
    layers = {int(match[2]): match[0] for match in numbered}
    if not names or len(layers) < len(names) or len({match.group(1, 3) for match in numbered}) > 1:
        raise Refused("is a folder: keep only slices in it, whose names differ in their number, as slice-000.png")
    if missing := set(range(min(layers), max(layers))) - set(layers):
        raise Refused(f"has no slice of number {min(missing)}: add it")
    pictures: list[Array] = []
    for _, name in sorted(layers.items()):
        with reading(folder / name, "the slice", most // len(layers), kind="an image") as each:
            pictures.append(decode((folder / name).read_bytes(), each, opaque=True)[0])
            if (pictures[-1].shape, pictures[-1].dtype) != (pictures[0].shape, pictures[0].dtype):
                raise ValueError("its size or type is not that of the first slice")
    return {"value": np.stack(pictures)}, _PLAIN


def _raw(path: Path, most: int) -> _Read:
    said = _RAW.fullmatch(path.name)
    if not said:
        raise Refused("is a .raw: name it with columns x rows x layers and type, as NAME_256x256x128_uint8.raw")
    shape, dtype = tuple(int(side) for side in said.group(3, 2, 1)), np.dtype(said[4].lower()).newbyteorder("<")
    check_size(prod(shape), 0, most)
    if (size := path.stat().st_size) != prod(shape) * dtype.itemsize:
        raise Refused(f"has {size} bytes, not {prod(shape) * dtype.itemsize} as its name says: rename it")
    return {"value": np.fromfile(path, dtype).reshape(shape)}, _PLAIN


def _beside(path: Path, name: str, most: int) -> bytes:
    """Return the data of the file that a header names, a file of its own folder within the limits."""
    file = path.with_name(Path(name).name or "..")
    if file.name != name or name == "LIST" or "%" in name:
        raise Refused(f"names the data file {name[:100]!r}: put the data into one file in the folder of the header")
    check_beside(path, [file])
    with reading(file, "the data file", most):
        return file.read_bytes()


def _nrrd(path: Path, most: int) -> _Read:
    needs("nrrd", "volumes", "an NRRD file")
    import nrrd

    with path.open("rb") as file:
        return _stored(path, dict(nrrd.read_header(file)), file.read(), most)


def _metaimage(path: Path, most: int) -> _Read:
    """Read a MetaImage by the header of an NRRD that says the same."""
    needs("nrrd", "volumes", "a MetaImage")
    said: dict[str, str] = {}
    with path.open("rb") as file:
        while "ElementDataFile" not in said:
            key, equals, text = file.readline(2**14).decode("latin-1").partition("=")
            said[key.strip()] = text.strip()
            if not equals:
                raise ValueError("its header has no ElementDataFile")
        data = file.read()

    def value(*keys: str) -> str:
        return next((said[key] for key in keys[:-1] if key in said), keys[-1]).lower()

    binary, packed = (value(key, "") == "true" for key in ("BinaryData", "CompressedData"))
    parts, kind = int(value("ElementNumberOfChannels", "1")), value("ElementType", "").removeprefix("met_")
    bits = {"char": 8, "short": 16, "int": 32, "long": 32, "long_long": 64}.get(kind.lstrip("u"))
    sizes = [parts] * (parts > 1) + [int(side) for side in said["DimSize"].split()]
    steps = np.array(value("TransformMatrix", "Rotation", "Orientation", "1 0 0 0 1 0 0 0 1").split(), float)
    cell = np.array(value("ElementSpacing", "ElementSize", "1 1 1").split(), float)
    header = {
        "type": "u" * (kind[0] == "u") + f"int{bits}" if bits else kind,
        "sizes": np.array(sizes),
        "dimension": len(sizes),
        "endian": "big" if value("ElementByteOrderMSB", "BinaryDataByteOrderMSB", "") == "true" else "little",
        "encoding": "gzip" if packed else "raw" if binary else "ascii",
        "byte skip": int(value("HeaderSize", "0")),
        "space directions": steps.reshape(3, 3) * cell[:, None],
        "space origin": np.array(value("Offset", "Position", "Origin", "0 0 0").split(), float),
        "data file": said["ElementDataFile"] if said["ElementDataFile"].upper() != "LOCAL" else "",
    }
    return _stored(path, header, data, most)


def _stored(path: Path, header: dict[str, Any], data: bytes, most: int) -> _Read:
    """Return the volume that the header of an NRRD describes; ``data`` follows it in its file."""
    import nrrd

    count = prod(int(side) for side in header["sizes"])
    check_size(count, 0, most)
    if count < 1:
        raise ValueError("it has no values")
    if name := header.pop("data file", None) or header.pop("datafile", None):
        data = _beside(path, name, most)
    lines, skip = (int(header.pop(f"{a} skip", 0) or header.pop(f"{a}skip", 0)) for a in ("line", "byte"))
    packed = header["encoding"].lower() in ("gzip", "gz", "bzip2", "bz2")
    if not (0 <= lines < 2**10 and packed - 1 <= skip <= most):
        raise ValueError("its header skips too much")
    data = data.split(b"\n", lines)[lines]
    if packed:
        gzip = header["encoding"][0] in "gG"
        unpack: Any = zlib.decompressobj(47) if gzip else bz2.BZ2Decompressor()  # 47: with a header of gzip or zlib
        data, header["encoding"] = unpack.decompress(data, skip + 8 * count), "raw"
    values = nrrd.read_data(header | {"byte skip": skip}, io.BytesIO(data), index_order="C")
    kinds = [str(kind).lower() for kind in header.get("kinds", ["vector"] * (values.ndim - 3) + ["domain"] * 3)]
    others = [axis for axis, kind in enumerate(kinds) if kind not in ("domain", "space", "???", "none")]
    if len(kinds) != len(others) + 3 or len(others) > 1 or "time" in kinds:
        raise Refused(f"has the axes {', '.join(kinds)}: give three of space, and at most one of variables")
    for axis in others:
        values = np.moveaxis(values, values.ndim - 1 - axis, -1)
    if "space directions" in header:
        steps: Any = [row for row in header["space directions"] if row is not None and np.isfinite(row).all()]
    else:
        steps = np.diag(np.nan_to_num(np.delete(header.get("spacings", [1.0] * len(kinds)), others), nan=1.0))
    return _placed({"value": values}, np.array(steps, np.float64), header.get("space origin", _PLAIN[0]))


def _placed(values: dict[str, Any], steps: NDArray[np.float64], origin: Any) -> _Read:
    """Return values along x, y and z, with a step from cell to cell in each row, and where the cells lie."""
    along, at = np.diagonal(steps), np.array(origin, np.float64)
    cell = np.linalg.norm(steps, axis=1)
    if np.abs(steps - np.diag(along)).max() > 1e-6 * cell.max():
        return values, frame(_PLAIN[0], cell.tolist())
    for axis in (axis for axis in range(3) if along[axis] < 0):
        at[axis] += along[axis] * (next(iter(values.values())).shape[2 - axis] - 1)
        values = {key: np.flip(array, 2 - axis) for key, array in values.items()}
    return values, frame(at.tolist(), np.abs(along).tolist())


def _vtk(path: Path, most: int) -> _Read:
    """Read an image that VTK reads, with the arrays of its points or of its cells."""
    needs("pyvista", "volumes", "an image of VTK")
    import pyvista
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline

    sums = [[int(count or 1) for count in match] for match in _COUNTS.findall(path.read_bytes())]
    check_size(sum(map(prod, sums)), 0, most)
    # its own log would be on standard error
    with pyvista.vtk_verbosity("off"), pyvista.VtkErrorCatcher(raise_errors=True, send_to_logging=False):
        reader: Any = pyvista.get_reader(str(path))  # type: ignore[no-untyped-call]
        reader.reader.UpdateInformation()
        extent = reader.reader.GetOutputInformation(0).Get(vtkStreamingDemandDrivenPipeline.WHOLE_EXTENT())
        sides = [last - first + 1 for first, last in zip(extent[4::-2], extent[5::-2], strict=True)]
        check_size(prod(sides) * max(1, sum(parts for parts, *_ in sums)), 0, most)
        grid = reader.read()
    if not isinstance(grid, pyvista.ImageData):
        raise Refused(f"holds {type(grid).__name__} of VTK: resample it to an image (ImageData, structured points)")
    kinds = grid.point_data, grid.cell_data
    points, cells = ({key: array for key, array in kind.items() if key[:3] != "vtk"} for kind in kinds)
    if bool(points) == bool(cells):
        raise Refused(f"has {'both point and' if points else 'no point or'} cell arrays: save one of the two kinds")
    shape = [max(1, side - bool(cells)) for side in sides]
    arrays = points or cells
    values = {str(key): np.asarray(array).reshape(*shape, *array.shape[1:]) for key, array in arrays.items()}
    steps = np.asarray(grid.direction_matrix).T * np.array(grid.spacing)[:, None]
    corner = [bool(cells) and side > 1 for side in sides[::-1]]  # half a cell before the centre of the first
    return _placed(values, steps, grid.GetPoint(0) + np.array(corner) / 2 @ steps)


_READERS: dict[str, Callable[[Path, int], _Read]] = {
    **dict.fromkeys((".npy", ".npz"), _array),
    **dict.fromkeys((".tif", ".tiff"), read_stack),
    **dict.fromkeys((".nrrd", ".nhdr"), _nrrd),
    **dict.fromkeys((".mha", ".mhd"), _metaimage),
    **dict.fromkeys((".vti", ".vtk"), _vtk),
    ".raw": _raw,
}


def write(path: PathLike, volume: ArrayLike) -> None:
    """Write a solid texture in the format of the suffix, atomically.

    Parameters
    ----------
    path : path
        ``.npz`` (compressed, key ``"volume"``) or ``.npy``, of any type; ``.tif`` ``.tiff``, a page for each slice, of
        any type but bool; ``.nrrd``, integers and floats of 32 and 64 bits; or a name without suffix for a folder
        of slices ``slice-000.png``, 8 or 16 bits, up to 4 channels. An existing folder of slices is replaced.
    volume : array_like, (depth, rows, cols) or (depth, rows, cols, channels)
        Real numbers, written unchanged.

    Raises
    ------
    TypeError
        The values are not real numbers.
    ValueError
        The path cannot be written, or its format cannot hold such values; the message names a suitable format.

    Notes
    -----
    A single channel is written without an axis, except in ``.npz`` and ``.npy``. In an NRRD file, which is not
    compressed, x varies fastest, then y, then z, with the channels as a vector before them.
    """
    values = image.pixels_of("the volume", volume, 3)
    check_writable(path, values.dtype, values.shape[3] if values.ndim == 4 else 1)
    suffix = Path(path).suffix.lower()
    if suffix not in (".npz", ".npy") and values.ndim == 4 and values.shape[3] == 1:
        values = values[..., 0]
    with atomic_path(path) if suffix else atomic_folder(path) as temporary:
        _encode(temporary, suffix, native(values))


def _encode(path: Path, suffix: str, values: Array) -> None:
    if suffix == ".npz":
        with path.open("wb") as file:  # NumPy would add its own suffix to a name in capitals
            np.savez_compressed(file, volume=values)
    elif suffix == ".npy":
        image.encode(path, suffix, values)
    elif suffix == ".nrrd":
        # without the fields of a space, after which VTK misreads the sizes of a vector volume
        import nrrd

        header = {"encoding": "raw", "kinds": ["vector"] * (values.ndim - 3) + ["domain"] * 3}
        written = io.BytesIO()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # pynrrd gets the time by a deprecated call
            nrrd.write(written, values, header, index_order="C")
        data = written.getvalue()
        head = data[: data.index(b"\n\n")]
        with path.open("wb") as file:
            file.write(re.sub(rb"\n# on .*", b"", head))  # the time: the same volume is to be the same file
            file.write(memoryview(data)[len(head) :])
    elif suffix:
        image.write_tiff(path, values)
    else:
        digits = max(3, len(str(len(values) - 1)))
        for index, picture in enumerate(values):
            image.encode(path / f"slice-{index:0{digits}}.png", ".png", picture)


_NEEDED = {
    ".zarr": ("xarray", "zarr"),
    ".nc": ("xarray", "h5netcdf", "h5py"),
    ".npz": (),
    **dict.fromkeys(SUFFIXES, ()),
}
"""The libraries that each suffix needs."""


def check_realisations_path(path: PathLike, *, source: bool = False) -> str:
    """Check before a long simulation that its realisations can be written; return the suffix in lower case.

    Raises
    ------
    ValueError
        The path cannot be written, a grid cannot hold the ``source`` map, or a library is not installed.
    """
    target = Path(path)
    suffix = target.suffix.lower()
    if suffix not in _NEEDED:
        raise ValueError(f"{target} names no format of realisations: end its name in one of {', '.join(_NEEDED)}")
    if source and suffix in SUFFIXES:
        raise ValueError(f"{target} is a grid, which holds no source map: end its name in .zarr, .nc or .npz")
    require("simulate", *_NEEDED[suffix])
    if suffix == ".zarr" and target.exists():  # a store may hold what others have added
        raise ValueError(f"{target} exists already: give a new name for the store")
    check_target(target)
    return suffix


def write_realisations(path: PathLike, array: DataArray | Dataset) -> None:
    """Write realisations in the format of the suffix, atomically.

    Parameters
    ----------
    path : path
        ``.zarr`` (a folder, Zarr format 3) and ``.nc`` (netCDF 4, compressed) for xarray; ``.npz`` for ``numpy.load``,
        with ``values``, each coordinate under its name, and ``attributes``, a JSON text; or ``.gslib``, ``.sgems`` and
        ``.tif``, grids with a variable for each realisation, ``NAME__real0`` and so on, see `simdtex.write_grid`, in
        which cells outside of the coordinate ``region`` are unknown. An existing file is replaced, and an existing
        store is an error.
    array : DataArray, ([realisation, z,] y, x[, variable]), or Dataset
        The result of `simdtex.simulate` or `simdtex.estimate`; attributes are texts and numbers. A grid needs evenly
        spaced, ascending coordinates, and cannot hold the Dataset that ``source=True`` gives.

    Raises
    ------
    TypeError
        `array` is no DataArray, or the format cannot hold its type or an attribute.
    ValueError
        The path cannot be written, or a library is not installed.
    """
    if not hasattr(array, "coords"):
        raise TypeError(f"the realisations are of type {type(array).__name__}: give an xarray.DataArray")
    several: Any = getattr(array, "data_vars", {})
    suffix = check_realisations_path(path, source="source_row" in several)
    if suffix in SUFFIXES:
        origin, cell = zip(*(axis_place(array, axis) for axis in "xyz"), strict=True)
        write_grid(path, dict(_variables(array)), origin=origin, cell=cell, crs=str(array.attrs.get("crs", "")))
        return
    if suffix == ".npz":
        members: Any = {**array.coords, **(several or {"values": array})}
        named: dict[str, Any] = {str(name): np.asarray(member.values) for name, member in members.items()}
        attributes = np.array(json.dumps(array.attrs))
        with atomic_path(path) as temporary, temporary.open("wb") as file:
            np.savez_compressed(file, attributes=attributes, **named)
        return
    whole: Any = array if several else array.to_dataset(name=array.name or "realisations")
    if suffix == ".nc":
        # in memory first, since HDF5 does not survive a full disk
        data = whole.to_netcdf(engine="h5netcdf", encoding={name: {"zlib": True} for name in whole.data_vars})
        with atomic_path(path) as temporary:
            temporary.write_bytes(data)
        return
    with atomic_folder(path) as store, warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Consolidated metadata")  # not yet in the specification, but read by xarray
        whole.to_zarr(store, mode="w-", zarr_format=3)


def write_at(path: PathLike, array: DataArray | Dataset, points: NDArray[Any], sites: NDArray[Any]) -> None:
    """Write coordinates (n, axes) and the values of realisations there as CSV; ``sites`` (n,) are the cells."""
    columns = dict(zip("xyz", points.T, strict=False))
    for name, values in _variables(array):
        columns[name] = np.ma.filled(np.ma.ravel(values)[sites].astype(str), "")
    with atomic_path(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows([[*columns], *zip(*columns.values(), strict=True)])


def _variables(array: Any) -> Iterator[tuple[str, Any]]:
    """Yield the name and the values, (z, y, x) or (y, x), of every variable of every realisation."""
    if several := getattr(array, "data_vars", None):
        for variable in sorted(several.values(), key=lambda variable: variable.ndim):
            yield from _variables(variable)
        return
    dims = [str(dim) for dim in array.dims]
    wanted: list[str] = [dim for dim in ("realisation", "variable", "category", "z", "y", "x") if dim in dims]
    if sorted(dims) != sorted(wanted) or wanted[-2:] != ["y", "x"]:
        raise ValueError(f"the realisations have the dimensions {', '.join(dims)}: give realisation, y and x")
    planes = np.asarray(array.values).transpose([dims.index(dim) for dim in wanted])
    if "region" in array.coords:
        planes = np.ma.masked_array(planes, np.broadcast_to(~array.coords["region"].values, planes.shape))
    names = [str(array.name or "realisations")]
    for dim, joint in (("category", "_"), ("variable", "_"), ("realisation", "__real")):
        if dim in dims:
            count = planes.shape[wanted.index(dim)]
            numbers = array.coords[dim].values.tolist() if dim in array.coords else range(count)
            names = [f"{name}{joint}{value}" for value in numbers for name in names]
    sides = planes.shape[sum(dim not in "zyx" for dim in dims) :]
    yield from zip(names, planes.reshape(-1, *sides), strict=True)
