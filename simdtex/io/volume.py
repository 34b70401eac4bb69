# SPDX-License-Identifier: BSD-3-Clause
"""Reading and writing of volumes, without a change of any value.

A volume is an array (depth, rows, cols) or (depth, rows, cols, channels): x-y slices one behind the other, each like a
picture with row 0 at the top. x is the column, y the row, z the depth.
"""

from __future__ import annotations

import io
import os
import re
import shutil
import warnings
from pathlib import Path
from typing import Any

import nrrd
import numpy as np
import tifffile
from numpy.typing import ArrayLike, DTypeLike, NDArray

from simdtex.io import image
from simdtex.io.atomic import atomic_folder, atomic_path, check_folder_writable, earlier_files
from simdtex.io.decode import native
from simdtex.io.image import FLOATS, INTEGERS, Format, check_holds
from simdtex.io.limits import check_array, read_npy, reading

__all__ = ["check_writable", "is_volume", "read", "write"]

Array = NDArray[Any]
PathLike = str | os.PathLike[str]

# "" means a folder of slices
_FORMATS = {
    ".npz": Format(None, None),
    ".npy": Format(None, None),
    ".tif": Format(INTEGERS | FLOATS, None),
    ".tiff": Format(INTEGERS | FLOATS, None),
    ".nrrd": Format(INTEGERS | {"float32", "float64"}, None),
    "": Format(frozenset({"uint8", "uint16"}), (1, 2, 3, 4)),
}
_SLICE = re.compile(r"slice-([0-9]{3,})\.png")


def check_writable(path: PathLike, dtype: DTypeLike | None = None, channels: int | None = None) -> None:
    """Raise ValueError before a long run unless its result can be written, without creating a file.

    The file or folder of slices must be writable, and its suffix name a format that holds values of this type and
    number of channels; None is not checked. A folder is only replaced if it contains only slices.
    """
    target = Path(path)
    suffix = target.suffix.lower()
    if suffix not in _FORMATS:
        raise ValueError(
            f"{target} ends in {target.suffix}: end its name in one of {', '.join(sorted(filter(None, _FORMATS)))}, "
            "or give a name without suffix for a folder of PNG slices"
        )
    if suffix:
        image.check_writable(target, suffixes=(suffix,))
    else:
        earlier_files(target, "the slices", lambda name: bool(_SLICE.fullmatch(name)))
        check_folder_writable(target)
    other = next(one for one in (".nrrd", ".tif", ".npz") if _FORMATS[one].holds(dtype, channels))
    check_holds(target, _FORMATS, dtype, channels, other)


def is_volume(path: PathLike) -> bool:
    """Return whether a file holds a volume: ``.nrrd``, a TIFF with several pages, or a ``.npy`` with four axes."""
    suffix = Path(path).suffix.lower()
    try:
        if suffix in (".tif", ".tiff"):
            with tifffile.TiffFile(path) as file:
                return len(file.pages) > 1
        if suffix == ".npy":
            return int(np.load(path, mmap_mode="r", allow_pickle=False).ndim) == 4
    except (OSError, ValueError, tifffile.TiffFileError):
        return False  # the reader of pictures reports the error
    return suffix == ".nrrd"


def read(path: PathLike, *, max_pixels: int | None = None) -> Array:
    """Return the volume in a file.

    Parameters
    ----------
    path : path
        ``.nrrd`` with three axes, x fastest, or four, with variables before x; a TIFF with a page for each of several
        layers; or a ``.npy`` of shape (layers, rows, cols, variables).
    max_pixels : int, optional
        The most values that are read, with 8 bytes for each. None: ``SIMDTEX_MAX_PIXELS`` of the environment, else
        2**27. The file's header is checked before anything is decoded.

    Returns
    -------
    ndarray, (layers, rows, cols, variables)

    Raises
    ------
    ValueError
        The file is missing, damaged, not a volume, or too large.
    """
    name, suffix = os.fspath(path), Path(path).suffix.lower()
    with reading(path, "the volume", max_pixels, kind="a volume") as most:
        if suffix == ".nrrd":
            header = nrrd.read_header(name)
            check_array(tuple(int(side) for side in header["sizes"]), 8, most)
            values = nrrd.read(name, index_order="C")[0]
        elif suffix == ".npy":
            with open(name, "rb") as file:
                values = read_npy(file, os.fstat(file.fileno()).st_size, most)
        else:
            with tifffile.TiffFile(name) as file:
                check_array((len(file.pages), *file.pages.first.shape), 8, most)
                values = np.stack([page.asarray() for page in file.pages])
    if values.ndim not in (3, 4) or values.size == 0 or values.dtype.kind not in "buif":
        raise ValueError(f"{name} has the shape {values.shape} and the type {values.dtype}: give numbers of three axes")
    return native(values[..., None] if values.ndim == 3 else values)


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
    A single channel is written without an axis, except in ``.npz`` and ``.npy``. In an NRRD file x varies fastest, then
    y, then z, with the channels as a vector before them, as ParaView, 3D Slicer and Fiji expect. It is not compressed,
    because not every version of ParaView can read compressed files.
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
        header = {"encoding": "raw", "kinds": ["vector"] * (values.ndim - 3) + ["domain"] * 3}
        written = io.BytesIO()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # pynrrd gets the time by a deprecated call
            nrrd.write(written, values, header, index_order="C")
        written.seek(0)
        with path.open("wb") as file:
            for line in iter(written.readline, b"\n"):  # the header, which ends with an empty line
                if not line.startswith(b"# on "):  # the time: the same volume is to be the same file
                    file.write(line)
            file.write(b"\n")
            shutil.copyfileobj(written, file)
    elif suffix:
        image.write_tiff(path, values)
    else:
        digits = max(3, len(str(len(values) - 1)))
        for number, picture in enumerate(values):
            image.encode(path / f"slice-{number:0{digits}}.png", ".png", picture)
