"""``simdtex extend``, ``synth`` and ``fill`` of a folder of maps, end to end."""

import os

import numpy as np
import pytest
from click.testing import CliRunner

import simdtex
from simdtex import checkpoint as checkpoints
from simdtex.cli import main
from simdtex.cli.inputs import Folder
from simdtex.io import image
from simdtex.io.atomic import NotWritten
from simdtex.model.source_map import apply_source_map, load_source_map

OPTIONS = {"order": 2, "device": "reference"}
NAMES = {"brick_albedo.png", "brick_normal.png", "Brick-Roughness.tif", "height.npy", "brick_ao.png"}


@pytest.fixture
def folder(tmp_path, monkeypatch):
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
    for name, pixels in maps.items():
        image.write(tmp_path / "brick" / name, pixels)
    return tmp_path


def run(*args):
    words = [*map(str, args), "--order", 2, "--seed", 5, "--device", "reference"]
    return CliRunner().invoke(main, [str(word) for word in words])


def everything(folder):
    return {str(path): path.is_file() and path.read_bytes() for path in folder.rglob("*")}


def names(path):
    return {one.name for one in path.iterdir()}


def pixels(*parts):
    return image.read("/".join(parts)).pixels


SEAMLESS = ["--seamless", "--band", 3]


@pytest.mark.parametrize("command", ["extend", "synth", "tile"])
def test_all_maps_are_arranged_by_the_albedo(folder, command):
    more = {"extend": SEAMLESS, "synth": ["--size", "150%"], "tile": SEAMLESS[1:]}[command]
    done = run(command, "brick", "-o", "tiled", *more, "--source-map", "s.npz")
    assert done.exit_code == 0, done.output
    assert done.output.startswith("tiled (5 maps arranged by brick_albedo.png): ")
    albedo = pixels("brick", "brick_albedo.png")
    if command != "synth":
        made = simdtex.extend(albedo, seamless=True, band=3, channel_axis=-1, rng=5, **OPTIONS)
    else:
        made = simdtex.synthesize(albedo, (30, 36), channel_axis=-1, rng=5, **OPTIONS)
    assert names(folder / "tiled") == NAMES
    np.testing.assert_array_equal(pixels("tiled", "brick_albedo.png"), made)
    source = load_source_map("s.npz")
    for name in NAMES - {"brick_albedo.png"}:
        before = pixels("brick", name.replace("ao.png", "ao.jpg"))
        after = pixels("tiled", name)
        assert after.dtype == before.dtype
        np.testing.assert_array_equal(after, apply_source_map(source, before))


def test_a_map_that_is_named_decides_and_mixed_normals_have_length_1(folder):
    done = run("extend", "brick/brick_normal.png", "-o", "tiled", *SEAMLESS, "--source-map", "s.npz")
    assert done.exit_code == 0 and "arranged by brick_normal.png" in done.output, done.output
    before, after = pixels("brick", "brick_normal.png"), pixels("tiled", "brick_normal.png")
    mixed = simdtex.extend(before, seamless=True, band=3, channel_axis=-1, rng=5, **OPTIONS)
    length = np.linalg.norm(mixed / 65535 * 2 - 1, axis=2)
    assert (np.abs(length - 1) > 0.01).any(), "else there is nothing to see"
    np.testing.assert_allclose(np.linalg.norm(after / 65535 * 2 - 1, axis=2), 1, atol=1e-4)
    same = (mixed == apply_source_map(load_source_map("s.npz"), before)).all(axis=2)
    np.testing.assert_array_equal(after[same], before[same])
    assert names(folder / "tiled") == NAMES


def erased(folder):
    """The hole of the brick: its albedo gets an alpha with a soft rim, and a wrong colour below it."""
    albedo = pixels("brick", "brick_albedo.png").copy()
    alpha = np.full(albedo.shape[:2], 255, np.uint8)
    alpha[6:13, 8:16], alpha[7:12, 9:15], alpha[8:11, 10:14] = 254, 130, 0
    albedo[alpha < 255] = (0, 255, 0)
    image.write("brick/brick_albedo.png", np.dstack([albedo, alpha]))
    return alpha < 255


@pytest.mark.parametrize("lead", ["brick_albedo.png", "brick_normal.png"])
def test_all_maps_are_filled_alike(folder, lead):
    hole = erased(folder)
    image.write("hole.png", np.where(hole, 255, 0).astype(np.uint8))
    more = [] if "albedo" in lead else ["--mask", "hole.png"]
    done = run("fill", "brick" if not more else f"brick/{lead}", *more, "-o", "whole", "--source-map", "s.npz")
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


def test_a_map_of_one_of_several_materials(folder):
    os.rename("brick/height.npy", "brick/brick_height.npy")
    image.write("brick/tile_albedo.png", np.zeros((3, 3), np.uint8))
    refused(
        folder,
        ["extend", "brick", *TO],
        "brick holds 2 materials: instead of it give a map of one, such as brick/brick_albe",
    )
    done = run("extend", "brick/brick_albedo.png", *TO)
    assert done.exit_code == 0 and "5 maps arranged by brick_albedo.png" in done.output, done.output
    assert names(folder / "tiled") == NAMES - {"height.npy"} | {"brick_height.npy"}


@pytest.mark.parametrize("command", ["extend", "synth", "fill"])
def test_a_role_that_the_name_does_not_show(folder, command):
    os.rename("brick/brick_albedo.png", "brick/one.png")
    os.rename("brick/brick_normal.png", "brick/two.png")
    image.write("hole.png", np.pad(np.full((3, 4), 255, np.uint8), ((5, 12), (9, 11))))
    more = {"extend": SEAMLESS, "synth": ["--size", "30x26"], "fill": ["--mask", "hole.png"]}[command]
    done = run(command, "brick", "-o", "tiled", *more, "--map", "albedo=one.png", "--map", "normal-dx=brick/two.png")
    assert done.exit_code == 0 and "left out" not in done.output and "5 maps arranged by one.png" in done.output, (
        done.output
    )
    assert names(folder / "tiled") == NAMES - {"brick_albedo.png", "brick_normal.png"} | {"one.png", "two.png"}


def test_maps_that_would_get_one_name_are_refused(folder):
    image.write("brick/brick_ao.png", pixels("brick", "brick_ao.jpg"))
    refused(folder, ["extend", "brick", *TO], "tiled/brick_ao.png would be written twice: move one of the maps out")


def test_variants_of_the_albedo(folder):
    image.write("brick/brick_color_var2.png", pixels("brick", "brick_albedo.png")[::-1])
    refused(
        folder, ["extend", "brick", *TO], "brick_albedo.png and brick_color_var2.png are both albedo maps: give the"
    )
    for args in (["brick", "--map", "albedo=brick_color_var2.png"], ["brick/brick_color_var2.png"]):
        done = run("extend", *args, *TO)
        assert done.exit_code == 0 and "6 maps arranged by brick_color_var2.png" in done.output, done.output


def test_an_earlier_output_is_replaced_and_nothing_else(folder):
    assert run("extend", "brick", "-o", "tiled", *SEAMLESS).exit_code == 0
    first = pixels("tiled", "brick_albedo.png")
    assert run("extend", "brick", "-o", "tiled", "--right", 4).exit_code == 0
    assert pixels("tiled", "brick_albedo.png").shape[1] == first.shape[1] + 4
    (folder / "tiled" / "scene.blend").touch()
    refused(folder, ["extend", "brick", "-o", "tiled", *SEAMLESS], "holds other files (scene.blend): give an empty")


def test_what_has_no_role_is_left_out_and_named(folder):
    image.write("brick/preview.png", np.zeros((3, 3), np.uint8))
    (folder / "brick" / "licence.txt").touch()
    done = run("extend", "brick", "-o", "tiled", *SEAMLESS)
    assert "simdtex: left out, because the name does not show the kind of map: preview.png\n" in done.output
    assert names(folder / "tiled") == NAMES


def test_all_maps_are_written_or_none(folder, monkeypatch):
    assert run("extend", "brick", "-o", "tiled", *SEAMLESS).exit_code == 0
    before, real = everything(folder), image.write

    def fails(path, *given):
        if "height" in str(path):
            raise NotWritten("the disk is full")
        real(path, *given)

    monkeypatch.setattr(image, "write", fails)
    done = run("extend", "brick", "-o", "tiled", "--right", 4)
    assert done.exit_code == 2 and "the disk is full" in done.output
    assert everything(folder) == before


def test_a_folder_may_have_a_point_in_its_name(folder):
    assert run("extend", "brick", "-o", "brick.v2", *SEAMLESS).exit_code == 0
    assert names(folder / "brick.v2") == NAMES


def test_a_picture_beside_other_maps_is_still_one_picture(folder):
    done = run("extend", "brick/brick_albedo.png", "-o", "out.png", *SEAMLESS)
    assert done.exit_code == 0 and (folder / "out.png").is_file(), done.output


def test_a_run_that_could_not_write_goes_on(folder, monkeypatch):
    monkeypatch.setattr(checkpoints, "FIRST", 0.0)
    assert run("extend", "brick", "-o", "tiled", *SEAMLESS).exit_code == 0

    def full(*_):
        raise NotWritten("the disk is full")

    with monkeypatch.context() as patch:
        patch.setattr(Folder, "write", full)
        done = run("extend", "brick", "-o", "again", *SEAMLESS, "--checkpoint", "state")
    assert done.exit_code == 2 and "the disk is full" in done.output and not (folder / "again").exists()
    done = CliRunner().invoke(main, ["resume", "state"])
    assert done.exit_code == 0, done.output
    for name in NAMES:
        assert (folder / "again" / name).read_bytes() == (folder / "tiled" / name).read_bytes()


def refused(folder, args, said):
    before = everything(folder)
    done = run(*args)
    assert done.exit_code == 2, done.output
    assert said in done.output and len(done.output.splitlines()) == 1, done.output
    assert everything(folder) == before


TO = ["-o", "tiled", *SEAMLESS]
BAD = {
    "two materials": (["extend", "brick", *TO], "brick holds 2 materials: instead of it give", "brick/color.png"),
    "no such role": (
        ["extend", "brick", *TO, "--map", "gold=height.npy"],
        "--map names the role gold; give one of the roles",
        None,
    ),
    "no such map": (
        ["fill", "brick", *TO[:2], "--map", "ao=x.png"],
        "brick/x.png",
        None,
    ),
    "a map of no folder": (["synth", "a.png", "-o", "b.png", "--map", "ao=a.png"], "--map requires a folder", "a.png"),
    "no hole": (["fill", "brick", "-o", "tiled"], "there is nothing to fill; give a mask", None),
    "another texture": (
        ["fill", "brick", "-o", "t", "--sample", "brick/brick_ao.jpg"],
        "cannot be filled with --s",
        None,
    ),
    "a size that differs": (
        ["extend", "brick", *TO],
        "opacity.png is 5x4 and brick_albedo.png 24x20",
        "brick/opacity.png",
    ),
    "no albedo": (["extend", "none", *TO], "has no albedo: give --map albedo=FILE", "none/b_normal.png"),
    "no maps at all": (["extend", "none", *TO], "no albedo (b.png is of unknown kind): give", "none/b.png"),
    "a file as output": (["extend", "brick", "-o", "out.png", *SEAMLESS], "give a folder for the output", None),
    "a store as output": (["synth", "brick", "-o", "out.zarr"], "give a folder for the output", None),
    "a suffix": (["extend", "brick/brick_ao.jpg", "-o", "out.pgn", *SEAMLESS], "ends in .pgn: end its name", None),
    "into itself": (["extend", "brick", "-o", "brick/tiled", *SEAMLESS], "is an input", None),
    "over itself": (["extend", "brick/brick_ao.jpg", "-o", "brick", *SEAMLESS], "is an input", None),
    "no folder for it": (["extend", "brick", "-o", "none/tiled", *SEAMLESS], "none does not exist: create it", None),
    "pyramid": (["synth", "brick", "-o", "t", "--method", "pyramid"], "takes no pixel from the sample; give one", None),
    "two samples": (["synth", "brick", "brick/height.npy", "-o", "t"], "brick is a folder", None),
    "tiles": (["synth", "brick", "-o", "t.zarr", "--tiles", 16], "brick is a folder", None),
    "known": (["synth", "brick", "-o", "t", "--known", "brick/brick_albedo.png"], "give one picture", None),
    "no role": (["extend", "none/b.png", *TO], "tiled has no suffix: end its name in", "none/b.png"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_gets_one_sentence(folder, case):
    args, said, extra = BAD[case]
    if extra:
        (folder / extra).parent.mkdir(exist_ok=True)
        image.write(extra, np.zeros((4, 5), np.uint8))
    refused(folder, args, said)


def test_a_map_that_is_a_link_into_the_output_is_refused(folder):
    (folder / "tiled").mkdir()
    os.rename("brick/brick_normal.png", "tiled/brick_normal.png")
    (folder / "brick" / "brick_normal.png").symlink_to(folder / "tiled" / "brick_normal.png")
    refused(folder, ["extend", "brick", *TO], "is an input and is in tiled, which would be replaced")
