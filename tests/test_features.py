"""The whole neighbourhoods that a classifier compares: values, and what is left of them with contrast compressed."""

import numpy as np
import pytest
import tolerances
from cases import REFERENCE, assert_same_bits
from hypothesis import given, settings
from hypothesis import strategies as st

from simdtex.ops.classes import features

TOP = 4080


def run(machine, levels, sites, offsets, contrast):
    arrays = [np.asarray(levels, np.uint16), np.asarray(sites, np.int32), np.asarray(offsets, np.int32)]
    return machine.get(features(machine, *map(machine.put, arrays), contrast))


def mirrored(i, n):
    while not 0 <= i < n:
        i = -i if i < 0 else 2 * n - 2 - i
        if n == 1:
            i = 0
    return i


def plain(levels, sites, offsets, contrast):
    """One neighbourhood after another, in float64."""
    bands, rows, cols = levels.shape
    found = []
    for site in sites:
        i, j = divmod(int(site), cols)
        values = np.array(
            [[levels[b, mirrored(i + y, rows), mirrored(j + x, cols)] / 16 for y, x in offsets] for b in range(bands)]
        )
        if contrast:
            z = values - values.mean(1, keepdims=True)
            size = np.sqrt((z * z).sum())
            # below 1 the size is taken for its square
            shown, inverse = (size, 1 / size) if size > 1 else (size * size, 1)
            values = z * 40 * np.log1p(shown / 5) * inverse
        found.append(values.ravel())
    return np.array(found).T


@st.composite
def cases(draw):
    bands, rows, cols = draw(st.integers(1, 3)), draw(st.integers(1, 7)), draw(st.integers(1, 7))
    rng = np.random.default_rng(draw(st.integers(0, 2**16)))
    spread = draw(st.sampled_from([1, 8, 300, TOP]))
    levels = rng.integers(0, spread, (bands, rows, cols), endpoint=True) + rng.integers(0, TOP - spread, endpoint=True)
    sites = rng.integers(0, rows * cols, draw(st.integers(1, 40)))
    offsets = np.concatenate([[[0, 0]], rng.integers(-4, 4, (draw(st.integers(1, 12)), 2), endpoint=True)])
    return levels, sites, offsets


@given(cases(), st.booleans())
@settings(max_examples=60)
def test_the_reference_is_the_formula(case, contrast):
    found, exact = run(REFERENCE, *case, contrast), plain(*case, contrast)
    assert found.dtype == np.float32
    assert (found == np.rint(found)).all()
    assert abs(found - exact).max() <= tolerances.HALF + tolerances.GAIN


@given(case=cases(), contrast=st.booleans())
@settings(max_examples=25)
def test_a_device_has_the_references_bits(machine, case, contrast):
    assert_same_bits(run(machine, *case, contrast), run(REFERENCE, *case, contrast))


def test_brightness_is_taken_away_and_contrast_compressed():
    rng = np.random.default_rng(0)
    picture, offsets = rng.integers(0, 500, (1, 6, 6)), [[0, 0], [0, 1], [1, 0], [1, 1]]
    sites = np.arange(36)
    own = run(REFERENCE, picture, sites, offsets, True)
    assert_same_bits(run(REFERENCE, picture + 2000, sites, offsets, True), own)
    twice = run(REFERENCE, 2 * picture, sites, offsets, True)
    size, larger = (np.sqrt((one * one).sum(0)) for one in (own, twice))
    assert (larger > size).all() and (larger < 1.9 * size).all()
    assert (run(REFERENCE, np.full((1, 6, 6), 700), sites, offsets, True) == 0).all()


@pytest.mark.parametrize("value", [0, 7, 8, 2040, TOP])
def test_raw_values_are_rounded_to_255_steps(machine, value):
    for m in (REFERENCE, machine):
        found = run(m, np.full((1, 3, 3), value), [4], [[0, 0], [-1, 1]], False)
        assert found.ravel().tolist() == [(value + 8) // 16] * 2
