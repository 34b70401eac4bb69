# SPDX-License-Identifier: BSD-3-Clause
"""Counter-based random numbers: a pure function of the seed, and of the purpose, the site and the time of a draw.

The twin of ``kernels/common/philox.h``.
"""

from __future__ import annotations

import secrets
from typing import Any

import numpy as np
from numpy.typing import NDArray

# The purposes of draws, with the numbers of kernels/common/philox.h.
START, DRAW, COLOR, SCHEDULE = 1, 2, 3, 4
NOISE, SEARCH, GUMBEL = 5, 6, 7

_LOW = np.uint64(0xFFFFFFFF)
_SHIFT = np.uint64(32)


def philox(counter: list[NDArray[np.uint32]], key: tuple[int, int]) -> list[NDArray[np.uint32]]:
    """Return 128 random bits for each counter: Philox4x32-10 of Salmon et al. (2011)."""
    c0, c1, c2, c3 = np.asarray(counter, np.uint64)
    k0, k1 = key
    for _ in range(10):
        first, second = c0 * np.uint64(0xD2511F53), c2 * np.uint64(0xCD9E8D57)
        c0, c1, c2, c3 = (
            (second >> _SHIFT) ^ c1 ^ np.uint64(k0),
            second & _LOW,
            (first >> _SHIFT) ^ c3 ^ np.uint64(k1),
            first & _LOW,
        )
        k0, k1 = (k0 + 0x9E3779B9) & 0xFFFFFFFF, (k1 + 0xBB67AE85) & 0xFFFFFFFF
    return list(np.array([c0, c1, c2, c3]).astype(np.uint32))


def draw4(seed: int, level: int, turn: Any, site: Any, purpose: int, attempt: Any = 0) -> list[NDArray[np.uint32]]:
    """Return four random 32-bit numbers per site, whose place has up to 48 bits."""
    site, attempt = np.broadcast_arrays(np.asarray(site, np.uint64), np.asarray(attempt))
    counter = [
        site & _LOW,
        np.full(site.shape, turn),
        (site >> _SHIFT) << np.uint64(16) | np.uint64(level << 8 | purpose),
        attempt,
    ]
    return philox([np.asarray(c).astype(np.uint32) for c in counter], (seed & 0xFFFFFFFF, seed >> 32))


def below(lo: NDArray[np.uint32], hi: NDArray[np.uint32], n: Any) -> NDArray[np.uint64]:
    """Return integers 0 .. n-1 from 64 random bits: the high half of the 128-bit product with n."""
    lo, hi, n = lo.astype(np.uint64), hi.astype(np.uint64), np.asarray(n, np.uint64)
    n_lo, n_hi = n & _LOW, n >> _SHIFT
    carry = (lo * n_lo) >> _SHIFT
    middle = hi * n_lo + carry
    other = lo * n_hi + (middle & _LOW)
    result: NDArray[np.uint64] = hi * n_hi + (middle >> _SHIFT) + (other >> _SHIFT)
    return result


def as_seed(rng: Any = None) -> int:
    """Return a seed, 0 <= seed < 2**64: ``rng`` itself, one drawn from a generator, or from the system for None."""
    if rng is None:
        return secrets.randbits(64)
    if isinstance(rng, (int, np.integer)) and not isinstance(rng, bool):
        if 0 <= int(rng) < 2**64:
            return int(rng)
        raise ValueError(f"the seed {rng} is out of range; give an integer from 0 to 2**64 - 1")
    if isinstance(rng, np.random.Generator):  # asked last: numpy loads this part of itself when it is named first
        return int(rng.integers(0, 2**64, dtype=np.uint64))
    raise TypeError(f"rng must be None, an integer or a numpy.random.Generator, not {type(rng).__name__}")
