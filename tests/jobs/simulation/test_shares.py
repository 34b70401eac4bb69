"""Shares of categories that realisations aim at: the integral range, data, the draws, and maps of probabilities."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from scipy.special import ndtri

import simdtex
from simdtex.jobs.simulation.shares import integral_range, spread, with_shares
from simdtex.model.given import Given
from simdtex.model.pictures import Pictures

BLOCK = 6
OF_BLOCKS = np.array([0.7, 0.3]), np.eye(2)


def blocks(shape=(240, 240), seed=1):
    """Return squares of 6 pixels, of category 1 with probability 0.3: their integral range is 36 pixels."""
    draw = np.random.default_rng(seed).random(tuple(-(-n // BLOCK) for n in shape)) < 0.3
    return np.kron(draw, np.ones((BLOCK,) * len(shape), bool)).astype(np.uint8)


def of_data(data, shape=(96, 96), soft=None, factor=1.0, image=None):
    """Return the spread of an image of blocks, given data {place: category}."""
    image = blocks() if image is None else image
    values, known = np.zeros((*shape, 1), np.uint8), np.zeros((*shape, 1), bool)
    for place, category in data.items():
        values[place], known[place] = category, True
    pictures = Pictures((image[..., None],), categorical=(True,))
    return spread(pictures, [0], soft, shape, Given(values, known) if data else None, factor)


def test_integral_range_of_squares_is_their_area():
    ranges = [integral_range([blocks(seed=seed).astype(np.intp)], *OF_BLOCKS) for seed in range(4)]
    assert 0.8 * BLOCK**2 < np.mean(ranges) < 1.7 * BLOCK**2  # the greatest of three estimates
    image = blocks().astype(np.intp)
    unknown = np.where(np.indices(image.shape)[0] < 60, -1, image)
    assert integral_range([unknown], *OF_BLOCKS) == pytest.approx(np.mean(ranges), rel=0.5)
    assert integral_range([np.zeros((1, 1), np.intp)], np.ones(1), np.eye(1)) == 1


def test_data_move_the_mean_and_narrow_the_spread_and_close_ones_count_as_few():
    free = of_data({})
    expected = (1 / 96**2 + 1 / 240**2) * integral_range([blocks().astype(np.intp)], free.mean, np.eye(2))
    assert free.mean == pytest.approx(np.bincount(blocks().ravel()) / 240**2, abs=1e-6)
    assert free.ratio == pytest.approx(expected, rel=1e-3)
    close = of_data({(40 + i, 40 + j): 1 for i in range(3) for j in range(3)})
    apart = of_data({(16 + 32 * i, 16 + 32 * j): 1 for i in range(3) for j in range(3)})
    assert free.mean[1] + 0.002 < close.mean[1] < apart.mean[1] - 0.01
    assert apart.ratio < close.ratio < free.ratio
    truth = blocks((96, 96), seed=5)
    known = of_data({tuple(at): truth[tuple(at)] for at in np.argwhere(truth >= 0)[::4]})
    assert known.mean[1] == pytest.approx(truth.mean(), abs=0.02) and known.ratio < 0.3 * free.ratio
    assert (known.draw(3) >= known.data).all()
    assert of_data({}, factor=0.5).ratio == pytest.approx(free.ratio / 4, rel=1e-6)


def test_draws_have_the_mean_and_the_deviation_and_depend_on_the_seed_alone():
    found = of_data({})
    draws = np.stack([found.draw(seed) for seed in range(2000)])
    assert draws.mean(0) == pytest.approx(found.mean, abs=0.003)
    assert draws.std(0) == pytest.approx(np.sqrt(found.ratio * found.mean * (1 - found.mean)), rel=0.06)
    assert found.draw(7).tolist() == [0.687376, 0.312624]


def test_values_draw_a_mean_score_and_keep_the_histogram_of_the_image():
    field = np.kron(np.random.default_rng(1).gamma(1, 1, (40, 40)), np.ones((BLOCK, BLOCK)))
    pictures = Pictures((field[..., None],), scores=True)
    shares = pictures.proportions() / field.size
    found = spread(pictures, [0], None, (96, 96), None, 1.0)
    draws = np.stack([found.draw(seed) for seed in range(1000)])
    assert draws.mean(0) == pytest.approx(shares, abs=0.003)
    score = draws @ ndtri(shares.cumsum() - shares / 2)  # of squares of 6 pixels
    assert score.std() == pytest.approx(np.sqrt(BLOCK**2 * (1 / 96**2 + 1 / 240**2)), rel=0.3)
    assert np.corrcoef(draws[:, 0], draws[:, 1])[0, 1] > 0.8 and np.corrcoef(draws[:, 0], draws[:, -1])[0, 1] < -0.8


def test_a_map_of_probabilities_keeps_its_pattern_with_other_shares():
    p = np.random.default_rng(1).dirichlet((2, 1, 1), 500).T
    p[:, 0], p[:, 1] = (1, 0, 0), (0, 0.5, 0.5)
    scaled = with_shares(p, np.array([0.3, 0.3, 0.4]))
    assert scaled.mean(1) == pytest.approx([0.3, 0.3, 0.4], abs=1e-6) and scaled.sum(0) == pytest.approx(1)
    assert scaled[:, 0].tolist() == [1, 0, 0] and scaled[0, 1] == 0
    odds = (scaled[1, 2:] / scaled[2, 2:]) / (p[1, 2:] / p[2, 2:])
    assert np.ptp(odds) < 1e-9 * odds.mean()


def test_realisations_reach_the_shares_that_they_aim_at():
    field = gaussian_filter(np.random.default_rng(1).normal(size=(128, 128)), 4)
    training, wells = (field > np.quantile(field, 0.7)).astype(np.uint8), np.ma.masked_all((96, 96), np.uint8)
    wells[4::24, 4::24] = 1  # where the image has 0.3
    soft = np.stack([np.full((96, 96), 0.4), np.full((96, 96), 0.6)])
    for how, least, most in (({}, 0.2, 0.4), ({"known": wells}, 0.35, 0.6), ({"probabilities": soft}, 0.5, 0.7)):
        found = simdtex.simulate(training, 3, shape=(96, 96), categorical=True, rng=1, **how)
        assert least < found.share_1.mean() < most
        assert found.mean(("y", "x")).values == pytest.approx(found.share_1.values, abs=0.04)


def test_pixels_that_are_not_taken_do_not_count():
    training, mask = blocks((96, 96)), np.ones((96, 96), bool)
    mask[:, :48], training[:, :48] = False, 1
    made = simdtex.simulate(training, 2, shape=(48, 48), mask=mask, categorical=True, rng=1, share_spread=0)
    assert made.share_1[0] == pytest.approx(training[mask].mean(), abs=1e-6)
