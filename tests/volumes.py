"""Random pictures and volumes, and volumes read back by the libraries of their formats."""

import struct
import zlib
from pathlib import Path

import imagecodecs
import nrrd
import numpy as np
import tifffile


def saved(tmp_path, content, name="a.gslib"):
    """A file with a content, a text or bytes."""
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def noise(shape, dtype="uint8", seed=0):
    """Random values over the whole range of a type."""
    rng = np.random.default_rng(seed)
    kind = np.dtype(dtype).newbyteorder("=")
    if kind.kind == "b":
        return rng.random(shape) < 0.5
    if kind.kind == "f":
        return rng.normal(size=shape).astype(dtype)
    limits = np.iinfo(kind)
    return rng.integers(limits.min, limits.max, shape, kind, endpoint=True).astype(dtype)


def loaded(path):
    """The volume (depth, rows, cols) or (depth, rows, cols, channels) of a file or of a folder of slices."""
    path = Path(path)
    if path.is_dir():
        return np.stack([imagecodecs.png_decode(slice_.read_bytes()) for slice_ in sorted(path.iterdir())])
    suffix = path.suffix.lower()
    if suffix == ".nrrd":
        return nrrd.read(str(path), index_order="C")[0]
    if suffix in (".tif", ".tiff"):
        with tifffile.TiffFile(path) as file:
            return np.stack([page.asarray() for page in file.pages])
    found = np.load(path)
    return found["volume"] if suffix == ".npz" else found


def png(width, height, bits=8, colours=2, rows=b"", **more):
    """The bytes of a PNG with these rows, each after its filter, and more chunks by name."""

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, bits, colours, 0, 0, 0)
    texts = b"".join(chunk(kind.encode(), data) for kind, data in more.items())
    return (
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + texts + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
    )
