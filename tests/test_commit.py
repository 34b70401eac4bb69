"""The end of a step: relaxed sites go into the field, and nothing else changes."""

import numpy as np
from cases import REFERENCE, assert_same_bits, host, problem, problems
from hypothesis import given, settings

from simdtex.ops.commit import commit
from simdtex.ops.lcpdf import Relaxed


def outcome(p):
    """What a relaxation of the problem's sites might have given."""
    rng = np.random.default_rng(p.sites.size)
    count, channels = p.sites.size, len(p.field.values)
    choice = rng.integers(0, p.sample.rows * p.sample.cols, count).astype(np.int32)
    values = rng.integers(0, 4096, (channels, count)).astype(np.uint16)
    return choice, values, rng.integers(0, 1025, count).astype(np.uint16)


def run(machine, p):
    sites, field, _ = p.on(machine)
    choice, values, cooled = (machine.put(a) for a in outcome(p))
    return host(machine, commit(machine, field, sites, Relaxed(choice, values), cooled))


def check_formula(p):
    choice, values, cooled = outcome(p)
    expected = [np.array(a) for a in p.field]
    for s, (row, col) in enumerate(p.where()):
        for c in range(len(values)):
            expected[0][c, row, col] = values[c, s]
        expected[1][row, col], expected[2][row, col] = choice[s], cooled[s]
    assert_same_bits(run(REFERENCE, p), expected)


@given(problems())
@settings(max_examples=40)
def test_the_reference_is_the_assignment(p):
    check_formula(p)


@given(p=problems())
@settings(max_examples=25)
def test_a_device_has_the_references_bits(machine, p):
    assert_same_bits(run(machine, p), run(REFERENCE, p))


def test_a_machine_never_writes_to_the_callers_arrays(machine):
    p = problem(3)
    before = [a.copy() for a in p.field]
    for m in (REFERENCE, machine):
        run(m, p)
        assert_same_bits(list(p.field), before)
