"""``simdtex fill``, ``extend`` and ``tile``, of pictures and of folders of maps."""

import os

import numpy as np
import pytest
from commands import contents, pixels, refused, run

import simdtex
from simdtex.io import image
from simdtex.io.files import NotWritten
from simdtex.model.source_map import apply_source_map, load_source_map

OPTIONS = {"order": 2, "rng": 5, "device": "reference"}
QUICK = ["--order", 2, "--seed", 5, "--device", "reference"]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A picture, a map of the same material, a mask, and textures to fill with."""
    monkeypatch.chdir(tmp_path)
    rng, mask = np.random.default_rng(1), np.zeros((24, 32), np.uint8)
    mask[8:14, 10:17] = 255
    noise = rng.integers(0, 256, (24, 32, 3), dtype=np.uint8)
    pictures = {
        "photo.png": noise,
        "normal.png": rng.integers(0, 65536, (24, 32, 3), dtype=np.uint16),
        "mask.png": mask,
        "inverse.png": 255 - mask,
        "texture.png": rng.integers(0, 256, (20, 16, 3), dtype=np.uint8),
        "another.png": rng.integers(0, 256, (16, 20, 3), dtype=np.uint8),
        "holed.tif": np.where(mask > 0, np.float32(np.nan), noise[..., 0]).astype(np.float32),
        "photo-3x3.png": noise,
    }
    for name, picture in pictures.items():
        image.write(name, picture)
    return mask > 0


def small(*words):
    done = run(*words, *QUICK)
    assert done.exit_code == 0, done.output
    return done.output


def test_fill_gives_the_bytes_of_the_function(folder):
    said = small("fill", "photo.png", "--mask", "mask.png", "-o", "out.png", "--reach", 6, "--structure", 0.5)
    assert "42 of 768 pixels" in said and "seed 5" in said
    wanted = simdtex.fill(pixels("photo.png"), folder, channel_axis=-1, reach=6, structure=0.5, **OPTIONS)
    assert np.array_equal(pixels("out.png"), wanted)
    mask = ["--mask", "inverse.png", "--invert", "--grow", 1, "--feather", 2]
    assert "136 of 768 pixels filled" in small("fill", "photo.png", *mask, "-o", "out.png")
    wanted = simdtex.fill(pixels("photo.png"), folder, channel_axis=-1, grow=1, feather=2, **OPTIONS)
    assert np.array_equal(pixels("out.png"), wanted)


def test_what_is_not_opaque_or_nan_is_filled_and_alpha_beside_a_mask_is_a_channel(folder):
    cut = np.dstack([pixels("photo.png"), np.where(folder, 0, 255).astype(np.uint8)])
    cut[5:17, 7:20, :3], cut[0, 0, 3] = (0, 255, 0), 254
    cut[5:17, 7:20, 3] = np.minimum(cut[5:17, 7:20, 3], 200)
    image.write("cut.png", cut)
    assert small("fill", "cut.png", "-o", "out.png", "-q") == ""
    hole = cut[..., 3] < 255
    assert np.array_equal(pixels("out.png"), simdtex.fill(cut[..., :3], hole, channel_axis=-1, **OPTIONS))
    small("fill", "holed.tif", "-o", "out.tif")
    assert np.array_equal(pixels("out.tif"), simdtex.fill(pixels("holed.tif"), **OPTIONS))
    image.write("hole.png", np.where(hole, 255, 0).astype(np.uint8))
    small("fill", "cut.png", "--mask", "hole.png", "-o", "out.npy")
    assert (pixels("out.npy")[..., 3] == 255).all()


def test_a_volume_leads_to_simulate(folder):
    image.write("layers.npy", np.zeros((24, 32, 40), np.uint8))
    np.save("volume.npy", np.zeros((4, 24, 32, 1), np.uint8))
    refused("is a volume: use simdtex simulate", "extend", "volume.npy", "-o", "out.npy", "--left", 3, *QUICK)
    done = run("synth", "layers.npy", "-o", "layers.png", *QUICK)
    assert done.exit_code == 2 and "a picture of 40 channels; for a volume use simdtex simulate" in done.output


def test_fill_with_other_textures(folder):
    args = ["--mask", "mask.png", "-o", "out.png", "--sample", "texture.png", "--sample", "another.png"]
    small("fill", "photo.png", *args, "--source-map", "s.npz", "--shares", "1,3")
    how = {"channel_axis": -1, "shares": (1, 3), "full_output": True} | OPTIONS
    textures = [pixels("texture.png"), pixels("another.png")]
    made, output = simdtex.fill(pixels("photo.png"), folder, sample=textures, **how)
    assert np.array_equal(pixels("out.png"), made) and np.array_equal(load_source_map("s.npz"), output.source)


def test_extend_gives_the_bytes_of_the_function(folder):
    said = small("extend", "photo.png", "-o", "out.png", "--left", 3, "--right", 2, "--top", 1, "--bottom", 4)
    assert "37x29 from 32x24" in said
    wanted = simdtex.extend(pixels("photo.png"), left=3, right=2, top=1, bottom=4, channel_axis=-1, **OPTIONS)
    assert np.array_equal(pixels("out.png"), wanted)
    small("extend", "photo.png", "-o", "out.png", "--size", "37x29")
    wanted = simdtex.extend(pixels("photo.png"), right=5, bottom=5, channel_axis=-1, **OPTIONS)
    assert np.array_equal(pixels("out.png"), wanted)


@pytest.mark.parametrize(("command", "flag", "tile"), [("extend", "--seamless", "y"), ("tile", "--direction", "x")])
def test_a_picture_and_its_maps_become_seamless(folder, command, flag, tile):
    args = ["photo.png", "-o", "out.png", flag, tile, "--band", 3, "--also", "normal.png=normal-out.png"]
    small(command, *args, "--source-map", "s.png", "--preview")
    made = pixels("out.png")
    assert np.array_equal(made, simdtex.extend(pixels("photo.png"), seamless=tile, band=3, channel_axis=-1, **OPTIONS))
    assert np.array_equal(pixels("out-3x3.png"), np.tile(made, (3, 3, 1)))
    assert np.array_equal(pixels("normal-out.png"), apply_source_map(load_source_map("s.png"), pixels("normal.png")))


MASKED, PHOTO = ["fill", "photo.png", "--mask", "mask.png", "-o", "out.png"], ["photo.png", "-o", "out.png"]
BAD_PICTURES = [
    (["fill", *PHOTO], "give a mask"),
    ([*MASKED, "--sample", "texture.png", "--also", "normal.png=n.png"], "leave --also out"),
    (["fill", "photo.png", "-o", "out.png", "--invert"], "--invert requires --mask"),
    ([*MASKED, "--weights", "much"], "numbers separated by commas"),
    (["extend", *PHOTO, "--size", "30x40"], "smaller than the picture of 32x24"),
    (["extend", *PHOTO, "--size", "40x40", "--left", 3], "--size cannot be used with --left"),
    (["extend", *PHOTO, "--seamless", "z"], "--seamless z must be x, y or both"),
    (["extend", *PHOTO, "--band", 3], "--band requires --seamless"),
    (["tile", "photo-3x3.png", "-o", "photo.png", "--preview"], "photo-3x3.png is an input and would be"),
]


@pytest.mark.parametrize(("args", "words"), BAD_PICTURES)
def test_bad_input_gets_one_sentence_and_writes_nothing(folder, args, words):
    refused(words, *args, *QUICK)


# -- Folders of maps

NAMES = {"brick_albedo.png", "brick_normal.png", "Brick-Roughness.tif", "height.npy", "brick_ao.png"}
SEAMLESS = ["--seamless", "--band", 3]
TO = ["-o", "tiled", *SEAMLESS]


@pytest.fixture
def material(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "brick").mkdir()
    rng = np.random.default_rng(1)
    normal = rng.normal(size=(20, 24, 3))
    normal[..., 2] = np.abs(normal[..., 2])
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    maps = {
        "brick_albedo.png": rng.integers(0, 256, (20, 24, 3), dtype=np.uint8),
        "brick_normal.png": np.round((normal + 1) / 2 * 65535).astype(np.uint16),
        "Brick-Roughness.tif": rng.integers(0, 65536, (20, 24), dtype=np.uint16),
        "height.npy": rng.random((20, 24), dtype=np.float32),
        "brick_ao.jpg": rng.integers(0, 256, (20, 24), dtype=np.uint8),
    }
    for name, one in maps.items():
        image.write(tmp_path / "brick" / name, one)
    return tmp_path


def files(path):
    return {one.name for one in path.iterdir()}


@pytest.mark.parametrize("command", ["extend", "synth", "fill"])
def test_all_maps_are_arranged_by_the_albedo(material, command):
    albedo, hole = pixels("brick", "brick_albedo.png"), np.zeros((20, 24), bool)
    more = {"extend": SEAMLESS, "synth": ["--size", "150%"], "fill": []}[command]
    if command == "extend":
        made = simdtex.extend(albedo, seamless=True, band=3, channel_axis=-1, **OPTIONS)
    elif command == "synth":
        made = simdtex.synthesize(albedo, (30, 36), channel_axis=-1, **OPTIONS)
    else:
        hole[6:13, 8:16] = True
        made = simdtex.fill(albedo, hole, channel_axis=-1, **OPTIONS)
        image.write("brick/brick_albedo.png", np.dstack([albedo, np.where(hole, 130, 255).astype(np.uint8)]))
    said = small(command, "brick", "-o", "tiled", *more, "--source-map", "s.npz")
    assert said.startswith("tiled (5 maps arranged by brick_albedo.png): ")
    assert files(material / "tiled") == NAMES
    np.testing.assert_array_equal(pixels("tiled", "brick_albedo.png"), made)
    source = load_source_map("s.npz")
    for name in NAMES - {"brick_albedo.png"}:
        before, after = pixels("brick", name.replace("ao.png", "ao.jpg")), pixels("tiled", name)
        assert after.dtype == before.dtype
        np.testing.assert_array_equal(after, apply_source_map(source, before))


def test_a_map_that_is_named_decides_and_mixed_normals_have_length_1(material):
    assert "arranged by brick_normal.png" in small("extend", "brick/brick_normal.png", *TO, "--source-map", "s.npz")
    before, after = pixels("brick", "brick_normal.png"), pixels("tiled", "brick_normal.png")
    mixed = simdtex.extend(before, seamless=True, band=3, channel_axis=-1, **OPTIONS)
    length = np.linalg.norm(mixed / 65535 * 2 - 1, axis=2)
    assert (np.abs(length - 1) > 0.01).any(), "else there is nothing to see"
    np.testing.assert_allclose(np.linalg.norm(after / 65535 * 2 - 1, axis=2), 1, atol=1e-4)
    same = (mixed == apply_source_map(load_source_map("s.npz"), before)).all(axis=2)
    np.testing.assert_array_equal(after[same], before[same])
    small("extend", "brick/brick_albedo.png", "-o", "out.png", *SEAMLESS)
    assert (material / "out.png").is_file(), "a picture beside other maps is still one picture"


def test_a_map_of_one_of_several_materials_or_variants(material):
    os.rename("brick/height.npy", "brick/brick_height.npy")
    image.write("brick/tile_albedo.png", np.zeros((3, 3), np.uint8))
    words = "brick holds 2 materials: instead of it give a map of one, such as brick/brick_albe"
    refused(words, "extend", "brick", *TO, *QUICK)
    assert "5 maps arranged by brick_albedo.png" in small("extend", "brick/brick_albedo.png", *TO)
    os.remove("brick/tile_albedo.png")
    image.write("brick/brick_color_var2.png", pixels("brick", "brick_albedo.png")[::-1])
    refused("brick_albedo.png and brick_color_var2.png are both albedo maps: give the", "extend", "brick", *TO, *QUICK)
    assert "6 maps arranged by brick_color" in small("extend", "brick", "--map", "albedo=brick_color_var2.png", *TO)


def test_a_role_that_the_name_does_not_show_and_what_has_none(material):
    os.rename("brick/brick_albedo.png", "brick/one.png")
    os.rename("brick/brick_normal.png", "brick/two.png")
    image.write("brick/preview.png", np.zeros((3, 3), np.uint8))
    (material / "brick" / "licence.txt").touch()
    said = small("extend", "brick", *TO, "--map", "albedo=one.png", "--map", "normal-dx=brick/two.png")
    assert "simdtex: left out, because the name does not show the kind of map: preview.png\n" in said
    assert "5 maps arranged by one.png" in said
    assert files(material / "tiled") == NAMES - {"brick_albedo.png", "brick_normal.png"} | {"one.png", "two.png"}


def test_an_earlier_output_is_replaced_and_nothing_else_and_all_maps_or_none(material, monkeypatch):
    small("extend", "brick", *TO)
    small("extend", "brick", "-o", "tiled", "--right", 4)
    assert pixels("tiled", "brick_albedo.png").shape[1] == 28
    before, real = contents(), image.write

    def fails(path, *given):
        if "height" in str(path):
            raise NotWritten("the disk is full")
        real(path, *given)

    with monkeypatch.context() as patch:
        patch.setattr(image, "write", fails)
        done = run("extend", "brick", *TO, *QUICK)
    assert done.exit_code == 2 and "the disk is full" in done.output and contents() == before
    (material / "tiled" / "scene.blend").touch()
    refused("holds other files (scene.blend): give an empty", "extend", "brick", *TO, *QUICK)


def test_a_map_that_is_a_link_into_the_output_is_refused(material):
    (material / "tiled").mkdir()
    os.rename("brick/brick_normal.png", "tiled/brick_normal.png")
    (material / "brick" / "brick_normal.png").symlink_to(material / "tiled" / "brick_normal.png")
    refused("is an input and is in tiled, which would be replaced", "extend", "brick", *TO, *QUICK)


BAD = [
    ("", ["extend", "brick", *TO, "--map", "gold=height.npy"], "--map names the role gold; give one of the"),
    ("", ["fill", "brick", *TO[:2], "--map", "ao=x.png"], "brick/x.png"),
    ("a.png", ["synth", "a.png", "-o", "b.png", "--map", "ao=a.png"], "--map requires a folder"),
    ("", ["fill", "brick", "-o", "t", "--sample", "brick/brick_ao.jpg"], "cannot be filled with --sample"),
    ("brick/opacity.png", ["extend", "brick", *TO], "opacity.png is 5x4 and brick_albedo.png 24x20"),
    ("brick/brick_ao.png", ["extend", "brick", *TO], "tiled/brick_ao.png would be written twice: move one of the maps"),
    ("none/b_normal.png", ["extend", "none", *TO], "has no albedo: give --map albedo=FILE"),
    ("none/b.png", ["extend", "none", *TO], "no albedo (b.png is of unknown kind): give"),
    ("", ["synth", "brick", "-o", "out.zarr"], "give a folder for the output"),
    ("", ["extend", "brick", "-o", "brick/tiled", *SEAMLESS], "is an input"),
    ("", ["synth", "brick", "-o", "t", "--method", "pyramid"], "takes no pixel from the sample; give one"),
    ("", ["synth", "brick", "brick/height.npy", "-o", "t"], "brick is a folder"),
]


@pytest.mark.parametrize(("extra", "args", "said"), BAD)
def test_bad_folders_get_one_sentence(material, extra, args, said):
    if extra:
        (material / extra).parent.mkdir(exist_ok=True)
        shape = (20, 24) if "ao" in extra else (4, 5)
        image.write(extra, np.zeros(shape, np.uint8))
    refused(said, *args, *QUICK)
