# SPDX-License-Identifier: BSD-3-Clause
"""The exact energy of the Ising model on a torus, J = k_B = 1, no field.

B. Kaufman, Phys. Rev. 76, 1232 (1949), in the form of A. E. Ferdinand and M. E. Fisher, Phys. Rev. 185, 832 (1969).
"""

from __future__ import annotations

from math import log, pi, sqrt, tanh

import numpy as np

from simdtex.options import real

CRITICAL = 2 / log(1 + sqrt(2))
"""T_c = 2 / ln(1 + sqrt(2)) = 2.269..., in units of J / k_B."""

HOTTEST = 1e6
"""Above this temperature 1 / T is lost in sums of order 1."""

COLDEST = 0.05
"""Below this temperature the energy is -2 to the last bit: the weight of the first excitation is exp(-8 / T)."""


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
    real("temperature", temperature, 0, HOTTEST, above=True)
    if temperature < COLDEST:
        return -2.0
    coupling = 1 / temperature
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
