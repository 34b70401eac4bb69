# SPDX-License-Identifier: BSD-3-Clause
"""Colour profile, pixels per inch and EXIF go from the file that is read to the file that is written."""

import io

import numpy as np
import PIL.Image
import pytest
import tifffile
from click.testing import CliRunner
from PIL import ExifTags, ImageCms, TiffImagePlugin
from volumes import noise

from simdtex.cli import main
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
        assert said[0x010F] == "Camera" and dated[DATE] == "2026:01:02 03:04:05" and placed[2] == (1.0, 2.0, 3.0)
    assert not {WIDTH, INTEROP} & {*dated}, "which are those of another file"
    back = image.read(tmp_path / f"b.{out}")
    if out != "jpg":
        np.testing.assert_array_equal(back.pixels, pixels)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("channels", [1, 3, 5])
def test_a_tiff_of_every_kind_keeps_exif(tmp_path, dtype, channels):
    pixels, long = noise((240, 20, channels), np.uint8).astype(dtype), exif()
    long[0x8769] = {DATE: "2026:01:02 03:04:05", 0x829A: TiffImagePlugin.IFDRational(1, 200)}
    long[0x010E], long[0x8298] = "A caption of a photo", "Caf\u00e9".encode()
    image.write(tmp_path / "a.tif", pixels, image.Metadata(exif=long.tobytes(), dpi=(300, 200)))
    with tifffile.TiffFile(tmp_path / "a.tif") as file:
        np.testing.assert_array_equal(file.asarray(), pixels[..., 0] if channels == 1 else pixels)
        tags = file.pages.first.tags
        assert tags.keys() == sorted(tags.keys()) and tags["ExifTag"].value["ExposureTime"] == (1, 200)
        assert tags["GPSTag"].value["GPSLatitude"] == (1, 1, 2, 1, 3, 1) and tags["Make"].value == "Camera"
    back = image.read(tmp_path / "a.tif").metadata
    assert back.dpi == (300, 200)
    image.write(tmp_path / "b.png", pixels[..., 0].astype(np.uint8), back)
    _, _, said, dated, placed = of_file(tmp_path / "b.png")
    assert said[0x010E] == long[0x010E] and said[0x8298].encode("latin-1") == long[0x8298], "in whatever encoding"
    assert dated == {DATE: "2026:01:02 03:04:05", 0x829A: 0.005} and placed == {1: "N", 2: (1.0, 2.0, 3.0)}


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
