# SPDX-License-Identifier: BSD-3-Clause
"""Energies of Markov chains compared with the exact one, with error bars."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np
from scipy import stats

from simdtex.experiments.ising import Chains
from simdtex.experiments.kaufman import torus_energy

LEVEL = 0.001
"""Probability that at least one result of a table of correct results differs."""


@dataclass(frozen=True)
class Finding:
    """The result of a schedule at one temperature.

    Attributes
    ----------
    schedule : str
    independent : bool
        Whether it keeps equation (14) on this lattice.
    temperature : float
    energy, error : float
        Energy per spin, and one standard error: that of the means of the chains. Chains are independent, so it is
        valid for any autocorrelation of their sweeps; its own relative error is 1 / sqrt(2 (R - 1)).
    exact : float
        The energy of this torus.
    sigmas : float
        Deviation from it in standard errors.
    magnetisation : float
        Mean of the absolute mean spin.
    neighbours : float
        Correlation of neighbouring spins beyond that of their sublattices' magnetisations, <s_r s_s> - <m_even m_odd>;
        0 if the sublattices are independent.
    differs : bool
        Whether the deviation counts.
    """

    schedule: str
    independent: bool
    temperature: float
    energy: float
    error: float
    exact: float
    sigmas: float
    magnetisation: float
    neighbours: float
    differs: bool

    @property
    def verdict(self) -> str:
        """Whether the energy agrees, in words."""
        return f"differs by {abs(self.sigmas):.0f} sigma" if self.differs else "agrees"


def findings(runs: Sequence[Chains]) -> list[Finding]:
    """Return a comparison of runs with the exact energy.

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
    first = runs[0]
    count = len(first.temperatures) * len(runs)
    least = float(stats.t.isf(LEVEL / count / 2, first.energy.shape[1] - 1))
    return [_finding(run, t, least) for t in range(len(first.temperatures)) for run in runs]


def _finding(run: Chains, t: int, least: float) -> Finding:
    rows, cols = run.spins.shape[-2:]
    temperature, means = float(run.temperatures[t]), run.energy[t].mean(1)
    one_spin = 8 / (rows * cols * run.energy[t].size)  # turned once: frozen chains have no spread
    error = max(float(means.std(ddof=1)) / sqrt(len(means)), one_spin)
    energy, exact = float(means.mean()), torus_energy(temperature, rows, cols)
    sigmas = (energy - exact) / error
    return Finding(
        schedule=run.schedule,
        independent=run.independent,
        temperature=temperature,
        energy=energy,
        error=error,
        exact=exact,
        sigmas=sigmas,
        magnetisation=float(np.abs(run.magnetisation[t]).mean()),
        neighbours=float(-energy / 2 - (run.even[t] * run.odd[t]).mean()),
        differs=abs(sigmas) > least,
    )
