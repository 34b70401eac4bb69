"""The left half of equation (12): confidences and weighted grey levels of every neighbour."""

import numpy as np
import plain
import pytest
from cases import REFERENCE, assert_same_bits, host, problem, problems
from hypothesis import given, settings

from simdtex.ops.neighbourhood import neighbourhood


def run(machine, p):
    sites, field, offsets = p.on(machine)
    confidence, weighted, count = neighbourhood(machine, sites, field, offsets, p.grid, p.confidences)
    confidence, weighted = host(machine, (confidence, weighted))
    assert count == p.sites.size
    padding = confidence[..., count:], weighted[:, :, count:]
    assert not any(a.any() for a in padding), "columns that are no sites have no weight"
    return confidence[..., :count], weighted[:, :, :count]


def check_formula(p):
    confidence, weighted = run(REFERENCE, p)
    t, x, spacing = p.temperature(), p.image(), p.grid.spacing
    for s, (row, col) in enumerate(p.where()):
        near = plain.neighbours(row // spacing, col // spacing, p.order, p.grid.rows, p.grid.cols, p.grid.torus)
        for k, r in enumerate(near):
            here = None if r is None else (r[0] * spacing, r[1] * spacing)
            u = 0 if here is None else 1 - t[here]
            assert confidence[k, s] == u, "1 - t is exact in float32"
            for c, channel in enumerate(x):
                assert weighted[k, c, s] == (0 if here is None else channel[here] * u)


@given(problems())
@settings(max_examples=40)
def test_the_reference_is_the_formula(p):
    check_formula(p)


@pytest.mark.parametrize("torus", [True, False], ids=["torus", "open"])
@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (2, 3)])
def test_the_reference_is_the_formula_on_tiny_pictures(shape, torus):
    check_formula(problem(1, order=5, shape=shape, torus=torus))


@given(p=problems())
@settings(max_examples=25)
def test_a_device_has_the_references_bits(machine, p):
    assert_same_bits(run(machine, p), run(REFERENCE, p))


def test_a_hot_neighbour_and_one_outside_have_no_weight():
    p = problem(3, order=1, shape=(3, 3), torus=False, temperatures="one")
    assert not np.concatenate([a.ravel() for a in run(REFERENCE, p)]).any()


BESIDE = [
    {"guides": 2},
    {"nowhere": 0.3, "weight": 1.0},
    {"guides": 1, "nowhere": 0.2, "weight": 1.0, "spacing": 2, "torus": False},
]
"""Guides, and hard data."""


@pytest.mark.parametrize("how", BESIDE, ids=str)
def test_what_stands_beside_counts_by_itself(machine, how):
    """A guide whatever the temperature, and at the site itself; hard data more; what is unknown nothing."""
    p = problem(4, order=2, channels=2, shape=(9, 10), **how)
    made, spacing, (values, source, t) = len(p.field.values) - p.confidences.guides, p.grid.spacing, p.field
    confidence, weighted = run(REFERENCE, p)
    terms = len(p.offsets) + (p.confidences.guides > 0)
    assert confidence.shape == weighted.shape == (terms, len(values), p.sites.size)
    seen = set()
    for s, (row, col) in enumerate(p.where()):
        near = plain.neighbours(row // spacing, col // spacing, p.order, p.grid.rows, p.grid.cols, p.grid.torus)
        for k, r in enumerate([*near, (row // spacing, col // spacing)][:terms]):
            at, itself = None if r is None else (r[0] * spacing, r[1] * spacing), k == len(near)
            for c in range(len(values)):
                u = 0.0
                if at and values[c][at] != 65535:
                    u = 0.0 if itself else (1024 - t[at]) / 1024 * (3.625 if source[at] < 0 else 1)
                    u = u if c < made else 2.0 if itself else 1.0
                assert confidence[k, c, s] == u
                assert weighted[k, c, s] == (values[c][at] * u if u else 0)
                seen.add((c < made, itself, bool(u), at is not None and source[at] < 0))
    assert len(seen) >= 4
    assert_same_bits(run(machine, p), [confidence, weighted])
