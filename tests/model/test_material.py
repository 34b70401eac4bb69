"""The maps of a material, and source maps, which arrange one picture like another."""

import os
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

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
    "albedo.png": "albedo",
    "brick_normal.png": "normal",
    "Brick-Roughness.tif": "roughness",
    "BrickBaseColor.png": "albedo",
    "base_color.tif": "albedo",
    "wood diffuse.jpg": "albedo",
    "Bricks001_2K-PNG_NormalGL.png": "normal",
    "Bricks001_2K-PNG_NormalDX.png": "normal-dx",
    "Bricks001_4K_AmbientOcclusion.jpg": "ao",
    "floor_nor_gl_2k.png": "normal",
    "floor_disp_1024.png": "height",
    "brick_height_16bit.tif": "height",
    "NormalMap.png": "normal",
    "BRICK_AO.PNG": "ao",
    "rock.Metalness.png": "metallic",
    "brick_albedo.1001.png": "albedo",
    "brick_metallic_roughness.png": "packed",
    "rock_Normal_OpenGL.png": "normal",
    "rock_Normal_DirectX.png": "normal-dx",
    "rock-normal-ogl.png": "normal",
    "rock_Mixed_AO.png": "ao",
    "rock_depth.png": "height",
    "rock_AlbedoTransparency.png": "albedo",
    "rock_MetallicSmoothness.png": "packed",
    "rock_MaskMap.png": "packed",
    "rock_OcclusionRoughnessMetallic.png": "packed",
    "vlkhcbxia_2K_Albedo.jpg": "albedo",
    "vlkhcbxia_2K_Normal_LOD0.jpg": "normal",
    "vlkhcbxia_2K_Cavity.jpg": "cavity",
    "vlkhcbxia_2K_Translucency.jpg": "translucency",
    "vlkhcbxia_2K_Fuzz.jpg": "fuzz",
    "Ground003_COL_VAR1_3K.jpg": "albedo",
    "Ground003_NRM16_3K.tif": "normal",
    "Ground003_DISP16_3K.tif": "height",
    "Ground003_REFL_3K.jpg": "specular",
    "Metal001_COL_2K_METALNESS.png": "albedo",
    "Metal001_METALNESS_2K_METALNESS.png": "metallic",
    "Metal001_NRM16_4K_LOD0_METALNESS.png": "normal",
    "rock_arm_2k.png": "packed",
    "T_Rock_BC.png": "albedo",
    "T_Rock_N.png": "normal",
    "T_Rock_ORM.png": "packed",
    "rock_OcclusionRoughMetal.png": "packed",
    "rock_MetallicGlossMap.png": "packed",
    "rock_DetailAlbedoMap.png": "detail",
    "rough_wood.png": None,
    "normal_wall.png": None,
    "abnormal.png": None,
    "color_metalness_old.png": None,
    "wood_r.png": None,
    "brick_n.png": None,
    "T_Sign_3D.png": None,
    "brick_mask.png": None,
    "2k.png": None,
    "brick.png": None,
}


@pytest.mark.parametrize("name", NAMES)
def test_the_end_of_a_name_says_what_a_map_is(name):
    assert map_role(f"Color/{name}") == NAMES[name]


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


@pytest.mark.parametrize(
    ("names", "count"),
    [
        (("wood_d.png", "wood_n.png", "wood_r.png"), 3),
        (("wood_d.png", "wood_r.png", "wood_AO.png"), 3),
        (("wood_r.png", "wood_d.png", "sky_AO.png"), 1),
        (("coast_n.png", "coast_e.png", "coast_s.png"), 0),
        (("coast_n.png", "coast_e.png", "coast_s.png", "coast.png"), 4),
        (("coast_n.png", "coast.png"), 0),
        (("G_COL_VAR1_3K.jpg", "G_COL_VAR2_3K.jpg", "G_DISP_3K.jpg", "G_DISP16_3K.tif", "G_NRM_3K.jpg"), 5),
        (("R_Normal_OpenGL.png", "r-normal-dx.png", "R_Base_Color.png", "height.npy"), 4),
    ],
)
def test_maps_with_letters_and_variants(tmp_path, names, count):
    found = find_maps(folder_with(tmp_path, *names))
    assert len(found.files) == count and len(found.unknown) == len(names) - count


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
    folder_with(
        tmp_path,
        "oak_albedo.png",
        "oak_OldRoughness.png",
        "ash_albedo.png",
        "ash_n.png",
        "elm.png",
        "elm_n.png",
        "elm_s.png",
    )
    found = find_maps(tmp_path, tmp_path / "oak_albedo.png")
    assert [*found.files.values()] == ["albedo"] and found.unknown == ["oak_OldRoughness.png"]
    assert [*find_maps(tmp_path, tmp_path / "elm.png").files.values()] == ["albedo", "normal", "specular"]


def test_sizes_are_parts_of_stems(tmp_path):
    folder_with(tmp_path, "floor_diff_1k.png", "floor_diff_2k.png", "floor_disp_1k.png")
    assert set(roles_in(tmp_path, tmp_path / "floor_diff_1k.png")) == {"floor_diff_1k.png", "floor_disp_1k.png"}


def test_a_folder_that_is_not_there_is_named(tmp_path):
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


def test_floats_of_0_to_1_stay_so():
    made = unit_normals(np.array([[[0.5, 0.5, 0.75]]]), np.array([[True]]))
    np.testing.assert_allclose(made, [[[0.5, 0.5, 1.0]]])


def test_a_grey_map_is_let_be():
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


@given(st.integers(0, 2**32 - 1), st.sampled_from(["uint8", "uint16", "float32", "bool"]),
       st.sampled_from([(), (1,), (3,), (6,)]))  # fmt: skip
def test_apply_against_a_loop(seed, dtype, channels):
    source = some_map(seed)
    other = (np.random.default_rng(seed).random((5, 6, *channels)) * 200).astype(dtype)
    carried = apply_source_map(source, other, (5, 6))
    assert carried.dtype == other.dtype
    for i, j in np.ndindex(7, 9):
        np.testing.assert_array_equal(carried[i, j], other[tuple(source[i, j])])


def test_apply_errors():
    source = some_map(0)
    source[0, 0] = (4, 5)
    with pytest.raises(ValueError, match=r"is 8 x 8 pixels .* sample 6 x 5: bring"):
        apply_source_map(source, np.zeros((8, 8, 3)), (5, 6))
    with pytest.raises(ValueError, match="at least 6 x 5"):
        apply_source_map(source, np.zeros((4, 6)))
    with pytest.raises(ValueError, match="1-dimensional"):
        apply_source_map(source, np.zeros(6))
    for bad in (source[..., :1], source.astype(float), source[:0]):
        with pytest.raises(ValueError, match="rows, cols, 2"):
            apply_source_map(bad, np.zeros((5, 6)))
    for value in (-2, 2**31):
        wild = source.copy()
        wild[1, 1, 1] = value
        with pytest.raises(ValueError, match=f"the position {value}:"):
            apply_source_map(wild, np.zeros((5, 6)))
    with pytest.raises(ValueError, match="position -1"):
        apply_source_map(source - source.min() - 1, np.zeros((5, 6)))


@given(st.integers(0, 2**32 - 1), st.sampled_from(["uint8", "float32"]), st.sampled_from([(), (1,), (3,)]))
def test_several_samples_against_a_loop(seed, dtype, channels):
    rng = np.random.default_rng(seed)
    source, _ = several(seed, none=0)
    others = [(rng.random((*shape, *channels)) * 200).astype(dtype) for shape in SAMPLES]
    carried = apply_source_map(source, others, SAMPLES)
    assert carried.dtype == dtype
    for i, j in np.ndindex(7, 9):
        row, col, sample = source[i, j]
        np.testing.assert_array_equal(carried[i, j], others[sample][row, col])


def test_pixels_without_a_source_are_refused():
    source = some_map(5)
    source[1, 4] = -1
    with pytest.raises(ValueError, match="1 pixel has no source, the first at row 1, column 4: carry over"):
        apply_source_map(source, np.zeros((5, 6)))
    source[3, 3] = -1
    with pytest.raises(ValueError, match="2 pixels have no source"):
        apply_source_map(source, np.zeros((5, 6)))


def test_errors_of_several_samples():
    source, _ = several(6, none=0)
    others = [np.zeros(shape) for shape in SAMPLES]
    with pytest.raises(ValueError, match="pixels of sample 2, counted from 0, and the number of other maps is 2"):
        apply_source_map(source, others[:2])
    with pytest.raises(ValueError, match="number of other maps is 1"):
        apply_source_map(source, others[0])
    with pytest.raises(ValueError, match=r"other map of sample 1 is 6 x 5 pixels .* sample 3 x 8: bring"):
        apply_source_map(source, [others[0], others[0], others[2]], SAMPLES)
    with pytest.raises(ValueError, match=r"other map of sample 2 is 4 x 1 pixels .* at least 4 x 4: bring"):
        apply_source_map(source, [*others[:2], np.zeros((1, 4))])
    for sizes in (SAMPLES[:2], (5, 6, 3), (5, 6)):
        with pytest.raises(ValueError, match="for each of 3 maps"):
            apply_source_map(source, others, sizes)
    with pytest.raises(ValueError, match="float64 with no channels and uint8 with no channels: bring"):
        apply_source_map(source, [*others[:2], others[2].astype(np.uint8)])
    with pytest.raises(ValueError, match="float64 with 3 channels and float64 with no channels: bring"):
        apply_source_map(source, [*others[:2], np.zeros((4, 4, 3))])
    with pytest.raises(ValueError, match="1-dimensional"):
        apply_source_map(source, [*others[:2], np.zeros(4)])
    for axis in range(3):
        bad = source.copy()
        bad[3, 3, axis] = -1
        with pytest.raises(ValueError, match="position -1 in a row, column or sample alone"):
            apply_source_map(bad, others)


@pytest.mark.parametrize("suffix", [".npz", ".npy"])
@pytest.mark.parametrize("columns", [2, 3])
def test_files_of_maps_with_pixels_that_have_no_source(tmp_path, suffix, columns):
    source, _ = several(8)
    source[0, 0] = -1
    source = source[..., :columns]
    save_source_map(tmp_path / f"map{suffix}", source)
    loaded = load_source_map(tmp_path / f"map{suffix}")
    assert loaded.dtype == np.int32
    np.testing.assert_array_equal(loaded, source)


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


def test_a_colour_picture_is_no_source_map(tmp_path):
    write(tmp_path / "colour.png", np.full((4, 4, 3), 7, np.uint8))
    with pytest.raises(ValueError, match=r"colour\.png is a picture of 8 bits and holds no source map"):
        load_source_map(tmp_path / "colour.png")


@pytest.mark.parametrize("suffix", [".npz", ".npy", ".png", ".NPZ"])
@pytest.mark.parametrize("sample", [(5, 6), (300, 65536), (1, 1)])
def test_files(tmp_path, suffix, sample):
    source = some_map(1, sample=sample)
    path = tmp_path / f"map{suffix}"
    save_source_map(path, source)
    loaded = load_source_map(path)
    assert loaded.dtype == np.int32
    np.testing.assert_array_equal(loaded, source)
    assert os.listdir(tmp_path) == [path.name]


def test_file_errors(tmp_path):
    source = some_map(2)
    with pytest.raises(ValueError, match="over 65535"):
        save_source_map(tmp_path / "a.png", source + 70000)
    with pytest.raises(ValueError, match=r"\.npz"):
        save_source_map(tmp_path / "a.tif", source)
    assert os.listdir(tmp_path) == []
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
