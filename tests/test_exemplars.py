"""The least squared distance of a neighbourhood to the exemplars of each class."""

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, opencl
from hypothesis import given, settings
from hypothesis import strategies as st

from simdtex.ops.classes import EXEMPLAR_MULTIPLE, exemplars, stacked


def run(machine, features, classes):
    known = stacked([np.asarray(one, np.float32) for one in classes]).on(machine)
    return machine.get(exemplars(machine, machine.put(np.asarray(features, np.float32)), known))


@st.composite
def cases(draw):
    count, sites = draw(st.integers(1, 40)), draw(st.integers(1, 70))
    rng = np.random.default_rng(draw(st.integers(0, 2**16)))
    low, high = draw(st.sampled_from([(0, 255), (-180, 180), (0, 3)]))
    sizes = draw(st.lists(st.integers(1, 11), min_size=1, max_size=4))
    features = rng.integers(low, high, (count, sites), endpoint=True)
    return features, [rng.integers(low, high, (size, count), endpoint=True) for size in sizes]


@given(cases())
@settings(max_examples=60)
def test_the_reference_is_the_least_of_all_distances(case):
    features, classes = case
    found = run(REFERENCE, *case)
    assert (found.dtype, found.shape) == (np.uint16, (len(classes), features.shape[1]))
    for logs, known in zip(found, classes, strict=True):
        squared = ((features.T[:, None] - known[None]) ** 2).sum(-1).min(1)
        assert abs(logs - 256 * np.log1p(squared)).max() <= 0.501


@given(case=cases())
@settings(max_examples=25)
def test_a_device_has_the_references_bits(machine, case):
    assert_same_bits(run(machine, *case), run(REFERENCE, *case))


@pytest.mark.parametrize("vector", [1, 4, 16])
def test_the_width_of_a_vector_changes_nothing(machine, vector):
    rng = np.random.default_rng(3)
    features, known = rng.integers(0, 255, (9, 37)), [rng.integers(0, 255, (n, 9)) for n in (5, 8)]
    assert_same_bits(run(opencl(machine.info, vector=vector), features, known), run(REFERENCE, features, known))


def test_the_widest_neighbourhoods_are_exact(machine):
    """14 bands of 9 raw values, at the ends of their range: no sum reaches 2**24."""
    features = np.stack([np.zeros(126), np.full(126, 255), np.arange(126) % 2 * 255], 1)
    known = [np.full((1, 126), 255), np.zeros((3, 126))]
    expected = 256 * np.log1p([[126 * 255**2, 0, 63 * 255**2], [0, 126 * 255**2, 63 * 255**2]])
    for m in (REFERENCE, machine):
        assert abs(run(m, features, known) - expected).max() <= 0.501


def test_classes_are_filled_up_by_their_own_last_exemplar():
    known = stacked([np.ones((3, 2), np.float32), np.full((EXEMPLAR_MULTIPLE + 1, 2), 2, np.float32)])
    assert known.starts.tolist() == [0, EXEMPLAR_MULTIPLE, 3 * EXEMPLAR_MULTIPLE]
    assert (known.doubled[:EXEMPLAR_MULTIPLE] == -2).all() and (known.doubled[EXEMPLAR_MULTIPLE:] == -4).all()
    assert known.squares.tolist() == [2.0] * EXEMPLAR_MULTIPLE + [8.0] * 2 * EXEMPLAR_MULTIPLE
