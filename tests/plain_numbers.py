"""Float32 arithmetic as the devices have it, in exact fractions where a double cannot tell.

Nothing here shares code with the package.
"""

from fractions import Fraction
from itertools import accumulate

import numpy as np
from numpy import float32


def philox(counter, key):
    """Philox4x32-10 of Salmon et al. (2011), of four words and a key of two."""
    mask = 2**32 - 1
    (a, b, c, d), (k, m) = counter, key
    for _ in range(10):
        first, second = 0xD2511F53 * a, 0xCD9E8D57 * c
        a, b, c, d = (second >> 32) ^ b ^ k, second & mask, (first >> 32) ^ d ^ m, first & mask
        k, m = (k + 0x9E3779B9) & mask, (m + 0xBB67AE85) & mask
    return [a, b, c, d]


def cumulative(terms):
    """Sums of the first terms over the sum of all, in 2^-32."""
    sums = list(accumulate(terms))
    return [*(min(2**32 - 1, round(s / sums[-1] * 2**32)) for s in sums[:-1]), 2**32 - 1]


def nearest(exact):
    """The float32 nearest to a fraction, ties to the even one."""
    close = float32(float(exact))
    around = [close, np.nextafter(close, float32(-np.inf)), np.nextafter(close, float32(np.inf))]
    return min(around, key=lambda x: abs(Fraction(float(x)) - exact))  # the first of equals: a tie is exact above


def fma(a, b, c):
    """A * b + c, rounded once to float32."""
    a, b, c = np.broadcast_arrays(*(np.atleast_1d(np.asarray(x, float)) for x in (a, b, c)))
    double = a * b + c
    low, high = (np.nextafter(double, end).astype(float32) for end in (-np.inf, np.inf))
    for k in np.flatnonzero(low != high):  # too close to the middle for the double to tell
        high[k] = nearest(Fraction(a[k]) * Fraction(b[k]) + Fraction(c[k]))
    return high


def exponential(x):
    """exp(x) of float32, as the polynomial that the devices' exponential is; x from -28 to 0."""
    x = np.atleast_1d(x)
    k = np.rint(x * float32(1.44269502))
    r = fma(k, float32(-0.693145752), x)
    r = fma(k, float32(-1.42860677e-6), r)
    p = float32(1.38888892e-3)
    for coefficient in (8.33333377e-3, 4.16666679e-2, 1.66666672e-1, 0.5, 1.0, 1.0):
        p = fma(p, r, float32(coefficient))
    return np.ldexp(p.astype(float), k.astype(int))
