"""The order of the values of segments: a stable radix sort, the ties in a given order."""

import importlib

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits
from hypothesis import given, settings
from hypothesis import strategies as st

from simdtex.ops.matching import sort

MODULE = importlib.import_module("simdtex.ops.matching")
LOW, HIGH = -(2**31), 2**31 - 1
KINDS = {
    "all": lambda rng, shape: rng.integers(LOW, HIGH, shape, endpoint=True),
    "subband": lambda rng, shape: np.rint(rng.normal(0, 2**17, shape)),
    "ties": lambda rng, shape: rng.integers(-3, 3, shape, endpoint=True),
    "ends": lambda rng, shape: rng.choice([LOW, LOW + 1, -256, -1, 0, 1, 255, HIGH - 1, HIGH], shape),
    "bytes": lambda rng, shape: rng.integers(0, 4, shape) << 8 * rng.integers(0, 4, shape),
    "constant": lambda rng, shape: np.full(shape, rng.integers(LOW, HIGH)),
    "falling": lambda rng, shape: np.broadcast_to(-np.arange(shape[1]), shape),
}


def case(shape, kind="all", seed=0):
    """Values (segments, n), and an order of equal ones."""
    rng = np.random.default_rng(seed)
    values = KINDS[kind](rng, shape).astype(np.int64).astype(np.int32)
    return values, rng.permutation(shape[1]).astype(np.int32)


@st.composite
def cases(draw, segments=(1, 2, 3, 5), lengths=(1, 2, 7, 40)):
    shape = draw(st.sampled_from(segments)), draw(st.sampled_from(lengths))
    return case(shape, draw(st.sampled_from(sorted(KINDS))), draw(st.integers(0, 2**16)))


def run(machine, values, first):
    return np.asarray(machine.get(sort(machine, machine.put(values), machine.put(first))))


@given(cases())
def test_the_reference_is_pythons_sort(problem):
    values, first = problem
    order = run(REFERENCE, values, first)
    assert (order.dtype, order.shape) == (np.int32, values.shape)
    for segment, own in zip(values.tolist(), order.tolist(), strict=True):
        assert own == sorted(first.tolist(), key=lambda i, segment=segment: segment[i])


@given(problem=cases(lengths=(1, 2, 40, 300)))
@settings(max_examples=40)
def test_a_device_has_the_references_bits(machine, problem):
    assert_same_bits(run(machine, *problem), run(REFERENCE, *problem))


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_long_segments_in_several_runs(machine, kind):
    problem = case((2, 20_001), kind)
    assert MODULE.run_length(machine, 2, 20_001) < 20_001
    assert_same_bits(run(machine, *problem), run(REFERENCE, *problem))


@pytest.mark.parametrize("kind", ["all", "ties", "ends"])
@pytest.mark.parametrize("length", [1, 7, 64, 299, 300])
def test_the_length_of_a_run_changes_no_bit(machine, monkeypatch, kind, length):
    monkeypatch.setattr(MODULE, "run_length", lambda *_: length)
    problem = case((3, 300), kind)
    assert_same_bits(run(machine, *problem), run(REFERENCE, *problem))


@pytest.mark.parametrize("scratch", [1, 600, 1300])
def test_pieces_of_whole_segments_change_no_bit(machine, monkeypatch, scratch):
    """One, two or four segments at a time, the last piece a smaller one."""
    monkeypatch.setattr(MODULE, "SCRATCH", scratch)
    for kind in ("all", "ties"):
        problem = case((5, 300), kind)
        assert_same_bits(run(machine, *problem), run(REFERENCE, *problem))


def test_scratch_memory_is_bounded(machine, monkeypatch):
    """Keys and indices for SCRATCH values, and no table of counters for segments of a single value each."""
    monkeypatch.setattr(MODULE, "SCRATCH", 2**12)
    made = []
    empty = machine.empty
    monkeypatch.setattr(machine, "empty", lambda shape, dtype: made.append(shape) or empty(shape, dtype))
    for segments, n in ((100, 300), (3000, 1)):
        problem = case((segments, n))
        arrays = [machine.put(array) for array in problem]
        made.clear()
        assert_same_bits(np.asarray(machine.get(sort(machine, *arrays))), run(REFERENCE, *problem))
        assert made[0] == (segments, n)
        assert all(np.prod(shape) <= 2 * 2**12 for shape in made[1:])


def test_a_constant_comes_in_the_order_of_its_ties(machine):
    values, first = case((3, 300), "constant")
    for backend in (REFERENCE, machine):
        assert (run(backend, values, first) == first).all()
