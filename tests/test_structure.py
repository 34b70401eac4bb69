"""The structure channel: signed distance to a sample's edges."""

from math import hypot

import numpy as np
import pytest
from cases import texture

from simdtex.model.sample import STEPS, Sample, variance
from simdtex.model.structure import REACH, distance, structure


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


def test_it_falls_towards_an_edge_from_either_side():
    levels = step().astype(np.uint16)
    found = structure([levels], 1.0, variance(levels), STEPS)[0]
    assert (found == found[0]).all(), "the edge is a column"
    line = found[0].astype(int)
    assert (line == line[::-1]).all()
    middle = line[28:32]
    assert middle.min() == 0
    assert (np.diff(line[30:47]) >= 0).all()
    assert line[59] == line[50] == line.max(), "beyond 16 pixels all are alike"


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


def plainly(levels):
    """The sign and size of the distance, in pixels, in Python numbers."""
    rows, cols = levels.shape[1:]

    def at(a, i, j):
        return a[min(max(i, 0), rows - 1)][min(max(j, 0), cols - 1)]

    kernel, gradient = (1, 4, 6, 4, 1), [[0] * cols for _ in range(rows)]
    for channel in levels.tolist():
        down = [
            [sum(w * at(channel, i + k - 2, j) for k, w in enumerate(kernel)) for j in range(cols)] for i in range(rows)
        ]
        both = [
            [sum(w * at(down, i, j + k - 2) for k, w in enumerate(kernel)) for j in range(cols)] for i in range(rows)
        ]
        for i, j in np.ndindex(rows, cols):
            a = at(both, i + 1, j) - at(both, i - 1, j)
            b = at(both, i, j + 1) - at(both, i, j - 1)
            gradient[i][j] += a * a + b * b
    limit = sorted(g for row in gradient for g in row)[int(0.85 * (rows * cols - 1))]
    edge = [[g > limit for g in row] for row in gradient]
    found = np.zeros((rows, cols))
    for i, j in np.ndindex(rows, cols):
        gaps = [hypot(i - k, j - m) for k, m in np.ndindex(rows, cols) if edge[k][m] != edge[i][j]]
        found[i, j] = min([16.0, *gaps]) * (-1 if edge[i][j] else 1)
    return found


def test_it_is_the_signed_distance():
    levels = np.moveaxis(texture((13, 15), 2, seed=4), -1, 0).astype(np.uint16)
    expected = plainly(levels)
    expected -= expected.min()
    scale = variance(levels) ** 0.5 / expected.std()
    assert np.abs(structure([levels], 1.0, variance(levels), STEPS)[0] - expected * scale).max() <= 1


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
