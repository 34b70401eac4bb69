"""``simdtex fill`` and ``simdtex extend``, end to end."""

import numpy as np
import pytest
from click.testing import CliRunner

import simdtex
from simdtex.cli import main
from simdtex.io import image
from simdtex.model.source_map import load_source_map

OPTIONS = {"order": 2, "device": "reference"}


@pytest.fixture
def folder(tmp_path):
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
    image.write(tmp_path / "white.png", np.full((24, 32), 255, np.uint8))
    image.write(tmp_path / "black.png", np.zeros((24, 32), np.uint8))
    image.write(tmp_path / "small.png", mask[:20])
    holed = noise[..., 0].astype(np.float32)
    holed[mask > 0] = np.nan
    image.write(tmp_path / "holed.tif", holed)
    image.write(tmp_path / "nothing.tif", np.full((24, 32), np.nan, np.float32))
    return tmp_path


def run(folder, *args):
    """Run a command; what ends like a file is one of the folder."""
    placed = [placed_in(folder, str(arg)) for arg in args]
    return CliRunner().invoke(main, placed)


def placed_in(folder, text):
    if not text.endswith((".png", ".tif", ".npz", ".npy", ".jpg", ".csv")):
        return text
    return "=".join(",".join(f"{folder}/{name}" for name in part.split(",")) for part in text.split("="))


def small(folder, command, *args):
    return run(folder, command, *args, "--order", 2, "--seed", 5, "--device", "reference")


def listing(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


def pixels(folder, name):
    return image.read(folder / name).pixels


def refused(folder, command, args, words):
    before = listing(folder)
    result = small(folder, command, *args)
    assert result.exit_code == 2, result.output
    assert words in result.output
    assert len(result.output.strip().splitlines()) == 1
    assert listing(folder) == before


def test_fill_gives_the_bytes_of_the_function(folder):
    args = ("photo.png", "--mask", "mask.png", "-o", "out.png", "--reach", 6, "--structure", 0.5)
    result = small(folder, "fill", *args)
    assert result.exit_code == 0, result.output
    assert "42 of 768 pixels" in result.output and "seed 5" in result.output
    photo, hole = pixels(folder, "photo.png"), pixels(folder, "mask.png") > 0
    wanted = simdtex.fill(photo, hole, channel_axis=-1, rng=5, reach=6, structure=0.5, **OPTIONS)
    made = pixels(folder, "out.png")
    assert np.array_equal(made, wanted)
    assert np.array_equal(made[~hole], photo[~hole]) and not np.array_equal(made, photo)


def test_what_is_transparent_is_a_mask(folder):
    small(folder, "fill", "photo.png", "--mask", "mask.png", "-o", "masked.png", "-q")
    result = small(folder, "fill", "cut.png", "-o", "out.png", "-q")
    assert result.exit_code == 0 and result.output == ""
    made = pixels(folder, "out.png")
    assert made.shape == (24, 32, 3)
    assert np.array_equal(made, pixels(folder, "masked.png"))


def test_what_is_not_opaque_is_filled(folder):
    cut = pixels(folder, "cut.png").copy()
    cut[5:17, 7:20, :3], cut[5:17, 7:20, 3] = (0, 255, 0), 200
    cut[8:14, 10:17, 3], cut[0, 0, 3] = 0, 254
    image.write(folder / "soft.png", cut)
    assert small(folder, "fill", "soft.png", "-o", "out.png").exit_code == 0
    made = pixels(folder, "out.png")
    assert not (made == (0, 255, 0)).all(-1).any()
    assert np.array_equal(made[cut[..., 3] == 255], cut[cut[..., 3] == 255][:, :3])


def test_inverted_widened_and_blended(folder):
    image.write(folder / "inverse.png", 255 - pixels(folder, "mask.png"))
    for name, mask in (("a.png", ["mask.png"]), ("b.png", ["inverse.png", "--invert"])):
        result = small(folder, "fill", "photo.png", "--mask", *mask, "-o", name, "--grow", 1, "--feather", 2)
        assert result.exit_code == 0 and "136 of 768 pixels filled" in result.output, result.output
    photo, hole = pixels(folder, "photo.png"), pixels(folder, "mask.png") > 0
    made = simdtex.fill(photo, hole, channel_axis=-1, rng=5, grow=1, feather=2, **OPTIONS)
    assert np.array_equal(pixels(folder, "a.png"), made) and np.array_equal(pixels(folder, "b.png"), made)


@pytest.mark.parametrize(
    ("command", "more"), [("fill", ["--mask", "mask.png"]), ("extend", ["--left", 3]), ("synth", [])]
)
def test_a_volume_leads_to_simulate(folder, command, more):
    image.write(folder / "layers.npy", np.zeros((24, 32, 40), np.uint8))
    np.save(folder / "volume.npy", np.zeros((4, 24, 32, 1), np.uint8))
    refused(folder, command, ["volume.npy", "-o", "out.npy", *more], "is a volume: use simdtex simulate")
    result = small(folder, command, "layers.npy", "-o", "layers.png", *more)
    assert result.exit_code == 2 and "a picture of 40 channels; for a volume use simdtex simulate" in result.output


def test_alpha_beside_a_mask_is_a_channel(folder):
    assert small(folder, "fill", "cut.png", "--mask", "mask.png", "-o", "out.npy").exit_code == 0
    made, cut = pixels(folder, "out.npy"), pixels(folder, "cut.png")
    assert made.shape == (24, 32, 4) and (made[..., 3] == 255).all()
    assert np.array_equal(made[cut[..., 3] > 0], cut[cut[..., 3] > 0])


def test_nan_is_a_mask(folder):
    assert small(folder, "fill", "holed.tif", "-o", "out.tif").exit_code == 0
    made, holed = pixels(folder, "out.tif"), pixels(folder, "holed.tif")
    assert np.array_equal(made[~np.isnan(holed)], holed[~np.isnan(holed)])
    assert np.array_equal(made, simdtex.fill(holed, rng=5, **OPTIONS))
    assert not np.isnan(made).any()


def test_fill_carries_other_maps_along(folder):
    args = ["--mask", "mask.png", "-o", "out.png", "--also", "normal.png=normal-out.png", "--source-map", "s.npz"]
    result = small(folder, "fill", "photo.png", *args, "--finish", 0)
    assert result.exit_code == 0, result.output
    source = load_source_map(folder / "s.npz")
    for name, out in (("photo.png", "out.png"), ("normal.png", "normal-out.png")):
        assert np.array_equal(pixels(folder, out), pixels(folder, name)[source[..., 0], source[..., 1]])
    hole = pixels(folder, "mask.png") > 0
    assert np.array_equal(pixels(folder, "normal-out.png")[~hole], pixels(folder, "normal.png")[~hole])


def test_fill_with_other_textures(folder):
    args = ["--mask", "mask.png", "-o", "out.png", "--sample", "texture.png", "--sample", "another.png"]
    result = small(folder, "fill", "photo.png", *args, "--source-map", "s.npz", "--finish", 0, "--shares", "1,3")
    assert result.exit_code == 0, result.output
    source, hole = load_source_map(folder / "s.npz"), pixels(folder, "mask.png") > 0
    textures = [pixels(folder, "texture.png"), pixels(folder, "another.png")]
    made = pixels(folder, "out.png")
    assert (source[~hole] == -1).all()
    assert {int(number) for number in source[hole][:, 2]} == {0, 1}
    for row, col in np.argwhere(hole):
        i, j, number = source[row, col]
        assert np.array_equal(made[row, col], textures[number][i, j])


MASKED = ["photo.png", "--mask", "mask.png", "-o", "out.png"]
BAD_FILL = {
    "no alpha and no mask": (["photo.png", "-o", "out.png"], "give a mask"),
    "a mask of nothing": (["photo.png", "--mask", "black.png", "-o", "out.png"], "nothing to fill"),
    "a mask of everything": (["photo.png", "--mask", "white.png", "-o", "out.png"], "nothing of the picture is known"),
    "a mask of another size": (["photo.png", "--mask", "small.png", "-o", "out.png"], "32 x 24"),
    "a grey sample": ([*MASKED, "--sample", "grey.png"], "2-dimensional (grey)"),
    "maps beside a sample": ([*MASKED, "--sample", "texture.png", "--also", "normal.png=n.png"], "leave --also out"),
    "a map of another size": ([*MASKED, "--also", "small.png=n.png"], "32x24"),
    "a source map that holds no -1": ([*MASKED, "--sample", "texture.png", "--source-map", "s.png"], ".npz"),
    "inverted alpha": (["cut.png", "-o", "out.png", "--invert"], "--invert requires --mask"),
    "a hole that grows inwards": ([*MASKED, "--grow", "-1"], "grow is -1"),
    "weights in words": ([*MASKED, "--weights", "much"], "numbers separated by commas"),
}


@pytest.mark.parametrize("case", BAD_FILL)
def test_bad_fills_get_one_sentence_and_write_nothing(folder, case):
    args, words = BAD_FILL[case]
    refused(folder, "fill", args, words)


def test_extend_gives_the_bytes_of_the_function(folder):
    sides = ["--left", 3, "--right", 2, "--top", 1, "--bottom", 4]
    result = small(folder, "extend", "photo.png", "-o", "out.png", *sides)
    assert result.exit_code == 0, result.output
    assert "37x29 from 32x24" in result.output
    photo, made = pixels(folder, "photo.png"), pixels(folder, "out.png")
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
    result = small(folder, command, *args, "--source-map", "s.png", "--preview")
    assert result.exit_code == 0, result.output
    assert np.array_equal(pixels(folder, "out-3x3.png"), np.tile(pixels(folder, "out.png"), (3, 3, 1)))
    photo, source = pixels(folder, "photo.png"), load_source_map(folder / "s.png")
    made = pixels(folder, "out.png")
    assert np.array_equal(
        made, simdtex.extend(photo, seamless=tile, band=3, channel_axis=-1, rng=5, finish=0.0, **OPTIONS)
    )
    assert np.array_equal(
        pixels(folder, "normal-out.png"), pixels(folder, "normal.png")[source[..., 0], source[..., 1]]
    )
    assert np.array_equal(made[3:-3, 3:-3], photo[3:-3, 3:-3])
    assert np.array_equal(made[3:-3], photo[3:-3]) == (tile == "y")
    assert np.array_equal(made[:, 3:-3], photo[:, 3:-3]) == (tile == "x")


def test_extend_shows_what_it_did(folder):
    args = ["--seamless", "--band", 3, "--stages", folder / "stages", "--report", folder / "report"]
    result = small(folder, "extend", "photo.png", "-o", "out.png", *args)
    assert result.exit_code == 0, result.output
    assert (folder / "stages" / "level0-sweep01.png").is_file()
    assert "simdtex extend" in (folder / "report" / "index.html").read_text(encoding="utf-8")


PHOTO = ["photo.png", "-o", "out.png"]
BAD_EXTEND = {
    "nothing to add": (PHOTO, "nothing to add"),
    "smaller": ([*PHOTO, "--size", "30x40"], "smaller than the picture of 32x24"),
    "the size it has": ([*PHOTO, "--size", "32x24"], "nothing to add"),
    "a size and sides": ([*PHOTO, "--size", "40x40", "--left", 3], "--size cannot be used with --left"),
    "a direction": ([*PHOTO, "--seamless", "z"], "--seamless z must be x, y or both"),
    "a band of nothing": ([*PHOTO, "--left", 3, "--band", 3], "--seamless"),
}


@pytest.mark.parametrize("case", BAD_EXTEND)
def test_bad_extensions_get_one_sentence_and_write_nothing(folder, case):
    args, words = BAD_EXTEND[case]
    refused(folder, "extend", args, words)


def test_bad_tiles_get_one_sentence_and_write_nothing(folder):
    refused(folder, "tile", [*PHOTO, "--direction", "z"], "--direction z must be x, y or both")
    refused(folder, "tile", [*PHOTO, "--band", 12], "band=12 leaves nothing of a picture of 24x32")
    image.write(folder / "photo-3x3.png", pixels(folder, "grey.png"))
    refused(folder, "tile", ["photo-3x3.png", "-o", "photo.png", "--preview"], "photo-3x3.png is an input and would be")
