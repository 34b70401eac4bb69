"""The picture before the first level: pixels of the sample at random, all hot."""

import numpy as np
from cases import REFERENCE, assert_same_bits, host, texture
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chisquare
from tolerances import SIGNIFICANCE

from simdtex import random
from simdtex.model.lattice import Grid
from simdtex.model.sample import Sample
from simdtex.ops.start import start


def run(machine, sample, positions, shape, seed):
    planes = machine.put(sample.working.astype(np.float32))
    return host(machine, start(machine, planes, machine.put(positions), Grid(*shape), seed))


@st.composite
def starts(draw):
    side = st.integers(1, 9)
    channels, margin = draw(st.integers(1, 3)), draw(st.integers(0, 3))
    dtype = draw(st.sampled_from([np.uint8, np.uint16, np.float32]))
    sample = Sample(texture((draw(side), draw(side)), channels, dtype, 1), 8, margin)
    positions = sample.places(np.zeros((1, 2), np.int32), 1).positions
    return sample, positions, (draw(side), draw(side)), draw(st.integers(0, 2**64 - 1))


@given(starts())
def test_the_reference_is_the_rule(case):
    sample, positions, shape, seed = case
    values, source, temperature = run(REFERENCE, *case)
    assert [a.dtype for a in (values, source, temperature)] == [np.uint16, np.int32, np.uint16]
    assert source.shape == temperature.shape == values.shape[1:] == shape
    assert (temperature == 1024).all()
    for site, p in enumerate(source.ravel().tolist()):
        lo, hi, *_ = random.draw4(seed, 0, 0, site, random.START)
        assert p == positions[((int(hi) << 32 | int(lo)) * len(positions)) >> 64]
        row, col = divmod(p, sample.cols)
        inside = (row - sample.margin, col - sample.margin)
        assert all(0 <= i < n for i, n in zip(inside, sample.levels[0].shape[1:], strict=True))
        assert values.reshape(sample.channels, -1)[:, site].tolist() == sample.levels[0][:, *inside].tolist()


@given(case=starts())
@settings(max_examples=25)
def test_a_device_has_the_references_bits(machine, case):
    assert_same_bits(run(machine, *case), run(REFERENCE, *case))


def test_every_pixel_is_as_likely():
    sample = Sample(texture((5, 4), 1), 8)
    positions = sample.places(np.zeros((1, 2), np.int32), 1).positions
    _, source, _ = run(REFERENCE, sample, positions, (100, 100), 11)
    assert chisquare(np.bincount(source.ravel(), minlength=20)).pvalue > SIGNIFICANCE
