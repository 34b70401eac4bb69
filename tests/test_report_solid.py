"""The picture of a solid: the faces of the block and its middle slices, in one scale, of every type."""

import numpy as np
import pytest

from simdtex.io import image
from simdtex.report.sheet import GAP, STRIP, view

SIZE = 96
TOP = GAP + STRIP


def cells(sheet):
    """The pictures of a sheet, with the white around them: the block and three slices."""
    return np.split(sheet[TOP:, GAP:], 4, axis=1)


def noise(shape, seed=0):
    return np.random.default_rng(seed).integers(0, 256, shape, np.uint8)


@pytest.mark.parametrize("shape", [(8, 8, 8), (3, 9, 6), (1, 5, 12)])
def test_faces_are_those_of_the_block(shape):
    block = noise((*shape, 3))
    depth, rows, cols = shape
    behind = (depth - 1) // 2
    factor = SIZE // max(behind + rows, behind + cols, depth)
    cube = cells(view(block, size=SIZE))[0][::factor, ::factor].astype(int)
    np.testing.assert_array_equal(cube[behind : behind + rows, :cols], block[0])
    for away in range(1, behind + 1):  # of two slices that share a pixel the nearer is in front
        z = 2 * away
        above, right = (
            cube[behind - away, away : away + cols],
            cube[behind - away : rows + behind - away, cols + away - 1],
        )
        np.testing.assert_array_equal(above, block[z, 0] // 4 * 3)
        np.testing.assert_array_equal(right, block[z, :, -1] // 4 * 3)
    if behind:
        assert (cube[: behind - 1, 0] == 255).all() and (cube[rows + 1 : behind + rows, cols + behind - 1] == 255).all()


@pytest.mark.parametrize("size", [96, 250])
def test_slices_have_the_scale_of_the_block_in_whole_pixels(size):
    block = noise((6, 5, 8, 3))
    factor = size // 10  # the block is 8 + 2 pixels wide
    shown = cells(view(block, size=size))[1:]
    for cell, picture in zip(shown, (block[3], block[:, 2], block[:, :, 4]), strict=True):
        large = picture.repeat(factor, 0).repeat(factor, 1)
        rows, cols = large.shape[:2]
        np.testing.assert_array_equal(cell[:rows, :cols], large)
        assert (cell[rows:] == 255).all() and (cell[:rows, cols:] == 255).all()


def test_a_large_block_is_reduced():
    sheet = view(np.full((3, 250, 150), 90, np.uint8), size=100)
    cell = cells(sheet)[1]
    assert (cell == 90).all(-1).sum() == 84 * 50  # a third of each side


@pytest.mark.parametrize("channels", [1, 2, 3, 5])
def test_the_first_channel_is_grey_and_the_first_three_are_colours(channels):
    block = noise((4, 5, 6, channels))
    shown = block[..., :3] if channels >= 3 else block[..., 0]
    np.testing.assert_array_equal(view(block, size=SIZE), view(shown, size=SIZE))
    sheet = view(block, size=SIZE)
    assert (sheet == sheet[..., :1]).all() == (channels < 3)


def test_the_sheet_is_written(tmp_path):
    sheet = view(noise((4, 4, 4, 3)), tmp_path / "a.png", size=SIZE)
    np.testing.assert_array_equal(image.read(tmp_path / "a.png").pixels, sheet, strict=True)


def test_what_cannot_be_shown(tmp_path):
    for shape in [(4, 4), (0, 4, 4), (1, 1, 1, 1, 1)]:
        with pytest.raises(ValueError, match="the shape"):
            view(np.zeros(shape))
    for size in (95, 1025):
        with pytest.raises(ValueError, match="give 96 to 1024 pixels"):
            view(np.zeros((2, 2, 2)), size=size)
    with pytest.raises(ValueError, match="does not exist"):
        view(np.zeros((2, 2, 2)), tmp_path / "none" / "a.png")
