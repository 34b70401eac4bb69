# SPDX-License-Identifier: BSD-3-Clause
"""What is known exactly of the Ising model on the square lattice, J = k_B = 1, no field.

References: L. Onsager, Phys. Rev. 65, 117 (1944); B. Kaufman, Phys. Rev. 76, 1232 (1949), in the form of A. E.
Ferdinand and M. E. Fisher, Phys. Rev. 185, 832 (1969); C. N. Yang, Phys. Rev. 85, 808 (1952).
"""

from __future__ import annotations

from math import cosh, inf, log, pi, sinh, sqrt, tanh

import numpy as np

CRITICAL = 2 / log(1 + sqrt(2))
"""T_c = 2 / ln(1 + sqrt(2)) = 2.269..., in units of J / k_B."""

COLDEST, HOTTEST = 1e-6, 1e6
"""Below the first nothing moves any more; above the second 1 / T is lost in sums of order 1."""

FROZEN = 20.0
"""From this coupling on the energy is -2 to the last bit: the first excitation weighs exp(-8 K)."""


def onsager_energy(temperature: float) -> float:
    """Energy per spin of the infinite lattice.

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
    from scipy.special import ellipkm1

    coupling = _coupling(temperature)
    if coupling > FROZEN:
        return -2.0
    part = 2 * tanh(2 * coupling) ** 2 - 1  # 1 - k^2 is its square; it vanishes at T_c faster than K_1 grows
    term = part * float(ellipkm1(part * part)) if part else 0.0
    return -(1 + 2 / pi * term) / tanh(2 * coupling)


def torus_energy(temperature: float, rows: int, cols: int) -> float:
    """Energy per spin of a lattice of rows x cols that wraps around.

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
    O(cols). Sums are of logarithms, so that no size overflows.
    """
    coupling = _coupling(temperature)
    if coupling > FROZEN:
        return -2.0
    s, c = sinh(2 * coupling), cosh(2 * coupling)
    # cosh g_l = cosh(2K)^2 / sinh(2K) - cos(l pi / cols); g_0 has a sign, that of T_c - T.
    angle = np.arange(1, 2 * cols) * pi / cols
    # cosh g - 1 without cancellation, for long lattices near T_c
    excess = (s - 1) ** 2 / s + 2 * np.sin(angle / 2) ** 2
    gamma = np.log1p(excess + np.sqrt(excess * (excess + 2)))
    slope = 2 * c * (1 - 1 / s**2) / np.sqrt(excess * (excess + 2))
    zero = 2 * coupling + log(tanh(coupling))
    odd, even = slice(0, None, 2), slice(1, None, 2)
    logs, slopes, signs = [], [], []
    for name, which in (("cosh", odd), ("sinh", odd), ("cosh", even), ("sinh", even)):
        g, dg = gamma[which], slope[which]
        if which is even:
            g, dg = np.append(zero, g), np.append(2 + 2 / s, dg)
        half = rows * g / 2
        small = np.exp(-2 * np.abs(half))
        if name == "cosh":
            logs.append(float((np.abs(half) + np.log1p(small)).sum()))
            slopes.append(float((rows / 2 * dg * np.tanh(half)).sum()))
            signs.append(1.0)
        else:
            # sinh may vanish with g_0, its slope does not: both are divided by the product of the other factors.
            first, rest = (half[:1], half[1:]) if which is even else (half[:0], half)
            others = float((rest + np.log1p(-np.exp(-2 * rest))).sum())
            inner = float((rows / 2 * dg[len(first) :] / np.tanh(rest)).sum())
            if first.size:
                size = float(np.abs(first[0]))
                value, turn = 1 - np.exp(-2 * size), 1 + np.exp(-2 * size)  # 2 sinh and 2 cosh, over exp(size)
                value = float(np.copysign(value, first[0]))
                logs.append(others + size)
                slopes.append(inner * value + rows / 2 * float(dg[0]) * float(turn))
                signs.append(value)
            else:
                logs.append(others)
                slopes.append(inner)
                signs.append(1.0)
    weights = np.exp(np.array(logs) - max(logs))
    value, slope_of_value = np.array(signs), np.array(slopes)
    # The first three slopes are of logarithms, the last is of the value itself.
    total = float((weights * value).sum())
    change = float((weights * np.append(value[:3] * slope_of_value[:3], slope_of_value[3])).sum())
    return -(change / total / (rows * cols) + c / s)


def spontaneous_magnetisation(temperature: float) -> float:
    """Yang's magnetisation per spin of the infinite lattice: (1 - sinh(2K)^-4)^(1/8) below T_c, 0 above."""
    coupling = _coupling(temperature)
    if coupling > FROZEN:
        return 1.0
    inside = 1 - sinh(2 * coupling) ** -4
    return float(inside**0.125) if inside > 0 else 0.0


def correlation_length(temperature: float) -> float:
    """Distance, in sites along a row, over which correlations of the infinite lattice fall by e; infinite at T_c.

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
    if not temperature > 0:
        raise ValueError(f"temperature {temperature} is none; give a number above 0, say 2.0")
    if temperature > HOTTEST:
        raise ValueError(f"temperature {temperature} is too high; give a number of at most {HOTTEST:g}, say 2.0")
    return 1 / max(temperature, COLDEST)
