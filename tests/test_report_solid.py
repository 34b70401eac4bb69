"""The picture of a solid: rays meet bodies where they should, faces show their slices, every type can be seen."""

import numpy as np
import pytest

from simdtex.io import image
from simdtex.report import solid
from simdtex.report.sheet import GAP, TEXT

SIZE = 96
TOP = GAP + TEXT + 6  # of the pictures in the upper row
SHAPES = [(8, 8, 8), (3, 9, 6), (1, 5, 12)]


def cell(sheet, number, size=SIZE):
    """A picture of the upper row: cube, cube without an octant, sphere."""
    width = (sheet.shape[1] - GAP) // 3  # a long label may be wider than a picture
    left = GAP + number * width
    return sheet[TOP : TOP + size, left : left + size].astype(int)


def noise(shape, seed=0):
    return np.random.default_rng(seed).integers(0, 256, shape, np.uint8)


def rays(extent, count=24):
    place = np.linspace(-extent, extent, count)
    return place[:, None, None] * solid.DOWN + place[:, None] * solid.RIGHT


def in_box(points, half):
    return (np.abs(points) < half).all(-1)


def in_box_without_octant(points, half):
    nearest = (points[..., 0] < 0) & (points[..., 1] < 0) & (points[..., 2] > 0)
    return in_box(points, half) & ~nearest


def in_sphere(points, half):
    return np.linalg.norm(points, axis=-1) < half.max()


BODIES = {
    "cube": (solid._cube, in_box),
    "octant": (solid._cube_without_octant, in_box_without_octant),
    "sphere": (lambda r, half: solid._sphere(r, half.max()), in_sphere),
}


@pytest.mark.parametrize("name", sorted(BODIES))
@pytest.mark.parametrize("shape", SHAPES)
def test_rays_meet_a_body_where_a_walk_along_them_enters_it(name, shape):
    meet, inside = BODIES[name]
    half = np.array(shape) / 2
    start = rays(np.linalg.norm(half))
    hit, points, normals = meet(start, half)
    ways = np.arange(-4, 4, 1 / 64) * half.max()  # to beyond the body's far corner
    walk = np.array([inside(start + way * solid.AHEAD, half) for way in ways])
    assert not walk[:, ~hit].any()
    entered = walk.any(0)[hit]  # it may step over a corner
    assert entered.mean() > 0.9
    first = walk.argmax(0)[hit][entered]
    way = ((points - start[hit]) @ solid.AHEAD)[entered]
    assert ((ways[first - 1] < way) & (way < ways[first])).all()
    assert (normals @ solid.AHEAD < 0).all()
    assert inside(points - 1e-6 * normals + 1e-7 * solid.AHEAD, half).all()  # just below the surface, and above it
    assert not inside(points + 1e-6 * normals, half).any()


def test_faces_show_their_slices():
    """Red first slice, green first rows, blue last columns, white inside."""
    block = np.full((16, 16, 16, 3), 255, np.uint8)
    block[:, 0], block[:, :, -1], block[0] = (0, 255, 0), (0, 0, 255), (255, 0, 0)
    sheet = solid.view(block, size=SIZE)
    for number in (0, 1):
        whole = cell(sheet, number)
        for row, col, channel in [(60, 10, 0), (10, 45, 1), (60, 85, 2)]:
            seen = whole[row, col]
            assert seen[channel] > 120
            assert np.delete(seen, channel).tolist() == [0, 0]
    inner = cell(sheet, 1)[SIZE // 2 - 4 : SIZE // 2 + 4, SIZE // 2 - 4 : SIZE // 2 + 4]
    assert (inner == inner[..., :1]).all()
    assert inner.max() > 120


def test_a_face_lies_as_its_slice():
    """Columns go to the right and rows down on the first slice; on the right face z goes away to the right."""
    for slot, before, after in [
        (np.s_[0, 8:12, 2:5], (60, 16), (69, 39)),  # on the left of the first slice
        (np.s_[0, 8:12, 10:13], (69, 39), (60, 16)),
        (np.s_[2:6, 8:12, -1], (69, 61), (58, 80)),  # at the near end of the right face
        (np.s_[10:14, 8:12, -1], (58, 80), (69, 61)),
        (np.s_[0, 2:5, 2:5], (36, 16), (60, 16)),  # above the first
    ]:
        block = np.zeros((16, 16, 16), np.uint8)
        block[slot] = 255
        cube = cell(solid.view(block, size=SIZE), 0)[..., 0]
        assert cube[before] > 120
        assert cube[after] == 0


def test_light_falls_from_above_and_edges_are_smooth():
    sheet = solid.view(np.full((9, 9, 9), 200, np.uint8), size=SIZE)
    cube = cell(sheet, 0)[..., 0]
    lamp = solid.LIGHT / np.linalg.norm(solid.LIGHT)
    shades = [round(200 * (solid.AMBIENT + solid.LAMP * abs(part))) for part in (lamp[1], lamp[0], lamp[2])]
    assert shades == sorted(shades, reverse=True)
    assert [cube[10, 45], cube[60, 20], cube[60, 80]] == shades
    between = ~np.isin(cube, [*shades, round(solid.BACKGROUND)])
    assert 0.01 < between.mean() < 0.12
    for number in range(3):
        corners = cell(sheet, number)[:: SIZE - 1, :: SIZE - 1]
        assert (corners == solid.BACKGROUND).all()
    sphere = cell(sheet, 2)[..., 0]
    assert sphere[30, 48] > sphere[80, 60] > 0


@pytest.mark.parametrize("shape", SHAPES)
def test_the_sphere_is_out_of_the_repeated_block(shape):
    block = noise((*shape, 3))
    pictures = [
        solid._rendered(b, lambda r: solid._sphere(r, 10.0), 48, 0.5) for b in (block, np.tile(block, (3, 3, 3, 1)))
    ]
    np.testing.assert_array_equal(*pictures)


@pytest.mark.parametrize("size", [96, 250])
def test_slices_stand_below_in_whole_pixels(size):
    block = noise((6, 5, 8, 3))
    sheet = solid.view(block, size=size)
    factor, width = size // 8, (sheet.shape[1] - GAP) // 3
    top = TOP + size + TOP
    for number, picture in enumerate((block[3], block[:, 2], block[:, :, 4])):
        large = picture.repeat(factor, 0).repeat(factor, 1)
        left = GAP + number * width
        shown = sheet[top : top + large.shape[0], left : left + width]
        np.testing.assert_array_equal(shown[:, : large.shape[1]], large)
        assert (shown[:, large.shape[1] :] == 255).all()


@pytest.mark.parametrize("channels", [1, 2, 3, 5])
def test_the_first_channel_is_grey_and_the_first_three_are_colours(channels):
    block = noise((4, 5, 6, channels))
    shown = block[..., :3] if channels >= 3 else block[..., 0]
    np.testing.assert_array_equal(solid.view(block, size=SIZE), solid.view(shown, size=SIZE))
    sheet = solid.view(block, size=SIZE)
    assert (sheet == sheet[..., :1]).all() == (channels < 3)


def test_the_sheet_is_written(tmp_path):
    sheet = solid.view(noise((4, 4, 4, 3)), tmp_path / "a.png", size=SIZE)
    np.testing.assert_array_equal(image.read(tmp_path / "a.png").pixels, sheet, strict=True)


def test_what_cannot_be_shown(tmp_path):
    for shape in [(4, 4), (0, 4, 4), (1, 1, 1, 1, 1)]:
        with pytest.raises(ValueError, match="the shape"):
            solid.view(np.zeros(shape))
    for size in (95, 1025):
        with pytest.raises(ValueError, match="give 96 to 1024 pixels"):
            solid.view(np.zeros((2, 2, 2)), size=size)
    with pytest.raises(ValueError, match="does not exist"):
        solid.view(np.zeros((2, 2, 2)), tmp_path / "none" / "a.png")
