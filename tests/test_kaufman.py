"""The exact energy of the Ising model, against every state of small lattices."""

import numpy as np
import pytest

from simdtex.experiments import ising as exact


def by_counting(temperature, rows, cols):
    """Energy per spin of a torus, over all 2**(rows cols) states."""
    bits = np.arange(2 ** (rows * cols))[:, None] >> np.arange(rows * cols) & 1
    s = 2 * bits.reshape(-1, rows, cols) - 1
    energy = -sum((s * np.roll(s, 1, axis)).sum((1, 2)) for axis in (1, 2))
    weight = np.exp(-(energy - energy.min()) / temperature)
    return (energy * weight).sum() / weight.sum() / (rows * cols)


@pytest.mark.parametrize("size", [(2, 2), (2, 3), (3, 2), (3, 3), (3, 4), (4, 3), (4, 4)])
@pytest.mark.parametrize("temperature", [0.3, 1.0, 2.0, exact.CRITICAL, 2.3, 4.0, 100.0])
def test_the_energy_of_a_torus_is_that_of_counting_its_states(temperature, size):
    assert exact.torus_energy(temperature, *size) == pytest.approx(by_counting(temperature, *size), abs=1e-11)


def test_a_large_torus_at_the_critical_point_has_onsagers_energy():
    assert pytest.approx(2.269185314213022, abs=1e-14) == exact.CRITICAL
    assert exact.torus_energy(exact.CRITICAL, 800, 900) == pytest.approx(-np.sqrt(2), abs=2e-3)
    assert exact.torus_energy(2.0, 800, 900) == pytest.approx(-1.745564575, abs=1e-8)  # K_1 is far from its pole there


def test_rows_and_columns_can_be_exchanged():
    for temperature in (1.7, exact.CRITICAL, 2.4):
        assert exact.torus_energy(temperature, 12, 31) == pytest.approx(exact.torus_energy(temperature, 31, 12))


def test_the_energy_rises_with_temperature_from_all_aligned():
    energies = [exact.torus_energy(t, 16, 16) for t in np.linspace(0.04, 6, 200)]
    assert energies[0] == -2 and (np.diff(energies) > -1e-14).all() and energies[-1] > -0.4


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan")])
def test_a_temperature_of_none_is_refused(value):
    with pytest.raises(ValueError, match="give a number above 0"):
        exact.torus_energy(value, 4, 4)
