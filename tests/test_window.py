"""Sums over a Gaussian window around each site, of the sites with one label alone."""

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from simdtex.ops.classes import TAPS, gaussian, window


def run(machine, labels, owner, taps, values=None):
    arrays = [np.asarray(labels, np.uint8), np.asarray(owner, np.int32), np.asarray(taps, np.uint32)]
    more = [] if values is None else [machine.put(np.asarray(values, np.uint16))]
    return machine.get(window(machine, *map(machine.put, arrays), *more))


@st.composite
def cases(draw):
    rows, cols, planes = draw(st.integers(1, 9)), draw(st.integers(1, 20)), draw(st.integers(1, 4))
    rng = np.random.default_rng(draw(st.integers(0, 2**16)))
    reach = draw(st.integers(1, 5))
    taps = np.diff(np.sort(np.concatenate([[0], rng.integers(0, TAPS, 2 * reach, endpoint=True), [TAPS]])))
    values = rng.integers(0, 2**13, (planes, rows, cols)) if draw(st.booleans()) else None
    return rng.integers(0, 3, (rows, cols)), rng.integers(0, 3, planes), taps, values


@given(cases())
@settings(max_examples=60)
def test_the_reference_is_a_correlation(case):
    labels, owner, taps, values = case
    found = run(REFERENCE, *case)
    assert found.dtype == np.uint32
    for p, own in enumerate(owner):
        here = (labels == own) * (1 if values is None else values[p])
        for axis in (0, 1):
            here = ndimage.correlate1d(here.astype(np.float64), taps.astype(np.float64), axis, mode="mirror")
        assert (found[p] == here).all()


@given(case=cases())
@settings(max_examples=25)
def test_a_device_has_the_references_bits(machine, case):
    assert_same_bits(run(machine, *case), run(REFERENCE, *case))


def test_the_largest_sums_fit_32_bits(machine):
    labels, taps = np.zeros((40, 40)), gaussian(6.0)
    values = np.full((1, 40, 40), 2**13 - 1)
    for m in (REFERENCE, machine):
        assert (run(m, labels, [0], taps, values) == (2**13 - 1) * TAPS**2).all()
        assert (run(m, labels, [0], taps) == TAPS**2).all()


@pytest.mark.parametrize("sd", [0.5, 0.8, 1.8, 8.0, 10.0, 33.3, 100.0])
def test_taps_are_a_gaussian_in_whole_numbers(sd):
    taps = gaussian(sd).astype(np.int64)
    reach = len(taps) // 2
    assert taps.sum() == TAPS and (taps == taps[::-1]).all() and reach >= min(3 * sd, 1)
    density = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sd) ** 2)
    assert abs(taps - TAPS * density / density.sum()).max() <= 2
    spread = np.sqrt((taps * np.arange(-reach, reach + 1) ** 2).sum() / TAPS)
    assert spread == pytest.approx(sd, rel=0.06, abs=0.15)
