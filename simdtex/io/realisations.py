# SPDX-License-Identifier: BSD-3-Clause
"""Realisations in files: many pictures of one simulation, with their coordinates and attributes.

They are an `xarray.DataArray` with the dimensions (realisation, y, x), or (realisation, y, x, variable). The extra
``simulate`` brings the libraries: ``pip install 'simdtex[simulate]'``.
"""

from __future__ import annotations

import json
import os
import zipfile
from collections.abc import Callable, Hashable, Mapping
from importlib import import_module
from math import prod
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from simdtex.io import image
from simdtex.io.decode import native
from simdtex.io.limits import (
    TooLarge,
    check_bytes,
    check_file,
    check_pixels,
    check_zip,
    max_pixels_or_default,
    read_npy,
)

if TYPE_CHECKING:
    from xarray import DataArray, Dataset

__all__ = ["check_realisations_path", "read_realisations", "write_realisations"]

Array = NDArray[Any]
PathLike = str | os.PathLike[str]

DIMENSIONS = ("realisation", "y", "x", "variable")

_NAME = "realisations"
"""The array's name in a file, where it has none of its own."""

_JSON = "simdtex_json"
"""The attribute that lists those attributes which are JSON."""

_RESERVED = frozenset(
    (
        *("missing_value", "scale_factor", "add_offset", "dtype", "coordinates"),
        *("CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST"),
        _JSON,
    )
)
"""Attributes by which the formats say how numbers are stored; so are all that begin with an underscore."""

# suffix: bytes of the floats that the format holds; .npz holds all
_FLOATS = {".zarr": (2, 4, 8), ".zarr.zip": (2, 4, 8), ".nc": (4, 8)}
# suffix: the modules needed beside xarray
_NEEDED = {".zarr": ("zarr",), ".zarr.zip": ("zarr",), ".nc": ("h5py", "h5netcdf"), ".npz": ()}
_CHUNK = 2**22  # bytes of a chunk, about, and many realisations or a part of one at most


# ---------------------------------------------------------------- checking


def check_realisations_path(path: PathLike, dtype: DTypeLike | None = None) -> None:
    """Find out before a long simulation whether its realisations can be written there.

    Parameters
    ----------
    path : path
        The file or folder to be written later, as for `write_realisations`; nothing is created now.
    dtype : dtype, optional
        The type of the values; None leaves it unchecked.

    Raises
    ------
    ValueError
        The suffix is not known or its format cannot hold the type, the folder is missing or not writable, something
        else is there, or a library is not installed.

    Notes
    -----
    The libraries are imported, which takes about a second the first time.
    """
    target = Path(path)
    suffix = _suffix(target)
    if suffix == ".zarr" and os.path.isdir(target):
        if not any((target / name).is_file() for name in ("zarr.json", ".zgroup", ".zarray")):
            raise ValueError(f"{target} is a folder and no Zarr store: give a new name")
        if not os.access(os.path.dirname(os.path.realpath(target)), os.W_OK | os.X_OK):
            raise ValueError(f"the folder {target.parent} is not writable: choose another folder")
    else:
        image.check_writable(target, suffixes={f".{suffix.rpartition('.')[2]}"})
        if suffix == ".zarr" and target.exists():
            raise ValueError(f"{target} is a file: give another name for the folder of the store")
    kind = np.dtype(np.uint8 if dtype is None else dtype)
    if kind.kind == "f" and kind.itemsize not in _FLOATS.get(suffix, (kind.itemsize,)):
        raise ValueError(f"{target}: {suffix} cannot hold {kind} values: end its name in .npz instead")
    _libraries(suffix)


def _suffix(target: Path) -> str:
    name = target.name.lower()
    found = next((suffix for suffix in _NEEDED if name.endswith(suffix) and name != suffix), None)
    if found is None:
        raise ValueError(f"{target} names no format of realisations: end its name in one of {', '.join(_NEEDED)}")
    return found


def _libraries(suffix: str) -> Any:
    """The module xarray, when all that the format needs is there."""
    for name in ("xarray", *_NEEDED[suffix]):
        try:
            import_module(name)
        except ImportError:
            raise ValueError(f"{name} is not installed; pip install 'simdtex[simulate]'") from None
    return import_module("xarray")


# ---------------------------------------------------------------- writing


def write_realisations(path: PathLike, array: DataArray) -> None:
    """Write realisations in the format that the suffix names, whole or not at all.

    Parameters
    ----------
    path : path
        ``.zarr`` (a folder, Zarr format 3), ``.zarr.zip`` (the same in one file), ``.nc`` (netCDF 4, any type but
        float16) or ``.npz`` (for NumPy alone: ``values``, each coordinate as ``coordinate NAME``, and ``description``,
        a JSON text). All are compressed. A file, or a Zarr store, that is there is replaced at the end.
    array : DataArray, (realisation, y, x) or (realisation, y, x, variable)
        Integers, bool or real floats, with coordinates of numbers or texts. Its type is kept.

    Raises
    ------
    TypeError
        `array` is no DataArray, or its values, coordinates or attributes are of a type that files do not hold.
    ValueError
        The dimensions are others, an attribute has a name that the formats use themselves, the path cannot be written,
        or a library is not installed.

    Notes
    -----
    Attributes that are texts and numbers are written as such, every other (None, bool, lists, dictionaries) as JSON
    under its own name. `read_realisations` gives them back equal; tuples and arrays come back as lists.
    """
    suffix = _suffix(Path(path))
    xarray = _libraries(suffix)
    if not isinstance(array, xarray.DataArray):
        raise TypeError(f"the realisations are of type {type(array).__name__}: give an xarray.DataArray")
    _check_dimensions(array)
    check_realisations_path(path, array.dtype)
    attributes = {name: _plain_attributes(one.attrs) for name, one in [(None, array), *array.coords.items()]}
    coordinates = {str(name): (one.dims, _plain_coordinate(name, one)) for name, one in array.coords.items()}
    values = native(np.asarray(array.values))
    if suffix == ".npz":
        with image.atomic_path(path) as temporary:
            _write_npz(temporary, array, values, coordinates, attributes)
        return
    stored = {name: _stored(given) for name, given in attributes.items()}
    name = _NAME if array.name is None else str(array.name)
    coords = {key: (dims, one, stored[key]) for key, (dims, one) in coordinates.items()}
    dataset = xarray.Dataset({name: (array.dims, values, stored[None])}, coords)
    dataset.attrs = {} if array.name is None else {"array": name}
    with image.atomic_folder(path) if suffix == ".zarr" else image.atomic_path(path) as temporary:
        _WRITERS[suffix](temporary, dataset, name)


def _check_dimensions(array: DataArray) -> None:
    if array.dims not in (DIMENSIONS[:3], DIMENSIONS):
        raise ValueError(
            f"the realisations have the dimensions {array.dims}: give ('realisation', 'y', 'x'), with 'variable' as "
            "the last one if there are several"
        )
    if array.size == 0:
        raise ValueError(f"the realisations have the shape {array.shape}: give one pixel at least")
    if array.dtype.kind not in "buif":
        raise TypeError(f"the realisations hold {array.dtype} values: give integers or real floats")
    name = _NAME if array.name is None else array.name
    if not isinstance(name, str) or not name or "/" in name:
        raise ValueError(f"the name of the realisations is {name!r}: give a text without '/', or None")
    if name in (*array.dims, *array.coords):
        raise ValueError(
            f"{name!r} is the name of the realisations and of one of their coordinates: rename one of them"
        )


def _plain_coordinate(name: Hashable, coordinate: DataArray) -> Array:
    values = np.asarray(coordinate.values)
    if values.dtype.kind in "OT" and all(isinstance(one, str) for one in values.ravel()):
        values = _texts(values)
    if not isinstance(name, str) or "/" in name or values.dtype.kind not in "buifU" or values.dtype == np.float16:
        raise TypeError(
            f"the coordinate {name!r} holds {values.dtype} values: give numbers or texts under a name without '/', or "
            "leave it out"
        )
    return native(values).reshape(values.shape)  # which a single value does not keep


def _texts(values: Array) -> Array:
    """Texts of one length, NumPy's own kind, from whatever a library holds texts in."""
    return np.array([str(one) for one in values.ravel()]).reshape(values.shape)


def _plain_attributes(attributes: Mapping[Any, Any]) -> dict[str, Any]:
    for name in attributes:
        if not isinstance(name, str) or not name or "\0" in name:
            raise TypeError(f"the attribute {name!r} has no text for a name: rename it")
        if name in _RESERVED or name.startswith("_"):
            raise ValueError(f"the attribute {name} has a name that the file formats use themselves: rename it")
    return {name: _plain(value, name) for name, value in attributes.items()}


def _plain(value: Any, name: str) -> Any:
    """A value of JSON for one of Python or NumPy."""
    if isinstance(value, (np.generic, np.ndarray)) and value.dtype.kind in "buifU":
        return value.tolist()
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, (list, tuple)):
        return [_plain(one, name) for one in value]
    if isinstance(value, Mapping):
        if any(not isinstance(key, str) for key in value):
            raise TypeError(f"the attribute {name} has a dictionary with keys that are no texts: make them texts")
        return {key: _plain(one, name) for key, one in value.items()}
    raise TypeError(
        f"the attribute {name} is of type {type(value).__name__}: give a text, a number, None, or a list or dictionary "
        "of these"
    )


def _stored(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Texts and numbers as they are, everything else as JSON, with a list of what is JSON."""
    text = [name for name, value in attributes.items() if not _is_native(value)]
    found = {name: json.dumps(value) if name in text else value for name, value in attributes.items()}
    return found | ({_JSON: json.dumps(text)} if text else {})


def _is_native(value: Any) -> bool:
    if isinstance(value, str):
        return "\0" not in value  # which ends a text in HDF5
    if isinstance(value, float):
        return bool(np.isfinite(value))
    return isinstance(value, int) and not isinstance(value, bool) and -(2**63) <= value < 2**63


def _write_npz(
    path: Path,
    array: DataArray,
    values: Array,
    coordinates: Mapping[str, tuple[tuple[Hashable, ...], Array]],
    attributes: Mapping[Any, Mapping[str, Any]],
) -> None:
    description = {
        "name": array.name,
        "dimensions": array.dims,
        "attributes": attributes[None],
        "coordinates": {
            name: {"dimensions": dims, "attributes": attributes[name]} for name, (dims, _) in coordinates.items()
        },
    }
    arrays: dict[str, Any] = {f"coordinate {name}": one for name, (_, one) in coordinates.items()}
    with path.open("wb") as file:  # NumPy would add its own suffix to a name in capitals
        np.savez_compressed(file, values=values, description=np.array(json.dumps(description)), **arrays)


def _write_netcdf(path: Path, dataset: Dataset, name: str) -> None:
    encoding = _encoding(dataset)
    encoding[name] |= {"zlib": True, "complevel": 4, "chunksizes": _chunks(dataset[name].shape, dataset[name].dtype)}
    # in memory first: HDF5 does not survive a disk that is full
    path.write_bytes(dataset.to_netcdf(engine="h5netcdf", encoding=encoding))


def _write_zarr(path: Path, dataset: Dataset, name: str) -> None:
    # objects, for Zarr has no lasting form of texts of one length; and it has none of consolidated metadata
    texts = {key: one.astype(object) for key, one in dataset.coords.items() if one.dtype.kind == "U"}
    encoding = _encoding(dataset)
    encoding[name]["chunks"] = _chunks(dataset[name].shape, dataset[name].dtype)
    dataset.assign_coords(texts).to_zarr(path, mode="w", zarr_format=3, consolidated=False, encoding=encoding)


def _write_zip(path: Path, dataset: Dataset, name: str) -> None:
    # not Zarr's own store in a zip file, which has every file twice that is written twice
    with TemporaryDirectory(dir=path.parent, prefix=".simdtex-") as folder:
        temporary = Path(folder)
        _write_zarr(temporary, dataset, name)
        with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
            for file in sorted(temporary.rglob("*")):
                if file.is_file():
                    archive.write(file, file.relative_to(temporary).as_posix())


_WRITERS: dict[str, Callable[[Path, Dataset, str], None]] = {
    ".zarr": _write_zarr,
    ".zarr.zip": _write_zip,
    ".nc": _write_netcdf,
}


def _encoding(dataset: Dataset) -> dict[Any, dict[str, Any]]:
    """No fill value for anything; xarray gives floats one, which comes back as an attribute."""
    return {key: {"_FillValue": None} for key in dataset.variables}


def _chunks(shape: tuple[int, ...], dtype: np.dtype[Any]) -> tuple[int, ...]:
    """Chunks of whole realisations, or of whole rows of one that is large."""
    row = int(np.prod(shape[2:])) * dtype.itemsize
    rows = min(shape[1], max(1, _CHUNK // row))
    realisations = min(shape[0], max(1, _CHUNK // (row * shape[1])))
    return realisations, rows, *shape[2:]


# ---------------------------------------------------------------- reading


def read_realisations(path: PathLike, *, max_pixels: int | None = None) -> DataArray:
    """Read realisations that `write_realisations` wrote, whole into memory.

    Parameters
    ----------
    path : path
        ``.zarr``, ``.zarr.zip``, ``.nc`` or ``.npz``. To read a part of many realisations use xarray itself.
    max_pixels : int, optional
        Pixels of all realisations together that are read at most, and 8 bytes for each. None: ``SIMDTEX_MAX_PIXELS`` of
        the environment, else 2**27.

    Returns
    -------
    DataArray, (realisation, y, x) or (realisation, y, x, variable)
        The values with their type, coordinates and attributes.

    Raises
    ------
    ValueError
        There is no such file, it is damaged, too large or holds no realisations, or a library is not installed.
    """
    target = Path(path)
    suffix = _suffix(target)
    most = max_pixels_or_default(max_pixels)
    xarray = _libraries(suffix)
    if not target.exists():
        raise ValueError(f"{target} does not exist: check the path of the realisations")
    if target.is_dir() != (suffix == ".zarr"):
        kind, other = ("folder", "file") if target.is_dir() else ("file", "folder")
        raise ValueError(f"{target} is a {kind} and should be a {other}: check the path of the realisations")
    if suffix != ".zarr":
        check_file(target, "the realisations", most)
    try:
        found: DataArray = _READERS[suffix](target, xarray, most)
        _check_dimensions(found)
    except TooLarge as error:
        raise ValueError(f"{target} {error}") from None
    except Exception as error:  # every library has its own exceptions for a damaged file
        reason = " ".join(str(error).split()) or type(error).__name__
        reason = reason if len(reason) <= 200 else reason[:197] + "..."
        raise ValueError(f"{target} cannot be read as realisations ({reason}): write them again") from None
    return found


def _read_npz(path: Path, xarray: Any, most: int) -> Any:
    with zipfile.ZipFile(path) as archive:
        check_zip(archive, most)
        with archive.open("values.npy") as packed:
            values = read_npy(packed, archive.getinfo("values.npy").file_size, 3, most)
    with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
        description = json.loads(str(arrays["description"]))
        coordinates = {
            name: (tuple(one["dimensions"]), arrays[f"coordinate {name}"], one["attributes"])
            for name, one in description["coordinates"].items()
        }
    return xarray.DataArray(
        values, coordinates, description["dimensions"], name=description["name"], attrs=description["attributes"]
    )


# numbers as they stand in the file: units and fill values are not looked at
_AS_IT_IS = {"mask_and_scale": False, "decode_times": False, "decode_timedelta": False}


def _read_netcdf(path: Path, xarray: Any, most: int) -> Any:
    with xarray.open_dataset(path, engine="h5netcdf", **_AS_IT_IS) as dataset:
        return _only(_bounded(dataset, most).load())


def _read_zarr(path: Path, xarray: Any, most: int) -> Any:
    with xarray.open_dataset(path, engine="zarr", chunks=None, consolidated=False, **_AS_IT_IS) as dataset:
        return _only(_bounded(dataset, most).load())


def _read_zip(path: Path, xarray: Any, most: int) -> Any:
    with zipfile.ZipFile(path) as archive:
        check_zip(archive, most)
    store = import_module("zarr.storage").ZipStore(path, mode="r")
    try:
        return _read_zarr(store, xarray, most)
    finally:
        store.close()


def _bounded(dataset: Any, most: int) -> Any:
    """The dataset, of which nothing has been loaded, if all of it and each of its chunks are no larger than may be."""
    variables = list(dataset.variables.values())
    check_bytes(sum(prod(one.shape) * one.dtype.itemsize for one in variables), most)
    for one in variables:
        check_pixels(prod(one.shape[:3]), most)
        check_bytes(prod(one.encoding.get("chunksizes") or one.encoding.get("chunks") or ()) * one.dtype.itemsize, most)
    return dataset


def _only(dataset: Any) -> Any:
    """The one array of a dataset, with its attributes as they were given."""
    if len(dataset.data_vars) != 1:
        raise ValueError(f"it has {len(dataset.data_vars)} arrays and not one")
    array = dataset[next(iter(dataset.data_vars))]
    array = array.rename(dataset.attrs.get("array")).drop_encoding()
    texts = {name: one for name, one in array.coords.items() if one.dtype.kind in "OT"}
    array = array.assign_coords({name: (one.dims, _texts(one.values), one.attrs) for name, one in texts.items()})
    for one in (array, *array.coords.values()):
        one.attrs = _given(one.attrs)
    return array


def _given(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Undo `_stored`."""
    text = json.loads(attributes.get(_JSON, "[]"))
    plain = {name: value.item() if isinstance(value, np.generic) else value for name, value in attributes.items()}
    return {name: json.loads(value) if name in text else value for name, value in plain.items() if name != _JSON}


_READERS: dict[str, Callable[[Path, Any, int], Any]] = {
    ".zarr": _read_zarr,
    ".zarr.zip": _read_zip,
    ".nc": _read_netcdf,
    ".npz": _read_npz,
}
