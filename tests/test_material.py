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
    "rough_wood.png": None,
    "normal_wall.png": None,
    "abnormal.png": None,
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


def test_maps_of_a_folder(tmp_path):
    for name in ("b_albedo.png", "b_normal.tif", "preview.png", "normal.txt", "material.mtlx", "._b_ao.png"):
        (tmp_path / name).touch()
    (tmp_path / "roughness.png").mkdir()
    found = find_maps(tmp_path)
    assert found.files == {"albedo": tmp_path / "b_albedo.png", "normal": tmp_path / "b_normal.tif"}
    assert found.unknown == ["preview.png"]


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (("b_color.png", "b_diffuse.png"), r"b_color.png and b_diffuse.png are both albedo maps: move one out"),
        (("b_color.png", "b_disp.exr"), "b_disp.exr is of a format that is not read: save it as TIFF"),
    ],
)
def test_a_folder_that_is_unclear_is_refused(tmp_path, names, said):
    for name in names:
        (tmp_path / name).touch()
    with pytest.raises(ValueError, match=said):
        find_maps(tmp_path)


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
