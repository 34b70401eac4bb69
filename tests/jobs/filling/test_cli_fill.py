"""``simdtex fill``, ``extend`` and ``tile``, of pictures and of folders of maps."""

import os

import numpy as np
import pytest
from commands import contents, pixels, refused, run

import simdtex
from simdtex import checkpoint as checkpoints
from simdtex.cli.inputs import Folder
from simdtex.io import image
from simdtex.io.files import NotWritten
from simdtex.model.source_map import apply_source_map, load_source_map

# -- ``simdtex fill`` and ``simdtex extend``, end to end.

OPTIONS = {"order": 2, "device": "reference"}
QUICK = ["--order", 2, "--seed", 5, "--device", "reference"]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A picture, a map of the same material, a mask, and textures to fill with."""
    rng = np.random.default_rng(1)
    noise = rng.integers(0, 256, (24, 32, 3), dtype=np.uint8)
    mask = np.zeros((24, 32), np.uint8)
    mask[8:14, 10:17] = 255
    image.write(tmp_path / "photo.png", noise)
    image.write(tmp_path / "normal.png", rng.integers(0, 65536, (24, 32, 3), dtype=np.uint16))
    image.write(tmp_path / "mask.png", mask)
    image.write(tmp_path / "cut.png", np.dstack([np.where(mask[..., None] > 0, 9, noise), 255 - mask]).astype(np.uint8))
    image.write(tmp_path / "texture.png", rng.integers(0, 256, (20, 16, 3), dtype=np.uint8))
    image.write(tmp_path / "another.png", rng.integers(0, 256, (16, 20, 3), dtype=np.uint8))
    image.write(tmp_path / "grey.png", noise[..., 0])
    image.write(tmp_path / "black.png", np.zeros((24, 32), np.uint8))
    image.write(tmp_path / "small.png", mask[:20])
    holed = noise[..., 0].astype(np.float32)
    holed[mask > 0] = np.nan
    image.write(tmp_path / "holed.tif", holed)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def small(*words):
    return run(*words, *QUICK)


def test_fill_gives_the_bytes_of_the_function(folder):
    args = ("photo.png", "--mask", "mask.png", "-o", "out.png", "--reach", 6, "--structure", 0.5)
    result = small("fill", *args)
    assert result.exit_code == 0, result.output
    assert "42 of 768 pixels" in result.output and "seed 5" in result.output
    photo, hole = pixels("photo.png"), pixels("mask.png") > 0
    wanted = simdtex.fill(photo, hole, channel_axis=-1, rng=5, reach=6, structure=0.5, **OPTIONS)
    made = pixels("out.png")
    assert np.array_equal(made, wanted)
    assert np.array_equal(made[~hole], photo[~hole]) and not np.array_equal(made, photo)


def test_what_is_transparent_is_a_mask(folder):
    small("fill", "photo.png", "--mask", "mask.png", "-o", "masked.png", "-q")
    result = small("fill", "cut.png", "-o", "out.png", "-q")
    assert result.exit_code == 0 and result.output == ""
    made = pixels("out.png")
    assert made.shape == (24, 32, 3)
    assert np.array_equal(made, pixels("masked.png"))


def test_what_is_not_opaque_is_filled(folder):
    cut = pixels("cut.png").copy()
    cut[5:17, 7:20, :3], cut[5:17, 7:20, 3] = (0, 255, 0), 200
    cut[8:14, 10:17, 3], cut[0, 0, 3] = 0, 254
    image.write(folder / "soft.png", cut)
    assert small("fill", "soft.png", "-o", "out.png").exit_code == 0
    made = pixels("out.png")
    assert not (made == (0, 255, 0)).all(-1).any()
    assert np.array_equal(made[cut[..., 3] == 255], cut[cut[..., 3] == 255][:, :3])


def test_inverted_widened_and_blended(folder):
    image.write(folder / "inverse.png", 255 - pixels("mask.png"))
    for name, mask in (("a.png", ["mask.png"]), ("b.png", ["inverse.png", "--invert"])):
        result = small("fill", "photo.png", "--mask", *mask, "-o", name, "--grow", 1, "--feather", 2)
        assert result.exit_code == 0 and "136 of 768 pixels filled" in result.output, result.output
    photo, hole = pixels("photo.png"), pixels("mask.png") > 0
    made = simdtex.fill(photo, hole, channel_axis=-1, rng=5, grow=1, feather=2, **OPTIONS)
    assert np.array_equal(pixels("a.png"), made) and np.array_equal(pixels("b.png"), made)


@pytest.mark.parametrize(
    ("command", "more"), [("fill", ["--mask", "mask.png"]), ("extend", ["--left", 3]), ("synth", [])]
)
def test_a_volume_leads_to_simulate(folder, command, more):
    image.write(folder / "layers.npy", np.zeros((24, 32, 40), np.uint8))
    np.save(folder / "volume.npy", np.zeros((4, 24, 32, 1), np.uint8))
    refused("is a volume: use simdtex simulate", command, "volume.npy", "-o", "out.npy", *more, *QUICK)
    result = small(command, "layers.npy", "-o", "layers.png", *more)
    assert result.exit_code == 2 and "a picture of 40 channels; for a volume use simdtex simulate" in result.output


def test_alpha_beside_a_mask_is_a_channel(folder):
    assert small("fill", "cut.png", "--mask", "mask.png", "-o", "out.npy").exit_code == 0
    made, cut = pixels("out.npy"), pixels("cut.png")
    assert made.shape == (24, 32, 4) and (made[..., 3] == 255).all()
    assert np.array_equal(made[cut[..., 3] > 0], cut[cut[..., 3] > 0])


def test_nan_is_a_mask(folder):
    assert small("fill", "holed.tif", "-o", "out.tif").exit_code == 0
    made, holed = pixels("out.tif"), pixels("holed.tif")
    assert np.array_equal(made[~np.isnan(holed)], holed[~np.isnan(holed)])
    assert np.array_equal(made, simdtex.fill(holed, rng=5, **OPTIONS))
    assert not np.isnan(made).any()


def test_fill_carries_other_maps_along(folder):
    args = ["--mask", "mask.png", "-o", "out.png", "--also", "normal.png=normal-out.png", "--source-map", "s.npz"]
    result = small("fill", "photo.png", *args, "--finish", 0)
    assert result.exit_code == 0, result.output
    source = load_source_map(folder / "s.npz")
    for name, out in (("photo.png", "out.png"), ("normal.png", "normal-out.png")):
        assert np.array_equal(pixels(out), pixels(name)[source[..., 0], source[..., 1]])
    hole = pixels("mask.png") > 0
    assert np.array_equal(pixels("normal-out.png")[~hole], pixels("normal.png")[~hole])


def test_fill_with_other_textures(folder):
    args = ["--mask", "mask.png", "-o", "out.png", "--sample", "texture.png", "--sample", "another.png"]
    result = small("fill", "photo.png", *args, "--source-map", "s.npz", "--finish", 0, "--shares", "1,3")
    assert result.exit_code == 0, result.output
    source, hole = load_source_map(folder / "s.npz"), pixels("mask.png") > 0
    textures = [pixels("texture.png"), pixels("another.png")]
    made = pixels("out.png")
    assert (source[~hole] == -1).all()
    assert {int(number) for number in source[hole][:, 2]} == {0, 1}
    for row, col in np.argwhere(hole):
        i, j, number = source[row, col]
        assert np.array_equal(made[row, col], textures[number][i, j])


MASKED = ["photo.png", "--mask", "mask.png", "-o", "out.png"]
BAD_FILL = {
    "no alpha and no mask": (["photo.png", "-o", "out.png"], "give a mask"),
    "a mask of nothing": (["photo.png", "--mask", "black.png", "-o", "out.png"], "nothing to fill"),
    "maps beside a sample": ([*MASKED, "--sample", "texture.png", "--also", "normal.png=n.png"], "leave --also out"),
    "a map of another size": ([*MASKED, "--also", "small.png=n.png"], "32x24"),
    "a source map that holds no -1": ([*MASKED, "--sample", "texture.png", "--source-map", "s.png"], ".npz"),
    "inverted alpha": (["cut.png", "-o", "out.png", "--invert"], "--invert requires --mask"),
    "weights in words": ([*MASKED, "--weights", "much"], "numbers separated by commas"),
}


@pytest.mark.parametrize("case", BAD_FILL)
def test_bad_fills_get_one_sentence_and_write_nothing(folder, case):
    args, words = BAD_FILL[case]
    refused(words, "fill", *args, *QUICK)


def test_extend_gives_the_bytes_of_the_function(folder):
    sides = ["--left", 3, "--right", 2, "--top", 1, "--bottom", 4]
    result = small("extend", "photo.png", "-o", "out.png", *sides)
    assert result.exit_code == 0, result.output
    assert "37x29 from 32x24" in result.output
    photo, made = pixels("photo.png"), pixels("out.png")
    wanted = simdtex.extend(photo, left=3, right=2, top=1, bottom=4, channel_axis=-1, rng=5, **OPTIONS)
    assert np.array_equal(made, wanted)
    assert np.array_equal(made[1:25, 3:35], photo)


@pytest.mark.parametrize(
    ("command", "flags", "tile"),
    [
        ("extend", ["--seamless"], True),
        ("extend", ["--seamless", "y"], "y"),
        ("tile", [], True),
        ("tile", ["--direction", "x"], "x"),
    ],
)
def test_a_material_becomes_seamless(folder, command, flags, tile):
    args = ["photo.png", "-o", "out.png", *flags, "--band", 3, "--also", "normal.png=normal-out.png", "--finish", 0]
    result = small(command, *args, "--source-map", "s.png", "--preview")
    assert result.exit_code == 0, result.output
    assert np.array_equal(pixels("out-3x3.png"), np.tile(pixels("out.png"), (3, 3, 1)))
    photo, source = pixels("photo.png"), load_source_map(folder / "s.png")
    made = pixels("out.png")
    assert np.array_equal(
        made, simdtex.extend(photo, seamless=tile, band=3, channel_axis=-1, rng=5, finish=0.0, **OPTIONS)
    )
    assert np.array_equal(pixels("normal-out.png"), pixels("normal.png")[source[..., 0], source[..., 1]])
    assert np.array_equal(made[3:-3, 3:-3], photo[3:-3, 3:-3])
    assert np.array_equal(made[3:-3], photo[3:-3]) == (tile == "y")
    assert np.array_equal(made[:, 3:-3], photo[:, 3:-3]) == (tile == "x")


PHOTO = ["photo.png", "-o", "out.png"]
BAD_EXTEND = {
    "smaller": ([*PHOTO, "--size", "30x40"], "smaller than the picture of 32x24"),
    "a size and sides": ([*PHOTO, "--size", "40x40", "--left", 3], "--size cannot be used with --left"),
    "a direction": ([*PHOTO, "--seamless", "z"], "--seamless z must be x, y or both"),
}


@pytest.mark.parametrize("case", BAD_EXTEND)
def test_bad_extensions_get_one_sentence_and_write_nothing(folder, case):
    args, words = BAD_EXTEND[case]
    refused(words, "extend", *args, *QUICK)


def test_bad_tiles_get_one_sentence_and_write_nothing(folder):
    refused("--direction z must be x, y or both", "tile", *PHOTO, "--direction", "z", *QUICK)
    image.write(folder / "photo-3x3.png", pixels("grey.png"))
    refused("photo-3x3.png is an input and would be", "tile", "photo-3x3.png", "-o", "photo.png", "--preview", *QUICK)


# -- ``simdtex extend``, ``synth`` and ``fill`` of a folder of maps, end to end.

NAMES = {"brick_albedo.png", "brick_normal.png", "Brick-Roughness.tif", "height.npy", "brick_ao.png"}


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


SEAMLESS = ["--seamless", "--band", 3]


@pytest.mark.parametrize("command", ["extend", "synth", "tile"])
def test_all_maps_are_arranged_by_the_albedo(material, command):
    more = {"extend": SEAMLESS, "synth": ["--size", "150%"], "tile": SEAMLESS[1:]}[command]
    done = small(command, "brick", "-o", "tiled", *more, "--source-map", "s.npz")
    assert done.exit_code == 0, done.output
    assert done.output.startswith("tiled (5 maps arranged by brick_albedo.png): ")
    albedo = pixels("brick", "brick_albedo.png")
    if command != "synth":
        made = simdtex.extend(albedo, seamless=True, band=3, channel_axis=-1, rng=5, **OPTIONS)
    else:
        made = simdtex.synthesize(albedo, (30, 36), channel_axis=-1, rng=5, **OPTIONS)
    assert files(material / "tiled") == NAMES
    np.testing.assert_array_equal(pixels("tiled", "brick_albedo.png"), made)
    source = load_source_map("s.npz")
    for name in NAMES - {"brick_albedo.png"}:
        before = pixels("brick", name.replace("ao.png", "ao.jpg"))
        after = pixels("tiled", name)
        assert after.dtype == before.dtype
        np.testing.assert_array_equal(after, apply_source_map(source, before))


def test_a_map_that_is_named_decides_and_mixed_normals_have_length_1(material):
    done = small("extend", "brick/brick_normal.png", "-o", "tiled", *SEAMLESS, "--source-map", "s.npz")
    assert done.exit_code == 0 and "arranged by brick_normal.png" in done.output, done.output
    before, after = pixels("brick", "brick_normal.png"), pixels("tiled", "brick_normal.png")
    mixed = simdtex.extend(before, seamless=True, band=3, channel_axis=-1, rng=5, **OPTIONS)
    length = np.linalg.norm(mixed / 65535 * 2 - 1, axis=2)
    assert (np.abs(length - 1) > 0.01).any(), "else there is nothing to see"
    np.testing.assert_allclose(np.linalg.norm(after / 65535 * 2 - 1, axis=2), 1, atol=1e-4)
    same = (mixed == apply_source_map(load_source_map("s.npz"), before)).all(axis=2)
    np.testing.assert_array_equal(after[same], before[same])
    assert files(material / "tiled") == NAMES


def erased(folder):
    """The hole of the brick: its albedo gets an alpha with a soft rim, and a wrong colour below it."""
    albedo = pixels("brick", "brick_albedo.png").copy()
    alpha = np.full(albedo.shape[:2], 255, np.uint8)
    alpha[6:13, 8:16], alpha[7:12, 9:15], alpha[8:11, 10:14] = 254, 130, 0
    albedo[alpha < 255] = (0, 255, 0)
    image.write("brick/brick_albedo.png", np.dstack([albedo, alpha]))
    return alpha < 255


@pytest.mark.parametrize("lead", ["brick_albedo.png", "brick_normal.png"])
def test_all_maps_are_filled_alike(material, lead):
    hole = erased(material)
    image.write("hole.png", np.where(hole, 255, 0).astype(np.uint8))
    more = [] if "albedo" in lead else ["--mask", "hole.png"]
    done = small("fill", "brick" if not more else f"brick/{lead}", *more, "-o", "whole", "--source-map", "s.npz")
    assert done.exit_code == 0, done.output
    assert done.output.startswith(f"whole (5 maps arranged by {lead}): {hole.sum()} of 480 pixels filled")
    source = load_source_map("s.npz")
    assert not hole[source[..., 0], source[..., 1]].any()
    for name in NAMES:
        before, after = pixels("brick", name.replace("ao.png", "ao.jpg")), pixels("whole", name)
        if name == "brick_albedo.png":
            before = before[..., :3]
            assert not (after == (0, 255, 0)).all(-1).any(), "the rim comes back"
        np.testing.assert_array_equal(after[~hole], before[~hole])
        if name == lead and more:
            np.testing.assert_allclose(np.linalg.norm(after / 65535 * 2 - 1, axis=2), 1, atol=1e-4)
        elif name != lead:
            np.testing.assert_array_equal(after, apply_source_map(source, before))


def test_a_map_of_one_of_several_materials(material):
    os.rename("brick/height.npy", "brick/brick_height.npy")
    image.write("brick/tile_albedo.png", np.zeros((3, 3), np.uint8))
    words = "brick holds 2 materials: instead of it give a map of one, such as brick/brick_albe"
    refused(words, "extend", "brick", *TO, *QUICK)
    done = small("extend", "brick/brick_albedo.png", *TO)
    assert done.exit_code == 0 and "5 maps arranged by brick_albedo.png" in done.output, done.output
    assert files(material / "tiled") == NAMES - {"height.npy"} | {"brick_height.npy"}


@pytest.mark.parametrize("command", ["extend", "synth", "fill"])
def test_a_role_that_the_name_does_not_show(material, command):
    os.rename("brick/brick_albedo.png", "brick/one.png")
    os.rename("brick/brick_normal.png", "brick/two.png")
    image.write("hole.png", np.pad(np.full((3, 4), 255, np.uint8), ((5, 12), (9, 11))))
    more = {"extend": SEAMLESS, "synth": ["--size", "30x26"], "fill": ["--mask", "hole.png"]}[command]
    done = small(command, "brick", "-o", "tiled", *more, "--map", "albedo=one.png", "--map", "normal-dx=brick/two.png")
    assert done.exit_code == 0 and "left out" not in done.output and "5 maps arranged by one.png" in done.output, (
        done.output
    )
    assert files(material / "tiled") == NAMES - {"brick_albedo.png", "brick_normal.png"} | {"one.png", "two.png"}


def test_maps_that_would_get_one_name_are_refused(material):
    image.write("brick/brick_ao.png", pixels("brick", "brick_ao.jpg"))
    refused("tiled/brick_ao.png would be written twice: move one of the maps out", "extend", "brick", *TO, *QUICK)


def test_variants_of_the_albedo(material):
    image.write("brick/brick_color_var2.png", pixels("brick", "brick_albedo.png")[::-1])
    refused("brick_albedo.png and brick_color_var2.png are both albedo maps: give the", "extend", "brick", *TO, *QUICK)
    for args in (["brick", "--map", "albedo=brick_color_var2.png"], ["brick/brick_color_var2.png"]):
        done = small("extend", *args, *TO)
        assert done.exit_code == 0 and "6 maps arranged by brick_color_var2.png" in done.output, done.output


def test_an_earlier_output_is_replaced_and_nothing_else(material):
    assert small("extend", "brick", "-o", "tiled", *SEAMLESS).exit_code == 0
    first = pixels("tiled", "brick_albedo.png")
    assert small("extend", "brick", "-o", "tiled", "--right", 4).exit_code == 0
    assert pixels("tiled", "brick_albedo.png").shape[1] == first.shape[1] + 4
    (material / "tiled" / "scene.blend").touch()
    refused("holds other files (scene.blend): give an empty", "extend", "brick", "-o", "tiled", *SEAMLESS, *QUICK)


def test_what_has_no_role_is_left_out_and_named(material):
    image.write("brick/preview.png", np.zeros((3, 3), np.uint8))
    (material / "brick" / "licence.txt").touch()
    done = small("extend", "brick", "-o", "tiled", *SEAMLESS)
    assert "simdtex: left out, because the name does not show the kind of map: preview.png\n" in done.output
    assert files(material / "tiled") == NAMES


def test_all_maps_are_written_or_none(material, monkeypatch):
    assert small("extend", "brick", "-o", "tiled", *SEAMLESS).exit_code == 0
    before, real = contents(), image.write

    def fails(path, *given):
        if "height" in str(path):
            raise NotWritten("the disk is full")
        real(path, *given)

    monkeypatch.setattr(image, "write", fails)
    done = small("extend", "brick", "-o", "tiled", "--right", 4)
    assert done.exit_code == 2 and "the disk is full" in done.output
    assert contents() == before


def test_a_picture_beside_other_maps_is_still_one_picture(material):
    done = small("extend", "brick/brick_albedo.png", "-o", "out.png", *SEAMLESS)
    assert done.exit_code == 0 and (material / "out.png").is_file(), done.output


def test_a_run_that_could_not_write_goes_on(material, monkeypatch):
    monkeypatch.setattr(checkpoints, "FIRST", 0.0)
    assert small("extend", "brick", "-o", "tiled", *SEAMLESS).exit_code == 0

    def full(*_):
        raise NotWritten("the disk is full")

    with monkeypatch.context() as patch:
        patch.setattr(Folder, "write", full)
        done = small("extend", "brick", "-o", "again", *SEAMLESS, "--checkpoint", "state")
    assert done.exit_code == 2 and "the disk is full" in done.output and not (material / "again").exists()
    done = run("resume", "state")
    assert done.exit_code == 0, done.output
    for name in NAMES:
        assert (material / "again" / name).read_bytes() == (material / "tiled" / name).read_bytes()


TO = ["-o", "tiled", *SEAMLESS]
EXTRA = {
    **{"two materials": "brick/color.png", "a map of no folder": "a.png", "a size that differs": "brick/opacity.png"},
    **{"no albedo": "none/b_normal.png", "no maps at all": "none/b.png", "no role": "none/b.png"},
}
"""Pictures that these cases have besides."""
BAD = {
    "two materials": (["extend", "brick", *TO], "brick holds 2 materials: instead of it give"),
    "no such role": (
        ["extend", "brick", *TO, "--map", "gold=height.npy"],
        "--map names the role gold; give one of the",
    ),
    "no such map": (["fill", "brick", *TO[:2], "--map", "ao=x.png"], "brick/x.png"),
    "a map of no folder": (["synth", "a.png", "-o", "b.png", "--map", "ao=a.png"], "--map requires a folder"),
    "no hole": (["fill", "brick", "-o", "tiled"], "there is nothing to fill; give a mask"),
    "another texture": (["fill", "brick", "-o", "t", "--sample", "brick/brick_ao.jpg"], "cannot be filled with --s"),
    "a size that differs": (["extend", "brick", *TO], "opacity.png is 5x4 and brick_albedo.png 24x20"),
    "no albedo": (["extend", "none", *TO], "has no albedo: give --map albedo=FILE"),
    "no maps at all": (["extend", "none", *TO], "no albedo (b.png is of unknown kind): give"),
    "a file as output": (["extend", "brick", "-o", "out.png", *SEAMLESS], "give a folder for the output"),
    "a store as output": (["synth", "brick", "-o", "out.zarr"], "give a folder for the output"),
    "a suffix": (["extend", "brick/brick_ao.jpg", "-o", "out.pgn", *SEAMLESS], "ends in .pgn: end its name"),
    "into itself": (["extend", "brick", "-o", "brick/tiled", *SEAMLESS], "is an input"),
    "over itself": (["extend", "brick/brick_ao.jpg", "-o", "brick", *SEAMLESS], "is an input"),
    "no folder for it": (["extend", "brick", "-o", "none/tiled", *SEAMLESS], "none does not exist: create it"),
    "pyramid": (["synth", "brick", "-o", "t", "--method", "pyramid"], "takes no pixel from the sample; give one"),
    "two samples": (["synth", "brick", "brick/height.npy", "-o", "t"], "brick is a folder"),
    "known": (["synth", "brick", "-o", "t", "--known", "brick/brick_albedo.png"], "give one picture"),
    "no role": (["extend", "none/b.png", *TO], "tiled has no suffix: end its name in"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_gets_one_sentence(material, case):
    args, said = BAD[case]
    if case in EXTRA:
        (material / EXTRA[case]).parent.mkdir(exist_ok=True)
        image.write(EXTRA[case], np.zeros((4, 5), np.uint8))
    refused(said, *args, *QUICK)


def test_a_map_that_is_a_link_into_the_output_is_refused(material):
    (material / "tiled").mkdir()
    os.rename("brick/brick_normal.png", "tiled/brick_normal.png")
    (material / "brick" / "brick_normal.png").symlink_to(material / "tiled" / "brick_normal.png")
    refused("is an input and is in tiled, which would be replaced", "extend", "brick", *TO, *QUICK)
