"""The maps of a material, and source maps, which arrange one picture like another."""

import os
import re
from pathlib import Path

import numpy as np
import pytest

from simdtex.io.image import read, write
from simdtex.model.source_map import (
    ROLES,
    apply_source_map,
    find_maps,
    load_source_map,
    map_role,
    save_source_map,
    unit_normals,
)

# -- The maps of a material: what a name says, what is in a folder, and normals of length 1.

NAMES = {
    "brick_normal.png": "normal",
    "BrickBaseColor.png": "albedo",
    "Bricks001_2K-PNG_NormalDX.png": "normal-dx",
    "Bricks001_4K_AmbientOcclusion.jpg": "ao",
    "floor_nor_gl_2k.png": "normal",
    "brick_height_16bit.tif": "height",
    "brick_albedo.1001.png": "albedo",
    "brick_metallic_roughness.png": "packed",
    "rock_Normal_DirectX.png": "normal-dx",
    "rock-normal-ogl.png": "normal",
    "vlkhcbxia_2K_Normal_LOD0.jpg": "normal",
    "Ground003_COL_VAR1_3K.jpg": "albedo",
    "Ground003_NRM16_3K.tif": "normal",
    "Metal001_COL_2K_METALNESS.png": "albedo",
    "Metal001_METALNESS_2K_METALNESS.png": "metallic",
    "Metal001_NRM16_4K_LOD0_METALNESS.png": "normal",
    "T_Rock_BC.png": "albedo",
    "rough_wood.png": None,
    "color_metalness_old.png": None,
    "wood_r.png": None,
    "brick_n.png": None,
    "T_Sign_3D.png": None,
    "2k.png": None,
    "brick.png": None,
}


def test_the_end_of_a_name_says_what_a_map_is():
    assert {name: map_role(f"Color/{name}") for name in NAMES} == NAMES


def test_the_words_of_the_page_are_known():
    page = (Path(__file__).parents[2] / "docs" / "readers" / "materials.rst").read_text(encoding="utf-8")
    rows = re.findall(r"^   \* - ([a-z; -]+)\n     - (.+)$", page, re.MULTILINE)
    told = {}
    for roles, words in rows:
        told |= dict(zip(roles.split("; "), words.split("; "), strict=True))
    assert set(told) == set(ROLES)
    for role, words in told.items():
        for word in words.split(", "):
            assert map_role(f"brick {word}.png") == role


def folder_with(tmp_path, *names):
    for name in names:
        (tmp_path / name).touch()
    return tmp_path


def roles_in(*args):
    return {path.name: role for path, role in find_maps(*args).files.items()}


def test_maps_of_a_folder(tmp_path):
    folder_with(tmp_path, "b_albedo.png", "b_normal.tif", "preview.png", "normal.txt", "material.mtlx", "._b_ao.png")
    (tmp_path / "roughness.png").mkdir()
    found = find_maps(tmp_path)
    assert found.files == {tmp_path / "b_albedo.png": "albedo", tmp_path / "b_normal.tif": "normal"}
    assert found.unknown == ["preview.png"]


def test_maps_with_letters_and_variants(tmp_path):
    for k, (names, count) in enumerate(
        [
            (("wood_d.png", "wood_n.png", "wood_r.png"), 3),
            (("wood_d.png", "wood_r.png", "wood_AO.png"), 3),
            (("wood_r.png", "wood_d.png", "sky_AO.png"), 1),
            (("coast_n.png", "coast_e.png", "coast_s.png"), 0),
            (("coast_n.png", "coast_e.png", "coast_s.png", "coast.png"), 4),
            (("coast_n.png", "coast.png"), 0),
            (("G_COL_VAR1_3K.jpg", "G_COL_VAR2_3K.jpg", "G_DISP_3K.jpg", "G_DISP16_3K.tif", "G_NRM_3K.jpg"), 5),
            (("R_Normal_OpenGL.png", "r-normal-dx.png", "R_Base_Color.png", "height.npy"), 4),
        ]
    ):
        (tmp_path / str(k)).mkdir()
        found = find_maps(folder_with(tmp_path / str(k), *names))
        assert len(found.files) == count and len(found.unknown) == len(names) - count, names


def test_materials_of_a_folder_are_told_apart_by_their_stems(tmp_path):
    folder_with(tmp_path, "oak_albedo.png", "Oak-Normal.png", "T_Brick_D.png", "T_Brick_N.png", "a.png", "oak_disp.hdr")
    with pytest.raises(
        ValueError, match=r"holds 2 materials: .* give a map of one, .*/T_Brick_D.png or .*/oak_albedo.png"
    ):
        find_maps(tmp_path)
    lead = tmp_path / "T_Brick_N.png"
    assert roles_in(tmp_path, lead) == {"T_Brick_D.png": "albedo", "T_Brick_N.png": "normal"}
    assert find_maps(tmp_path, lead).unknown == ["a.png"]
    with pytest.raises(ValueError, match=r"oak_disp.hdr is of a format that is not read: save it as TIFF"):
        find_maps(tmp_path, tmp_path / "oak_albedo.png")


def test_all_maps_of_one_of_several_materials_are_taken_or_named(tmp_path):
    """Sizes are parts of the stems, and an OldRoughness is named."""
    folder_with(tmp_path, "oak_albedo.png", "oak_OldRoughness.png", "ash_albedo.png", "ash_n.png")
    folder_with(tmp_path, "elm.png", "elm_n.png", "elm_s.png", "floor_diff_1k.png", "floor_diff_2k.png")
    folder_with(tmp_path, "floor_disp_1k.png")
    found = find_maps(tmp_path, tmp_path / "oak_albedo.png")
    assert [*found.files.values()] == ["albedo"] and found.unknown == ["oak_OldRoughness.png"]
    assert [*find_maps(tmp_path, tmp_path / "elm.png").files.values()] == ["albedo", "normal", "specular"]
    assert set(roles_in(tmp_path, tmp_path / "floor_diff_1k.png")) == {"floor_diff_1k.png", "floor_disp_1k.png"}
    with pytest.raises(ValueError, match=r"nothing cannot be read \(No such file or directory\): check the path"):
        find_maps(tmp_path / "nothing")


def encoded(vectors, dtype):
    if np.dtype(dtype).kind == "f":
        return vectors.astype(dtype)
    return np.round((vectors + 1) / 2 * np.iinfo(dtype).max).astype(dtype)


@pytest.mark.parametrize(("dtype", "near"), [(np.uint8, 0.01), (np.uint16, 3e-5), (np.float32, 1e-6)])
def test_normals_get_the_length_1_where_asked(dtype, near):
    rng = np.random.default_rng(1)
    vectors = rng.uniform(-1, 1, (6, 7, 3)) * 0.5
    vectors[0, 0] = 0
    pixels = np.dstack([encoded(vectors, dtype), np.full((6, 7), 7, dtype)])
    where = np.arange(42).reshape(6, 7) % 2 == 0
    made = unit_normals(pixels, where)
    assert made.dtype == dtype and (made[~where] == pixels[~where]).all() and (made[..., 3] == 7).all()
    back = made[..., :3] if dtype == np.float32 else made[..., :3] / np.iinfo(dtype).max * 2 - 1
    wanted = vectors / np.maximum(np.linalg.norm(vectors, axis=2, keepdims=True), 1e-9)
    there = where & (np.linalg.norm(vectors, axis=2) > 0.3)
    assert there.sum() > 5 and np.abs(back[there] - wanted[there]).max() < 6 * near
    assert np.abs(back[0, 0]).max() < near, "no direction is made up"


def test_floats_of_0_to_1_stay_so_and_a_grey_map_is_let_be():
    made = unit_normals(np.array([[[0.5, 0.5, 0.75]]]), np.array([[True]]))
    np.testing.assert_allclose(made, [[[0.5, 0.5, 1.0]]])
    grey = np.arange(6, dtype=np.uint8).reshape(2, 3)
    assert unit_normals(grey, np.ones((2, 3), bool)) is grey


# -- Source maps survive their files and carry an arrangement over pixel for pixel.


def some_map(seed, shape=(7, 9), sample=(5, 6)):
    rng = np.random.default_rng(seed)
    return np.stack([rng.integers(0, side, shape) for side in sample], axis=-1)


SAMPLES = [(5, 6), (8, 3), (4, 4)]


def several(seed, shape=(7, 9), none=0.2):
    """A source map of three samples, and where its pixels have no source."""
    rng = np.random.default_rng(seed)
    of = rng.integers(0, 3, shape)
    source = np.stack([rng.integers(0, np.array([s[axis] for s in SAMPLES])[of]) for axis in (0, 1)] + [of], axis=-1)
    bare = rng.random(shape) < none
    source[bare, :2] = -1
    return source, bare


@pytest.mark.parametrize(("dtype", "channels"), [("uint8", ()), ("float32", (3,)), ("bool", (1,))])
def test_apply_against_a_loop(dtype, channels):
    source, other = some_map(1), (np.random.default_rng(1).random((5, 6, *channels)) * 200).astype(dtype)
    carried = apply_source_map(source, other, (5, 6))
    assert carried.dtype == other.dtype
    for i, j in np.ndindex(7, 9):
        np.testing.assert_array_equal(carried[i, j], other[tuple(source[i, j])])
    source, _ = several(1, none=0)
    others = [(np.random.default_rng(2).random((*shape, *channels)) * 200).astype(dtype) for shape in SAMPLES]
    carried = apply_source_map(source, others, SAMPLES)
    assert carried.dtype == dtype
    for i, j in np.ndindex(7, 9):
        row, col, sample = source[i, j]
        np.testing.assert_array_equal(carried[i, j], others[sample][row, col])


def test_apply_errors():
    source, grey = some_map(0), np.zeros((5, 6))
    source[0, 0] = (4, 5)
    wild, far, bare, two = (source.copy() for _ in range(4))
    wild[1, 1, 1], far[1, 1, 1], bare[1, 4], two[1, 4], two[3, 3] = -2, 2**31, -1, -1, -1
    for positions, other, shape, words in (
        (source, np.zeros((8, 8, 3)), (5, 6), r"is 8 x 8 pixels .* sample 6 x 5: bring"),
        (source, np.zeros((4, 6)), None, "at least 6 x 5"),
        (source, np.zeros(6), None, "1-dimensional"),
        (source[..., :1], grey, None, "rows, cols, 2"),
        (source.astype(float), grey, None, "rows, cols, 2"),
        (source[:0], grey, None, "rows, cols, 2"),
        (wild, grey, None, "the position -2:"),
        (far, grey, None, f"the position {2**31}:"),
        (source - source.min() - 1, grey, None, "position -1"),
        (bare, grey, None, "1 pixel has no source, the first at row 1, column 4: carry over"),
        (two, grey, None, "2 pixels have no source"),
    ):
        with pytest.raises(ValueError, match=words):
            apply_source_map(positions, other, shape)


def test_errors_of_several_samples():
    source, _ = several(6, none=0)
    a, b, c = (np.zeros(shape) for shape in SAMPLES)
    for others, sizes, words in (
        ([a, b], None, "pixels of sample 2, counted from 0, and the number of other maps is 2"),
        (a, None, "number of other maps is 1"),
        ([a, a, c], SAMPLES, r"other map of sample 1 is 6 x 5 pixels .* sample 3 x 8: bring"),
        ([a, b, np.zeros((1, 4))], None, r"other map of sample 2 is 4 x 1 pixels .* at least 4 x 4: bring"),
        ([a, b, c], SAMPLES[:2], "for each of 3 maps"),
        ([a, b, c], (5, 6, 3), "for each of 3 maps"),
        ([a, b, c.astype(np.uint8)], None, "float64 with no channels and uint8 with no channels: bring"),
        ([a, b, np.zeros((4, 4, 3))], None, "float64 with 3 channels and float64 with no channels: bring"),
        ([a, b, np.zeros(4)], None, "1-dimensional"),
    ):
        with pytest.raises(ValueError, match=words):
            apply_source_map(source, others, sizes)
    for axis in range(3):
        bad = source.copy()
        bad[3, 3, axis] = -1
        with pytest.raises(ValueError, match="position -1 in a row, column or sample alone"):
            apply_source_map(bad, [a, b, c])


def test_files(tmp_path):
    bare, _ = several(8)
    bare[0, 0] = -1
    for source in (*(some_map(1, sample=sample) for sample in ((5, 6), (300, 65536))), bare, bare[..., :2]):
        for name in ("map.npz", "map.npy", "MAP.NPZ", *["map.png"] * int(source.min() >= 0)):
            save_source_map(tmp_path / name, source)
            loaded = load_source_map(tmp_path / name)
            assert loaded.dtype == np.int32 and np.array_equal(loaded, source)
    assert sorted(os.listdir(tmp_path)) == ["MAP.NPZ", "map.npy", "map.npz", "map.png"]


def test_a_png_has_the_sample_in_blue(tmp_path):
    source, _ = several(9, none=0)
    save_source_map(tmp_path / "map.png", source)
    np.testing.assert_array_equal(load_source_map(tmp_path / "map.png"), source)
    np.testing.assert_array_equal(read(tmp_path / "map.png").pixels, source)
    source[..., 2] = 0
    save_source_map(tmp_path / "one.png", source)
    np.testing.assert_array_equal(load_source_map(tmp_path / "one.png"), source[..., :2])
    save_source_map(tmp_path / "one.npy", source)
    np.testing.assert_array_equal(load_source_map(tmp_path / "one.npy"), source)
    source[2, 2, :2] = -1
    with pytest.raises(ValueError, match=r"bare\.png cannot hold pixels without a source: use \.npz"):
        save_source_map(tmp_path / "bare.png", source)
    assert not (tmp_path / "bare.png").exists()


def test_file_errors(tmp_path):
    source = some_map(2)
    write(tmp_path / "colour.png", np.full((4, 4, 3), 7, np.uint8))
    with pytest.raises(ValueError, match=r"colour\.png is a picture of 8 bits and holds no source map"):
        load_source_map(tmp_path / "colour.png")
    with pytest.raises(ValueError, match="over 65535"):
        save_source_map(tmp_path / "a.png", source + 70000)
    with pytest.raises(ValueError, match=r"\.npz"):
        save_source_map(tmp_path / "a.tif", source)
    assert os.listdir(tmp_path) == ["colour.png"]
    for name in ("none.npz", "none.npy"):
        with pytest.raises(ValueError, match="does not exist"):
            load_source_map(tmp_path / name)
    save_source_map(tmp_path / "a.npz", source)
    data = (tmp_path / "a.npz").read_bytes()
    (tmp_path / "part.npz").write_bytes(data[: len(data) // 2])
    np.savez(tmp_path / "other.npz", something=source)
    for name in ("part.npz", "other.npz"):
        with pytest.raises(ValueError, match="cannot be read as a source map of simdtex"):
            load_source_map(tmp_path / name)
    np.save(tmp_path / "grey.npy", np.zeros((3, 3)))
    with pytest.raises(ValueError, match=r"grey\.npy: a source map is"):
        load_source_map(tmp_path / "grey.npy")
