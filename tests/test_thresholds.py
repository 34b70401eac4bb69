"""Thresholds of unusual size and type, and the alpha that is looked for."""

import math
from fractions import Fraction
from inspect import signature
from math import inf

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, texture
from plain_multires import as_large
from test_multires import alike

import simdtex
from simdtex.methods.multires import STRETCH, STRETCHES, Options, differences, suggest_alpha, thresholds
from simdtex.methods.multires.analysis import analyse


@pytest.mark.parametrize("beta", [20, 20.0, 100, 1000.0, Fraction(1, 2)])
def test_a_large_beta_is_no_more_than_strict(beta):
    table = thresholds(11, Options(beta=beta), 0.3)[:, 0]
    assert table[-1] == 0.3, "k is 1 at the top"
    assert (np.diff(table) >= 0).all() and (table >= 0).all() and np.isfinite(table).all()
    assert np.isinf(thresholds(11, Options(alpha=inf, beta=beta), inf)).all()


def test_numbers_of_any_kind_are_thresholds():
    sample, options = texture((13, 9)), {"method": "multires", "rng": 1, "device": "reference"}
    plain = simdtex.synthesize(sample, (12, 14), alpha=0.25, sigma=0.75, **options)
    for kind in (Fraction, np.float32, np.float64):
        other = simdtex.synthesize(sample, (12, 14), alpha=kind(0.25), sigma=kind(0.75), **options)
        assert_same_bits(other, plain)


@pytest.mark.parametrize("name", ["alpha", "beta", "target", "sigma"])
def test_a_number_beyond_all_others_is_refused(name):
    with pytest.raises(ValueError, match=f"{name} is 1000"):
        Options(**{name: 10**400})


@pytest.mark.parametrize("table", [[True, False], ["1", "2"], [1j, 2], [None, 1], [10**400, 1]], ids=str)
def test_thresholds_are_numbers(table):
    with pytest.raises(TypeError, match="thresholds must be an array of numbers"):
        Options(thresholds=table)


def test_infinite_thresholds_let_every_difference_pass():
    found = analyse(REFERENCE, texture((13, 9))[..., None])
    table = np.full((found.levels, 1), inf)
    table[2] = 0
    largest = differences(found, table)
    assert (largest[2] == 0).all() and (np.delete(largest, 2, 0) == 2**32 - 1).all()


def test_an_analysis_has_the_defaults_of_the_method():
    given = {name: p.default for name, p in signature(analyse).parameters.items() if p.default is not p.empty}
    assert given == Options().analysis


def test_a_sample_beyond_32_bits_is_refused_before_any_work():
    vast = np.broadcast_to(np.uint8(0), (2**16, 2**13, 1))
    with pytest.raises(ValueError, match=r"65536 rows x 8192 columns with 9 features is beyond .* give a smaller one"):
        analyse(REFERENCE, vast)


def test_the_alpha_that_is_looked_for_is_not_given():
    with pytest.raises(TypeError, match="suggest_alpha finds alpha; leave alpha out"):
        simdtex.suggest_alpha(texture((9, 9)), alpha=0.3)


def test_alpha_of_a_sample_too_large_to_count_whole(any_device):
    """Stretches of its levels stand for the rest; with two levels the finest is the one that counts."""
    sample = texture((64, 65))
    assert sample.size > STRETCH * STRETCHES
    found = analyse(REFERENCE, sample[..., None], levels=2)
    options = Options(alpha="auto", target=3, levels=2)
    alpha = suggest_alpha(REFERENCE, found, options)
    assert simdtex.suggest_alpha(sample, target=3, levels=2, device=str(any_device.index)) == alpha
    assert 0.01 < alpha < 4
    assert suggest_alpha(REFERENCE, found, Options(alpha="auto", target=6, levels=2)) > alpha


def mean_candidates(found, alpha, beta, parity):
    """Candidates of the sample's own pixels: the mean over the means of the coarser half of the levels sampled."""
    table = [[alpha / k**beta] for k in range(1, found.levels)]
    similar, means = alike(found, 9, table), []
    together = np.ones((1, 1), bool)
    for level in reversed(range(found.levels - 1)):
        above = np.indices(found.shapes[level + 1]).reshape(2, -1)
        if level + 1 < found.levels - 1:  # their parents are similar too
            parent = above[0] // 2 * found.shapes[level + 2][1] + above[1] // 2
            together = together[np.ix_(parent, parent)] & similar[level + 1]
        else:
            together = similar[level + 1]
        row, col = np.indices(found.shapes[level]).reshape(2, -1)
        parent = row // 2 * found.shapes[level + 1][1] + col // 2
        allowed = together[parent][:, parent if parity == "free" else slice(None)]
        if parity == "match":
            size = found.shapes[0]
            large = [np.array([as_large(n, level, k) for k in x]) for n, x in zip(size, (row, col), strict=True)]
            allowed = allowed & large[0][:, above[0]] & large[1][:, above[1]]
        means.append(allowed.sum(1).mean())
    return np.mean(means[: math.ceil(len(means) / 2)])


@pytest.mark.parametrize(
    ("size", "options"),
    [
        ((12, 11), {"target": 1.2}),
        ((16, 16), {"target": 1.3, "beta": 1}),
        ((16, 16), {"target": 5.5, "parity": "free"}),
        ((24, 20), {"target": 1.4, "boundary": "open"}),
        ((24, 20), {"target": 1.5, "levels": 4, "beta": 1}),
        ((9, 5), {"target": 2.5, "levels": 3}),
        ((9, 8), {"target": 3.0, "levels": 2}),
    ],
    ids=str,
)
def test_a_suggested_alpha_is_the_least_that_reaches_the_target(size, options):
    sample = texture(size)
    alpha = simdtex.suggest_alpha(sample, device=REFERENCE, **options)
    assert alpha == round(alpha * 100) / 100
    assert 0.01 < alpha < 4
    bearing = {name: value for name, value in options.items() if name in ("boundary", "levels")}
    found = analyse(REFERENCE, sample[..., None], **bearing)
    rest = options.get("beta", 0), options.get("parity", "match")
    less = round(alpha * 100 - 1) / 100
    assert mean_candidates(found, less, *rest) < options["target"] <= mean_candidates(found, alpha, *rest)
