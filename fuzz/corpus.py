# SPDX-License-Identifier: BSD-3-Clause
"""Small valid files of every kind that a command reads, all made by code, and what breaks them."""

import gzip
import io
import struct
import zlib

import numpy as np

SIDE = 10
"""Rows and columns of the pictures."""


def _saved(write):
    """The bytes that a function writes to a file, or to a path where it wants one."""
    file = io.BytesIO()
    write(file)
    return file.getvalue()


def _pixels(channels, dtype, rows=SIDE, cols=SIDE):
    """A pattern with something of noise, in the whole range of a type."""
    row, col, channel = np.ogrid[:rows, :cols, :channels]
    noise = np.random.default_rng(rows * cols * channels).integers(0, 60, (rows, cols, channels))
    values = (row // 3 + col // 3 + channel) % 2 * 150 + noise
    dtype = np.dtype(dtype)
    if dtype.kind == "f":
        return (values / 255).astype(dtype)
    if dtype.kind == "b":
        return values > 100
    return (values * (np.iinfo(dtype).max // 255)).astype(dtype)


def pictures():
    """Name -> bytes."""
    from PIL import Image

    grey, rgb, rgba = (_pixels(n, np.uint8) for n in (1, 3, 4))
    modes = {"L": grey[..., 0], "RGB": rgb, "RGBA": rgba}
    made = {}
    for mode, values in modes.items():
        picture = Image.fromarray(values, mode)
        made[f"{mode}.png"] = _saved(lambda file, p=picture: p.save(file, "png"))
        made[f"{mode}.tif"] = _saved(lambda file, p=picture: p.save(file, "tiff"))
        made[f"{mode}.webp"] = _saved(lambda file, p=picture: p.save(file, "webp", lossless=True))
    colour, plain = Image.fromarray(rgb), Image.fromarray(grey[..., 0])
    others = [Image.fromarray(np.roll(rgb, n, 0)) for n in range(1, 4)]
    for name, picture, kind, options in (
        ("jpeg.jpg", colour, "jpeg", {}),
        ("grey.jpg", plain, "jpeg", {}),
        ("colour.bmp", colour, "bmp", {}),
        ("grey.gif", plain, "gif", {}),
        ("animated.gif", colour, "gif", {"save_all": True, "append_images": others}),
        ("animated.webp", colour, "webp", {"save_all": True, "append_images": others}),
        ("animated.png", colour, "png", {"save_all": True, "append_images": others}),
        ("lossy.webp", colour, "webp", {"quality": 50}),
        ("palette.png", colour.quantize(8), "png", {}),
        ("bits.png", plain.convert("1"), "png", {}),
        ("sixteen.png", Image.fromarray(_pixels(1, np.uint16)[..., 0]), "png", {}),
        ("lzw.tif", colour, "tiff", {"compression": "tiff_lzw"}),
        ("packed.tif", plain, "tiff", {"compression": "packbits"}),
    ):
        made[name] = _saved(lambda file, p=picture, k=kind, o=options: p.save(file, k, **o))
    made["alpha-hole.png"] = _holed(rgb)
    for dtype in ("uint8", "uint16", "float32", "float64", "bool", "int16", "int64"):
        made[f"{dtype}.npy"] = _saved(lambda file, d=dtype: np.save(file, _pixels(1, d)[..., 0]))
        made[f"{dtype}-3.npy"] = _saved(lambda file, d=dtype: np.save(file, _pixels(3, d)))
    holed = _pixels(1, np.float32)[..., 0].copy()
    holed[2:5, 2:6] = np.nan
    made["nan.npy"] = _saved(lambda file: np.save(file, holed))
    made["fortran.npy"] = _saved(lambda file: np.save(file, np.asfortranarray(_pixels(1, np.uint8)[..., 0])))
    made["big-endian.npy"] = _saved(lambda file: np.save(file, _pixels(1, np.uint16)[..., 0].astype(">u2")))
    made["complex.npy"] = _saved(lambda file: np.save(file, np.ones((4, 4), complex)))
    made["object.npy"] = _saved(lambda file: np.save(file, np.array([[None]]), allow_pickle=True))
    made["empty.npy"] = _saved(lambda file: np.save(file, np.zeros((0, 5), np.uint8)))
    made["constant.npy"] = _saved(lambda file: np.save(file, np.full((9, 9), 7, np.uint8)))
    made["one.npy"] = _saved(lambda file: np.save(file, np.full((1, 1), 7, np.uint8)))
    made["huge-values.npy"] = _saved(lambda file: np.save(file, _pixels(1, np.float64)[..., 0] * 1e308))
    made["tiny-values.npy"] = _saved(lambda file: np.save(file, _pixels(1, np.float64)[..., 0] * 1e-320))
    made["inf.npy"] = _saved(lambda file: np.save(file, np.full((6, 6), np.inf)))
    made["labels.npy"] = _saved(lambda file: np.save(file, (_pixels(1, np.uint8)[..., 0] > 100).astype(np.uint8)))
    made |= _tiffs()
    return made


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


def _holed(rgb):
    from PIL import Image

    alpha = np.full((SIDE, SIDE, 1), 255, np.uint8)
    alpha[3:6, 3:7] = 0
    return _saved(lambda file: Image.fromarray(np.concatenate([rgb, alpha], -1)).save(file, "png"))


def _tiffs():
    import tifffile

    made = {}
    for name, values, options in (
        ("float32.tif", _pixels(1, np.float32)[..., 0], {}),
        ("float64.tif", _pixels(1, np.float64)[..., 0], {}),
        ("sixteen-3.tif", _pixels(3, np.uint16), {"photometric": "rgb"}),
        ("planar.tif", np.moveaxis(_pixels(3, np.uint8), -1, 0), {"photometric": "rgb", "planarconfig": "separate"}),
        ("pages.tif", np.stack([_pixels(1, np.uint8)[..., 0]] * 3), {"photometric": "minisblack"}),
        ("big.tif", _pixels(1, np.uint8)[..., 0], {"bigtiff": True}),
        ("tiled.tif", _pixels(1, np.uint8, 32, 32)[..., 0], {"tile": (16, 16)}),
        ("deflate.tif", _pixels(1, np.uint8)[..., 0], {"compression": "zlib"}),
    ):
        made[name] = _saved(lambda file, v=values, o=options: tifffile.imwrite(file, v, **o))
    return made


def masks():
    """Pictures of black and white of the same size."""
    from PIL import Image

    mask = np.zeros((SIDE, SIDE), np.uint8)
    mask[3:6, 3:7] = 255
    return {
        "hole.png": _saved(lambda file: Image.fromarray(mask).save(file, "png")),
        "most.png": _saved(lambda file: Image.fromarray(255 - mask).save(file, "png")),
        "black.png": _saved(lambda file: Image.fromarray(0 * mask).save(file, "png")),
        "hole.npy": _saved(lambda file: np.save(file, mask > 0)),
    }


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
        "nan.csv": b"x,y,v\nnan,1,10\n1,inf,3\n",
        "bom.csv": b"\xef\xbb\xbfx,y,v\r\n1,1,10\r\n",
        "empty.csv": b"",
    }


def volumes():
    """Blocks in every format, 6 x 6 x 6."""
    import tifffile

    block = np.stack([_pixels(1, np.uint8, 6, 6)[..., 0]] * 6)
    header = b"NRRD0004\ntype: uint8\ndimension: 3\nsizes: 6 6 6\nencoding: %s\n%s\n"
    return {
        "block.npy": _saved(lambda file: np.save(file, block)),
        "block.npz": _saved(lambda file: np.savez_compressed(file, volume=block)),
        "block.tif": _saved(lambda file: tifffile.imwrite(file, block, photometric="minisblack")),
        "block.nrrd": header % (b"raw", b"") + block.tobytes(),
        "gzip.nrrd": header % (b"gzip", b"") + gzip.compress(block.tobytes(), mtime=0),
        "text.nrrd": header % (b"ascii", b"") + b" ".join(b"%d" % v for v in block.ravel()),
        "detached.nrrd": header % (b"raw", b"data file: ../beside/secret.raw\n"),
        "three.npz": _saved(lambda file: np.savez(file, a=block, b=block)),
        "bomb.npz": _bomb(),
    }


def _bomb():
    """An archive of half a mebibyte that opens to 512: pieces of zeros, packed once."""
    zeros, pieces = bytes(2**20), 512
    head = _saved(
        lambda file: np.lib.format.write_array_header_1_0(
            file, {"descr": "|u1", "fortran_order": False, "shape": (pieces, 1024, 1024)}
        )
    )
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    packed = packer.compress(head) + packer.flush(zlib.Z_FULL_FLUSH)
    packed += (packer.compress(zeros) + packer.flush(zlib.Z_FULL_FLUSH)) * pieces + packer.flush()
    sum_of = zlib.crc32(head)
    for _ in range(pieces):
        sum_of = zlib.crc32(zeros, sum_of)
    name, sizes = b"volume.npy", (len(packed), len(head) + pieces * len(zeros))
    shared = struct.pack("<HHHHHIIIHH", 20, 0, 8, 0, 33, sum_of, *sizes, len(name), 0)
    local = b"PK\x03\x04" + shared + name + packed
    central = b"PK\x01\x02" + struct.pack("<H", 20) + shared + struct.pack("<HHHII", 0, 0, 0, 0, 0) + name
    return local + central + b"PK\x05\x06" + struct.pack("<HHHHIIH", 0, 0, 1, 1, len(central), len(local), 0)


def strange():
    """Files that are nothing of what is asked for."""
    return {
        "empty.png": b"",
        "text.png": b"hello\n",
        "zeros.png": bytes(300),
        "page.eps": b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n%%EndComments\nshowpage\n%%EOF\n",
        "brackets.json": b"[" * 100_000,
    }


def build():
    """Role -> name -> bytes; the same on every call."""
    made = {
        "picture": pictures(),
        "mask": masks(),
        "table": tables(),
        "grid": grids(),
        "volume": volumes(),
        "strange": strange(),
    }
    made["picture"]["page.png"] = made["strange"]["page.eps"]
    return made


WORDS = (
    b"0",
    b"-1",
    b"nan",
    b"inf",
    b"1e308",
    b"4294967295",
    b"2147483648",
    b"99999999999999999999",
    b"",
    b"\x00",
    b"\xff",
)
NUMBERS = tuple(
    n.to_bytes(4, order) for n in (0, 1, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 10**9) for order in ("little", "big")
)


def mutated(rng, data, others):
    """The bytes of a file with a few of them changed: flips, cuts, splices, numbers, repeats, words of text."""
    data = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 2, 3, 8))):
        kind = rng.randrange(8)
        at = rng.randrange(len(data) + 1)
        if rng.random() < 0.5:  # headers tell most
            at = min(at, rng.randrange(200))
        if kind == 0 and at < len(data):
            data[at] ^= 1 << rng.randrange(8)
        elif kind == 1:
            del data[at:]
        elif kind == 2:
            other = rng.choice(others)
            begin = rng.randrange(len(other) + 1)
            data[at : at + rng.randrange(64)] = other[begin : begin + rng.randrange(64)]
        elif kind == 3:
            number = rng.choice(NUMBERS)
            data[at : at + 4] = number
        elif kind == 4:
            data[at:at] = data[at : at + rng.randrange(40)] * rng.choice((1, 2, 50))
        elif kind == 5:
            del data[at : at + rng.randrange(40)]
        elif kind == 6 and at < len(data):
            data[at] = rng.randrange(256)
        else:
            digits = [i for i, byte in enumerate(data[:2000]) if 48 <= byte <= 57]
            if digits:
                at = rng.choice(digits)
                data[at : at + 1] = rng.choice(WORDS)
    return bytes(data)
