"""The preference for candidates that continue a neighbour's source."""

import numpy as np
import plain
import pytest
from cases import REFERENCE, assert_same_bits, problem, problems
from hypothesis import given, settings
from hypothesis import strategies as st

strengths = st.sampled_from([0.25, 1.0, 1.5, 7.0])


def run(machine, p, strength):
    """Distances without the sign that marks them on a device, and the least of each block."""
    found, candidates = p.distances(machine, strength)
    count = candidates.size
    distance = np.asarray(machine.get(found.distance))[:, : found.sites]
    if found.nearest is not None:
        nearest = np.asarray(machine.get(found.nearest))[:, : found.sites]
        blocks = np.abs(distance).reshape(nearest.shape[0], -1, found.sites)
        assert_same_bits(nearest, blocks.min(1))
        assert np.isinf(distance[count:]).all(), "what fills the last block is never near"
    return np.abs(distance[:count])


def check_formula(p, strength):
    before, after = run(REFERENCE, p, 0), run(REFERENCE, p, strength)
    discount = np.float32(1 / (1 + strength))
    t = p.field.temperature
    for s, site in enumerate(p.where()):
        continuing = plain.coherent(p.source(), t, site, p.order, p.grid.spacing, p.grid.torus)
        # The neighbours' offsets are pixels of the sample, spread as the level's grid is.
        for i, position in enumerate(p.positions()):
            expected = before[i, s] * discount if position in continuing else before[i, s]
            assert after[i, s] == expected
    return bool((before != after).any())


@given(problems(max_order=5), strengths)
@settings(max_examples=25)
def test_the_reference_is_the_rule(p, strength):
    check_formula(p, strength)


@pytest.mark.parametrize("edges", ["whole", "reflect"])
@pytest.mark.parametrize("spacing", [1, 2])
def test_the_reference_is_the_rule_where_many_are_coherent(spacing, edges):
    p = problem(4, order=4, shape=(10, 11), spacing=spacing, edges=edges, sample_shape=(14, 13))
    assert check_formula(p, 1.0), "some candidate is discounted"


@given(p=problems(), strength=strengths)
@settings(max_examples=25)
def test_a_device_has_the_references_bits(machine, p, strength):
    assert_same_bits(run(machine, p, strength), run(REFERENCE, p, strength))


def test_neighbours_that_no_relaxation_has_touched_propose_nothing(machine):
    p = problem(6, temperatures="one")
    for m in (REFERENCE, machine):
        assert_same_bits(run(m, p, 2.0), run(m, p, 0))


def test_many_neighbours_discount_a_candidate_once(machine):
    """All neighbours were taken as one piece, so all propose the same candidate."""
    p = problem(7, order=8, shape=(5, 5), sample_shape=(12, 12), temperatures="zero")
    row, col = np.indices((5, 5)) + 4
    p = p._replace(field=p.field._replace(source=(row * p.sample.cols + col).astype(np.int32)))
    p = p._replace(sites=np.array([12], np.int32))
    for m in (REFERENCE, machine):
        before, after = run(m, p, 0), run(m, p, 1.0)
        changed = np.flatnonzero(before != after)
        assert [p.positions()[i] for i in changed] == [(6, 6)]
        assert after[changed] == before[changed] / 2


def test_a_distance_of_zero_stays_zero_and_is_found(machine):
    """The mark of a discounted distance is its sign, also of 0."""
    p = problem(8, order=2, shape=(6, 6), sample_shape=(9, 9), temperatures="zero", torus=False)
    row, col = np.indices((6, 6)) + 1 + p.sample.margin
    source = (row * p.sample.cols + col).astype(np.int32)
    values = p.sample.working[:, source]
    p = p._replace(field=p.field._replace(source=source, values=values))
    for m in (REFERENCE, machine):
        after = run(m, p, 1.0)
        assert (after.min(0) == 0).all()
        assert_same_bits(after, run(REFERENCE, p, 1.0))
