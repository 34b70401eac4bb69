"""Penalties are added to distances that are kept."""

import numpy as np
from cases import REFERENCE, assert_same_bits, problems
from hypothesis import given, settings
from hypothesis import strategies as st

from simdtex.ops.charge import charge


@given(p=problems(max_order=4), strength=st.sampled_from([0.0, 1.0]))
@settings(max_examples=15)
def test_each_candidate_has_its_penalty(machine, p, strength):
    found, candidates = p.distances(REFERENCE, strength)
    expected = found.distance + p.penalty()[: candidates.size, None]
    numbers = np.arange(candidates.size)[:, None]
    for term, more in ((p.phased(REFERENCE), ()), (p.scattered(REFERENCE), (candidates,)), (p.kinds(REFERENCE), ())):
        expected = expected + term.cost(numbers, p.sites, *more) if term else expected
    for m in (REFERENCE, machine):
        distances, candidates = p.distances(m, strength)
        charged = charge(m, distances, candidates, m.put(p.sites), p.costs(m))
        distance = np.asarray(m.get(charged.distance))[: candidates.size, : charged.sites]
        assert_same_bits(distance, expected)
        if charged.nearest is not None:  # the least of each block of candidates
            nearest = np.asarray(m.get(charged.nearest))[:, : charged.sites]
            blocks = np.array_split(expected, range(64, candidates.size, 64))
            assert_same_bits(nearest, np.stack([block.min(0) for block in blocks]))
