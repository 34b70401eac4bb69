"""Colours without correlation: against numpy.linalg in float64, there and back, flat channels, several pictures."""

import numpy as np
import plain_pyramid as plain
import pytest
from cases import texture
from hypothesis import given
from hypothesis import strategies as st
from tolerances import DECORRELATED, DIRECTION

from simdtex.methods.pyramid.palette import FLAT, decorrelated, palette
from simdtex.model.stretched import TOP, Stretched


def planes_of(shape=(12, 11), channels=3, dtype=np.uint8, seed=0):
    return Stretched(texture(shape, channels, dtype, seed)).planes


def mixed(rng, channels, count=400, top=TOP):
    """Planes whose channels are any linear mixture of as many that have nothing to do with each other."""
    own = rng.uniform(-1, 1, (channels, count)) * rng.uniform(0.2, 1, (channels, 1))
    values = rng.normal(0, 1, (channels, channels)) @ own
    values = (values - values.min()) / (values.max() - values.min())
    return np.rint(values * top).astype(np.int32)[:, None]


def moments(channels):
    flat = channels.reshape(len(channels), -1)
    return flat.mean(1), np.cov(flat, bias=True).reshape(len(flat), -1)


@given(st.integers(0, 2**16), st.integers(1, 5))
def test_channels_have_unit_variance_and_no_correlation(seed, channels):
    planes = mixed(np.random.default_rng(seed), channels)
    own = palette([planes], [1.0])
    mean, covariance = moments(own.decorrelated(planes))
    deviations = np.sqrt(np.linalg.svd(moments(planes)[1])[1])
    busy = own.deviations > 0
    assert abs(mean).max() <= channels / deviations[busy].min(), "the mean is an integer"
    assert abs(np.diag(covariance)[busy] - 1).max() <= DECORRELATED
    between = abs(covariance - np.diag(np.diag(covariance)))
    lesser = np.minimum(*np.meshgrid(deviations, deviations))
    assert (between * lesser).max() <= DECORRELATED * deviations.max()


@given(st.integers(0, 2**16), st.integers(1, 4))
def test_the_transform_is_that_of_a_plain_svd(seed, channels):
    planes = mixed(np.random.default_rng(seed), channels)
    matrix, _, mean = plain.decorrelating(planes.reshape(channels, -1).T.astype(float))
    own = palette([planes], [1.0])
    assert abs(own.mean - mean).max() <= 0.5 + 1e-6
    gaps = np.diff(np.linalg.svd(moments(planes)[1])[1]) / (own.deviations[0] / 2**14) ** 2
    if channels > 1 and abs(gaps).min() < 0.02:
        return  # the axes of variances that nearly agree may be any
    ours = own.axes / own.deviations[:, None]
    assert abs(ours - matrix).max() <= DIRECTION * abs(matrix).max()
    assert (np.diff(own.deviations) <= 0).all(), "the largest variance first"


@given(st.integers(0, 2**16), st.integers(1, 5), st.booleans())
def test_there_and_back_is_the_same(seed, channels, decorrelate):
    planes = mixed(np.random.default_rng(seed), channels)
    own = palette([planes], [1.0], decorrelate)
    if (own.deviations == 0).any():
        return
    assert (own.restored(own.decorrelated(planes)) == planes).all()


def test_what_is_scaled_comes_back_within_what_scaling_rounds():
    planes = planes_of()
    own = palette([planes], [1.0])
    scale = decorrelated([planes], [own])
    channels = scale.channels[0]
    assert channels.dtype == np.int32
    assert (abs(channels).reshape(3, -1).max(1) == TOP).all()
    step = (scale.spans / TOP * own.deviations / 2**14).sum()
    assert abs(own.restored(scale.normalised(channels)) - planes).max() <= 1.5 + step


def test_channels_kept_apart_are_only_centred_and_scaled():
    planes = planes_of()
    own = palette([planes], [1.0], decorrelate=False)
    assert (own.axes == np.eye(3, dtype=np.int64) * 2**14).all()
    flat = planes.reshape(3, -1).astype(float)
    assert own.deviations / 2**14 == pytest.approx(flat.std(1), rel=1e-9)
    assert (own.mean == np.rint(flat.mean(1))).all()


def test_grey_in_three_channels_is_one_channel():
    grey = planes_of(channels=1)
    planes = np.repeat(grey, 3, 0)
    own = palette([planes], [1.0])
    assert (own.deviations[1:] == 0).all()
    assert own.deviations[0] > 0
    channels = own.decorrelated(planes)
    assert not channels[1:].any()
    back = own.restored(np.concatenate([np.linspace(-3, 3, 77).reshape(1, 7, 11), np.zeros((2, 7, 11))]))
    assert (back == back[0]).all(), "grey to the bit"


def test_a_flat_channel_keeps_its_value():
    planes = planes_of()
    planes[1] = 1234
    own = palette([planes], [1.0])
    assert own.deviations[-1] == 0
    assert (own.restored(own.decorrelated(planes))[1] == 1234).all()
    assert (own.restored(np.random.default_rng(1).normal(0, 2, planes.shape))[1] == 1234).all()


@pytest.mark.parametrize("decorrelate", [True, False])
def test_a_constant_picture_has_flat_channels(decorrelate):
    planes = np.arange(3, dtype=np.int32).reshape(3, 1, 1).repeat(5, 1).repeat(4, 2)
    own = palette([planes], [1.0], decorrelate)
    scale = decorrelated([planes], [own])
    assert not own.deviations.any()
    assert not scale.channels[0].any()
    assert not scale.spans.any()
    assert (own.restored(scale.normalised(scale.channels[0])) == planes).all()


@pytest.mark.parametrize(("share", "flat"), [(2 * FLAT, False), (FLAT / 2, True)])
def test_a_channel_is_flat_below_a_share_of_the_largest(share, flat):
    rng = np.random.default_rng(2)
    planes = np.rint(rng.normal(0, 2**17, (2, 50, 50)) * np.array([1, share])[:, None, None]).astype(np.int32)
    own = palette([planes], [1.0])
    assert (own.deviations[1] == 0) == flat
    assert own.deviations[0] > 0


@given(st.integers(0, 2**16), st.lists(st.floats(0.01, 10), min_size=2, max_size=3))
def test_several_pictures_are_one_with_each_its_share(seed, weights):
    rng = np.random.default_rng(seed)
    pictures = [mixed(rng, 3, count) for count in (60, 110, 35)[: len(weights)]]
    shares = np.array(weights) / sum(weights)
    flat = [p.reshape(3, -1).astype(float) for p in pictures]
    mean = sum(s * f.mean(1) for s, f in zip(shares, flat, strict=True))
    covariance = sum(
        s * (f - mean[:, None]) @ (f - mean[:, None]).T / f.shape[1] for s, f in zip(shares, flat, strict=True)
    )
    own = palette(pictures, weights)
    assert abs(own.mean - mean).max() <= 0.5 + 1e-6
    axes = own.axes / 2**14
    found = axes @ covariance @ axes.T
    assert (own.deviations / 2**14) ** 2 == pytest.approx(np.diag(found), rel=1e-6, abs=2.0)
    assert abs(found - np.diag(np.diag(found))).max() <= DECORRELATED * found.max()


def test_channels_of_several_pictures_share_a_scale():
    a, b = planes_of(seed=1), planes_of((7, 9), seed=2)
    own = palette([a, b], [1, 1])
    scale = decorrelated([a, b], [own, own])
    most = np.max([abs(c).reshape(3, -1).max(1) for c in scale.channels], 0)
    assert (most == TOP).all()
    for picture, channels in zip((a, b), scale.channels, strict=True):
        assert channels.shape == picture.shape
        assert scale.normalised(channels) == pytest.approx(own.decorrelated(picture), abs=4 / TOP * scale.spans.max())
