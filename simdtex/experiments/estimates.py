# SPDX-License-Identifier: BSD-3-Clause
"""Means of Markov chains, with error bars for correlated sweeps, against exact values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, sqrt

import numpy as np
from emcee.autocorr import integrated_time
from numpy.typing import NDArray
from scipy import stats

from simdtex.experiments import onsager as exact
from simdtex.experiments.ising import Chains

FAIR = 10
"""Correlation lengths that a side must have for |m| of a finite lattice to stand for that of the infinite one."""

LEVEL = 0.001
"""Probability that a table of correct results has one with the verdict `differs`."""


@dataclass(frozen=True)
class Estimate:
    """A mean with its error bar.

    Attributes
    ----------
    mean : float
    error : float
        One standard error: the larger of `between` and `within`.
    between : float
        From the means of the chains alone: standard deviation / sqrt(R). Chains are independent, so it includes any
        autocorrelation; its own relative error is 1 / sqrt(2 (R - 1)).
    within : float
        From all sweeps: standard deviation * sqrt(tau / (R n)).
    tau : float
        Integrated autocorrelation time in sweeps, 1 + 2 times the sum of the autocorrelations; at least 1.
    """

    mean: float
    error: float
    between: float
    within: float
    tau: float


def estimate(series: NDArray[np.float64], least: float = 0.0) -> Estimate:
    """Return the mean of chains with its error bar.

    Parameters
    ----------
    series : (R, n) array
        R independent chains of n sweeps each.
    least : float
        The least error: a series without changes has no spread.

    Returns
    -------
    Estimate

    Notes
    -----
    The autocorrelation time is that of `emcee.autocorr.integrated_time` (Sokal's window), the autocorrelation function
    averaged over chains. It is too small for chains shorter than some 50 of it; `between` is not affected.
    """
    chains, length = series.shape
    moving = series[np.ptp(series, 1) > 0]
    tau = max(1.0, float(integrated_time(moving.T, tol=0)[0])) if len(moving) and length > 1 else 1.0
    between = float(series.mean(1).std(ddof=1)) / sqrt(chains) if chains > 1 else 0.0
    within = float(series.std()) * sqrt(tau / series.size)
    return Estimate(float(series.mean()), max(between, within, least), between, within, tau)


@dataclass(frozen=True)
class Finding:
    """The result of a schedule at one temperature.

    Attributes
    ----------
    schedule : str
    independent : bool
        Whether it keeps equation (14) on this lattice.
    temperature : float
    energy, magnetisation, lagged : Estimate
        Energy per spin, absolute mean spin, and the energy across a sweep (`simdtex.experiments.ising.Chains`).
    exact_energy, onsager_energy : float
        Of this torus, and of the infinite lattice.
    yang_magnetisation : float
        Of the infinite lattice; 0 from T_c up.
    fair : bool
        Whether ``|m|`` of this lattice stands for that of the infinite one: T < T_c, and sides of `FAIR` correlation
        lengths at least.
    energy_sigmas, magnetisation_sigmas : float
        Deviations in error bars; the second is 0 if it is not `fair`.
    staggered : float
        Mean of ``|m_even - m_odd| / 2``.
    neighbours : float
        Correlation of neighbouring spins beyond that of their sublattices' magnetisations, <s_r s_s> - <m_even m_odd>;
        0 if the sublattices are independent.
    differs : str
        Empty if all agrees, else ``"energy"`` or ``"magnetisation"``, whichever is worse.
    """

    schedule: str
    independent: bool
    temperature: float
    energy: Estimate
    magnetisation: Estimate
    lagged: Estimate
    exact_energy: float
    onsager_energy: float
    yang_magnetisation: float
    fair: bool
    energy_sigmas: float
    magnetisation_sigmas: float
    staggered: float
    neighbours: float
    differs: str = ""

    @property
    def verdict(self) -> str:
        """Whether it agrees, in words."""
        if not self.differs:
            return "agrees"
        sigmas = self.energy_sigmas if self.differs == "energy" else self.magnetisation_sigmas
        return f"differs by {abs(sigmas):.0f} sigma" + (" in |m|" if self.differs == "magnetisation" else "")


def findings(runs: Sequence[Chains]) -> list[Finding]:
    """Compare runs with the exact values.

    Parameters
    ----------
    runs : sequence of simdtex.experiments.ising.Chains
        Of a torus, two chains or more.

    Returns
    -------
    list of Finding
        For each temperature, every run.

    Notes
    -----
    A deviation counts if Student's t with R - 1 degrees of freedom gives it a probability below `LEVEL` divided by the
    number of comparisons (Bonferroni).
    """
    found = [_finding(run, t) for t in range(len(runs[0].temperatures)) for run in runs]
    comparisons, chains = len(found) + sum(one.fair for one in found), runs[0].energy.shape[1]
    least = float(stats.t.isf(LEVEL / comparisons / 2, chains - 1)) if chains > 1 else inf
    judged = []
    for one in found:
        sigmas = {"energy": abs(one.energy_sigmas), "magnetisation": abs(one.magnetisation_sigmas)}
        worst = max(sigmas, key=lambda name: sigmas[name])
        judged.append(replace(one, differs=worst if sigmas[worst] > least else ""))
    return judged


def _finding(run: Chains, t: int) -> Finding:
    rows, cols = run.spins.shape[-2:]
    temperature = float(run.temperatures[t])
    sites, samples = rows * cols, run.energy[t].size
    energy = estimate(run.energy[t], 8 / sites / samples)  # one spin turned once, against all its neighbours
    magnetisation = estimate(np.abs(run.magnetisation[t]), 2 / sites / samples)
    right, infinite = exact.torus_energy(temperature, rows, cols), exact.spontaneous_magnetisation(temperature)
    fair = temperature < exact.CRITICAL and min(rows, cols) >= FAIR * exact.correlation_length(temperature)
    return Finding(
        schedule=run.schedule,
        independent=run.independent,
        temperature=temperature,
        energy=energy,
        magnetisation=magnetisation,
        lagged=estimate(run.lagged[t], 8 / sites / samples),
        exact_energy=right,
        onsager_energy=exact.onsager_energy(temperature),
        yang_magnetisation=infinite,
        fair=fair,
        energy_sigmas=(energy.mean - right) / energy.error,
        magnetisation_sigmas=(magnetisation.mean - infinite) / magnetisation.error if fair else 0.0,
        staggered=float(np.abs(run.even[t] - run.odd[t]).mean() / 2),
        neighbours=float(-energy.mean / 2 - (run.even[t] * run.odd[t]).mean()),
    )
