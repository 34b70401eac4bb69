"""The temperature after a relaxation, equation (13), in integers of 1/1024."""

import plain
import pytest
from cases import REFERENCE, assert_same_bits, problem, problems
from hypothesis import given, settings
from hypothesis import strategies as st

from simdtex.ops.temperature import temperature

xis = st.sampled_from([-1, -100, -1024, -5000, -(2**20)])


def run(machine, p, xi):
    sites, field, offsets = p.on(machine)
    return machine.get(temperature(machine, sites, field, offsets, p.grid, xi))


def check_formula(p, xi):
    formula = [plain.cooled(p.field.temperature, site, p.order, p.grid.spacing, p.grid.torus, xi) for site in p.where()]
    ours = run(REFERENCE, p, xi)
    assert ours.dtype == p.field.temperature.dtype
    assert ours.tolist() == formula


@given(problems(max_order=20), xis)
@settings(max_examples=60)
def test_the_reference_is_the_formula(p, xi):
    check_formula(p, xi)


@given(p=problems(max_order=20), xi=xis)
@settings(max_examples=25)
def test_a_device_has_the_references_bits(machine, p, xi):
    assert_same_bits(run(machine, p, xi), run(REFERENCE, p, xi))


@pytest.mark.parametrize("torus", [True, False], ids=["torus", "open"])
@pytest.mark.parametrize("shape", [(1, 1), (1, 2), (1, 7), (2, 3)])
def test_tiny_pictures(machine, shape, torus):
    p = problem(1, order=5, shape=shape, torus=torus)
    check_formula(p, -1)
    assert_same_bits(run(machine, p, -1), run(REFERENCE, p, -1))


def test_all_hot_cools_by_the_share_of_xi():
    p = problem(3, order=8, temperatures="one")
    assert set(run(REFERENCE, p, -1024).tolist()) == {(24 * 1024 - 1024) // 24}


def test_the_least_xi_cools_everything_in_the_end():
    """Rounding down makes progress certain: 1/1024 a sweep at least."""
    p = problem(4, order=2, temperatures="one")
    assert set(run(REFERENCE, p, -1).tolist()) == {1023}
