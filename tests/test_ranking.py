"""Histogram matching by rank in one operation, beside the sort, the ranks and the distance that it is made of."""

import importlib
from types import SimpleNamespace

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, host
from hypothesis import given, settings
from hypothesis import strategies as st

from simdtex.ops.matching import ranking

MODULE = importlib.import_module("simdtex.ops.matching")
LOW, HIGH = -(2**31), 2**31 - 1
KINDS = {
    "all": lambda rng, shape: rng.integers(LOW, HIGH, shape, endpoint=True),
    "ends": lambda rng, shape: rng.choice([LOW, LOW + 1, -1, 0, HIGH - 1, HIGH], shape),
    "subband": lambda rng, shape: np.rint(rng.normal(0, 2**17, shape)),
    "11 bits": lambda rng, shape: HIGH - rng.integers(0, 2**11, shape),
    "12 bits": lambda rng, shape: LOW + rng.choice([0, 1, 2**11 - 1, 2**11], shape),
    "22 bits": lambda rng, shape: rng.choice([0, 2**11, 2**22 - 1], shape) - 5,
    "23 bits": lambda rng, shape: rng.choice([0, 2**11, 2**22 - 1, 2**22], shape) - 5,
    "constant": lambda rng, shape: np.full(shape, rng.integers(LOW, HIGH)),
}


def case(segments, n, m, targets=1, kind="subband", seed=0):
    """Values, the order of equal ones, sorted targets."""
    rng = np.random.default_rng(seed)
    values = KINDS[kind](rng, (segments, n)).astype(np.int64).astype(np.int32)
    wanted = np.sort(rng.integers(LOW, HIGH, (targets, m), endpoint=True).astype(np.int32), 1)
    return values, rng.permutation(n).astype(np.int32), wanted


@st.composite
def cases(draw):
    targets = draw(st.integers(1, 3))
    n, m = (draw(st.sampled_from([1, 2, 7, 40, 300])) for _ in range(2))
    kind, seed = draw(st.sampled_from(sorted(KINDS))), draw(st.integers(0, 2**16))
    return case(targets * draw(st.integers(1, 3)), n, m, targets, kind, seed)


def run(machine, problem):
    return host(machine, ranking(machine, *(machine.put(a) for a in problem)))


@given(cases())
def test_the_reference_is_a_sort_in_python(problem):
    values, first, targets = problem
    matched, moved = run(REFERENCE, problem)
    (segments, n), m = values.shape, targets.shape[1]
    assert (matched.dtype, moved.dtype, moved.shape) == (np.int32, np.int64, (segments,))
    for s, own in enumerate(values.tolist()):
        target, total = targets[s * len(targets) // segments].tolist(), 0
        for k, i in enumerate(sorted(first.tolist(), key=own.__getitem__)):
            assert matched[s, i] == target[(2 * k + 1) * m // (2 * n)]
            total += abs(own[i] - target[(2 * k + 1) * m // (2 * n)])
        assert moved[s] == total


@given(problem=cases())
@settings(max_examples=60)
def test_a_device_has_the_references_bits(machine, problem):
    assert_same_bits(run(machine, problem), run(REFERENCE, problem))


@pytest.mark.parametrize("kind", sorted(KINDS))
@pytest.mark.parametrize("m", [5000, 2500, 3000, 10_000])
def test_a_work_item_and_several_have_the_same_bits(machine, monkeypatch, kind, m):
    problem = case(4, 5000, m, 2, kind)
    expected = run(REFERENCE, problem)
    for alone in (True, False):
        monkeypatch.setattr(MODULE, "alone", lambda *_, alone=alone: alone)
        assert_same_bits(run(machine, problem), expected)


@pytest.mark.parametrize("kind", ["subband", "all"])
def test_segments_of_more_values_than_a_word_numbers(machine, monkeypatch, kind):
    monkeypatch.setattr(MODULE, "alone", lambda *_: True)
    problem = case(1, 2**21 + 1, 1000, kind=kind)
    assert_same_bits(run(machine, problem), run(REFERENCE, problem))


@pytest.mark.parametrize("scratch", [1, 7000, 13_000])
def test_pieces_of_whole_segments_change_no_bit(machine, monkeypatch, scratch):
    """One, two or four segments at a time, the last piece a smaller one; no array beyond the scratch memory."""
    monkeypatch.setattr(MODULE, "SCRATCH", scratch)
    monkeypatch.setattr(MODULE, "alone", lambda *_: True)
    made, empty = [], machine.empty
    monkeypatch.setattr(machine, "empty", lambda shape, dtype: made.append(np.prod(shape)) or empty(shape, dtype))
    problem = case(5, 300, 100)
    assert_same_bits(run(machine, problem), run(REFERENCE, problem))
    assert sorted(made)[-1] <= max(MODULE.COUNTERS, 2 * scratch)


def test_who_sorts_alone():
    processor = SimpleNamespace(info=SimpleNamespace(kind="cpu", compute_units=8))
    graphics = SimpleNamespace(info=SimpleNamespace(kind="gpu", compute_units=8))
    assert MODULE.alone(processor, 1, MODULE.SHORT)
    assert not MODULE.alone(processor, 3, MODULE.SHORT + 1)
    assert MODULE.alone(processor, 4, MODULE.LONG)
    assert not MODULE.alone(processor, 4, MODULE.LONG + 1)
    assert not MODULE.alone(graphics, 4, 1)
