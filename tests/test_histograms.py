"""Histograms as sorted values: of a channel and its pyramids, averaged and spliced."""

from fractions import Fraction
from math import lcm

import numpy as np
import pytest
from cases import REFERENCE, texture
from hypothesis import given
from hypothesis import strategies as st

from simdtex.methods.pyramid.matcher import Histograms, average, averaged, histograms, spliced
from simdtex.methods.pyramid.pyramids import Transform

sizes = st.integers(1, 9)


def sorted_values(rng, bands, m, top):
    return np.sort(rng.integers(-top, top, (bands, m), np.int32, endpoint=True), axis=1)


def by_repeating(parts, weights, m):
    """The paper's average: every value as often as its share demands, exactly, then m quantiles of these."""
    denominator = lcm(*(p.size for p in parts))
    pool = np.sort(np.concatenate([p.repeat(w * (denominator // p.size)) for p, w in zip(parts, weights, strict=True)]))
    n = pool.size  # the quantile p is the least value at which the cdf reaches p
    return [pool[-(-(2 * k + 1) * n // (2 * m)) - 1] for k in range(m)]


def near_a_step(parts, weights, m):
    """Whether some quantile falls exactly on a step of the cdf, which float64 may round to either side."""
    total, steps = sum(weights), {Fraction(0)}
    for value in np.unique(np.concatenate(parts)):
        steps.add(
            sum(Fraction(int(w) * int((p <= value).sum()), p.size * total) for p, w in zip(parts, weights, strict=True))
        )
    return any(Fraction(2 * k + 1, 2 * m) in steps for k in range(m))


@given(st.integers(0, 2**16), st.lists(st.tuples(sizes, st.integers(1, 4)), min_size=2, max_size=3))
def test_counts_are_averaged(seed, parts):
    rng = np.random.default_rng(seed)
    values, weights = [sorted_values(rng, 2, m, 6) for m, _ in parts], [w for _, w in parts]
    found = average(values, weights)
    m = max(m for m, _ in parts)
    assert found.dtype == np.int32
    assert found.shape == (2, m)
    for band, own in enumerate(found):
        separate = [v[band] for v in values]
        if not near_a_step(separate, weights, m):
            assert own.tolist() == by_repeating(separate, weights, m)
        assert (np.diff(own) >= 0).all()
        assert set(own) <= set(np.concatenate(separate))


def test_a_weight_of_zero_leaves_the_others_alone():
    rng = np.random.default_rng(1)
    a, b = sorted_values(rng, 3, 40, 2**20), sorted_values(rng, 3, 25, 2**20)
    assert (average([a, b], [1, 0]) == a).all()
    assert (average([a, b], [0, 0.25]) == b).all()
    assert (average([a, b, a], [0, 7, 0]) == b).all()


def test_histograms_of_textures_are_averaged_one_by_one():
    rng = np.random.default_rng(4)
    a, b = (
        Histograms(sorted_values(rng, 1, m, 99), [sorted_values(rng, f, m // 2, 99) for f in (1, 4)]) for m in (20, 12)
    )
    found = averaged([a, b], [1, 2])
    assert (found.pixels == average([a.pixels, b.pixels], [1, 2])).all()
    assert len(found.subbands) == 2
    for own, first, second in zip(found.subbands, a.subbands, b.subbands, strict=True):
        assert (own == average([first, second], [1, 2])).all()


@pytest.mark.parametrize("split", [0, 1, 3])
def test_a_splice_takes_the_finest_from_one_and_the_rest_from_the_other(split):
    low, high = (
        Histograms(np.full((1, 4), v, np.int32), [np.full((1, 4), v + i, np.int32) for i in range(3)]) for v in (10, 20)
    )
    found = spliced(low, high, split)
    assert found.pixels is low.pixels
    assert [int(band[0, 0]) for band in found.subbands] == [(20 if i < split else 10) + i for i in range(3)]


def test_those_of_a_channel_are_its_pixels_and_its_pyramids_one_after_another():
    channel = texture((12, 11)).astype(np.int32) * 4000
    pyramids = [Transform(REFERENCE, "laplacian", 1, 4, False), Transform(REFERENCE, "steerable", 2, 2, False)]
    found = histograms(REFERENCE, channel, *pyramids)
    assert (found.pixels == np.sort(channel, axis=None)[None]).all()
    expected = [band for pyramid in pyramids for band in pyramid.make(channel[None])]
    assert [band.shape for band in found.subbands] == [(len(band), band[0].size) for band in expected]
    for own, band in zip(found.subbands, expected, strict=True):
        for values, plane in zip(own, band, strict=True):
            assert (values == np.sort(plane, axis=None)).all()
