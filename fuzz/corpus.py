# SPDX-License-Identifier: BSD-3-Clause
"""Small valid files of every kind that a command reads, all made by code, and what breaks them."""

import gzip
import io
import struct
from functools import cache

import numpy as np
import tifffile
from PIL import Image

SIDE = 10
"""Rows and columns of the pictures."""


def _saved(write, *args, **options):
    """The bytes that a function writes to a file."""
    file = io.BytesIO()
    write(file, *args, **options)
    return file.getvalue()


def _pixels(channels, dtype, rows=SIDE, cols=SIDE):
    """A pattern with some noise, in the whole range of a type."""
    row, col, channel = np.ogrid[:rows, :cols, :channels]
    noise = np.random.default_rng(rows * cols * channels).integers(0, 60, (rows, cols, channels))
    values = (row // 3 + col // 3 + channel) % 2 * 150 + noise
    dtype = np.dtype(dtype)
    if dtype.kind == "f":
        return (values / 255).astype(dtype)
    return values > 100 if dtype.kind == "b" else (values * (np.iinfo(dtype).max // 255)).astype(dtype)


def _npy(values):
    return _saved(np.save, values)


def _tif(values, **options):
    return _saved(tifffile.imwrite, values, **options)


def _drawn(values, kind="png", **options):
    picture = values if isinstance(values, Image.Image) else Image.fromarray(values)
    return _saved(picture.save, kind, **options)


def pictures():
    """Name -> bytes."""
    grey, rgb, rgba = (_pixels(n, np.uint8) for n in (1, 3, 4))
    grey, short = grey[..., 0], _pixels(1, np.uint16)[..., 0]
    made = {}
    for mode, values in {"L": grey, "RGB": rgb, "RGBA": rgba}.items():
        for suffix, kind, options in (("png", "png", {}), ("tif", "tiff", {}), ("webp", "webp", {"lossless": True})):
            made[f"{mode}.{suffix}"] = _drawn(values, kind, **options)
    several = {"save_all": True, "append_images": [Image.fromarray(np.roll(rgb, n, 0)) for n in range(1, 4)]}
    holed, alpha = _pixels(1, np.float32)[..., 0].copy(), np.full((SIDE, SIDE, 1), 255, np.uint8)
    holed[2:5, 2:6], alpha[3:6, 3:7] = np.nan, 0
    made |= {
        **{"jpeg.jpg": _drawn(rgb, "jpeg"), "grey.jpg": _drawn(grey, "jpeg")},
        **{"colour.bmp": _drawn(rgb, "bmp"), "grey.gif": _drawn(grey, "gif")},
        **{f"animated.{kind}": _drawn(rgb, kind, **several) for kind in ("gif", "webp", "png")},
        "lossy.webp": _drawn(rgb, "webp", quality=50),
        "palette.png": _drawn(Image.fromarray(rgb).quantize(8)),
        "bits.png": _drawn(Image.fromarray(grey).convert("1")),
        "sixteen.png": _drawn(short),
        "lzw.tif": _drawn(rgb, "tiff", compression="tiff_lzw"),
        "alpha-hole.png": _drawn(np.concatenate([rgb, alpha], -1)),
    }
    for dtype in ("uint8", "uint16", "float32", "float64", "bool", "int16", "int64"):
        made[f"{dtype}.npy"], made[f"{dtype}-3.npy"] = _npy(_pixels(1, dtype)[..., 0]), _npy(_pixels(3, dtype))
    arrays = {
        "nan": holed,
        "fortran": np.asfortranarray(grey),
        "big-endian": short.astype(">u2"),
        **{"complex": np.ones((4, 4), complex), "object": np.array([[None]]), "empty": np.zeros((0, 5), np.uint8)},
        **{"constant": np.full((9, 9), 7, np.uint8), "one": np.full((1, 1), 7, np.uint8)},
        **{f"{n}-values": _pixels(1, np.float64)[..., 0] * by for n, by in (("huge", 1e308), ("tiny", 1e-320))},
        "inf": np.full((6, 6), np.inf),
        "labels": (grey > 100).astype(np.uint8),
    }
    made |= {f"{name}.npy": _npy(values) for name, values in arrays.items()}
    return made | {
        "float32.tif": _tif(_pixels(1, np.float32)[..., 0]),
        "sixteen-3.tif": _tif(_pixels(3, np.uint16), photometric="rgb"),
        "planar.tif": _tif(np.moveaxis(rgb, -1, 0), photometric="rgb", planarconfig="separate"),
        "pages.tif": _tif(np.stack([grey] * 3), photometric="minisblack"),
        "big.tif": _tif(grey, bigtiff=True),
        "deflate.tif": _tif(grey, compression="zlib"),
    }


def grids():
    """Grids of geostatistics, one of two layers."""
    values = _pixels(1, np.uint8)[..., 0].ravel()
    head = b"\xb2\x11\x17\x5d\0\0\0\6Cgrid\0\0\0\0\2g\0\0\0\0\x64"
    head += struct.pack(">3I6f", SIDE, SIDE, 1, 10, 10, 1, 5, 5, 0) + b"\0\0\0\1\0\0\0\2v\0"
    text = b"\n".join(b"%d" % v for v in values) + b"\n"
    return {
        "grid.sgems": head + values.astype(">f4").tobytes(),
        "grid.gslib": b"%d %d 1\n1\nv\n" % (SIDE, SIDE) + text,
        "solid.gslib": b"t\n1 %d %d 2 0 0 0 1 1 1\nv\n" % (SIDE, SIDE) + 2 * text,
    }


def masks():
    """Pictures of black and white of the same size."""
    mask = np.pad(np.full((3, 4), 255, np.uint8), ((3, SIDE - 6), (3, SIDE - 7)))
    drawn = {"hole.png": _drawn(mask), "most.png": _drawn(255 - mask), "black.png": _drawn(0 * mask)}
    return drawn | {"hole.npy": _npy(mask > 0)}


def tables():
    """Tables of known values, with and without headers, and GSLIB's."""
    return {
        "known.csv": b"x,y,v\n0,0,12\n3,4,200\n5,2,99\n",
        "plain.csv": b"1,1,10\n2,2,20\n",
        "colour.csv": b"x,y,r,g,b\n1,1,10,20,30\n4,5,200,100,50\n",
        "known.tsv": b"x\ty\tv\n0\t0\t12\n3\t4\t200\n",
        "gslib.dat": b"hard data\n4\nx\ny\nz\nv\n1 1 0 10\n4 2 0 200\n",
        "labels.txt": b"x y v\n1 1 0\n2 5 1\n",
        "same.csv": b"x,y,v\n1,1,10\n1,1,20\n",
        "far.csv": b"x,y,v\n-1,1e300,10\n",
        "nan.csv": b"\xef\xbb\xbfx,y,v\r\nnan,1,10\r\n1,inf,3\r\n",
        "empty.csv": b"",
    }


def volumes():
    """Blocks in every format, 6 x 6 x 6."""
    block = np.stack([_pixels(1, np.uint8, 6, 6)[..., 0]] * 6)
    header = b"NRRD0004\ntype: uint8\ndimension: 3\nsizes: 6 6 6\nencoding: %s\n%s\n"
    return {
        "block.npy": _npy(block),
        "block.npz": _saved(np.savez_compressed, volume=block),
        "block.tif": _tif(block, photometric="minisblack"),
        "block.nrrd": header % (b"raw", b"") + block.tobytes(),
        "gzip.nrrd": header % (b"gzip", b"") + gzip.compress(block.tobytes(), mtime=0),
        "text.nrrd": header % (b"ascii", b"") + b" ".join(b"%d" % v for v in block.ravel()),
        "detached.nrrd": header % (b"raw", b"data file: ../beside/secret.raw\n"),
        "three.npz": _saved(np.savez, a=block, b=block),
        "bomb.npz": _saved(np.savez_compressed, volume=np.broadcast_to(np.uint8(0), (128, 1024, 1024))),
    }


def strange():
    """Files that are nothing of what is asked for."""
    return {
        "empty.png": b"",
        "text.png": b"hello\n",
        "page.eps": b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n%%EndComments\nshowpage\n%%EOF\n",
        "brackets.json": b"[" * 100_000,
    }


@cache
def build():
    """Role -> name -> bytes; the same on every call."""
    roles = {"picture": pictures, "mask": masks, "table": tables, "grid": grids, "volume": volumes, "strange": strange}
    made = {role: make() for role, make in roles.items()}
    made["picture"]["page.png"] = made["strange"]["page.eps"]
    return made


def named(words):
    """The files that a command line names: name -> bytes."""
    return {name: data for files in build().values() for name, data in files.items() if name in words}


WORDS = (
    *(b"0", b"-1", b"nan", b"inf", b"1e308", b"4294967295", b"2147483648", b"99999999999999999999"),
    *(b"", b"\x00", b"\xff"),
)
NUMBERS = tuple(struct.pack(order + "I", n) for n in (0, 1, 0xFFFF, 2**31 - 1, 2**32 - 1, 10**9) for order in "<>")


def damaged(data, how, rng):
    """Return the content of a file after damage of a kind, ``bits`` for twenty flipped ones; None for no file."""
    if how in ("cut", "empty", "remove"):
        return {"cut": data[: rng.randrange(len(data) or 1)], "empty": b"", "remove": None}[how]
    data = bytearray(data)
    for _ in range(1 if how == "bit" else 20):
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    return bytes(data)


def put(path, data):
    """Give a file this content, or remove it."""
    if data is None:
        path.unlink(missing_ok=True)
    else:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)


def mutated(rng, data, others):
    """The bytes of a file with a few of them changed: flips, cuts, splices, numbers, repeats, words of text."""
    data = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 2, 3, 8))):
        at = rng.randrange(len(data) + 1)
        if rng.random() < 0.5:  # headers tell most
            at = min(at, rng.randrange(200))
        digits = [i for i, byte in enumerate(data[:2000]) if 48 <= byte <= 57]
        other, begin = rng.choice(others), rng.randrange(2000)
        kind = rng.choice(("flip", "cut", "splice", "number", "repeat", "drop", "byte", "word"))
        if kind in ("flip", "byte") and at < len(data):
            data[at] = data[at] ^ 1 << rng.randrange(8) if kind == "flip" else rng.randrange(256)
        elif kind == "cut":
            del data[at:]
        elif kind == "splice":
            data[at : at + rng.randrange(64)] = other[begin : begin + rng.randrange(64)]
        elif kind == "number":
            data[at : at + 4] = rng.choice(NUMBERS)
        elif kind == "repeat":
            data[at:at] = data[at : at + rng.randrange(40)] * rng.choice((1, 2, 50))
        elif kind == "drop":
            del data[at : at + rng.randrange(40)]
        elif kind == "word" and digits:
            at = rng.choice(digits)
            data[at : at + 1] = rng.choice(WORDS)
    return bytes(data)
