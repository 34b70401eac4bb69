# SPDX-License-Identifier: BSD-3-Clause
"""Writing the realisations of a simulation, by xarray, as NumPy arrays, or as a grid.

Realisations are an `xarray.DataArray`, as `simdtex.simulate` returns. The extra ``simulate`` installs the libraries:
``pip install 'simdtex[simulate]'``.
"""

from __future__ import annotations

import hashlib
import json
import os
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from simdtex.io.atomic import atomic_folder, atomic_path, check_folder_writable, check_target
from simdtex.io.grids import SUFFIXES, write_grid
from simdtex.io.rasters import axis_place
from simdtex.options import require

if TYPE_CHECKING:
    from xarray import DataArray, Dataset

__all__ = ["check_realisations_path", "write_realisations"]

MARK = "simdtex_realisations"
"""The attribute that holds the checksum of a Zarr store written here; only an unchanged store is replaced."""

PathLike = str | os.PathLike[str]

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
        The suffix is unknown, or is that of a grid and there is a source map; the folder is missing or not writable,
        `path` exists and may not be replaced, or a library is not installed.
    """
    target = Path(path)
    suffix = target.suffix.lower()
    if suffix not in _NEEDED:
        raise ValueError(f"{target} names no format of realisations: end its name in one of {', '.join(_NEEDED)}")
    if source and suffix in SUFFIXES:
        raise ValueError(f"{target} is a grid, which holds no source map: end its name in .zarr, .nc or .npz")
    require("simulate", *_NEEDED[suffix])
    if suffix == ".zarr" and target.is_dir():
        if not _own(target):
            raise ValueError(
                f"{target} is a folder and not a store of realisations alone: remove it, or give a new name"
            )
        check_folder_writable(target)
        return suffix
    check_target(target)
    if suffix == ".zarr" and target.exists():
        raise ValueError(f"{target} is a file: give another name for the folder of the store")
    return suffix


def write_realisations(path: PathLike, array: DataArray | Dataset) -> None:
    """Write realisations in the format of the suffix, atomically.

    Parameters
    ----------
    path : path
        ``.zarr`` (a folder, Zarr format 3) and ``.nc`` (netCDF 4, compressed), which ``xarray.open_dataarray`` reads;
        or ``.npz`` for ``numpy.load``: ``values``, each coordinate under its name, and ``attributes``, a JSON text.
        ``.gslib`` (text) and ``.sgems`` are grids with a variable for each realisation, whose name is the array's name,
        ``__real`` and the number, as in SGeMS: `simdtex.write_grid`. They keep origin and size of cells, and no
        attributes; cells outside of the coordinate ``region`` are unknown values. An existing file is replaced, and a
        Zarr store if it was written here and nothing in it was added or changed, as its attribute
        ``simdtex_realisations``, a checksum, shows.
    array : DataArray, (realisation, y, x) or (realisation, y, x, variable), or Dataset
        The result of `simdtex.simulate`; attributes are texts and numbers. A grid may have layers, (realisation, z, y,
        x), and its coordinates must be evenly spaced and ascend. Only ``.zarr`` and ``.nc`` need xarray. With
        ``source=True`` the result is a Dataset: ``xarray.open_dataset`` reads it, an ``.npz`` has its variables by
        name, and a grid cannot hold it. A grid has the variables of any other Dataset, for example of `estimate`.

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
        arrays = sorted(several.values(), key=lambda one: one.ndim) or [array]
        found = dict(pair for one in arrays for pair in _variables(one))
        write_grid(path, found, origin=origin, cell=cell, crs=str(array.attrs.get("crs", "")))
        return
    if suffix == ".npz":
        coordinates: dict[str, Any] = {str(name): np.asarray(one.values) for name, one in array.coords.items()}
        coordinates |= {name: one.values for name, one in (several or {"values": array}).items()}
        attributes = np.array(json.dumps(array.attrs))
        with atomic_path(path) as temporary, temporary.open("wb") as file:
            np.savez_compressed(file, attributes=attributes, **coordinates)
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
        about = json.loads((store / "zarr.json").read_bytes())
        about["attributes"][MARK] = _checksum(store, about)
        (store / "zarr.json").write_text(json.dumps(about, indent=2))


def _checksum(store: Path, about: dict[str, Any]) -> str:
    """Return the SHA-256 of a Zarr store: of its description ``about``, and of the names and contents of its files."""
    found = hashlib.sha256(json.dumps(about, sort_keys=True).encode())
    for path in sorted(store.rglob("*")):
        content = path.read_bytes() if path.is_file() and path != store / "zarr.json" else b""
        found.update(repr((path.relative_to(store).parts, hashlib.sha256(content).digest())).encode())
    return found.hexdigest()


def _own(store: Path) -> bool:
    """Return whether a folder holds only what `write_realisations` wrote."""
    try:
        about = json.loads((store / "zarr.json").read_bytes())
        return bool(about["attributes"].pop(MARK) == _checksum(store, about))
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return False


def _variables(array: Any) -> Iterator[tuple[str, Any]]:
    """Yield the name and the values, (z, y, x) or (y, x), of every variable of every realisation."""
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
            names = [f"{name}{joint}{number}" for number in numbers for name in names]
    sides = planes.shape[sum(dim not in "zyx" for dim in dims) :]
    yield from zip(names, planes.reshape(-1, *sides), strict=True)
