"""Files that unpack to far more than they are: told by their headers, before anything is decoded."""

import io
import struct
import subprocess
import tracemalloc
import zipfile
import zlib
from pathlib import Path

import imagecodecs
import numpy as np
import PIL.Image
import PIL.ImageFile
import pytest
import tifffile
from click.testing import CliRunner
from volumes import png

from simdtex.cli import main
from simdtex.io import decode, files, image
from simdtex.io.grids import read_grid
from simdtex.io.hard_data import read_hard_data
from simdtex.model.source_map import load_source_map

PIXELS = 10_000
MANY = np.zeros((101, 100), np.uint8)  # just too many
DOCS = Path(__file__).parent.parent / "docs"


def saved(array, kind, **options):
    file = io.BytesIO()
    PIL.Image.fromarray(array).save(file, kind, **options)
    return file.getvalue()


def npy(shape, dtype="<f8", data=b""):
    header = f"{{'descr': {dtype!r}, 'fortran_order': False, 'shape': {shape}, }}".encode()
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header) + 1) + header + b"\n" + data


def zipped(**files):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(f"{name}.npy", data)
    return file.getvalue()


def tiff(*pages, **options):
    file = io.BytesIO()
    with tifffile.TiffWriter(file) as writer:
        for page in pages:
            writer.write(page, metadata=None, photometric="minisblack", **options)
    return file.getvalue()


def sparse_tiff(width, height):
    """A TIFF that says that it is large, and has next to no data."""
    entries = [(256, 4, 1, width), (257, 4, 1, height), (258, 3, 1, 8), (259, 3, 1, 8), (262, 3, 1, 1)]
    entries += [(273, 4, 1, 8), (277, 3, 1, 1), (278, 4, 1, height), (279, 4, 1, 4)]
    data = b"II*\0" + struct.pack("<I", 12) + b"\0" * 4 + struct.pack("<H", len(entries))
    return data + b"".join(struct.pack("<HHII", *entry) for entry in entries) + struct.pack("<I", 0)


def swollen_jpeg():
    """A TIFF of 16 x 16 pixels with a JPEG of many more in its place."""
    data = bytearray(tiff(np.zeros((16, 16), np.uint8), compression="jpeg"))
    for marker in (b"\xff\xc0", b"\xff\xc1"):
        at = data.find(marker)
        if at >= 0:
            struct.pack_into(">HH", data, at + 5, 60000, 60000)
    return bytes(data)


PICTURES = {
    "PNG": png(200_000, 200_000),
    "16-bit PNG": png(200_000, 200_000, bits=16),
    "a PNG of a pixel too many": saved(MANY, "PNG"),
    "a 16-bit PNG of a pixel too many": imagecodecs.png_encode(MANY.astype(np.uint16)),
    "JPEG": saved(MANY, "JPEG"),
    "BMP": saved(MANY, "BMP"),
    "GIF": b"GIF89a" + struct.pack("<HH", 65535, 65535) + b"\0\0\0,\0\0\0\0\1\0\1\0\0\2\2D\1\0;",
    "WebP": saved(MANY, "WEBP"),
    "TGA": saved(MANY, "TGA"),
    "JPEG 2000": saved(MANY, "JPEG2000"),
    "JPEG 2000 of 12 bits": imagecodecs.jpeg2k_encode(
        np.dstack([MANY] * 3).astype(np.uint16), bitspersample=12, level=0
    ),
    "AVIF": saved(np.dstack([MANY] * 3), "AVIF"),
    "PBM": b"P4 101 100\n" + bytes(1300),
    "TIFF": tiff(MANY),
    "a sparse TIFF": sparse_tiff(2**31, 2**31),
    "npy": npy((50_000, 50_000)),
    "npy in channels": npy((10, 10, 10**9)),
}


def refused(reading, path, words, peak=4 * 2**20):
    """Reading ends in one sentence that names the file, and takes no more memory than `peak`."""
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match=words) as said:
            reading(path)
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert str(path) in str(said.value) and "\n" not in str(said.value) and len(str(said.value)) < 400
    assert most < peak


TOO_LARGE = rf"(pixels|bytes|cells|frames) and no more than \d+ are read: .*, or set {files.VARIABLE} higher"


@pytest.mark.parametrize("kind", PICTURES)
def test_pictures_of_too_many_pixels_are_not_decoded(tmp_path, kind, monkeypatch, caplog, capfd):
    def never(*_, **__):
        raise AssertionError("it is decoded")

    monkeypatch.setattr(PIL.ImageFile.ImageFile, "load", never)
    monkeypatch.setattr(tifffile.TiffPage, "asarray", never)
    for name in ("png_decode", "jpeg2k_decode", "avif_decode"):
        monkeypatch.setattr(imagecodecs, name, never)
    (tmp_path / "a.png").write_bytes(PICTURES[kind])
    refused(lambda path: image.read(path, max_pixels=PIXELS), tmp_path / "a.png", TOO_LARGE)
    assert not caplog.records and not "".join(capfd.readouterr())


def test_more_than_pillow_allows_is_read_where_it_is_asked_for(tmp_path, monkeypatch):
    monkeypatch.setattr(PIL.Image, "MAX_IMAGE_PIXELS", 1000)
    (tmp_path / "a.png").write_bytes(saved(MANY, "PNG"))
    with pytest.raises(ValueError, match=TOO_LARGE):
        image.read(tmp_path / "a.png", max_pixels=PIXELS)
    assert image.read(tmp_path / "a.png", max_pixels=10_100).pixels.shape == (101, 100)
    assert PIL.Image.MAX_IMAGE_PIXELS == 1000


def test_the_environment_says_how_many(tmp_path, monkeypatch):
    (tmp_path / "a.png").write_bytes(saved(MANY, "PNG"))
    for text, fits in (("10099", False), ("10100", True), ("", True), (" 20000 ", True)):
        monkeypatch.setenv(files.VARIABLE, text)
        if fits:
            image.read(tmp_path / "a.png")
        else:
            refused(image.read, tmp_path / "a.png", TOO_LARGE)
        image.read(tmp_path / "a.png", max_pixels=10100)
    for text in ("0", "-5", "many", "1e9", "9" * 30, "1.5"):
        monkeypatch.setenv(files.VARIABLE, text)
        with pytest.raises(ValueError, match=rf"^{files.VARIABLE} is .*: set it to a number of pixels"):
            image.read(tmp_path / "a.png")
    for number, error in ((0, ValueError), (1.5, TypeError), (True, TypeError)):
        with pytest.raises(error, match="max_pixels"):
            image.read(tmp_path / "a.png", max_pixels=number)


def test_the_command_line_says_it_in_one_sentence(tmp_path, monkeypatch):
    (tmp_path / "a.png").write_bytes(PICTURES["PNG"])
    done = CliRunner().invoke(main, ["synth", str(tmp_path / "a.png"), "-o", str(tmp_path / "out.png")])
    assert done.exit_code == 2 and files.VARIABLE in done.output and len(done.output.splitlines()) == 1


def test_texts_beside_the_pixels_are_not_unpacked(tmp_path):
    """Of 8 bits they are refused by Pillow; of 16 bits nobody looks at them but for the orientation."""
    bomb = zlib.compress(bytes(2**25), 9)
    texts = {"zTXt": b"Comment\0\0" + bomb, "iTXt": b"Comment\0\1\0\0\0" + bomb, "iCCP": b"profile\0\0" + bomb}
    for kind, data in texts.items():
        for bits in (8, 16):
            rows = bytes(4 * (1 + 3 * 4 * bits // 8))
            (tmp_path / "a.png").write_bytes(png(4, 4, bits, rows=rows, **{kind: data}))
            tracemalloc.start()
            try:
                assert image.read(tmp_path / "a.png").pixels.shape == (4, 4, 3)
            except ValueError as error:
                assert "cannot be read as an image" in str(error)
            finally:
                most = tracemalloc.get_traced_memory()[1]
                tracemalloc.stop()
            assert most < 2**24, (kind, bits)


def test_source_maps_and_hard_data(tmp_path):
    files = {
        "map.npz": (load_source_map, zipped(source=npy((50_000, 50_000, 2), "<i4"))),
        "map.npy": (load_source_map, npy((50_000, 50_000, 2), "<i4")),
        "table.npy": (read_hard_data, npy((10**9, 3))),
        # a million of numbers
        "table.csv": (lambda path: read_hard_data(path, max_pixels=12_000), b"1,2,3\n" * 2000 + b"1,2,3"),
        "wide.csv": (lambda path: read_hard_data(path, max_pixels=3_000), b"1," * 1500 + b"1\n" + b"," * 1500),
    }
    for name, (reading, data) in files.items():
        (tmp_path / name).write_bytes(data)
        refused(reading, tmp_path / name, f"{TOO_LARGE}|no more than .* are read: give fewer rows", peak=2**23)


def test_grids(tmp_path):
    """What a header says is compared with the length of the file before memory is asked for."""
    sgems = b"\xb2\x11\x17\x5d\0\0\0\6Cgrid\0\0\0\0\1\0\0\0\0\x64%s" + struct.pack(">6f", *[1] * 6)
    files = {
        "far.gslib": (b"40000 40000 9\n1\nv\n1\n", "14400000000 pixels and no more than"),
        "near.gslib": (b"10000 10000 1\n1\nv\n1\n", "too short for what its header says"),
        "names.gslib": (b"1 1 1\n999999999\nv\n1\n", "line 5 has no name of a variable"),
        "far.sgems": (sgems % struct.pack(">3I", 40000, 40000, 9) + b"\0\0\0\1\0\0\0\1\0", "14400000000 pixels"),
        "near.sgems": (sgems % struct.pack(">3I", 10000, 10000, 1) + b"\0\0\0\1\0\0\0\1\0", "before the last of"),
        "names.sgems": (sgems % struct.pack(">3I", 1, 1, 1) + b"\xff" * 8, "ends within its header"),
    }
    for name, (data, words) in files.items():
        (tmp_path / name).write_bytes(data)
        refused(read_grid, tmp_path / name, words, peak=2**20)


def test_lines_that_no_table_has(tmp_path):
    first = ",".join("1" * 30_000)
    for text, words in {
        first + "\n" + "1,2\n" * 3000: "line 2 has 2 cells and those before it 30000",
        "1,2," + "9x" * 60_000: "which is no number",
        "1,2," + "9" * 200_000: "cannot be split into cells",
    }.items():
        (tmp_path / "a.csv").write_text(text)
        refused(read_hard_data, tmp_path / "a.csv", words, peak=2**24)


def test_only_documented_formats_are_tried(tmp_path, monkeypatch):
    """Pillow knows a PostScript file by its first bytes, and hands it to Ghostscript."""

    def never(*_, **__):
        raise AssertionError("a program is started")

    for name in ("Popen", "check_call", "check_output", "run", "call"):
        monkeypatch.setattr(subprocess, name, never)
    (tmp_path / "a.png").write_bytes(b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 20 20\n%%EndComments\nshowpage\n")
    for kind in ("ICO", "PCX", "SGI", "DDS", "ICNS"):
        (tmp_path / f"{kind}.png").write_bytes(saved(np.zeros((32, 32, 3), np.uint8), kind))
    for path in sorted(tmp_path.iterdir()):
        with pytest.raises(
            ValueError,
            match=r"is not an image: give a PNG, JPEG, TIFF, BMP, WebP, .*\.npy|is a drawing|is an icon|is a texture",
        ):
            image.read(path)


def test_the_documented_formats_are_those_that_are_read(tmp_path):
    for text in (image.read.__doc__, (DOCS / "reference" / "command-line.rst").read_text(encoding="utf-8")):
        words = " ".join(text.split())
        for name in ("PNG", "JPEG", "TIFF", "BMP", "WebP", "GIF", "TGA", "JPEG 2000", "AVIF", "PBM", "PGM", "PPM"):
            assert name in words, name
    for kind in decode.FORMATS:
        (tmp_path / "a").write_bytes(saved(np.full((8, 9, 3), 7, np.uint8), kind))
        assert image.read(tmp_path / "a").pixels.shape[:2] == (8, 9)


def test_how_a_tiff_may_be_compressed(tmp_path):
    values = np.arange(256, dtype=np.uint8).reshape(16, 16)
    for method in (None, "zlib", "lzw", "packbits", "zstd", "lzma"):
        (tmp_path / "a.tif").write_bytes(tiff(values, values, compression=method))
        assert np.array_equal(image.read(tmp_path / "a.tif").pixels, values)
    (tmp_path / "a.tif").write_bytes(tiff(values, compression="jpeg"))
    assert abs(image.read(tmp_path / "a.tif").pixels.astype(int) - values).max() < 9
    (tmp_path / "a.tif").write_bytes(swollen_jpeg())
    refused(image.read, tmp_path / "a.tif", "cannot be read as an image")
    (tmp_path / "a.tif").write_bytes(tiff(values, compression="png"))
    with pytest.raises(ValueError, match="is compressed by the method 34933: save it with Deflate"):
        image.read(tmp_path / "a.tif")
