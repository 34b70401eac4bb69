"""White noise: uniform 32-bit words, a function of seed, level, plane and site alone."""

import re

import numpy as np
from cases import REFERENCE, assert_same_bits
from hypothesis import given, settings
from hypothesis import strategies as st

from simdtex import random
from simdtex.machine.opencl import kernel_folder
from simdtex.ops.pyramids import noise

seeds = st.integers(0, 2**64 - 1)
levels = st.integers(0, 30)


def run(machine, *args):
    return np.asarray(machine.get(noise(machine, *args)))


@given(st.integers(1, 9), st.sampled_from([1, 2, 13]), seeds, levels)
def test_the_reference_is_a_word_of_each_sites_draw(planes, n, seed, level):
    values = run(REFERENCE, planes, n, seed, level)
    assert (values.dtype, values.shape) == (np.int32, (planes, n))
    for p, s in np.ndindex(planes, n):
        word = int(random.draw4(seed, level, p // 4, s, 5, 0)[p % 4])
        assert values[p, s] == (word if word < 2**31 else word - 2**32)


@given(planes=st.integers(1, 9), n=st.sampled_from([1, 13, 100]), seed=seeds, level=levels)
@settings(max_examples=40)
def test_a_device_has_the_references_bits(machine, planes, n, seed, level):
    args = planes, n, seed, level
    assert_same_bits(run(machine, *args), run(REFERENCE, *args))


def test_a_plane_is_the_same_whatever_is_beside_it():
    whole = run(REFERENCE, 9, 50, 3, 1)
    for planes, n in ((1, 50), (4, 50), (5, 7), (9, 1)):
        assert_same_bits(run(REFERENCE, planes, n, 3, 1), whole[:planes, :n].copy())


def test_noise_has_a_purpose_of_its_own_that_the_kernels_know():
    header = (kernel_folder() / "common" / "philox.h").read_text()
    purposes = re.findall(r"#define PURPOSE_(\w+) (\d+)u\n", header)
    assert ("NOISE", str(random.NOISE)) in purposes
    assert len({number for _, number in purposes}) == len(purposes)
