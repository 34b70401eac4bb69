"""Iterated conditional modes of a Potts field."""

import numpy as np
from cases import REFERENCE, assert_same_bits
from hypothesis import given, settings
from hypothesis import strategies as st

from simdtex.ops.classes import potts


def run(machine, sites, evidence, votes, weight, labels):
    put = machine.put
    arrays = put(np.asarray(sites, np.int32)), put(np.asarray(evidence, np.int32)), put(np.asarray(votes, np.uint32))
    return machine.get(potts(machine, *arrays, weight, put(np.asarray(labels, np.uint8))))


@st.composite
def cases(draw):
    classes, rows, cols = draw(st.integers(1, 5)), draw(st.integers(1, 6)), draw(st.integers(1, 6))
    rng = np.random.default_rng(draw(st.integers(0, 2**16)))
    scale = draw(st.sampled_from([2, 2**18, 2**24]))  # of the smallest, many are equal
    evidence = rng.integers(-scale, scale, (classes, rows, cols))
    votes = rng.integers(0, min(scale, 2**18), (classes, rows, cols), endpoint=True)
    sites = rng.permutation(rows * cols)[: draw(st.integers(1, rows * cols))]
    return sites, evidence, votes, draw(st.sampled_from([0, 1, 112, 1600])), rng.integers(0, classes, (rows, cols))


@given(cases())
@settings(max_examples=60)
def test_the_reference_takes_the_first_of_the_greatest_energies(case):
    sites, evidence, votes, weight, labels = case
    found = run(REFERENCE, *case)
    for site in range(labels.size):
        at = np.unravel_index(site, labels.shape)
        energy = [int(u[at]) + (weight * int(v[at])) // 16 for u, v in zip(evidence, votes, strict=True)]
        assert found[at] == (energy.index(max(energy)) if site in sites else labels[at])


@given(case=cases())
@settings(max_examples=25)
def test_a_device_has_the_references_bits(machine, case):
    assert_same_bits(run(machine, *case), run(REFERENCE, *case))
