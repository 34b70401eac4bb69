# SPDX-License-Identifier: BSD-3-Clause
"""Writing the realisations of a simulation: by xarray's own writers, or as plain NumPy arrays.

Realisations are an `xarray.DataArray`, as `simdtex.simulate` returns. The extra ``simulate`` installs the libraries:
``pip install 'simdtex[simulate]'``.
"""

from __future__ import annotations

import json
import os
import warnings
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from simdtex.io.atomic import atomic_folder, atomic_path, check_folder_writable, check_target

if TYPE_CHECKING:
    from xarray import DataArray

__all__ = ["check_realisations_path", "write_realisations"]

PathLike = str | os.PathLike[str]

_NEEDED = {".zarr": ("xarray", "zarr"), ".nc": ("xarray", "h5netcdf", "h5py"), ".npz": ()}
"""The libraries that each suffix needs."""


def check_realisations_path(path: PathLike) -> str:
    """Check before a long simulation that its realisations can be written; return the suffix in lower case.

    Raises
    ------
    ValueError
        The suffix is unknown, the folder is missing or not writable, `path` is something else than what would be
        replaced, or a library is not installed.
    """
    target = Path(path)
    suffix = target.suffix.lower()
    if suffix not in _NEEDED:
        raise ValueError(f"{target} names no format of realisations: end its name in one of {', '.join(_NEEDED)}")
    for library in _NEEDED[suffix]:
        if find_spec(library) is None:
            raise ValueError(f"{library} is not installed; pip install 'simdtex[simulate]'")
    if suffix == ".zarr" and target.is_dir():
        if not (target / "zarr.json").is_file():
            raise ValueError(f"{target} is a folder and no Zarr store: give a new name")
        check_folder_writable(target)
        return suffix
    check_target(target)
    if suffix == ".zarr" and target.exists():
        raise ValueError(f"{target} is a file: give another name for the folder of the store")
    return suffix


def write_realisations(path: PathLike, array: DataArray) -> None:
    """Write realisations in the format of the suffix, atomically.

    Parameters
    ----------
    path : path
        ``.zarr`` (a folder, Zarr format 3) and ``.nc`` (netCDF 4, compressed), which ``xarray.open_dataarray`` reads;
        or ``.npz`` for ``numpy.load``: ``values``, each coordinate under its name, and ``attributes``, a JSON text.
        An existing file or Zarr store is replaced.
    array : DataArray, (realisation, y, x) or (realisation, y, x, variable)
        What `simdtex.simulate` returns; attributes are texts and numbers. Writing ``.npz`` does not import xarray.

    Raises
    ------
    TypeError
        `array` is no DataArray, or the format cannot hold its type or an attribute.
    ValueError
        The path cannot be written, or a library is not installed.
    """
    if not hasattr(array, "coords"):
        raise TypeError(f"the realisations are of type {type(array).__name__}: give an xarray.DataArray")
    suffix = check_realisations_path(path)
    if suffix == ".npz":
        coordinates: dict[str, Any] = {str(name): np.asarray(one.values) for name, one in array.coords.items()}
        attributes = np.array(json.dumps(array.attrs))
        with atomic_path(path) as temporary, temporary.open("wb") as file:
            np.savez_compressed(file, values=array.values, attributes=attributes, **coordinates)
        return
    named = array.rename(array.name or "realisations")
    if suffix == ".nc":
        # in memory first, since HDF5 does not survive a full disk
        data = named.to_netcdf(engine="h5netcdf", encoding={named.name: {"zlib": True}})
        with atomic_path(path) as temporary:
            temporary.write_bytes(data)
        return
    with atomic_folder(path) as store, warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Consolidated metadata")  # not yet in the specification, but read by xarray
        named.to_zarr(store, mode="w", zarr_format=3)
