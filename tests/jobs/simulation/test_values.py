"""`simulate` of values that are no categories: their distribution, their variogram, and the relation of variables."""

import numpy as np
import pytest

import simdtex
from simdtex.jobs.simulation.ensemble import variogram
from simdtex.model.pictures import Pictures
from simdtex.model.scale import Scale

pytest.importorskip("xarray")


def smooth(seed, width=2.0, shape=(96, 96)):
    """A Gaussian random field that wraps around, with mean 0 and variance 1."""
    waves = np.meshgrid(*(np.fft.fftfreq(n) for n in shape), indexing="ij")
    noise = np.fft.fftn(np.random.default_rng(seed).normal(size=shape))
    field = np.fft.ifftn(noise * np.exp(-2 * (np.pi * width) ** 2 * sum(w**2 for w in waves))).real
    return ((field - field.mean()) / field.std()).astype(np.float32)


def test_a_skewed_variable_with_zeros_keeps_its_values_their_shares_and_its_variogram():
    training = np.exp(smooth(1))
    training[training < np.quantile(training, 0.1)] = 0
    known = np.full((64, 64), np.nan, np.float32)
    known[::9, ::9] = np.float32(0.777)  # between values of the image
    found = simdtex.simulate(training, 6, shape=(64, 64), rng=1, share_spread=0).values
    assert np.isin(found, training).all()
    assert abs((found == 0).mean() - 0.1) < 0.02
    assert abs(found.mean() / training.mean() - 1) < 0.06 and abs(found.std() / training.std() - 1) < 0.1
    for lag in (1, 2, 4, 8):
        of = [variogram(field, axis, lag)[lag] for field in found for axis in (0, 1)]
        assert 0.84 < np.mean(of) / np.mean([variogram(training, axis, lag)[lag] for axis in (0, 1)]) < 1.2, lag
    held = simdtex.simulate(training, 1, shape=(64, 64), known=known, rng=1, levels=1, free_sweeps=0).values[0]
    assert (held[::9, ::9] == np.float32(0.777)).all()


def test_a_variable_known_everywhere_has_the_relation_of_the_image_to_the_other():
    first, other = smooth(2), smooth(3)
    training = np.stack([first, 0.8 * first + 0.6 * other], -1)
    known = np.stack([smooth(4), np.full(first.shape, np.nan)], -1).astype(np.float32)
    known[..., 0] = np.clip(known[..., 0], first.min(), first.max())
    found = simdtex.simulate(training, 2, known=known, channel_axis=-1, rng=1).values
    of = [np.corrcoef(one.reshape(-1, 2).T)[0, 1] for one in (training, *found)]
    assert np.abs(np.subtract(of[1:], of[0])).max() < 0.06
    rough = [variogram(one[..., 1], 0, 1)[1] for one in (training, *found)]
    assert np.mean(rough[1:]) < 2 * rough[0], "four to five times, where the neighbours of the second count too little"


def test_scores_keep_ties_and_order_and_lie_between_for_values_between():
    values = np.repeat([0.0, 1.0, 10.0, 1000.0], [40, 20, 20, 20])
    scale = Scale(Pictures((values.reshape(10, 10, 1),), scores=True), 25)
    levels = scale.levels(np.array([[0.0], [0.5], [1.0], [10.0], [505.0], [1000.0]]))[0].astype(int)
    assert (np.diff(levels) > 0).all()
    assert abs(levels[1] - levels[[0, 2]].mean()) <= 1 and abs(levels[4] - levels[[3, 5]].mean()) <= 1
    assert np.ptp(levels) == scale.top
    gaps = np.diff(levels[[0, 2, 3, 5]]) / np.diff([-0.8416, 0.0, 0.5244, 1.2816])  # of ranks .2, .5, .7 and .9
    assert np.ptp(gaps) < 0.01 * gaps.mean()


def test_a_frequent_value_is_a_class_of_its_own():
    values = np.append(np.zeros(10), np.arange(1, 91))
    assert Pictures((values.reshape(10, 10, 1),)).classes[:3].tolist() == [0, 10, 20]
    values = np.append(np.full(10, 45.5), np.arange(90))
    classes = Pictures((values.reshape(10, 10, 1),)).classes.tolist()
    assert classes[classes.index(45.5) - 1] == 45 and len(classes) > 10


def test_a_smooth_variable_stays_smooth():
    training = smooth(1, 4.0, (128, 128))
    found = simdtex.simulate(training, 2, shape=(64, 64), rng=1).values
    curves = [sum(variogram(field, axis, 4) for axis in (0, 1)) for field in (training, *found)]
    steep = [curve[1] / curve[4] for curve in curves]
    assert max(steep[1:]) < 1.5 * steep[0], "twice, where penalties exceed the differences of neighbours"
