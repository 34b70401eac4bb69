"""The structure channel: signed distance to the border between the bright and the dark parts of a sample."""

import numpy as np
import plain_sample
import pytest
from cases import texture

from simdtex.model.sample import STEPS, Sample, variance
from simdtex.model.scale import REACH, distance, principal, structure


@pytest.mark.parametrize("shape", [(40, 37), (1, 30), (30, 1), (6, 5)])
def test_the_distance_is_to_the_nearest_marked_pixel(shape):
    rng = np.random.default_rng(1)
    marked = rng.random(shape) < 0.02
    marked.ravel()[3] = True
    found = distance(marked)
    places = np.argwhere(marked)
    for i, j in np.ndindex(shape):
        nearest = min((i - k) ** 2 + (j - m) ** 2 for k, m in places)
        assert found[i, j] == min(nearest, REACH**2)


def test_nothing_marked_is_far():
    assert (distance(np.zeros((5, 6), bool)) == REACH**2).all()


def step(side=60, at=30):
    """A picture of one edge, between two columns."""
    return np.where(np.arange(side) < at, 40, 200)[None, None] * np.ones((1, side, 1), int)


@pytest.mark.parametrize("turned", [False, True])
def test_it_rises_across_a_border_from_the_dark_to_the_bright(turned):
    levels = step().astype(np.uint16)
    found = structure([np.swapaxes(levels, 1, 2) if turned else levels], 1.0, variance(levels), STEPS)[0]
    found = found.T if turned else found
    assert (found == found[0]).all(), "the border is a column"
    line = np.diff(found[0].astype(int))
    near = line[30 - 16 : 30 + 15]
    assert near.min() > 0
    assert near.max() - near.min() <= 1, "a pixel farther inside is as much more everywhere"
    assert (line[:8] <= 0).all(), "what is far from anything darker is no longer bright"


def test_a_bright_stripe_and_a_dark_one_differ():
    stripes = np.where(np.arange(60) // 6 % 2, 40, 200)[None, None] * np.ones((1, 20, 1), int)
    found = structure([stripes.astype(np.uint16)], 1.0, 6400.0, STEPS)[0][10].astype(int)
    assert (found[(stripes[0, 0] == 200)].min()) > found[stripes[0, 0] == 40].max()


def test_the_principal_component_is_that_of_greatest_variance():
    rng = np.random.default_rng(3)
    base = rng.integers(0, 100, (12, 30))
    levels = np.stack([4 * base, -base, rng.integers(0, 9, base.shape)])
    assert principal([levels[:, :5], levels[:, 5:]])[:2].tolist() == [127, -32]
    assert principal([-levels]).tolist()[:2] == [127, -32], "its weights add up to more than 0"
    assert principal([np.stack([base, -base])]).tolist() == [127, -127]
    assert principal([np.stack([base // 2, -base])]).tolist()[1] == 127
    assert principal([np.zeros((2, 3, 3), int)]).tolist() == [1, 1]


@pytest.mark.parametrize("weight", [0.5, 1.0, 2.0])
def test_its_deviation_is_its_weight_in_those_of_the_sample(weight):
    levels = np.moveaxis(texture((50, 48), 3, seed=2), -1, 0).astype(np.uint16)
    found = structure([levels], weight, variance(levels), STEPS)[0]
    assert found.std() == pytest.approx(weight * variance(levels) ** 0.5, rel=0.01)


def test_it_keeps_to_the_legal_levels():
    levels = (texture((50, 48), seed=2)[None] // 8 * 8).astype(np.uint16)
    found = structure([levels], 50.0, variance(levels), STEPS)[0]
    assert (found.min(), found.max()) == (0, STEPS)


@pytest.mark.parametrize("levels", [np.full((1, 9, 9), 7), np.zeros((3, 4, 5), int)])
def test_a_sample_without_an_edge_has_none(levels):
    assert not structure([levels.astype(np.uint16)], 1.0, 1.0, 255)[0].any()


@pytest.mark.parametrize("channels", [1, 3])
def test_it_is_what_plain_loops_find(channels):
    pictures = [np.moveaxis(texture(shape, channels, seed=4), -1, 0).astype(np.uint16) for shape in ((13, 15), (9, 40))]
    expected = plain_sample.structure([[*one.astype(int)] for one in pictures], 1.0, STEPS)
    found = structure(pictures, 1.0, variance(*pictures), STEPS)
    for one, other in zip(found, expected, strict=True):
        assert (one == other).all()
        assert one.any()


@pytest.mark.parametrize("dtype", [np.uint8, np.float32])
def test_a_sample_matches_it_and_does_not_show_it(dtype):
    pixels = texture((20, 22), 3, dtype, 1)
    sample, plain = Sample(pixels, 16, 2, 1.5), Sample(pixels, 16, 2)
    assert (sample.channels, sample.shown, plain.channels) == (4, 3, 3)
    assert (sample.working[:3] == plain.working).all()
    assert sample.working[3].max() > 0
    source = np.arange(sample.rows * sample.cols).reshape(sample.rows, sample.cols)[2:-2, 2:-2]
    values = sample.working[:, source].copy()
    values[3] += 5
    assert (sample.picture(values, source) == pixels).all()
