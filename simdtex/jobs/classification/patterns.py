# SPDX-License-Identifier: BSD-3-Clause
"""Binary patterns of textures, and the classes that their frequencies in small windows suggest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from simdtex.jobs.classification.operations import LOGS, gaussian
from simdtex.methods.mrf.arithmetic import exp32, log32
from simdtex.methods.pyramid.laplacian import within

PATTERNS = 10
"""Binary patterns of a level: uniform ones by the number of greater neighbours, 0 to 8, and all others."""

OCCURRENCE = 2**12
"""Units in 1 of the share of bands in which a pattern occurs."""

RARE = 0.02
"""Added to the frequency of a pattern, whose root is compared: the variance of roots hardly depends on the mean."""

NEAR = gaussian(3)
"""The taps of the small windows in which frequencies are compared between classes."""

OWN = 0.7
"""Share of a class's own variance in its variance; the rest is pooled."""

DRIFT = 10
"""Weight of the variance between the quarters of a sample in the covariance of a class."""

RIDGE = 1e-3
"""Added to variances, relative to them, since the frequencies of a level add up to 1."""

TEMPERATURE = 8
"""Divisor of the logarithms of densities, since the windows of near sites overlap and are no independent evidence."""

FLOOR = 0.05
"""Added to probabilities, so that the greatest evidence against a class is bounded."""

WEIGHT = 0.35
"""Weight of the logarithms of probabilities in the evidence."""

_ROOT, _WHITE = 2**12, 2**20  # units in 1 of roots, and of whitening matrices


def patterns(levels: Sequence[NDArray[np.uint16]], rows: slice) -> NDArray[np.uint16]:
    """Return where binary patterns occur in some rows, (levels x `PATTERNS`, rows, cols): shares of the bands."""
    counts = []
    for level, values in enumerate(levels):
        bands, height, width = values.shape
        near = [
            [within(np.arange(*part.indices(n)) + 2**level * by, n, False) for by in (-1, 0, 1)]
            for part, n in ((rows, height), (slice(None), width))
        ]
        ring = [(0, 0), (0, 1), (0, 2), (1, 2), (2, 2), (2, 1), (2, 0), (1, 0)]
        greater = [values[:, near[0][y]][..., near[1][x]] >= values[:, rows] for y, x in ring]
        changes = sum((a != b).astype(np.uint8) for a, b in zip(greater, greater[1:] + greater[:1], strict=True))
        code = np.where(changes <= 2, np.sum(greater, 0, dtype=np.uint8), PATTERNS - 1)
        counts += [(code == pattern).sum(0, dtype=np.uint16) * (OCCURRENCE // bands) for pattern in range(PATTERNS)]
    return np.array(counts, np.uint16)


def roots(patterned: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return square roots of frequencies, given in 1 / `OCCURRENCE`: their variances hardly depend on their means."""
    return np.sqrt(patterned / OCCURRENCE + RARE)


class Discriminant(NamedTuple):
    """Normal densities of roots of frequencies: integer ``means`` (classes, P) and ``whitening`` (classes, P, P)."""

    means: NDArray[np.float64]
    whitening: NDArray[np.float64]
    logs: NDArray[np.float64]

    @classmethod
    def of(cls, windows: Sequence[NDArray[np.float64]], parts: Sequence[NDArray[np.float64]]) -> Self:
        """Return the densities of classes by the roots in n windows, (P, n), and in parts of samples, (parts, P)."""
        # products of integers have exact sums
        means, within_class = zip(*map(_covariance, windows), strict=True)
        drift = [_covariance(part.T)[1] for part in parts if len(part) > 1]
        shared = (1 - OWN) * sum(within_class) / len(means) + DRIFT * sum(drift) / max(1, len(drift))
        whitening, logs = [], []
        for own in within_class:
            covariance = OWN * own + shared
            inverse, log = _whitened(covariance + np.diag(RIDGE * np.diag(covariance) + 1))
            whitening.append(np.rint(inverse * _WHITE))
            logs.append(np.rint(log * LOGS) / LOGS)
        return cls(np.array(means), np.array(whitening), np.array(logs))

    def logarithms(self, patterned: NDArray[np.float64]) -> NDArray[np.uint16]:
        """Return -log of the probability of each class, (classes, n) uint16 in 1 / `LOGS`: O(classes P^2 n)."""
        values = np.rint(roots(patterned) * _ROOT)
        energy = np.empty((len(self.means), values.shape[1]))
        for plane, mean, white, log in zip(energy, self.means, self.whitening, self.logs, strict=True):
            whitened = white @ (values - mean[:, None]) / _WHITE  # sums of integers are the same in any order
            plane[:] = ((whitened * whitened).sum(0) / 2 + log) / TEMPERATURE
        chance = exp32(np.maximum(energy.min(0) - energy, -80))
        chance /= np.add.accumulate(chance)[-1]
        least, most = np.float32(FLOOR), np.float32(1 + FLOOR)
        logs: NDArray[np.float32] = np.rint((log32(most) - log32(chance + least)) * np.float32(LOGS))
        return logs.astype(np.uint16)


def _covariance(values: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the mean and the covariance of roots (P, n), in `_ROOT`."""
    whole = np.rint(values * _ROOT)
    n = whole.shape[1]
    total = whole.sum(1)
    return np.rint(total / n), (whole @ whole.T - np.outer(total, total) / n) / max(1, n - 1)


def _whitened(covariance: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Return the inverse Cholesky factor of a covariance (P, P), and the logarithm of the factor's determinant."""
    # NumPy's own factors differ in their last bits between machines; single operations are the same on all
    rest, inverse, log = covariance.copy(), np.eye(len(covariance)), 0.0
    for k in range(len(rest)):
        root = np.sqrt(rest[k, k])
        below = rest[k + 1 :, k] / root
        inverse[k] /= root
        inverse[k + 1 :] -= np.outer(below, inverse[k])
        rest[k + 1 :, k + 1 :] -= np.outer(below, below)
        log += np.log(root)
    return inverse, log
