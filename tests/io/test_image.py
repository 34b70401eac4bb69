"""Pictures go from file to array and back without a value changed, and errors say what to do."""

import logging
import os
import stat
import struct

import imagecodecs
import numpy as np
import PIL.Image
import PIL.ImageOps
import pytest
import tifffile
from volumes import noise, png

from simdtex.io import image, volume
from simdtex.io.files import atomic_path

FORMATS = {
    ".png": (("uint8", "uint16"), (None, 1, 2, 3, 4)),
    ".tif": (("uint8", "float32"), (None, 2, 3, 4, 5)),
    ".tiff": (("uint16", "int32", "float16", "float64", "int64"), (3,)),
    ".bmp": (("uint8",), (None, 3)),
    ".webp": (("uint8",), (3, 4)),
    ".exr": (("float16", "float32"), (None, 1, 3)),
    ".npy": (("bool", "float64"), (None, 7)),
    ".NPY": ((">i4",), (1,)),
}
"""The table of formats: the types and the numbers of channels that each holds."""


@pytest.mark.parametrize("suffix", FORMATS)
def test_values_and_types_survive_a_file(tmp_path, suffix):
    path, (types, numbers) = tmp_path / f"picture{suffix}", FORMATS[suffix]
    for dtype, channels in ((dtype, channels) for dtype in types for channels in numbers):
        pixels = noise((11, 6) if channels is None else (11, 6, channels), dtype)
        image.write(path, pixels)
        picture = image.read(path)
        pixels = pixels[..., 0] if channels == 1 and suffix != ".NPY" else pixels
        assert picture.channel_axis == (-1 if pixels.ndim == 3 else None)
        assert picture.pixels.dtype == pixels.dtype.newbyteorder("=") and picture.pixels.dtype.isnative
        np.testing.assert_array_equal(picture.pixels, pixels)
    assert os.listdir(tmp_path) == [path.name]


def test_jpeg_is_close_and_bool_becomes_black_and_white(tmp_path):
    ramp = np.add.outer(np.arange(32), 2 * np.arange(40)).astype(np.uint8)
    for name, pixels in (("a.jpg", ramp), ("a.jpeg", np.stack([ramp] * 3, axis=-1))):
        image.write(tmp_path / name, pixels)
        back = image.read(tmp_path / name).pixels
        assert back.shape == pixels.shape and np.abs(back.astype(int) - pixels).max() <= 4
    pixels = noise((5, 7), bool)
    for suffix in (".png", ".tif", ".bmp"):
        image.write(tmp_path / f"a{suffix}", pixels)
        back = image.read(tmp_path / f"a{suffix}").pixels
        assert back.dtype == np.uint8
        np.testing.assert_array_equal(back if back.ndim == 2 else back[..., 0], pixels * 255)


@pytest.mark.parametrize(
    "suffix, transparent",
    [("png", None), ("gif", None), ("tif", None), ("bmp", None), ("gif", 2), ("png", b"\xff\x80\x00")],
)
def test_a_palette_is_read_as_indices_and_written_back(tmp_path, suffix, transparent):
    indices, colours = noise((8, 9), np.uint8) % 5, noise((5, 3), np.uint8, seed=2)
    colours[3] = colours[1]  # what colours could not tell apart
    picture = PIL.Image.fromarray(indices)
    picture.putpalette(colours.tobytes())
    picture.save(tmp_path / f"a.{suffix}", **{} if transparent is None else {"transparency": transparent})
    plain, found = (image.read(tmp_path / f"a.{suffix}", palette=palette) for palette in (False, True))
    assert plain.pixels.shape[2] in (3, 4) and plain.metadata.palette is None
    if transparent is None:
        np.testing.assert_array_equal(plain.pixels, colours[indices])
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
        with pytest.raises(ValueError, match="JPEG changes labels and categories: end its name in"):
            image.write(tmp_path / "b.jpg", found.pixels, found.metadata)
    else:
        np.testing.assert_array_equal(found.pixels[..., 0], indices)
        np.testing.assert_array_equal(found.pixels[..., 1], plain.pixels[..., 3])
        np.testing.assert_array_equal(image.coloured(found.pixels, found.metadata.palette), plain.pixels)


def test_alpha_is_dropped_only_where_opaque(tmp_path):
    for dtype, colours, suffix in (("uint8", 1, ".png"), ("uint16", 3, ".tif"), ("uint16", 1, ".png")):
        pixels = noise((6, 5, colours + 1), dtype)
        pixels[..., -1] = np.iinfo(dtype).max
        image.write(tmp_path / f"a{suffix}", pixels)
        kept = pixels[..., 0] if colours == 1 else pixels[..., :3]
        np.testing.assert_array_equal(image.read(tmp_path / f"a{suffix}").pixels, kept)
        pixels[2, 3, -1] = 0
        image.write(tmp_path / f"b{suffix}", pixels)
        np.testing.assert_array_equal(image.read(tmp_path / f"b{suffix}").pixels, pixels)
    grey = PIL.Image.fromarray(np.array([[0, 7], [7, 9]], np.uint8))
    grey.save(tmp_path / "a.png", transparency=7)
    np.testing.assert_array_equal(image.read(tmp_path / "a.png").pixels[..., 1], [[255, 0], [0, 255]])


@pytest.mark.parametrize("suffix", ["png", "tif", "jpg"])
def test_orientation_is_applied(tmp_path, suffix):
    for orientation in range(1, 9):
        picture = PIL.Image.fromarray(np.arange(6 * 4, dtype=np.uint8).reshape(6, 4) * 10)
        exif = picture.getexif()
        exif[0x0112] = orientation
        # turned in memory, for Pillow turns a TIFF already while it loads it
        expected = np.asarray(PIL.ImageOps.exif_transpose(picture)).astype(int)
        picture.save(tmp_path / f"a.{suffix}", exif=exif, quality=100)
        upright = image.read(tmp_path / f"a.{suffix}").pixels
        assert upright.shape == expected.shape
        assert np.abs(upright - expected).max() <= (2 if suffix == "jpg" else 0)


def test_a_16_bit_png_has_its_orientation_and_values_at_full_scale(tmp_path):
    """Whatever its significant bits are, which are those of the camera."""
    pixels = noise((6, 4, 3), np.uint16)
    exif = PIL.Image.Exif()
    exif[0x0112] = 6
    rows = b"".join(b"\0" + row.tobytes() for row in pixels.astype(">u2"))
    more = {"eXIf": exif.tobytes().removeprefix(b"Exif\0\0"), "sBIT": b"\x0c\x0c\x0c"}
    (tmp_path / "a.png").write_bytes(png(4, 6, 16, rows=rows, **more))
    np.testing.assert_array_equal(image.read(tmp_path / "a.png").pixels, np.rot90(pixels, -1))


def test_tiff_kinds(tmp_path):
    path, planar, grey = tmp_path / "a.tif", noise((3, 6, 4), np.uint16), noise((6, 4), np.uint8)
    tifffile.imwrite(path, planar, photometric="rgb", planarconfig="separate", byteorder=">")
    np.testing.assert_array_equal(image.read(path).pixels, np.moveaxis(planar, 0, -1))
    tifffile.imwrite(path, grey, photometric="miniswhite", compression="lzw")
    np.testing.assert_array_equal(image.read(path).pixels, 255 - grey)
    for pages in (1, 2):
        tifffile.imwrite(path, noise((pages, 8, 9), np.uint8), photometric="minisblack", metadata=None)
        assert image.read(path).metadata.more == (pages > 1)
    with tifffile.TiffWriter(path) as file:
        file.write(noise((8, 8, 3)), photometric="rgb", subfiletype=1, metadata=None)
        file.write(noise((32, 32), "uint16"), photometric="cfa", metadata=None)
    with pytest.raises(ValueError, match="is a camera's raw file: develop it to TIFF"):
        image.read(path)


def netpbm(kind, pixels, largest):
    """The bytes of a PGM or PPM, with comments in its header: as text for 2 and 3, binary for 5 and 6."""
    height, width = pixels.shape[:2]
    head = f"P{kind} # made by hand\n# of a scanner\n{width} {height}\n{largest}\n".encode()
    if kind < 4:
        return head + b"# more\n" + "\n".join(" ".join(map(str, row.ravel())) for row in pixels).encode()
    return head + pixels.astype(">u2" if largest > 255 else np.uint8).tobytes()


def test_netpbm_has_the_values_of_the_file(tmp_path):
    """A mask is white above half of the maximum in the header."""
    path = tmp_path / "a.pgm"
    for largest in (1, 3, 255, 256, 4095, 65535):
        for kind in (2, 5, 3, 6):
            shape = (4, 5) if kind in (2, 5) else (4, 5, 3)
            pixels = np.random.default_rng(largest).integers(0, largest, shape, endpoint=True)
            path.write_bytes(netpbm(kind, pixels, largest))
            found = image.read(path).pixels
            assert found.dtype == (np.uint8 if largest < 256 else np.uint16)
            np.testing.assert_array_equal(found, pixels)
            white = (pixels > (largest / 2 if pixels.max() > 1 else 0)).reshape(4, 5, -1).any(2)
            np.testing.assert_array_equal(image.read_mask(path, (4, 5)), white)
    for data in (b"P1 # text\n3 2\n1 0 1\n001", b"P4\n3 2\n\xa0\x20"):
        path.write_bytes(data)
        assert image.read(path).pixels.tolist() == [[0, 255, 0], [255, 255, 0]]


def test_a_png_of_few_bits_is_at_full_scale(tmp_path):
    """Also the grey that is transparent, which Pillow compares with scaled pixels, and no entry of a palette."""
    path = tmp_path / "a.png"
    for bits in (1, 2, 4):
        top = 2**bits - 1
        grey = np.array([[0, top, top // 2, top]] * 2)
        rows = [int("".join(f"{value:0{bits}b}" for value in row).ljust(16, "0"), 2).to_bytes(2, "big") for row in grey]
        rows = b"".join(b"\0" + row[: (4 * bits + 7) // 8] for row in rows)
        for more in ({}, {"tRNS": struct.pack(">H", top)}):
            path.write_bytes(png(4, 2, bits, 0, rows, **more))
            found = image.read(path).pixels
            np.testing.assert_array_equal(found[..., 0] if more else found, grey * (255 // top))
            if more:
                np.testing.assert_array_equal(found[..., 1], np.where(grey == top, 0, 255))
    picture = PIL.Image.fromarray(noise((8, 9, 3))).quantize(4)
    picture.save(path, bits=2, transparency=2)
    np.testing.assert_array_equal(image.read(path).pixels[..., 3], np.where(np.asarray(picture) == 2, 0, 255))


@pytest.mark.parametrize(("kind", "channels"), [("jp2", None), ("j2k", 3), ("avif", None), ("avif", 3)])
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
        pytest.importorskip("pillow_heif").from_pillow(picture).save(tmp_path / "a", quality=90)
    else:
        picture.save(tmp_path / "a", kind)
    found = image.read(tmp_path / "a").pixels
    assert found.shape == pixels.shape
    assert np.abs(found - pixels.astype(int)).max() <= (0 if kind in ("TGA", "JPEG2000") else 6)


def test_only_documented_formats_are_tried(tmp_path):
    """Pillow knows more, some of which start programs."""
    for kind in ("PCX", "SGI", "ICNS"):
        PIL.Image.new("RGB", (32, 32)).save(tmp_path / "a.png", kind)
        with pytest.raises(ValueError, match="is not an image: give a PNG"):
            image.read(tmp_path / "a.png")


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


@pytest.mark.parametrize(("dtype", "colours"), [("uint8", 1), ("uint16", 3), ("float32", 3)])
def test_colours_that_were_multiplied_by_alpha_are_divided(tmp_path, dtype, colours):
    full = 1 if dtype == "float32" else np.iinfo(dtype).max
    rng = np.random.default_rng(1)
    alpha = np.array([0, full // 2 or 0.5, full, full // 3 or 0.3]).repeat(6).reshape(4, 6, 1)
    plain = rng.integers(0, full, (4, 6, colours), endpoint=True) if full > 1 else rng.random((4, 6, colours))
    premultiplied = plain * (alpha / full) if full == 1 else np.rint(plain * (alpha / full))
    values = np.concatenate([premultiplied, alpha], -1).astype(dtype)
    how = {"photometric": "rgb" if colours == 3 else "minisblack", "planarconfig": 1}
    tifffile.imwrite(tmp_path / "a.tif", values, extrasamples=["unassalpha"], **how)
    np.testing.assert_array_equal(image.read(tmp_path / "a.tif").pixels, values)
    tifffile.imwrite(tmp_path / "a.tif", values, extrasamples=["assocalpha"], **how)
    found = image.read(tmp_path / "a.tif").pixels
    assert found.dtype == dtype and (found[0, :, :-1] == 0).all()
    np.testing.assert_array_equal(found[..., -1:], alpha.astype(dtype))
    np.testing.assert_array_equal(found[2], values[2])
    tolerance = 2.0 if full > 1 else 1e-6  # of an alpha of a third, and rounded before and after
    assert np.abs(found[1:, :, :-1].astype(float) - plain[1:]).max() <= tolerance


def test_divided_colours_are_rounded_and_no_more_than_white(tmp_path):
    values = np.array([[[100, 150], [7, 200], [200, 100], [9, 0]]], np.uint8)
    tifffile.imwrite(tmp_path / "a.tif", values, photometric="minisblack", extrasamples=["assocalpha"], planarconfig=1)
    assert image.read(tmp_path / "a.tif").pixels.tolist() == [[[170, 150], [9, 200], [255, 100], [0, 0]]]


def test_damaged_files_get_one_sentence(tmp_path, caplog):
    for name, dtype in [*((f"a{s}", "uint8") for s in (".png", ".tif", ".jpg", ".bmp", ".webp")), ("b.png", "uint16")]:
        image.write(tmp_path / name, noise((40, 30, 3), dtype))
        data = (tmp_path / name).read_bytes()
        for share in (0.02, 0.5, 0.95):
            (tmp_path / name).write_bytes(data[: max(9, int(len(data) * share))])
            with pytest.raises(ValueError, match=name) as said:
                image.read(tmp_path / name)
            assert "\n" not in str(said.value)
        (tmp_path / name).write_bytes(data)
    data = bytearray((tmp_path / "a.tif").read_bytes())
    data[8:60] = bytes(range(52))
    (tmp_path / "a.tif").write_bytes(data)
    np.save(tmp_path / "o.npy", np.array([{}, {}], object), allow_pickle=True)
    for name in ("a.tif", "o.npy"):
        with pytest.raises(ValueError, match="cannot be read as an image"):
            image.read(tmp_path / name)
    np.save(tmp_path / "line.npy", np.zeros(4))
    with pytest.raises(ValueError, match=r"line\.npy: the picture has the shape \(4,\)"):
        image.read(tmp_path / "line.npy")
    assert [r.message for r in caplog.records if r.levelno >= logging.WARNING] == []


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
    ("dtype", "alpha"),
    [("uint8", [0, 127, 128, 255]), ("uint16", [0, 32767, 32768, 65535]), ("float32", [0, np.nan, 0.5, 1])],
)
def test_split_alpha(dtype, alpha):
    for colours in (1, 3):
        picture = noise((2, 2, colours + 1), dtype)
        picture[..., -1] = np.array(alpha).reshape(2, 2)
        pixels, mask = image.split_alpha(picture)
        assert pixels.dtype == picture.dtype and mask.dtype == bool and mask.ravel().tolist() == [1, 1, 0, 0]
        np.testing.assert_array_equal(pixels, picture[..., 0] if colours == 1 else picture[..., :3])
    assert image.split_alpha(picture, opaque=True)[1].ravel().tolist() == [1, 1, 1, 0]
    for check in (image.split_alpha, lambda pixels: image.write("a.npy", pixels)):
        with pytest.raises(TypeError, match="complex128 values; convert it to integers or real floats"):
            check(np.zeros((2, 2, 4), complex))
        with pytest.raises(ValueError, match="has the shape"):
            check(np.zeros(4))


MASKS = {
    "grey.png": (np.array([[0, 127, 128, 255]], np.uint8), [0, 0, 1, 1]),
    "grey16.png": (np.array([[0, 32767, 32768, 65535]], np.uint16), [0, 0, 1, 1]),
    "float.tif": (np.array([[0, 0.5, 0.51, 1]], np.float32), [0, 0, 1, 1]),
    "bool.npy": (np.array([[False, False, True, True]]), [0, 0, 1, 1]),
    "colour.png": (np.array([[[0, 0, 0], [9, 127, 0], [0, 0, 128], [255, 255, 255]]], np.uint8), [0, 0, 1, 1]),
    "alpha.png": (np.array([[[0, 255], [200, 127], [200, 128], [255, 255]]], np.uint8), [0, 0, 1, 1]),
    "rgba.png": (np.array([[[0] * 4, [255] * 3 + [0], [0, 255, 0, 200], [255] * 4]], np.uint8), [0, 0, 1, 1]),
    "ones.png": (np.array([[0, 1, 0, 1]], np.uint8), [0, 1, 0, 1]),
    "NaN.npy": (np.array([[0, np.nan, 1, -1]]), [0, 0, 1, 0]),
    "all.npy": (np.ones((1, 4, 1)), [1, 1, 1, 1]),
}


def test_read_mask(tmp_path):
    for name, (pixels, expected) in MASKS.items():
        image.write(tmp_path / name, pixels)
        mask = image.read_mask(tmp_path / name, (1, 4, 3))
        assert mask.dtype == bool and mask.tolist() == [expected], name
    with pytest.raises(ValueError, match=r"all\.npy: .*is 4 x 1 pixels .* must be 1 x 4: bring"):
        image.read_mask(tmp_path / "all.npy", (4, 1))


def test_check_sample_brings_channels_last():
    pixels = noise((3, 5, 4), ">u2")
    checked = image.check_sample(pixels, 0)
    assert checked.shape == (5, 4, 3) and checked.dtype == np.uint16 and checked.flags.c_contiguous
    np.testing.assert_array_equal(checked[..., 1], pixels[1])
    assert image.check_sample([[1, 2], [3, 4]], None).shape == (2, 2, 1)


def test_sizes():
    for text, shape in {"640x480": (480, 640), " 7 X 99999999 ": (99999999, 7), "12": (12, 12)}.items():
        assert image.parse_size(text) == shape
    for text in ("", "0", "0x5", "5x0", "-3x4", "3x", "x3", "1x2x3", "a", "1.5", "9" * 9):
        with pytest.raises(ValueError, match="WIDTHxHEIGHT"):
            image.parse_size(text)
    multiples = {"2x": (42, 10), "150%": (32, 8), "0.5 X": (10, 2), "1.\u00d7": (21, 5), "2x3": (2, 3)}
    for text, sides in multiples.items():
        assert image.parse_sides(text, "WIDTHxHEIGHT", (21, 5)) == sides
    for text in ("0x", "0.01x", "-1x", "x", "2y", "1e3%", "99999999x"):
        with pytest.raises(ValueError, match="or 2x or 200% of the sample"):
            image.parse_sides(text, "WIDTHxHEIGHT", (21, 5))


def test_formats_that_cannot_hold_the_pixels(tmp_path):
    for name, dtype, channels, remedy in (
        ("a.jpg", "uint16", 3, ".png"),
        ("a.png", "float32", 3, ".tif"),
        ("a.png", "uint8", 5, ".tif"),
        ("a.jpg", "uint8", 4, ".png"),
        ("a.tif", "longdouble", 1, ".npy"),
    ):
        with pytest.raises(ValueError, match=rf"cannot hold .* in \{remedy} instead"):
            image.check_writable(tmp_path / name, dtype, channels)
        with pytest.raises(ValueError, match="cannot hold"):
            image.write(tmp_path / name, np.zeros((2, 2, channels), dtype))
        image.check_writable(tmp_path / f"a{remedy}", dtype, channels)
    assert os.listdir(tmp_path) == []


def test_places_that_cannot_be_written(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    for path, words in [
        (tmp_path / "none" / "a.png", "the folder .* does not exist"),
        (tmp_path / "file" / "a.png", "the folder .* does not exist"),
        (tmp_path / "a.xyz", "ends in .xyz"),
        (tmp_path / "a", "has no suffix"),
        (tmp_path, "is a folder"),
        (tmp_path / ("a" * 300 + ".png"), "cannot be written"),
        ("/dev/null", "not a regular file"),
    ]:
        with pytest.raises(ValueError, match=words):
            image.check_writable(path, np.uint8, 3)
    image.check_writable(tmp_path / "a.npz", suffixes={".npz"})
    with pytest.raises(ValueError, match=r"\.npz"):
        image.check_writable(tmp_path / "a.png", suffixes={".npz"})
    monkeypatch.setattr(os, "access", lambda *_: False)  # root may write anywhere
    with pytest.raises(ValueError, match="not writable"):
        image.check_writable(tmp_path / "a.png")


def test_a_file_has_the_usual_permissions_or_those_of_the_replaced_one(tmp_path):
    (tmp_path / "usual").touch()
    (tmp_path / "link.png").symlink_to(tmp_path / "real.png")
    image.write(tmp_path / "link.png", np.zeros((2, 2), np.uint8))
    assert (tmp_path / "link.png").is_symlink()
    modes = [stat.S_IMODE((tmp_path / name).stat().st_mode) for name in ("usual", "real.png")]
    assert modes[0] == modes[1]
    path, folder = tmp_path / "a.png", tmp_path / "slices"
    path.touch()
    folder.mkdir()
    for mode in (0o600, 0o444):
        path.chmod(mode)
        folder.chmod(mode | 0o300)
        image.write(path, np.zeros((2, 2), np.uint8))
        volume.write(folder, np.zeros((2, 2, 2), np.uint8))
        assert stat.S_IMODE(path.stat().st_mode) == mode
        assert stat.S_IMODE(folder.stat().st_mode) == mode | 0o300
    with atomic_path(path) as temporary:
        assert stat.S_IMODE(temporary.stat().st_mode) == 0o600, "and is read by no others meanwhile"


def test_to_display():
    assert image.to_display(np.array([0, 3, 255], np.uint8)).tolist() == [0, 3, 255]
    assert image.to_display(np.array([False, True])).tolist() == [0, 255]
    values = np.array([-5.0, 0.0, 5.0, 10.0, 20.0])
    assert image.to_display(values, (0.0, 10.0)).tolist() == [0, 0, 128, 255, 255]
    assert image.to_display(np.array([0, 65535], np.uint16)).tolist() == [0, 255]
    assert image.to_display(np.full(2, 7.0)).tolist() == [128, 128]
    assert image.to_display(np.array([-1.7e308, 1.7e308])).tolist() == [0, 255]
