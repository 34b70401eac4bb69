"""The maps of a material: what a name says, what is in a folder, and normals of length 1."""

import re
from pathlib import Path

import numpy as np
import pytest

from simdtex.model.material import ROLES, find_maps, map_role, unit_normals

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
    page = (Path(__file__).parent.parent / "docs" / "readers" / "materials.rst").read_text(encoding="utf-8")
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
