"""Turned and scaled copies of pictures: exact where they can be, the nearest pixel elsewhere, and their way back."""

from itertools import product
from math import cos, radians, sin

import numpy as np
import pytest
from cases import texture

import simdtex
from simdtex.model.pictures import MOST_COPIES, Pictures, copy_of, turned


@pytest.mark.parametrize("shape", [(5, 8), (7, 7), (1, 4)])
def test_quarter_turns_are_exact(shape):
    picture = np.arange(shape[0] * shape[1]).reshape(shape)
    for quarter in range(4):
        copy = copy_of(0, shape, 2 * quarter, 0)
        assert copy.inside.all()
        assert np.array_equal(copy.of([picture]), np.rot90(picture, -quarter)), "from columns to rows"


@pytest.mark.parametrize(("eighths", "halves"), [*product(range(8), range(-2, 3))])
def test_a_pixel_is_the_nearest_of_the_picture(eighths, halves):
    rows, cols = 9, 14
    copy, by, angle = copy_of(3, (rows, cols), eighths, halves), 2.0 ** (halves / 2), radians(45 * eighths)
    assert copy.image == 3
    high, wide = copy.inside.shape
    far = 0.0
    for i, j in np.ndindex(high, wide):
        y, x = (i - (high - 1) / 2) / by, (j - (wide - 1) / 2) / by
        col = x * cos(angle) + y * sin(angle) + (cols - 1) / 2
        row = -x * sin(angle) + y * cos(angle) + (rows - 1) / 2
        if copy.inside[i, j]:
            far = max(far, abs(row - copy.row[i, j]), abs(col - copy.col[i, j]))
        else:
            assert not (-0.4 < row < rows - 0.6 and -0.4 < col < cols - 0.6)
        assert 0 <= copy.row[i, j] < rows and 0 <= copy.col[i, j] < cols
    assert far <= 0.5 + 1e-6
    assert copy.inside.sum() == pytest.approx(rows * cols * by**2, rel=0.2)


def test_only_what_is_wanted_is_made():
    picture = Pictures((texture((9, 14))[..., None],) * 2)
    images = np.zeros((2, 4, 5))
    images[0] = 1
    images[:, :, 4] = [[0.25] * 4, [0.75] * 4]
    rotation = np.array([[0, 359, 22, 23, 90]] * 3 + [[np.nan] * 5])
    found = turned(picture, images, rotation, None)
    assert len(found.copies) == 4, "0, 45 of the first, and 90 of both"
    assert found.probability[:, 0].T.tolist() == [[1, 0, 0, 0]] * 3 + [[0, 1, 0, 0], [0, 0, 0.25, 0.75]]
    assert np.isnan(found.probability[:, 3]).all()
    assert [one.image for one in found.copies] == [0, 0, 0, 1]
    scale = np.array([[0.5, 0.55, 0.6, 0.65, 2]] * 4)
    assert [one.inside.shape for one in turned(picture, images, None, scale).copies] == [
        (5, 7), (7, 10), (18, 28), (18, 28)]  # fmt: skip


def test_too_many_copies_are_refused():
    picture = Pictures((texture((9, 14))[..., None],) * 3)
    rotation, scale = (np.arange(40) % 8 * 45.0)[None], 2.0 ** ((np.arange(40) // 8 - 2) / 2)[None]
    with pytest.raises(ValueError, match=f"120 different copies .* round .* {MOST_COPIES} or fewer"):
        turned(picture, np.full((3, 1, 40), 1 / 3), rotation, scale)
    with pytest.raises(ValueError, match="have no number; leave them out"):
        turned(picture, np.full((3, 1, 40), 1 / 3), rotation * np.nan, scale)


def test_sources_lead_back_to_the_training_image():
    training = np.arange(400, dtype=np.int32).reshape(20, 20)
    row, col = np.indices((12, 13))
    maps = {"rotation": col * 30.0, "scale": np.where(row < 6, 0.6, 1.4)}
    options = {"order": 2, "levels": 2, "device": "reference", "rng": 1, "finish": 0.0, "source": True}
    found = simdtex.simulate(training, 2, **maps, **options)
    assert (training[found.source_row.values, found.source_column.values] == found.simulation.values).all()
    usable = training % 20 < 13
    half = simdtex.simulate([training, -training], 1, **maps, **options, mask=[usable, usable])
    assert (half.source_column < 13).all()
    signs = np.where(half.source_image.values == 1, -1, 1)
    assert (signs * training[half.source_row.values, half.source_column.values] == half.simulation.values).all()


@pytest.mark.parametrize("quarters", [0, 1])
def test_stripes_turn(quarters):
    stripes = np.tile(np.uint8([0, 0, 9, 9]), (24, 6))
    found = simdtex.simulate(
        stripes, 1, shape=(16, 16), rotation=np.full((16, 16), 90.0 * quarters), order=4, device="reference", rng=3
    ).values[0]
    along = (found == np.roll(found, 1, 1 if quarters else 0))[1:, 1:].mean()
    across = (found == np.roll(found, 1, 0 if quarters else 1))[1:, 1:].mean()
    assert along > 0.95 and across < 0.65


def test_guides_turn_with_their_training_image():
    training = np.arange(400, dtype=np.int32).reshape(20, 20)
    wanted = np.arange(12)[:, None] * np.ones((1, 12)) > 5
    found = simdtex.simulate(
        training, 1, rotation=np.full((12, 12), 90.0), guide=((training > 199).astype(int), wanted.astype(int)),
        guide_weight=1e6, order=2, levels=1, device="reference", rng=3, finish=0.0,
    ).values[0]  # fmt: skip
    assert ((found > 199) == wanted).mean() > 0.95
