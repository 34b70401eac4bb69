"""Colour profile, pixels per inch and EXIF go from the file that is read to the file that is written."""

import io

import numpy as np
import PIL.Image
import PIL.ImageOps
import pytest
import tifffile
from click.testing import CliRunner
from PIL import ExifTags, ImageCms
from volumes import noise

from simdtex.commands import main
from simdtex.io import image

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
        dpi, found = picture.info.get("dpi"), picture.getexif()
        dated, placed = (dict(found.get_ifd(ifd)) if ifd in found else {} for ifd in (0x8769, 0x8825))
        return picture.info.get("icc_profile"), dpi and tuple(round(float(v)) for v in dpi), found, dated, placed


@pytest.mark.parametrize(
    ("kind", "out"),
    [
        *(("jpg", out) for out in ("png", "jpg", "webp", "tif", "deep.png")),
        ("png", "jpg"),
        ("webp", "png"),
        ("tif", "png"),
    ],
)
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
    if out != "jpg":
        np.testing.assert_array_equal(image.read(tmp_path / f"b.{out}").pixels, pixels)


def test_a_tiff_of_every_kind_keeps_the_texts_of_exif(tmp_path):
    long = exif()
    long[0x010E], long[0x8298] = "A caption of a photo", "Caf\u00e9".encode()
    for dtype, channels in (("uint8", 1), ("float32", 5)):
        pixels = noise((24, 20, channels), np.uint8).astype(dtype)
        image.write(tmp_path / "a.tif", pixels, image.Metadata(exif=long.tobytes(), dpi=(300, 200)))
        back = image.read(tmp_path / "a.tif").metadata
        assert back.dpi == (300, 200)
        image.write(tmp_path / "b.png", pixels[..., 0].astype(np.uint8), back)
        said = of_file(tmp_path / "b.png")[2]
        assert said[0x010F] == "Camera" and said[0x010E] == long[0x010E]
        assert said[0x8298].encode("latin-1") == long[0x8298], "in whatever encoding"


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


def test_the_preview_of_a_photo_does_not_show_what_was_there(tmp_path):
    preview, data = io.BytesIO(), exif().tobytes()[6:]
    PIL.Image.new("RGB", (4, 4)).save(preview, "JPEG")
    # a second directory with the place and the length of the preview, after the first
    more = b"\0\2" + b"\2\1\0\4" + b"\0\0\0\1" + (len(data) + 30).to_bytes(4, "big")
    more += b"\2\2\0\4" + b"\0\0\0\1" + len(preview.getvalue()).to_bytes(4, "big") + b"\0\0\0\0"
    whole = bytearray(data + more + preview.getvalue())
    link = 10 + 12 * int.from_bytes(whole[8:10], "big")
    whole[link : link + 4] = len(data).to_bytes(4, "big")
    PIL.Image.new("RGB", (9, 8)).save(tmp_path / "a.jpg", exif=b"Exif\0\0" + bytes(whole))
    with PIL.Image.open(tmp_path / "a.jpg") as picture:
        assert PREVIEW in picture.getexif().get_ifd(ExifTags.IFD.IFD1)
    read = image.read(tmp_path / "a.jpg")
    image.write(tmp_path / "b.jpg", read.pixels, read.metadata)
    with PIL.Image.open(tmp_path / "b.jpg") as picture:
        assert picture.getexif()[0x010F] == "Camera" and not picture.getexif().get_ifd(ExifTags.IFD.IFD1)


def test_exif_that_is_damaged_or_too_long_for_a_jpeg_is_left_out(tmp_path):
    for damaged in (b"Exif\0\0garbage", b"Exif\0\0MM\0*\0\0\xff\xff"):
        PIL.Image.new("RGB", (9, 8), "red").save(tmp_path / "a.png", exif=damaged)
        found = image.read(tmp_path / "a.png")
        assert found.pixels.shape == (8, 9, 3) and found.metadata.exif is None
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
    rgb, calls = PIL.Image.fromarray(noise((8, 9, 3), np.uint8)), []

    def convert(picture, profile, wanted, outputMode):
        calls.append((picture.mode, outputMode))
        return rgb

    rgb.convert("CMYK").save(tmp_path / "a.jpg", icc_profile=SRGB)
    rgb.convert("CMYK").save(tmp_path / "a.tif")
    for name in ("a.jpg", "a.tif"):  # a profile that does not fit is not used
        plain = image.read(tmp_path / name)
        assert plain.pixels.shape == (8, 9, 3) and plain.metadata.profile is None
    monkeypatch.setattr(ImageCms, "profileToProfile", convert)
    found = image.read(tmp_path / "a.jpg")
    assert calls == [("CMYK", "RGB")] and found.metadata.profile is None
    np.testing.assert_array_equal(found.pixels, np.asarray(rgb))


def test_a_tiff_says_pixels_per_centimetre_or_nothing(tmp_path):
    path, pixels = tmp_path / "a.tif", noise((8, 9), np.uint8)
    for unit, dpi in (("centimeter", (254, 508)), ("none", None), ("inch", (100, 200))):
        tifffile.imwrite(path, pixels, resolution=(100, 200), resolutionunit=unit)
        found = image.read(path).metadata.dpi
        assert (found and tuple(round(v) for v in found)) == dpi
    with tifffile.TiffFile(path, mode="r+b") as file:
        file.pages.first.tags[282].overwrite((0, 0))
    found = image.read(path)
    assert found.metadata.dpi is None and np.array_equal(found.pixels, pixels)
    PIL.Image.new("CMYK", (9, 8)).save(path)
    assert image.read(path).metadata.dpi is None


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


@pytest.mark.parametrize(
    "command, args",
    [
        ("fill", ["wide.jpg", "--mask", "mask.png", "--order", 2]),
        ("extend", ["wide.jpg", "--right", 2, "--order", 2]),
        ("synth", ["wide.jpg", "--size", "9x8", "--order", 2]),
        ("mix", ["wide.jpg", "wide.jpg", "--size", "16x16"]),
    ],
)
def test_an_output_has_the_colours_of_its_sample(folder, command, args):
    """The photo is turned once, and one line says that JPEG changes the known pixels."""
    result = run(folder, command, *args, "-o", "out.jpg", "-q")
    assert result.exit_code == 0, result.output
    profile, dpi, said, dated, _ = of_file(folder / "out.jpg")
    assert profile == WIDE and dpi == (200, 300)
    photographed = command in ("fill", "extend")  # a new picture was taken by no camera
    assert bool(said) == bool(dated) == photographed and 0x0112 not in said
    told = [line for line in result.output.splitlines() if "JPEG changes all pixels" in line]
    assert len(told) == photographed
    assert all(line.endswith("end its name in .png to keep the known pixels exactly") for line in told)


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


def test_known_values_have_the_colours_of_the_sample_and_without_a_profile_are_srgb(folder):
    known = np.full((8, 9, 3), np.nan)
    known[2, 3] = 7
    np.save(folder / "known.npy", known)
    args = ["wide.jpg", "--known", folder / "known.npy", "--size", "9x8", "--order", 2]
    result = run(folder, "synth", *args, "-o", "out.png")
    assert result.exit_code == 0, result.output
    assert of_file(folder / "out.png")[0] == WIDE and image.read(folder / "out.png").pixels[2, 3].tolist() == [7, 7, 7]
    (folder / "wells.csv").write_text("0,0,1,2,3\n")
    args = ["plain.png", "srgb.png", "--size", "9x8", "--order", 2, "--known", folder / "wells.csv"]
    result = run(folder, "synth", *args, "-o", "out.jpg", "-q")
    assert result.exit_code == 0 and result.output.count("JPEG changes all pixels") == 1, result.output


def test_only_the_first_frame_of_an_animation_is_read(folder):
    """One line says so. Damage to the second frame changes nothing; the preview in a photo is no frame."""
    frames = [PIL.Image.fromarray(noise((24, 20, 3), np.uint8, seed)) for seed in (1, 2)]
    frames[0].save(folder / "a.gif", save_all=True, append_images=frames[1:])
    result = run(folder, "synth", "a.gif", "--size", "9x8", "--order", 2, "-o", "out.png")
    assert result.exit_code == 0, result.output
    assert result.output.count("a.gif has several frames or pages; only the first is read") == 1
    whole, data = image.read(folder / "a.gif").pixels, (folder / "a.gif").read_bytes()
    for share in (0.6, 0.75, 0.9, 0.99):
        (folder / "a.gif").write_bytes(data[: int(len(data) * share)])
        np.testing.assert_array_equal(image.read(folder / "a.gif").pixels, whole)
    frames[0].save(folder / "a.gif")
    assert not image.read(folder / "a.gif").metadata.more
    frames[0].save(folder / "a.jpg", format="MPO", save_all=True, append_images=frames[1:])
    assert not image.read(folder / "a.jpg").metadata.more
