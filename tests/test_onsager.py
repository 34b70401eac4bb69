"""The exact values of the Ising model, against every state of small lattices and against one another."""

import numpy as np
import pytest

from simdtex.experiments import onsager as exact


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


@pytest.mark.parametrize("temperature", [0.01, 0.5, 1.9, 2.6, 5.0, 1e4])
def test_a_large_torus_has_the_energy_of_the_infinite_lattice(temperature):
    assert exact.torus_energy(temperature, 800, 900) == pytest.approx(exact.onsager_energy(temperature), abs=1e-11)


def test_rows_and_columns_can_be_exchanged():
    for temperature in (1.7, exact.CRITICAL, 2.4):
        assert exact.torus_energy(temperature, 12, 31) == pytest.approx(exact.torus_energy(temperature, 31, 12))


def test_onsager_at_the_critical_point():
    assert abs(exact.CRITICAL - 2.269185314213022) < 1e-14
    assert exact.onsager_energy(exact.CRITICAL) == pytest.approx(-np.sqrt(2), abs=1e-12)
    around = [exact.onsager_energy(exact.CRITICAL + d) for d in (-1e-9, 1e-9)]
    assert around == pytest.approx([-np.sqrt(2)] * 2, abs=1e-7)


def test_the_energy_rises_with_temperature_from_all_aligned():
    temperatures = np.linspace(0.05, 6, 200)
    energies = [exact.onsager_energy(t) for t in temperatures]
    assert energies[0] == -2 and (np.diff(energies) > -1e-14).all() and energies[-1] > -0.4


def test_yang_and_the_correlation_length():
    assert exact.spontaneous_magnetisation(0.01) == 1
    assert exact.spontaneous_magnetisation(2.0) == pytest.approx(0.911319377877496)
    assert exact.spontaneous_magnetisation(exact.CRITICAL + 1e-6) == 0
    assert exact.correlation_length(2.3) == pytest.approx(42.165, abs=1e-3)
    assert exact.correlation_length(2.0) == pytest.approx(2.1924, abs=1e-4)
    assert exact.correlation_length(0.01) < 0.01
    assert exact.correlation_length(exact.CRITICAL) > 1e12


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan")])
def test_a_temperature_of_none_is_refused(value):
    with pytest.raises(ValueError, match="give a number above 0"):
        exact.onsager_energy(value)
    with pytest.raises(ValueError, match="give a number above 0"):
        exact.torus_energy(value, 4, 4)
