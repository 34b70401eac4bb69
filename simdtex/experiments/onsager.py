# SPDX-License-Identifier: BSD-3-Clause
"""Exact results for the Ising model on the square lattice, J = k_B = 1, no field.

References: L. Onsager, Phys. Rev. 65, 117 (1944); B. Kaufman, Phys. Rev. 76, 1232 (1949), in the form of A. E.
Ferdinand and M. E. Fisher, Phys. Rev. 185, 832 (1969); C. N. Yang, Phys. Rev. 85, 808 (1952).
"""

from __future__ import annotations

from math import inf, log, pi, sinh, sqrt, tanh

import numpy as np
from scipy.special import ellipkm1

from simdtex.options import real

CRITICAL = 2 / log(1 + sqrt(2))
"""T_c = 2 / ln(1 + sqrt(2)) = 2.269..., in units of J / k_B."""

COLDEST, HOTTEST = 1e-6, 1e6
"""Below the first nothing moves any more; above the second 1 / T is lost in sums of order 1."""

FROZEN = 20.0
"""From this coupling on the energy is -2 to the last bit: the first excitation weighs exp(-8 K)."""


def onsager_energy(temperature: float) -> float:
    """Return the energy per spin of the infinite lattice.

    Parameters
    ----------
    temperature : float
        Above 0, at most 1e6.

    Returns
    -------
    float
        -coth(2K) (1 + 2/pi (2 tanh(2K)^2 - 1) K_1(k)), with K = 1/T, K_1 the complete elliptic integral of the first
        kind and k = 2 sinh(2K) / cosh(2K)^2 its modulus.
    """
    coupling = _coupling(temperature)
    if coupling > FROZEN:
        return -2.0
    part = 2 * tanh(2 * coupling) ** 2 - 1  # 1 - k^2 is its square; it vanishes at T_c faster than K_1 grows
    term = part * float(ellipkm1(part * part)) if part else 0.0
    return -(1 + 2 / pi * term) / tanh(2 * coupling)


def torus_energy(temperature: float, rows: int, cols: int) -> float:
    """Return the energy per spin of a lattice of rows x cols that wraps around.

    Parameters
    ----------
    temperature : float
        Above 0, at most 1e6.
    rows, cols : int
        2 or more. Between two sites that are neighbours both ways around (a side of 2) there are two bonds.

    Returns
    -------
    float
        -(1/N) d ln Z / dK with the partition function of Kaufman, a sum of four products over the columns.

    Notes
    -----
    O(cols). The derivative is the imaginary part of ln Z at a complex K (a complex step): exact to the last bits. Sums
    are of logarithms, so that no size overflows.
    """
    coupling = _coupling(temperature)
    if coupling > FROZEN:
        return -2.0
    step = 1e-30
    k = complex(coupling, step)
    s = np.sinh(2 * k)
    # cosh g_l - 1 = cosh(2K)^2 / sinh(2K) - cos(l pi / cols) - 1, without cancellation near T_c
    excess = (s - 1) ** 2 / s + 2 * np.sin(np.arange(1, 2 * cols) * pi / cols / 2) ** 2
    gamma = np.log1p(excess + np.sqrt(excess * (excess + 2)))
    zero = 2 * k + np.log(np.tanh(k))  # g_0 has a sign, that of T_c - T
    sign = -1.0 if zero.real < 0 else 1.0
    logs = []
    for half in (rows / 2 * gamma[::2], rows / 2 * np.append(sign * zero, gamma[1::2])):
        logs.append((half + np.log1p(np.exp(-2 * half))).sum())  # the product of 2 cosh
        logs.append((half + np.log(-np.expm1(-2 * half))).sum())  # the product of 2 sinh
    shifted = np.array(logs) - max(one.real for one in logs)
    total = (np.exp(shifted) * (1, 1, 1, sign)).sum()
    return float(-(total.imag / total.real / step / (rows * cols) + 1 / tanh(2 * coupling)))


def spontaneous_magnetisation(temperature: float) -> float:
    """Return Yang's magnetisation per spin of the infinite lattice: (1 - sinh(2K)^-4)^(1/8) below T_c, 0 above."""
    coupling = _coupling(temperature)
    if coupling > FROZEN:
        return 1.0
    inside = 1 - sinh(2 * coupling) ** -4
    return float(inside**0.125) if inside > 0 else 0.0


def correlation_length(temperature: float) -> float:
    """Return the distance in sites over which correlations of the infinite lattice fall by e; infinite at T_c.

    1 / (ln coth K - 2K) above T_c and half of that, with the other sign, below.
    """
    coupling = _coupling(temperature)
    if coupling > FROZEN:
        return 1 / (4 * coupling)
    rate = 2 * coupling + log(tanh(coupling))
    if rate == 0:
        return inf
    return 1 / (2 * rate) if rate > 0 else -1 / rate


def _coupling(temperature: float) -> float:
    real("temperature", temperature, 0, HOTTEST, above=True)
    return 1 / max(temperature, COLDEST)
