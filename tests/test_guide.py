"""The working levels of guides, and of variables that are known where others are not."""

import numpy as np
import pytest

from simdtex.model.guide import UNKNOWN, Colocated, Guide, Surroundings, smooth
from simdtex.model.pictures import Pictures
from simdtex.model.sample import Sample
from simdtex.model.scale import Scale

SPREAD, TOP = 100.0, 1000


def planes(samples, output, labels, weight=1.0):
    """Of guides that are given without a channel axis."""
    samples = tuple(np.asarray(one)[..., None] for one in samples)
    return Guide(samples, np.asarray(output)[..., None], labels, weight).planes(None, SPREAD, TOP)


def test_two_labels_are_one_channel():
    found = planes([[[4, 9], [9, 9]]], [[9, 4, 4]], True)
    height = int(found.output.max())
    assert found.samples[0].tolist() == [[[0, height], [height, height]]]
    assert found.output.tolist() == [[[height, 0, 0]]]
    assert height == round((SPREAD / (0.25 * 0.75)) ** 0.5), "the pixels' variance"


def test_three_labels_have_a_channel_each():
    found = planes([[[4, 9, 1]]], [[9.0, np.nan]], True)
    height = int(found.samples[0].max())
    assert found.samples[0].tolist() == [[[0, 0, height]], [[height, 0, 0]], [[0, height, 0]]]
    assert found.output.tolist() == [[[0, UNKNOWN]], [[0, UNKNOWN]], [[height, UNKNOWN]]]


def test_one_label_says_nothing():
    found = planes([[[4, 4]]], [[4]], True)
    assert not found.samples[0].any()
    assert not found.output.any()


@pytest.mark.parametrize("weight", [0.25, 1.0, 4.0])
@pytest.mark.parametrize("labels", [True, False])
def test_a_guide_varies_as_much_as_the_pixels_times_its_weight(labels, weight):
    rng = np.random.default_rng(1)
    sample = rng.integers(0, 3, (30, 31)) if labels else rng.normal(size=(30, 31))
    found = planes([sample], sample[:4], labels, weight)
    assert found.samples[0].var((1, 2)).sum() == pytest.approx(weight * SPREAD, rel=0.1)


def test_all_of_its_channels_together_vary_so():
    rng = np.random.default_rng(2)
    sample = rng.normal(size=(30, 31, 2)) * [1, 1000]
    found = Guide((sample,), sample[:2], False, 1.0).planes(None, 1e4, TOP)
    first, second = found.samples[0].var((1, 2))
    assert first == pytest.approx(second, rel=0.02)
    assert first + second == pytest.approx(1e4, rel=0.02)
    assert Guide((sample,), sample[:2], False, 1.0).channels == 2


def test_no_weight_is_no_guide():
    found = planes([[[0.0, 1.0, 3.0]]], [[1.0, np.nan]], False, 0.0)
    assert not found.samples[0].any()
    assert found.output.tolist() == [[[0, UNKNOWN]]]


def test_numbers_of_the_output_count_beside_those_of_the_sample():
    """Whatever the types: the same number is the same level."""
    for output in (np.float64([[-0.5, 7, 12]]), np.int16([[-3, 7, 12]]), np.float32([[7, np.nan, 20]])):
        for dtype in (np.uint8, np.int64, np.float32):
            sample = np.arange(5, 11, dtype=dtype)[None]
            found = planes([sample], output, False)
            at = int(np.flatnonzero(output[0] == 7)[0])
            assert found.output[0, 0, at] == found.samples[0][0, 0, 2]
            levels = found.samples[0][0, 0].astype(float)
            steps = np.diff(levels)
            assert steps.min() > 0
            assert np.ptp(steps) <= 1, "and equal steps are equal"


def test_several_samples_have_one_scale():
    found = planes([[[0.0, 1.0]], [[2.0], [4.0]]], [[4.0, 0.0, 2.0]], False)
    high = found.output[0, 0, 0]
    assert found.samples[1][0].ravel().tolist() == [round(high / 2), high]
    assert found.samples[0][0].ravel().tolist()[0] == 0 == found.output[0, 0, 1]


def test_variables_known_alone_are_told_again():
    """In the levels that the pixels have."""
    pixels = np.float32([[[0, 10], [4, 30], [2, 20]]])
    scale = Scale(Pictures((pixels,)), 64)
    values = np.zeros((1, 4, 2), np.float32)
    values[0, :, 1] = [10, 30, 20, 15]
    known = np.zeros((1, 4, 2), bool)
    known[0, 1:3, 1] = True
    found = Colocated((pixels,), values, known).planes(scale, SPREAD, TOP)
    assert found.samples[0].tolist() == scale.levels(pixels)[1:].tolist()
    assert found.output.tolist() == [[[UNKNOWN, scale.top, scale.levels(pixels)[1, 0, 2], UNKNOWN]]]


def test_a_category_known_alone_has_all_of_its_channels():
    pixels = np.stack([np.arange(6) % 3, np.arange(6)], -1)[None].astype(np.float64)
    scale = Scale(Pictures((pixels,), categorical=(True, False)), 64)
    known = np.zeros((1, 6, 2), bool)
    known[0, 2, 0] = True
    found = Colocated((pixels,), pixels, known).planes(scale, SPREAD, TOP)
    assert found.output.shape == (3, 1, 6)
    assert found.output[:, 0, 2].tolist() == scale.levels(pixels)[:3, 0, 2].tolist()
    assert (np.delete(found.output[:, 0], 2, 1) == UNKNOWN).all()


def test_a_sample_has_its_guide_last_and_does_not_vary_with_it():
    rng = np.random.default_rng(3)
    pixels, label = rng.integers(0, 256, (8, 9, 1)).astype(np.uint8), rng.integers(0, 4, (8, 9, 1))
    guide = Guide((label,), label[:2], True, 1.0)
    plain, guided = Sample(pixels, 24, 2, 1.0), Sample(pixels, 24 * 6, 2, 1.0, guides=[guide])
    assert guide.channels == 4
    assert guided.levels[0].shape == (1 + 1 + 4, 8, 9)
    assert guided.levels[0][:2].tolist() == plain.levels[0].tolist()
    assert (guided.channels, guided.shown, guided.variance) == (2, 1, plain.variance)
    assert guided.guides.shape == (4, 2, 9)


def test_colours_go_on_into_a_hole_from_the_known_pixels_near_its_rim():
    rng = np.random.default_rng(5)
    levels, known = rng.integers(0, 200, (2, 23, 31)).astype(np.uint16), np.ones((23, 31), bool)
    known[4:19, 6:25] = False
    found = smooth(levels, known)
    for i, j in np.ndindex(*known.shape):
        nearest = min(max(abs(i - k), abs(j - m)) for k, m in np.argwhere(known))
        reach = next(side for side in (4, 6, 9, 13) if side >= nearest + 4)
        square = slice(max(0, i - reach), i + reach + 1), slice(max(0, j - reach), j + reach + 1)
        inside = levels[:, *square][:, known[square]].astype(int)
        assert found[:, i, j].tolist() == (inside.sum(1) // inside.shape[1]).tolist()


def test_surroundings_are_colours_and_places():
    sample = np.random.default_rng(6).integers(0, 256, (40, 700, 2)).astype(np.uint8)
    known = np.random.default_rng(7).random((40, 700)) < 0.9
    scale = Scale(Pictures((sample,)), 100)
    guide = Surroundings(sample, known, sample[10:20, 50:], known[10:20, 50:], (10, 50))
    found = guide.planes(scale, 300_000.0, 4095)
    (own,), output = found
    assert len(own) == len(output) == guide.channels == 4
    assert (own[:2] == smooth(np.moveaxis(sample, -1, 0).astype(np.uint16), known)).all()
    assert (output[2:] == own[2:, 10:20, 50:]).all(), "a place is the same in both"
    step = own[3, 0].astype(int)
    assert step[600] - step[300] == round(0.3**0.5 * 300_000**0.5) and not np.diff(own[3], axis=0).any()
    assert (np.diff(own[2, :, 0].astype(int)) >= 0).all() and own[2, -1, 0] == round(39 * (0.3 * 3e5) ** 0.5 / 300)
    rows_alone = Surroundings(sample, known, sample[10:20], known[10:20], (10, np.nan)).planes(scale, 300_000.0, 4095)
    assert not rows_alone.output[3].any() and not rows_alone.samples[0][3].any()
    assert (rows_alone.output[2] == own[2, 10:20]).all()
