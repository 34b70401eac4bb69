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


def logarithm(x):
    """log(x) of float32 x > 0, as the polynomial that the devices' logarithm is."""
    m, e = np.frexp(np.asarray(x, float32))
    small = m < float32(0.5**0.5)
    return log_of(e - small, np.where(small, 2 * m, m) - float32(1))


def log_of(e, r):
    """log(2^e (1 + r))."""
    p = float32(0.0873511881)
    for coefficient in (-0.144429281, 0.14979136, -0.165521428, 0.199536145, -0.250025034, 0.333342254, -0.499999821):
        p = fma(p, r, float32(coefficient))
    return fma(e, float32(0.693145752), fma(p, r * r, fma(e, float32(1.42860677e-6), r)))


def minus_gumbel(words):
    """log(-log u), u = (word + 1/2) / 2^32, of random words; near 1 from 1 - u."""
    words, unit = np.array(words, float), float32(2.0**-32)
    rest = 2.0**32 - 1 - words
    u, below_1 = (fma(n.astype(float32), unit, unit / 2) for n in (words, rest))
    return logarithm(-np.where(rest < 0x4AFB0CCD, log_of(0, -below_1), logarithm(u)))
