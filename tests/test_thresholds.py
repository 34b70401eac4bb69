"""Thresholds of unusual size and type, and the alpha that is looked for."""

from fractions import Fraction
from math import inf

import numpy as np
import pytest
from cases import REFERENCE, analyse, assert_same_bits, texture

import simdtex
from simdtex.methods.multires import Options
from simdtex.methods.multires.analysis import thresholds


@pytest.mark.parametrize("beta", [20, 20.0, 100, 1000.0, Fraction(1, 2)])
def test_a_large_beta_is_no_more_than_strict(beta):
    table = thresholds(11, 0.3, beta)
    assert table[-1] == 0.3, "k is 1 at the top"
    assert (np.diff(table) >= 0).all() and (table >= 0).all() and np.isfinite(table).all()
    assert np.isinf(thresholds(11, inf, beta)).all()


def test_numbers_of_any_kind_are_thresholds():
    sample, options = texture((13, 9)), {"method": "multires", "rng": 1, "device": "reference"}
    plain = simdtex.synthesize(sample, (12, 14), alpha=0.25, beta=0.75, **options)
    for kind in (Fraction, np.float32, np.float64):
        other = simdtex.synthesize(sample, (12, 14), alpha=kind(0.25), beta=kind(0.75), **options)
        assert_same_bits(other, plain)


@pytest.mark.parametrize("name", ["alpha", "beta"])
def test_a_number_beyond_all_others_is_refused(name):
    with pytest.raises(ValueError, match=f"{name} is 1000"):
        Options(**{name: 10**400})


def test_a_sample_beyond_32_bits_is_refused_before_any_work():
    vast = np.broadcast_to(np.uint8(0), (2**16, 2**13, 1))
    with pytest.raises(ValueError, match=r"65536 rows x 8192 columns with 9 features is beyond .* give a smaller one"):
        analyse(REFERENCE, vast)
