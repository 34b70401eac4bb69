"""Counts of exact matches, equations (4) and (5)."""

import numpy as np
import plain
import pytest
from cases import REFERENCE, assert_same_bits, problem
from hypothesis import given, settings
from hypothesis import strategies as st

import simdtex
from simdtex.methods.mrf.lcpdf import histogram
from simdtex.model.sample import Sample

GREYS = 3


def few_levels(seed, order, torus, temperatures="mixed", side=12):
    """A problem of three grey levels, so that neighbourhoods do match."""
    p = problem(seed, order=order, torus=torus, temperatures=temperatures, sample_shape=(side, side))
    rng = np.random.default_rng(seed)
    levels = (np.indices((side, side)).sum(0) // 2 + (rng.random((side, side)) < 0.1)) % GREYS
    values = (np.indices(p.field.source.shape).sum(0) // 2 % GREYS).astype(np.uint16)
    return p._replace(sample=Sample.of_levels(levels, GREYS), field=p.field._replace(values=values[None]))


def run(machine, p):
    sites, field, _ = p.on(machine)
    return machine.get(histogram(machine, sites, field, p.relaxation(machine, exact=True), GREYS))


def counted(p):
    """F(x, neighbours) of equation (4); a neighbour at temperature 1 matches anything."""
    counts = np.zeros((p.sites.size, GREYS), np.uint32)
    y = p.padded()
    for s, site in enumerate(p.where()):
        for position in plain.whole_positions(y[0].shape, p.order, p.grid.step):
            d = plain.distance(p.image(), p.temperature(), site, y, position, p.order, p.grid.step, p.grid.torus)
            counts[s, y[0][position]] += d == 0
    return counts


@given(st.integers(0, 1000), st.sampled_from([1, 2, 4]), st.booleans(), st.sampled_from(["mixed", "zero", "one"]))
@settings(max_examples=15)
def test_the_reference_counts_matches(seed, order, torus, temperatures):
    p = few_levels(seed, order, torus, temperatures, side=8)
    assert_same_bits(run(REFERENCE, p), counted(p))


@given(seed=st.integers(0, 1000), order=st.sampled_from([1, 2, 5, 8]), torus=st.booleans())
@settings(max_examples=20)
def test_a_device_has_the_references_bits(machine, seed, order, torus):
    p = few_levels(seed, order, torus, side=15)
    assert_same_bits(run(machine, p), run(REFERENCE, p))


def test_the_histogram_estimator_is_the_share_of_each_level(machine):
    p = few_levels(2, 1, False)
    counts = counted(p).astype(float)
    matched = np.flatnonzero(counts.sum(1))
    assert matched.size > 20
    options = {"order": 1, "greys": GREYS, "temperature": p.temperature(), "estimator": "histogram", "boundary": "open"}
    given = p.field.values[0], p.sample.levels[0][0], np.array(p.where())[matched]
    for m in (REFERENCE, machine):
        ours = simdtex.lcpdf(*given, **options, device=m)
        assert_same_bits(ours, counts[matched] / counts[matched].sum(1, keepdims=True))


def test_no_match_is_an_error_that_names_the_site_and_the_ways_out(machine):
    sample = np.zeros((5, 6), np.uint8)
    image = np.zeros((6, 6), np.uint8)
    image[3, 4] = 1
    options = {"order": 1, "greys": 2, "estimator": "histogram"}
    for m in (REFERENCE, machine):
        assert simdtex.lcpdf(image, sample, [(0, 0)], device=m, **options).tolist() == [[1, 0]]
        with pytest.raises(ValueError, match=r"equals that of site \(3, 3\); use fewer grey levels"):
            simdtex.lcpdf(image, sample, [(0, 0), (3, 3)], device=m, **options)
