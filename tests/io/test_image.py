"""Pictures go from file to array and back with values, profile, resolution and EXIF, and errors say what to do."""

import io
import logging
import os
import stat
import struct
from itertools import product

import imagecodecs
import numpy as np
import PIL.Image
import PIL.ImageOps
import pytest
import tifffile
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st
from PIL import ExifTags, ImageCms
from volumes import noise, png

from simdtex.commands import main
from simdtex.io import image, volume
from simdtex.io.files import atomic_path

# -- Pictures go from file to array and back without a value changed, and errors say what to do.

ROUND_TRIPS = [
    *[(".png", dtype, c) for dtype in ("uint8", "uint16") for c in (None, 1, 2, 3, 4)],
    *[
        (".tif", dtype, c)
        for dtype in ("uint8", "uint16", "int32", "float16", "float32", "float64", "int64")
        for c in (None, 2, 3, 4, 5)
    ],
    (".tiff", "uint16", 3),
    (".bmp", "uint8", None),
    (".bmp", "uint8", 3),
    (".webp", "uint8", 3),
    (".webp", "uint8", 4),
    *[(".exr", dtype, c) for dtype in ("float16", "float32") for c in (None, 1, 3)],
    (".npy", "bool", None),
    (".npy", "float64", 7),
    (".NPY", ">i4", 1),
]


@pytest.mark.parametrize(("suffix", "dtype", "channels"), ROUND_TRIPS)
def test_values_and_types_survive_a_file(tmp_path, suffix, dtype, channels):
    shape = (11, 6) if channels is None else (11, 6, channels)
    pixels = noise(shape, dtype)
    path = tmp_path / f"picture{suffix}"
    image.write(path, pixels)
    picture = image.read(path)
    if channels == 1 and suffix != ".NPY":
        pixels = pixels[..., 0]
    assert picture.channel_axis == (-1 if pixels.ndim == 3 else None)
    assert picture.pixels.dtype == pixels.dtype.newbyteorder("=")
    assert picture.pixels.dtype.isnative
    np.testing.assert_array_equal(picture.pixels, pixels)
    assert os.listdir(tmp_path) == [path.name]


@pytest.mark.parametrize(("suffix", "channels"), [(".jpg", None), (".jpeg", 3)])
def test_jpeg_is_close(tmp_path, suffix, channels):
    ramp = np.add.outer(np.arange(32), 2 * np.arange(40)).astype(np.uint8)
    pixels = ramp if channels is None else np.stack([ramp] * channels, axis=-1)
    image.write(tmp_path / f"a{suffix}", pixels)
    back = image.read(tmp_path / f"a{suffix}").pixels
    assert back.shape == pixels.shape
    assert np.abs(back.astype(int) - pixels).max() <= 4


def test_bool_becomes_black_and_white(tmp_path):
    pixels = noise((5, 7), bool)
    for suffix in (".png", ".tif", ".bmp"):
        image.write(tmp_path / f"a{suffix}", pixels)
        back = image.read(tmp_path / f"a{suffix}").pixels
        assert back.dtype == np.uint8
        np.testing.assert_array_equal(back if back.ndim == 2 else back[..., 0], pixels * 255)


def test_one_bit_and_palette_and_print_colours(tmp_path):
    rgb = PIL.Image.fromarray(noise((8, 9, 3), np.uint8))
    rgb.convert("1").save(tmp_path / "bit.png")
    bit = image.read(tmp_path / "bit.png").pixels
    assert bit.dtype == np.uint8
    assert set(np.unique(bit)) <= {0, 255}
    palette = rgb.quantize(16)
    for suffix in ("png", "gif", "tif"):
        palette.save(tmp_path / f"palette.{suffix}")
        read = image.read(tmp_path / f"palette.{suffix}")
        assert read.channel_axis == -1
        np.testing.assert_array_equal(read.pixels, np.asarray(palette.convert("RGB")))
    for suffix in ("tif", "jpg"):
        rgb.convert("CMYK").save(tmp_path / f"cmyk.{suffix}")
        assert image.read(tmp_path / f"cmyk.{suffix}").pixels.shape == (8, 9, 3)


HALF = b"\xff\x80\x00"


@pytest.mark.parametrize(
    "suffix, transparent", [*product(["png", "gif", "tif", "bmp"], [None]), ("png", 2), ("gif", 2), ("png", HALF)]
)
def test_a_palette_is_read_as_indices_and_written_back(tmp_path, suffix, transparent):
    indices = noise((8, 9), np.uint8) % 5
    colours = noise((5, 3), np.uint8, seed=2)
    colours[3] = colours[1]  # what colours could not tell apart
    picture = PIL.Image.fromarray(indices)
    picture.putpalette(colours.tobytes())
    picture.save(tmp_path / f"a.{suffix}", **{} if transparent is None else {"transparency": transparent})
    plain, found = (image.read(tmp_path / f"a.{suffix}", palette=palette) for palette in (False, True))
    assert plain.pixels.shape[2] in (3, 4) and plain.metadata.palette is None
    assert found.metadata.palette[:15] == colours.tobytes()
    if transparent is None:
        np.testing.assert_array_equal(found.pixels, indices)
        for out in ("png", "bmp"):
            image.write(tmp_path / f"b.{out}", found.pixels, found.metadata)
            with PIL.Image.open(tmp_path / f"b.{out}") as back:
                assert back.mode == "P" and np.array_equal(back, indices)
                assert np.array_equal(back.convert("RGB"), plain.pixels)
        for out, held in (("webp", plain.pixels), ("tif", indices), ("npy", indices)):
            image.write(tmp_path / f"b.{out}", found.pixels, found.metadata)
            np.testing.assert_array_equal(image.read(tmp_path / f"b.{out}").pixels, held)
    else:
        np.testing.assert_array_equal(found.pixels[..., 0], indices)
        np.testing.assert_array_equal(found.pixels[..., 1], plain.pixels[..., 3])
        np.testing.assert_array_equal(image.coloured(found.pixels, found.metadata.palette), plain.pixels)


def test_a_picture_without_a_palette_has_no_indices(tmp_path):
    for suffix, shape in (("png", (8, 9)), ("png", (8, 9, 4)), ("tif", (8, 9, 3)), ("jpg", (8, 9, 3))):
        image.write(tmp_path / f"a.{suffix}", noise(shape, np.uint8))
        plain, found = (image.read(tmp_path / f"a.{suffix}", palette=palette) for palette in (False, True))
        np.testing.assert_array_equal(found.pixels, plain.pixels)
        assert found.metadata == plain.metadata


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("colours", [1, 3])
@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_alpha_is_dropped_only_where_opaque(tmp_path, dtype, colours, suffix):
    pixels = noise((6, 5, colours + 1), dtype)
    pixels[..., -1] = np.iinfo(dtype).max
    image.write(tmp_path / f"a{suffix}", pixels)
    read = image.read(tmp_path / f"a{suffix}")
    np.testing.assert_array_equal(read.pixels, pixels[..., 0] if colours == 1 else pixels[..., :3])
    pixels[2, 3, -1] = 0
    image.write(tmp_path / f"b{suffix}", pixels)
    np.testing.assert_array_equal(image.read(tmp_path / f"b{suffix}").pixels, pixels)


def test_transparent_colour_becomes_alpha(tmp_path):
    grey = PIL.Image.fromarray(np.array([[0, 7], [7, 9]], np.uint8))
    grey.save(tmp_path / "a.png", transparency=7)
    np.testing.assert_array_equal(image.read(tmp_path / "a.png").pixels[..., 1], [[255, 0], [0, 255]])


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("suffix", ["png", "tif", "jpg"])
def test_orientation_is_applied(tmp_path, orientation, suffix):
    picture = PIL.Image.fromarray(np.arange(6 * 4, dtype=np.uint8).reshape(6, 4) * 10)
    exif = picture.getexif()
    exif[0x0112] = orientation
    path = tmp_path / f"a.{suffix}"
    # turned in memory, for Pillow turns a TIFF already while it loads it
    expected = np.asarray(PIL.ImageOps.exif_transpose(picture)).astype(int)
    picture.save(path, exif=exif, quality=100)
    upright = image.read(path).pixels
    assert upright.shape == expected.shape
    assert np.abs(upright - expected).max() <= (2 if suffix == "jpg" else 0)


def test_orientation_of_a_16_bit_png(tmp_path):
    pixels = noise((6, 4, 3), np.uint16)
    exif = PIL.Image.Exif()
    exif[0x0112] = 6
    body = b"eXIf" + exif.tobytes().removeprefix(b"Exif\0\0")
    rows = b"".join(b"\0" + row.tobytes() for row in pixels.astype(">u2"))
    (tmp_path / "a.png").write_bytes(png(4, 6, 16, rows=rows, eXIf=body[4:]))
    np.testing.assert_array_equal(image.read(tmp_path / "a.png").pixels, np.rot90(pixels, -1))


def test_tiff_kinds(tmp_path):
    path = tmp_path / "a.tif"
    planar = noise((3, 6, 4), np.uint16)
    tifffile.imwrite(path, planar, photometric="rgb", planarconfig="separate", byteorder=">")
    np.testing.assert_array_equal(image.read(path).pixels, np.moveaxis(planar, 0, -1))
    grey = noise((6, 4), np.uint8)
    tifffile.imwrite(path, grey, photometric="miniswhite", compression="lzw")
    np.testing.assert_array_equal(image.read(path).pixels, 255 - grey)
    tifffile.imwrite(path, noise((16, 16, 3), np.uint8), photometric="rgb", compression="jpeg")
    assert image.read(path).pixels.shape == (16, 16, 3)


def netpbm(kind, pixels, largest):
    """The bytes of a PGM or PPM, with comments in its header: as text for 2 and 3, binary for 5 and 6."""
    height, width = pixels.shape[:2]
    head = f"P{kind} # made by hand\n# of a scanner\n{width} {height}\n{largest}\n".encode()
    if kind < 4:
        return head + b"# more\n" + "\n".join(" ".join(map(str, row.ravel())) for row in pixels).encode()
    return head + pixels.astype(">u2" if largest > 255 else np.uint8).tobytes()


@pytest.mark.parametrize("largest", [1, 3, 255, 256, 4095, 65535])
@pytest.mark.parametrize("channels", [None, 3])
def test_pgm_and_ppm_have_the_values_of_the_file(tmp_path, largest, channels):
    """A mask is white above half of the maximum in the header."""
    shape = (4, 5) if channels is None else (4, 5, channels)
    pixels = np.random.default_rng(largest).integers(0, largest, shape, endpoint=True)
    for kind in (2, 5) if channels is None else (3, 6):
        (tmp_path / "a.pgm").write_bytes(netpbm(kind, pixels, largest))
        found = image.read(tmp_path / "a.pgm").pixels
        assert found.dtype == (np.uint8 if largest < 256 else np.uint16)
        np.testing.assert_array_equal(found, pixels)
        white = (pixels > (largest / 2 if pixels.max() > 1 else 0)).reshape(4, 5, -1).any(2)
        assert channels or (white.any() and not white.all())
        np.testing.assert_array_equal(image.read_mask(tmp_path / "a.pgm", (4, 5)), white)


@pytest.mark.parametrize("data", [b"P1 # text\n3 2\n1 0 1\n001", b"P4\n3 2\n\xa0\x20"])
def test_pbm_is_black_and_white(tmp_path, data):
    (tmp_path / "a.pbm").write_bytes(data)
    assert image.read(tmp_path / "a.pbm").pixels.tolist() == [[0, 255, 0], [255, 255, 0]]


@pytest.mark.parametrize("bits", [1, 2, 4])
def test_a_png_of_few_bits_is_at_full_scale(tmp_path, bits):
    """Also the grey that is transparent, which Pillow compares with scaled pixels."""
    top = 2**bits - 1
    grey = np.array([[0, top, top // 2, top]] * 2)
    rows = [int("".join(f"{value:0{bits}b}" for value in row).ljust(16, "0"), 2).to_bytes(2, "big") for row in grey]
    rows = b"".join(b"\0" + row[: (4 * bits + 7) // 8] for row in rows)
    for more in ({}, {"tRNS": struct.pack(">H", top)}):
        (tmp_path / "a.png").write_bytes(png(4, 2, bits, 0, rows, **more))
        found = image.read(tmp_path / "a.png").pixels
        np.testing.assert_array_equal(found[..., 0] if more else found, grey * (255 // top))
        if more:
            np.testing.assert_array_equal(found[..., 1], np.where(grey == top, 0, 255))


def test_a_transparent_entry_of_a_palette_is_not_scaled(tmp_path):
    picture = PIL.Image.fromarray(noise((8, 9, 3))).quantize(4)
    picture.save(tmp_path / "a.png", bits=2, transparency=2)
    found = image.read(tmp_path / "a.png").pixels
    np.testing.assert_array_equal(found[..., 3], np.where(np.asarray(picture) == 2, 0, 255))


def test_significant_bits_of_a_png_change_nothing(tmp_path):
    """Its values are at full scale whatever the camera had."""
    values = np.array([[0, 16, 65535]], ">u2")
    (tmp_path / "a.png").write_bytes(png(3, 1, 16, 0, b"\0" + values.tobytes(), sBIT=b"\x0c"))
    assert image.read(tmp_path / "a.png").pixels.tolist() == [[0, 16, 65535]]


@pytest.mark.parametrize("channels", [None, 3])
@pytest.mark.parametrize("kind", ["jp2", "j2k", "avif"])
def test_jpeg_2000_and_avif_keep_more_than_8_bits(tmp_path, kind, channels):
    bits = 10 if kind == "avif" else 12
    values = np.arange(32 * 32, dtype=np.uint16).reshape(32, 32) * (2**bits - 1) // 1023
    values = values if channels is None else np.dstack([values, values[::-1], values])
    if kind == "avif":
        data = imagecodecs.avif_encode(values, bitspersample=bits, level=100)
    else:
        data = imagecodecs.jpeg2k_encode(values, bitspersample=bits, codecformat=kind, level=0, reversible=True)
    (tmp_path / "a").write_bytes(data)
    found = image.read(tmp_path / "a").pixels
    assert found.dtype == np.uint16
    found = found[..., 0] if found.ndim == 3 and channels is None else found
    assert np.abs(found - np.rint(values * (65535 / (2**bits - 1)))).max() <= (0 if kind != "avif" else 2**9)


@pytest.mark.parametrize(("kind", "channels"), [("TGA", 3), ("TGA", 4), ("JPEG2000", 3), ("AVIF", 3), ("HEIF", 3)])
def test_other_formats_of_pictures(tmp_path, kind, channels):
    pixels = np.add.outer(np.arange(32), 2 * np.arange(40))[..., None] + np.arange(channels)
    picture = PIL.Image.fromarray(pixels.astype(np.uint8))
    if kind == "HEIF":
        heif = pytest.importorskip("pillow_heif")
        heif.from_pillow(picture).save(tmp_path / "a", quality=90)
    else:
        picture.save(tmp_path / "a", kind)
    found = image.read(tmp_path / "a").pixels
    assert found.shape == pixels.shape
    assert np.abs(found - pixels.astype(int)).max() <= (0 if kind in ("TGA", "JPEG2000") else 6)


def test_openexr(tmp_path):
    """Colours that were multiplied by alpha are divided; parts and channels of renderers are named."""
    exr = pytest.importorskip("OpenEXR")
    header = {"compression": exr.ZIP_COMPRESSION, "type": exr.scanlineimage}
    values = np.abs(noise((5, 6, 4), "float32"))
    values[..., 3] = np.repeat([[0, 0.25, 0.5, 1, 1, 1]], 5, 0)
    values[:, 0] = 0
    stored = np.concatenate([values[..., :3] * values[..., 3:], values[..., 3:]], -1)
    exr.File(header, {"RGBA": stored}).write(str(tmp_path / "a.exr"))
    np.testing.assert_allclose(image.read(tmp_path / "a.exr").pixels, values, rtol=1e-6)
    image.write(tmp_path / "b.exr", values)
    np.testing.assert_array_equal(exr.File(str(tmp_path / "b.exr")).channels()["RGBA"].pixels, stored)
    image.write(tmp_path / "c.exr", values[..., 2:])
    np.testing.assert_allclose(image.read(tmp_path / "c.exr").pixels, values[..., 2:], rtol=1e-6)
    first = np.ascontiguousarray(values[..., 0])
    exr.File(header, {"height": first}).write(str(tmp_path / "a.exr"))
    np.testing.assert_array_equal(image.read(tmp_path / "a.exr").pixels, first)
    exr.File(header, {"N.X": first, "N.Y": first}).write(str(tmp_path / "a.exr"))
    with pytest.raises(ValueError, match=r"has 1 parts and channels N\.X, N\.Y: save R, G and B, or one"):
        image.read(tmp_path / "a.exr")


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"8BPS\0\1" + bytes(20), r"is a Photoshop document \(PSD\): export it as PNG or TIFF"),
        (b"DDS |" + bytes(120), r"is a texture of DirectX \(DDS\): export it"),
        (b"\0\0\1\0\1\0\x10\x10" + bytes(30), r"is an icon \(ICO\): export it"),
        (b"\xff\x0a" + bytes(30), "is a JPEG XL picture: save it"),
        (b"#?RADIANCE\n", r"is a Radiance picture \(HDR\): save it as OpenEXR"),
        (b"<?xml version='1.0'?>\n<svg xmlns='http://www.w3.org/2000/svg'/>", "is a drawing .*SVG.: export it"),
        (b"%PDF-1.7\n", r"is a drawing \(PDF"),
        (b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 20 20\n", "is a drawing"),
        (b"II*\0\x10\0\0\0CR\2\0" + bytes(40), "is a camera's raw file: develop it"),
        (b"\0\0\0\x18ftypcrx " + bytes(40), "is a camera's raw file: develop it"),
        (bytes(128) + b"DICM" + bytes(40), "is a DICOM picture: convert it to NRRD"),
        (b"II*\0\x54\x18\x08\0" + bytes(120) + b"DICM" + bytes(40), "is a DICOM picture: convert it to NRRD"),
        (b"NRRD0004\n", "is a volume .*: simdtex simulate reads it"),
        (b'<?xml version="1.0"?>\n<VTKFile type="ImageData">', "is a volume .*: simdtex simulate reads it"),
        (b"PK\3\4" + bytes(40), "is an archive .*: unpack it"),
        (b"hello, world", "is not an image: give a PNG, JPEG, TIFF"),
        (bytes(range(256)) * 9, "is not an image: give a PNG, JPEG, TIFF"),
    ],
)
def test_formats_that_are_not_read_are_named(tmp_path, data, words):
    (tmp_path / "a").write_bytes(data)
    with pytest.raises(ValueError, match=f"a {words}"):
        image.read(tmp_path / "a")


@pytest.mark.parametrize("kind", ["PCX", "SGI", "ICNS"])
def test_only_documented_formats_are_tried(tmp_path, kind):
    """Pillow knows more, some of which start programs."""
    PIL.Image.new("RGB", (32, 32)).save(tmp_path / "a.png", kind)
    with pytest.raises(ValueError, match="is not an image: give a PNG"):
        image.read(tmp_path / "a.png")


def test_the_preview_in_a_raw_file_is_not_the_picture(tmp_path):
    with tifffile.TiffWriter(tmp_path / "a.dng") as file:
        file.write(noise((8, 8, 3)), photometric="rgb", subfiletype=1, metadata=None)
        file.write(noise((32, 32), "uint16"), photometric="cfa", metadata=None)
    with pytest.raises(ValueError, match="is a camera's raw file: develop it to TIFF"):
        image.read(tmp_path / "a.dng")


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"P5 2 2 255 \0\0\0", "cannot be read as an image"),
        (b"P2 2 2 255 1 2 3", "cannot be read as an image"),
        (b"P2 2 2 255 1 2 x 4", "cannot be read as an image"),
        (b"P2 2 2 3 1 2 3 4", "value that is not 0 to 3"),
        (b"P2 2 2 3 1 2 3 -1", "value that is not 0 to 3"),
        (b"P5 2 2 3 \0\1\2\4", "value that is not 0 to 3"),
        (b"P5 2 2 0 \0\0\0\0", "largest value is 0, not 1 to 65535"),
        (b"P5 2 2 65536 " + bytes(8), "largest value is 65536"),
        (b"P5 0 2 255 ", "shape"),
        (b"P5 999999999 999999999 255 ", "no more than"),
        (b"P5 2 two", "cannot be read as an image"),
    ],
)
def test_damaged_pgm(tmp_path, data, words):
    (tmp_path / "a.pgm").write_bytes(data)
    with pytest.raises(ValueError, match=rf"a\.pgm.*{words}"):
        image.read(tmp_path / "a.pgm")


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
@pytest.mark.parametrize("colours", [1, 3])
def test_colours_that_were_multiplied_by_alpha_are_divided(tmp_path, dtype, colours):
    full = 1 if dtype == "float32" else np.iinfo(dtype).max
    rng = np.random.default_rng(1)
    alpha = np.array([0, full // 2 or 0.5, full, full // 3 or 0.3]).repeat(6).reshape(4, 6, 1)
    plain = rng.integers(0, full, (4, 6, colours), endpoint=True) if full > 1 else rng.random((4, 6, colours))
    premultiplied = plain * (alpha / full)
    premultiplied = premultiplied if full == 1 else np.rint(premultiplied)
    values = np.concatenate([premultiplied, alpha], -1).astype(dtype)
    for extra in ("assocalpha", "unassalpha"):
        photometric = "rgb" if colours == 3 else "minisblack"
        tifffile.imwrite(tmp_path / "a.tif", values, photometric=photometric, extrasamples=[extra], planarconfig=1)
        found = image.read(tmp_path / "a.tif").pixels
        assert found.dtype == dtype
        np.testing.assert_array_equal(found[..., -1:], alpha.astype(dtype))
        if extra == "unassalpha":
            np.testing.assert_array_equal(found, values)
            continue
        assert (found[0, :, :-1] == 0).all()
        np.testing.assert_array_equal(found[2], values[2])
        tolerance = 2.0 if full > 1 else 1e-6  # of an alpha of a third, and rounded before and after
        assert np.abs(found[1:, :, :-1].astype(float) - plain[1:]).max() <= tolerance


def test_divided_colours_are_rounded_and_no_more_than_white(tmp_path):
    values = np.array([[[100, 150], [7, 200], [200, 100], [9, 0]]], np.uint8)
    tifffile.imwrite(tmp_path / "a.tif", values, photometric="minisblack", extrasamples=["assocalpha"], planarconfig=1)
    assert image.read(tmp_path / "a.tif").pixels.tolist() == [[[170, 150], [9, 200], [255, 100], [0, 0]]]


def test_format_is_told_by_content(tmp_path):
    pixels = noise((5, 4, 3), np.uint16)
    image.write(tmp_path / "a.png", pixels)
    (tmp_path / "a.png").rename(tmp_path / "a.jpg")
    np.testing.assert_array_equal(image.read(tmp_path / "a.jpg").pixels, pixels)


def encoded(suffix, dtype, tmp_path):
    path = tmp_path / f"whole{suffix}"
    image.write(path, noise((40, 30, 3), dtype))
    return path.read_bytes()


@pytest.mark.parametrize(
    ("suffix", "dtype"),
    [(s, "uint8") for s in (".png", ".tif", ".jpg", ".bmp", ".webp", ".npy")]
    + [(s, "uint16") for s in (".png", ".tif")],
)
@pytest.mark.parametrize("share", [0.02, 0.5, 0.95])
def test_truncated_files(tmp_path, suffix, dtype, share):
    data = encoded(suffix, dtype, tmp_path)
    path = tmp_path / f"part{suffix}"
    path.write_bytes(data[: max(9, int(len(data) * share))])
    with pytest.raises(ValueError, match="part") as caught:
        image.read(path)
    assert "\n" not in str(caught.value)


def test_damaged_tiff_says_one_sentence(tmp_path, caplog):
    data = bytearray(encoded(".tif", "uint8", tmp_path))
    data[8:60] = bytes(range(52))
    (tmp_path / "a.tif").write_bytes(data)
    with pytest.raises(ValueError, match="cannot be read as an image"):
        image.read(tmp_path / "a.tif")
    assert [r.message for r in caplog.records if r.levelno >= logging.WARNING] == []


def test_files_that_are_no_images(tmp_path):
    with pytest.raises(ValueError, match="does not exist"):
        image.read(tmp_path / "none.png")
    with pytest.raises(ValueError, match="is a folder"):
        image.read(tmp_path)
    (tmp_path / "empty.png").touch()
    with pytest.raises(ValueError, match="is empty"):
        image.read(tmp_path / "empty.png")
    (tmp_path / "text.png").write_text("not a picture")
    with pytest.raises(ValueError, match="is not an image"):
        image.read(tmp_path / "text.png")
    np.save(tmp_path / "o.npy", np.array([{}, {}], object), allow_pickle=True)
    with pytest.raises(ValueError, match="cannot be read as an image"):
        image.read(tmp_path / "o.npy")
    np.save(tmp_path / "line.npy", np.zeros(4))
    with pytest.raises(ValueError, match=r"line\.npy: the picture has the shape \(4,\)"):
        image.read(tmp_path / "line.npy")
    with pytest.raises(ValueError, match="null"):
        image.read("a\0b")


def test_unknown_pixels_are_read_and_for_the_function_to_judge(tmp_path):
    pixels = noise((5, 4, 3), np.float32)
    pixels[1, 2, 0] = np.nan
    for name in ("a.tif", "a.npy"):
        image.write(tmp_path / name, pixels)
        np.testing.assert_array_equal(image.read(tmp_path / name).pixels, pixels)
    with pytest.raises(ValueError, match="1 value that is NaN or infinite, the first at row 1, column 2: fill"):
        image.check_sample(pixels, -1)
    np.testing.assert_array_equal(image.check_sample(pixels, -1, unknown=True), pixels)
    np.testing.assert_array_equal(image.check_sample([[1, 2]], None, unknown=True), [[[1], [2]]])
    pixels[3, 1, 2] = -np.inf
    with pytest.raises(ValueError, match="1 value that is infinite, the first at row 3, column 1: give NaN"):
        image.check_sample(pixels, -1, unknown=True)


@pytest.mark.parametrize(
    ("dtype", "alpha", "transparent"),
    [
        ("uint8", [0, 127, 128, 255], [1, 1, 0, 0]),
        ("uint16", [0, 32767, 32768, 65535], [1, 1, 0, 0]),
        ("float32", [0, np.nan, 0.5, 1], [1, 1, 0, 0]),
        ("bool", [0, 0, 1, 1], [1, 1, 0, 0]),
    ],
)
@pytest.mark.parametrize("colours", [1, 3])
def test_split_alpha(dtype, alpha, transparent, colours):
    picture = noise((2, 2, colours + 1), dtype)
    picture[..., -1] = np.array(alpha).reshape(2, 2)
    pixels, mask = image.split_alpha(picture)
    assert pixels.dtype == picture.dtype
    np.testing.assert_array_equal(pixels, picture[..., 0] if colours == 1 else picture[..., :3])
    assert mask.dtype == bool
    assert mask.ravel().tolist() == transparent


@pytest.mark.parametrize(
    "check", [image.split_alpha, lambda pixels: image.write("a.npy", pixels)], ids=["split", "write"]
)
def test_what_is_no_picture_is_refused(check, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(TypeError, match="complex128 values; convert it to integers or real floats"):
        check(np.zeros((2, 2, 4), complex))
    with pytest.raises(ValueError, match="has the shape"):
        check(np.zeros(4))


MASKS = [
    ("grey.png", np.array([[0, 127, 128, 255]], np.uint8), [0, 0, 1, 1]),
    ("grey16.png", np.array([[0, 32767, 32768, 65535]], np.uint16), [0, 0, 1, 1]),
    ("float.tif", np.array([[0, 0.5, 0.51, 1]], np.float32), [0, 0, 1, 1]),
    ("bool.npy", np.array([[False, False, True, True]]), [0, 0, 1, 1]),
    ("colour.png", np.array([[[0, 0, 0], [9, 127, 0], [0, 0, 128], [255, 255, 255]]], np.uint8), [0, 0, 1, 1]),
    ("alpha.png", np.array([[[0, 255], [200, 127], [200, 128], [255, 255]]], np.uint8), [0, 0, 1, 1]),
    ("rgba.png", np.array([[[0] * 4, [255] * 3 + [0], [0, 255, 0, 200], [255] * 4]], np.uint8), [0, 0, 1, 1]),
    ("ones.png", np.array([[0, 1, 0, 1]], np.uint8), [0, 1, 0, 1]),
    ("NaN.npy", np.array([[0, np.nan, 1, -1]]), [0, 0, 1, 0]),
    ("none.png", np.zeros((1, 4), np.uint8), [0, 0, 0, 0]),
    ("all.npy", np.ones((1, 4, 1)), [1, 1, 1, 1]),
]


@pytest.mark.parametrize(("name", "pixels", "expected"), MASKS, ids=[name for name, *_ in MASKS])
def test_read_mask(tmp_path, name, pixels, expected):
    image.write(tmp_path / name, pixels)
    mask = image.read_mask(tmp_path / name, (1, 4, 3))
    assert mask.dtype == bool
    assert mask.tolist() == [[bool(v) for v in expected]]


def test_a_mask_of_another_size(tmp_path):
    np.save(tmp_path / "mask.npy", np.zeros((4, 1), np.uint8))
    with pytest.raises(ValueError, match=r"mask\.npy: .*is 1 x 4 pixels .* must be 4 x 1: bring"):
        image.read_mask(tmp_path / "mask.npy", (1, 4))


def test_check_sample_brings_channels_last():
    pixels = noise((3, 5, 4), ">u2")
    checked = image.check_sample(pixels, 0)
    assert checked.shape == (5, 4, 3)
    assert checked.dtype == np.uint16
    assert checked.flags.c_contiguous
    np.testing.assert_array_equal(checked[..., 1], pixels[1])
    assert image.check_sample([[1, 2], [3, 4]], None).shape == (2, 2, 1)


@given(st.integers(1, 10**8 - 1), st.integers(1, 10**8 - 1))
def test_parse_size(width, height):
    assert image.parse_size(f"{width}x{height}") == (height, width)
    assert image.parse_size(f" {width} X {height} ") == (height, width)
    assert image.parse_size(str(width)) == (width, width)


@pytest.mark.parametrize(
    ("text", "sides"),
    [
        ("2x", (42, 10)),
        ("150%", (32, 8)),
        ("0.5 X", (10, 2)),
        ("1.\u00d7", (21, 5)),
        ("2x3", (2, 3)),
        ("200", (200, 200)),
    ],
)
def test_a_size_may_be_a_multiple_of_the_sample(text, sides):
    assert image.parse_sides(text, "WIDTHxHEIGHT", (21, 5)) == sides


@pytest.mark.parametrize("text", ["0x", "0.01x", "-1x", "x", "2y", "1e3%", "99999999x"])
def test_a_multiple_must_leave_pixels(text):
    with pytest.raises(ValueError, match="or 2x or 200% of the sample"):
        image.parse_sides(text, "WIDTHxHEIGHT", (21, 5))


@pytest.mark.parametrize("text", ["", "0", "0x5", "5x0", "-3x4", "3x", "x3", "1x2x3", "a", "1.5", "9" * 9])
def test_parse_size_errors(text):
    with pytest.raises(ValueError, match="WIDTHxHEIGHT"):
        image.parse_size(text)


@pytest.mark.parametrize(
    ("suffix", "dtype", "channels", "remedy"),
    [
        (".jpg", "uint16", 3, ".png"),
        (".png", "float32", 3, ".tif"),
        (".png", "uint8", 5, ".tif"),
        (".jpg", "uint8", 4, ".png"),
        (".tif", "longdouble", 1, ".npy"),
    ],
)
def test_formats_that_cannot_hold_the_pixels(tmp_path, suffix, dtype, channels, remedy):
    with pytest.raises(ValueError, match=rf"cannot hold .* in \{remedy} instead"):
        image.check_writable(tmp_path / f"a{suffix}", dtype, channels)
    with pytest.raises(ValueError, match="cannot hold"):
        image.write(tmp_path / f"a{suffix}", np.zeros((2, 2, channels), dtype))
    image.check_writable(tmp_path / f"a{remedy}", dtype, channels)
    assert os.listdir(tmp_path) == []


def test_places_that_cannot_be_written(tmp_path, monkeypatch):
    for path, words in [
        (tmp_path / "none" / "a.png", "the folder .* does not exist"),
        (tmp_path / "a.xyz", "ends in .xyz"),
        (tmp_path / "a", "has no suffix"),
        (tmp_path, "is a folder"),
        (tmp_path / ("a" * 300 + ".png"), "cannot be written"),
        ("/dev/null", "not a regular file"),
    ]:
        with pytest.raises(ValueError, match=words):
            image.check_writable(path, np.uint8, 3)
    (tmp_path / "file").touch()
    with pytest.raises(ValueError, match=r"the folder .* does not exist"):
        image.check_writable(tmp_path / "file" / "a.png")
    image.check_writable(tmp_path / "a.npz", suffixes={".npz"})
    with pytest.raises(ValueError, match=r"\.npz"):
        image.check_writable(tmp_path / "a.png", suffixes={".npz"})
    monkeypatch.setattr(os, "access", lambda *_: False)  # root may write anywhere
    with pytest.raises(ValueError, match="not writable"):
        image.check_writable(tmp_path / "a.png")


def test_written_file_has_the_usual_permissions_and_follows_links(tmp_path):
    (tmp_path / "usual").touch()
    (tmp_path / "link.png").symlink_to(tmp_path / "real.png")
    image.write(tmp_path / "link.png", np.zeros((2, 2), np.uint8))
    assert (tmp_path / "link.png").is_symlink()
    modes = [stat.S_IMODE((tmp_path / name).stat().st_mode) for name in ("usual", "real.png")]
    assert modes[0] == modes[1]


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o444, 0o666])
def test_a_file_that_is_replaced_keeps_its_permissions(tmp_path, mode):
    path, folder = tmp_path / "a.png", tmp_path / "slices"
    path.touch()
    folder.mkdir()
    path.chmod(mode)
    folder.chmod(mode | 0o300)
    image.write(path, np.zeros((2, 2), np.uint8))
    volume.write(folder, np.zeros((2, 2, 2), np.uint8))
    assert stat.S_IMODE(path.stat().st_mode) == mode
    assert stat.S_IMODE(folder.stat().st_mode) == mode | 0o300


def test_a_file_that_is_replaced_is_read_by_no_others_meanwhile(tmp_path):
    path = tmp_path / "a.bin"
    path.touch()
    path.chmod(0o600)
    with atomic_path(path) as temporary:
        assert stat.S_IMODE(temporary.stat().st_mode) == 0o600


def test_to_display():
    assert image.to_display(np.array([0, 3, 255], np.uint8)).tolist() == [0, 3, 255]
    assert image.to_display(np.array([False, True])).tolist() == [0, 255]
    values = np.array([-5.0, 0.0, 5.0, 10.0, 20.0])
    assert image.to_display(values, (0.0, 10.0)).tolist() == [0, 0, 128, 255, 255]
    assert image.to_display(np.array([0, 65535], np.uint16)).tolist() == [0, 255]
    assert image.to_display(np.full(2, 7.0)).tolist() == [128, 128]
    assert image.to_display(np.array([-1.7e308, 1.7e308])).tolist() == [0, 255]


# -- Colour profile, pixels per inch and EXIF go from the file that is read to the file that is written.

SRGB = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
WIDE = SRGB.replace(b"s\0R\0G\0B", b"W\0i\0d\0e")  # another name makes it another profile
GREY = SRGB[:16] + b"GRAY" + SRGB[20:]
DATE, WIDTH, INTEROP, PREVIEW = 0x9003, 0xA002, 0xA005, 0x0201


def exif(orientation=1):
    """The EXIF of a photo: who took it, when and where, how it is turned, its width, and a preview."""
    found = PIL.Image.Exif()
    found[0x0112], found[0x010F] = orientation, "Camera"
    found[0x8769] = {DATE: "2026:01:02 03:04:05", WIDTH: 20, INTEROP: 7}
    found[0x8825] = {1: "N", 2: (1.0, 2.0, 3.0)}
    return found


def photo(path, orientation=1, profile=WIDE, seed=1):
    """Write a photo with a profile, 300 x 200 pixels per inch and EXIF."""
    pixels = np.random.default_rng(seed).integers(0, 256, (24, 20, 3), dtype=np.uint8)
    if path.suffix == ".tif":
        tifffile.imwrite(path, pixels, photometric="rgb", iccprofile=profile, resolution=(300, 200), resolutionunit=2)
        return path
    PIL.Image.fromarray(pixels).save(path, icc_profile=profile, dpi=(300, 200), exif=exif(orientation), quality=95)
    return path


def of_file(path):
    """What Pillow reads of profile, pixels per inch (rounded) and EXIF."""
    with PIL.Image.open(path) as picture:
        dpi = picture.info.get("dpi")
        found = picture.getexif()
        dated, placed = (dict(found.get_ifd(ifd)) if ifd in found else {} for ifd in (0x8769, 0x8825))
        return picture.info.get("icc_profile"), dpi and tuple(round(float(v)) for v in dpi), found, dated, placed


@pytest.mark.parametrize("kind", ["png", "jpg", "webp", "tif"])
@pytest.mark.parametrize("out", ["png", "jpg", "webp", "tif", "deep.png"])
def test_what_a_file_says_of_its_pixels_is_written(tmp_path, kind, out):
    found = image.read(photo(tmp_path / f"a.{kind}"))
    pixels = found.pixels.astype(np.uint16) * 257 if out == "deep.png" else found.pixels
    image.write(tmp_path / f"b.{out}", pixels, found.metadata)
    profile, dpi, said, dated, placed = of_file(tmp_path / f"b.{out}")
    assert profile == WIDE
    if out != "webp" and kind != "webp":  # which has no place for it
        assert dpi == (300, 200)
    if kind != "tif":
        assert said[0x010F] == "Camera"
        if out != "tif":  # which gets texts only
            assert dated[DATE] == "2026:01:02 03:04:05" and placed[2] == (1.0, 2.0, 3.0)
    assert not {WIDTH, INTEROP} & {*dated}, "which are those of another file"
    back = image.read(tmp_path / f"b.{out}")
    if out != "jpg":
        np.testing.assert_array_equal(back.pixels, pixels)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("channels", [1, 3, 5])
def test_a_tiff_of_every_kind_keeps_the_texts_of_exif(tmp_path, dtype, channels):
    pixels, long = noise((240, 20, channels), np.uint8).astype(dtype), exif()
    long[0x010E], long[0x8298] = "A caption of a photo", "Caf\u00e9".encode()
    image.write(tmp_path / "a.tif", pixels, image.Metadata(exif=long.tobytes(), dpi=(300, 200)))
    with tifffile.TiffFile(tmp_path / "a.tif") as file:
        np.testing.assert_array_equal(file.asarray(), pixels[..., 0] if channels == 1 else pixels)
        assert file.pages.first.tags["Make"].value == "Camera"
    back = image.read(tmp_path / "a.tif").metadata
    assert back.dpi == (300, 200)
    image.write(tmp_path / "b.png", pixels[..., 0].astype(np.uint8), back)
    said = of_file(tmp_path / "b.png")[2]
    assert said[0x010E] == long[0x010E] and said[0x8298].encode("latin-1") == long[0x8298], "in whatever encoding"


def test_what_a_program_notes_in_a_tiff_is_not_kept(tmp_path):
    pixels = noise((8, 9), np.uint8)
    for options in ({"imagej": True}, {"metadata": {"axes": "YX"}}):
        tifffile.imwrite(tmp_path / "a.tif", pixels, **options)
        said = image.read(tmp_path / "a.tif").metadata.exif
        assert b"axes" not in said and b"ImageJ=" not in said
    tifffile.imwrite(tmp_path / "a.tif", pixels, imagej=True, extratags=[(0x010F, 2, 0, "Camera", True)])
    image.write(tmp_path / "b.tif", pixels, image.read(tmp_path / "a.tif").metadata)
    with tifffile.TiffFile(tmp_path / "b.tif") as file:
        assert file.pages.first.tags["Make"].value == "Camera" and not file.is_imagej


def test_a_photo_that_was_turned_is_not_turned_again(tmp_path):
    found = image.read(photo(tmp_path / "a.jpg", orientation=6))
    assert found.pixels.shape == (20, 24, 3)
    image.write(tmp_path / "b.png", found.pixels, found.metadata)
    _, dpi, said, _, _ = of_file(tmp_path / "b.png")
    assert 0x0112 not in said and dpi == (200, 300)
    np.testing.assert_array_equal(image.read(tmp_path / "b.png").pixels, found.pixels)


def test_the_preview_of_a_photo_does_not_show_what_was_there(tmp_path):
    found = exif()
    preview = io.BytesIO()
    PIL.Image.new("RGB", (4, 4)).save(preview, "JPEG")
    data = found.tobytes()[6:]
    # a second directory with the place and the length of the preview, after the first
    with io.BytesIO() as file:
        file.write(data)
        at = len(data)
        file.write(b"\0\2" + b"\2\1\0\4" + b"\0\0\0\1" + (at + 30).to_bytes(4, "big"))
        file.write(b"\2\2\0\4" + b"\0\0\0\1" + len(preview.getvalue()).to_bytes(4, "big") + b"\0\0\0\0")
        file.write(preview.getvalue())
        whole = bytearray(file.getvalue())
    assert whole[:2] == b"MM"
    entries = int.from_bytes(whole[8:10], "big")
    whole[10 + 12 * entries : 14 + 12 * entries] = at.to_bytes(4, "big")
    PIL.Image.new("RGB", (9, 8)).save(tmp_path / "a.jpg", exif=b"Exif\0\0" + bytes(whole))
    with PIL.Image.open(tmp_path / "a.jpg") as picture:
        assert PREVIEW in picture.getexif().get_ifd(ExifTags.IFD.IFD1)
    read = image.read(tmp_path / "a.jpg")
    image.write(tmp_path / "b.jpg", read.pixels, read.metadata)
    with PIL.Image.open(tmp_path / "b.jpg") as picture:
        assert picture.getexif()[0x010F] == "Camera" and not picture.getexif().get_ifd(ExifTags.IFD.IFD1)


@pytest.mark.parametrize("damaged", [b"Exif\0\0garbage", b"Exif\0\0MM\0*\0\0\xff\xff"])
def test_damaged_exif_is_left_out(tmp_path, damaged):
    PIL.Image.new("RGB", (9, 8), "red").save(tmp_path / "a.png", exif=damaged)
    found = image.read(tmp_path / "a.png")
    assert found.pixels.shape == (8, 9, 3) and found.metadata.exif is None


def test_exif_that_is_too_long_for_a_jpeg_is_left_out(tmp_path):
    long = exif()
    long[0x010E] = "x" * 70_000
    PIL.Image.new("RGB", (9, 8)).save(tmp_path / "a.png", exif=long)
    found = image.read(tmp_path / "a.png")
    image.write(tmp_path / "b.jpg", found.pixels, found.metadata)
    assert image.read(tmp_path / "b.jpg").metadata.exif is None


def test_a_profile_of_other_channels_is_left_out(tmp_path):
    said = image.Metadata(profile=GREY)
    for channels, profile in ((1, GREY), (2, GREY), (3, None), (4, None), (5, None)):
        image.write(tmp_path / "a.tif", noise((8, 9, channels), np.uint8), said)
        assert image.read(tmp_path / "a.tif").metadata.profile == profile
    image.write(tmp_path / "a.png", noise((8, 9), np.uint16), said)
    assert image.read(tmp_path / "a.png").metadata.profile == GREY


def test_print_colours_become_srgb_by_their_profile(tmp_path, monkeypatch):
    """There is no profile of print colours at hand: the conversion is another program's to test, its use is ours."""
    rgb = PIL.Image.fromarray(noise((8, 9, 3), np.uint8))
    calls = []

    def convert(picture, profile, wanted, outputMode):
        calls.append((picture.mode, outputMode))
        return rgb

    rgb.convert("CMYK").save(tmp_path / "a.jpg", icc_profile=SRGB)
    plain = image.read(tmp_path / "a.jpg")  # a profile that does not fit is not used
    assert plain.pixels.shape == (8, 9, 3) and plain.metadata.profile is None
    monkeypatch.setattr(ImageCms, "profileToProfile", convert)
    found = image.read(tmp_path / "a.jpg")
    assert calls == [("CMYK", "RGB")] and found.metadata.profile is None
    np.testing.assert_array_equal(found.pixels, np.asarray(rgb))


def test_a_tiff_says_pixels_per_centimetre_or_nothing(tmp_path):
    for unit, dpi in (("centimeter", (254, 508)), ("inch", (100, 200)), ("none", None)):
        tifffile.imwrite(tmp_path / "a.tif", noise((8, 9), np.uint8), resolution=(100, 200), resolutionunit=unit)
        found = image.read(tmp_path / "a.tif").metadata.dpi
        assert (found and tuple(round(v) for v in found)) == dpi
    PIL.Image.new("CMYK", (9, 8)).save(tmp_path / "a.tif")
    assert image.read(tmp_path / "a.tif").metadata.dpi is None


def test_names_of_profiles():
    assert image.profile_name(None) == image.profile_name(SRGB) == "sRGB"
    assert image.profile_name(WIDE).startswith("Wide")
    assert image.profile_name(b"damaged") == "an unknown profile"


def run(folder, command, *args):
    """Run a command on files of a folder."""
    named = [str(folder / arg) if str(arg).endswith((".png", ".jpg", ".tif", ".gif")) else str(arg) for arg in args]
    return CliRunner().invoke(main, [command, *named, "--device", "reference", "--seed", "1"])


@pytest.fixture
def folder(tmp_path):
    """Photos, with and without profiles, and a mask."""
    photo(tmp_path / "wide.jpg", orientation=6)
    photo(tmp_path / "srgb.png", profile=SRGB, seed=2)
    photo(tmp_path / "plain.png", profile=None, seed=3)
    mask = np.zeros((20, 24), np.uint8)
    mask[8:12, 8:12] = 255
    image.write(tmp_path / "mask.png", mask)
    image.write(tmp_path / "tall.png", mask.T)
    return tmp_path


COMMANDS = {
    "fill": ["wide.jpg", "--mask", "mask.png", "--order", 2],
    "extend": ["wide.jpg", "--right", 2, "--order", 2],
    "synth": ["wide.jpg", "--size", "9x8", "--order", 2],
    "mix": ["wide.jpg", "wide.jpg", "--size", "16x16"],
}


@pytest.mark.parametrize("command", COMMANDS)
def test_an_output_has_the_colours_of_its_sample(folder, command):
    result = run(folder, command, *COMMANDS[command], "-o", "out.png")
    assert result.exit_code == 0, result.output
    profile, dpi, said, dated, _ = of_file(folder / "out.png")
    assert profile == WIDE and dpi == (200, 300)
    photographed = command in ("fill", "extend")  # a new picture was taken by no camera
    assert bool(said) == bool(dated) == photographed and 0x0112 not in said


def test_other_maps_have_their_own_profiles(folder):
    also = f"{folder}/srgb.png={folder}/also.png"
    result = run(folder, "fill", "plain.png", "--mask", "tall.png", "-o", "out.png", "--order", 2, "--also", also)
    assert result.exit_code == 0, result.output
    assert of_file(folder / "also.png")[0] == SRGB and of_file(folder / "out.png")[0] is None


@pytest.mark.parametrize(
    ("command", "args"),
    [
        ("synth", ["srgb.png", "wide.jpg", "--size", "9x8", "--order", 2]),
        ("mix", ["srgb.png", "wide.jpg"]),
        ("synth", ["srgb.png", "--known", "wide.jpg"]),
        ("fill", ["srgb.png", "--mask", "tall.png", "--sample", "wide.jpg"]),
    ],
)
def test_samples_of_different_colours_are_refused(folder, command, args):
    result = run(folder, command, *args, "-o", "out.png")
    assert result.exit_code == 2 and not (folder / "out.png").exists()
    said = result.output.replace(str(folder), "")
    assert "/wide.jpg has the colour profile Wide" in said and "and /srgb.png sRGB; convert" in said


def test_an_array_has_the_colours_of_the_sample(folder):
    known = np.full((8, 9, 3), np.nan)
    known[2, 3] = 7
    np.save(folder / "known.npy", known)
    args = ["wide.jpg", "--known", folder / "known.npy", "--size", "9x8", "--order", 2]
    result = run(folder, "synth", *args, "-o", "out.png")
    assert result.exit_code == 0, result.output
    assert of_file(folder / "out.png")[0] == WIDE and image.read(folder / "out.png").pixels[2, 3].tolist() == [7, 7, 7]


def test_a_sample_without_a_profile_is_srgb(folder):
    result = run(folder, "synth", "plain.png", "srgb.png", "--size", "9x8", "--order", 2, "-o", "out.png")
    assert result.exit_code == 0, result.output


@pytest.mark.parametrize("command", COMMANDS)
def test_a_lossy_output_of_what_is_to_stay_is_told_once(folder, command):
    result = run(folder, command, *COMMANDS[command], "-o", "out.jpg", "-q")
    assert result.exit_code == 0, result.output
    told = [line for line in result.output.splitlines() if "JPEG changes all pixels" in line]
    assert len(told) == (command in ("fill", "extend"))
    assert all(line.endswith("end its name in .png to keep the known pixels exactly") for line in told)


def test_a_lossy_output_of_known_values_is_told(folder):
    (folder / "wells.csv").write_text("0,0,1,2,3\n")
    args = ["--size", "9x8", "--order", 2, "--known", folder / "wells.csv"]
    result = run(folder, "synth", "plain.png", *args, "-o", "out.jpg", "-q")
    assert result.exit_code == 0 and result.output.count("JPEG changes all pixels") == 1, result.output


@pytest.mark.parametrize("command", ["synth", "mix", "fill"])
def test_that_an_animation_has_more_frames_is_told_once(folder, command):
    frames = [PIL.Image.fromarray(noise((24, 20), np.uint8, seed)) for seed in (1, 2)]
    frames[0].save(folder / "a.gif", save_all=True, append_images=frames[1:])
    frames[0].save(folder / "one.gif")
    more = {"synth": ["--size", "9x8", "--order", 2], "mix": [], "fill": ["--mask", "tall.png", "--order", 2]}[command]
    for name in ("a.gif", "one.gif"):
        result = run(folder, command, name, *more, "-o", "out.png")
        assert result.exit_code == 0, result.output
        assert result.output.count("a.gif has several frames or pages; only the first is read") == (name == "a.gif")


def test_a_second_frame_that_is_damaged_takes_nothing_from_the_first(tmp_path):
    frames = [PIL.Image.fromarray(noise((24, 20, 3), np.uint8, seed)) for seed in (1, 2)]
    frames[0].save(tmp_path / "a.gif", save_all=True, append_images=frames[1:])
    whole = image.read(tmp_path / "a.gif").pixels
    data = (tmp_path / "a.gif").read_bytes()
    for share in (0.6, 0.75, 0.9, 0.99):
        (tmp_path / "a.gif").write_bytes(data[: int(len(data) * share)])
        np.testing.assert_array_equal(image.read(tmp_path / "a.gif").pixels, whole)


def test_a_damaged_resolution_is_left_out(tmp_path):
    pixels = noise((8, 9), np.uint8)
    tifffile.imwrite(tmp_path / "a.tif", pixels, resolution=(100, 200), resolutionunit="inch")
    with tifffile.TiffFile(tmp_path / "a.tif", mode="r+b") as file:
        file.pages.first.tags[282].overwrite((0, 0))
    found = image.read(tmp_path / "a.tif")
    assert found.metadata.dpi is None
    np.testing.assert_array_equal(found.pixels, pixels)


def test_the_previews_of_a_photo_are_no_frames(tmp_path):
    frames = [PIL.Image.fromarray(noise((24, 20, 3), np.uint8, seed)) for seed in (1, 2)]
    frames[0].save(tmp_path / "a.jpg", format="MPO", save_all=True, append_images=frames[1:])
    with PIL.Image.open(tmp_path / "a.jpg") as picture:
        assert picture.is_animated
    assert not image.read(tmp_path / "a.jpg").metadata.more


def test_that_a_tiff_has_more_pages_is_known(tmp_path):
    for pages in (1, 2):
        tifffile.imwrite(tmp_path / "a.tif", noise((pages, 8, 9), np.uint8), photometric="minisblack", metadata=None)
        assert image.read(tmp_path / "a.tif").metadata.more == (pages > 1)
