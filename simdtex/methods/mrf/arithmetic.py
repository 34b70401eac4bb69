# SPDX-License-Identifier: BSD-3-Clause
"""float32 arithmetic with the bits that a device gives: the twins of fma(), kernels/common/exp.h and log.h."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def fma32(a: Any, b: Any, c: Any) -> NDArray[np.float32]:
    """Return a * b + c in float32, rounded once.

    The product of two float32 is exact in float64. The sum is rounded to odd there, which makes the second
    rounding, to float32, correct (Boldo and Melquiond, 2008).
    """
    product = np.asarray(a, np.float64) * np.asarray(b, np.float64)
    c = np.asarray(c, np.float64)
    total = np.atleast_1d(product + c)
    part = total - product
    error = np.atleast_1d((product - (total - part)) + (c - part))
    bits = total.view(np.int64)
    even = (bits & 1) == 0
    outward = (error > 0) == (total > 0)
    bits = np.where((error != 0) & even, np.where(outward, bits + 1, bits - 1), bits)
    result: NDArray[np.float32] = bits.view(np.float64).astype(np.float32)
    return result.reshape(np.broadcast_shapes(product.shape, c.shape))


def exp32(x: Any) -> NDArray[np.float32]:
    """Return exp(x) for -87 < x <= 0, bit for bit as on the device; relative error below 2.5e-7."""
    x = np.asarray(x, np.float32)
    k = np.rint(x * np.float32(1.44269502))
    r = fma32(k, np.float32(-0.693145752), x)
    r = fma32(k, np.float32(-1.42860677e-6), r)
    p = np.asarray(1.38888892e-3, np.float32)
    for coefficient in (8.33333377e-3, 4.16666679e-2, 1.66666672e-1, 0.5, 1.0, 1.0):
        p = fma32(p, r, np.float32(coefficient))
    result: NDArray[np.float32] = (p.view(np.int32) + (k.astype(np.int32) << 23)).view(np.float32)
    return result


def log32(x: Any) -> NDArray[np.float32]:
    """Return log(x) of normal x > 0, bit for bit as on the device.

    The absolute error is below 1.2e-6 for 2**-34 < x < 2**24.
    """
    bits = np.asarray(x, np.float32).view(np.int32)
    k = (bits - np.int32(0x3F3504F3)) >> 23
    return _log_sum(k.astype(np.float32), (bits - (k << 23)).view(np.float32) - np.float32(1))


def _log_sum(e: NDArray[np.float32], r: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return log(2**e (1 + r)) for 1 + r from sqrt(1/2) to sqrt(2)."""
    p = np.asarray(0.0873511881, np.float32)
    for coefficient in (-0.144429281, 0.14979136, -0.165521428, 0.199536145, -0.250025034, 0.333342254, -0.499999821):
        p = fma32(p, r, np.float32(coefficient))
    return fma32(e, np.float32(0.693145752), fma32(p, r * r, fma32(e, np.float32(1.42860677e-6), r)))


def minus_gumbel(bits: NDArray[np.uint32]) -> NDArray[np.float32]:
    """Return log(-log u), u = (bits + 1/2) 2**-32: minus Gumbel noise, bit for bit as on the device."""
    rest, unit = ~bits, np.float32(2.0**-32)
    u = fma32(bits.astype(np.float32), unit, unit / 2)
    k = (u.view(np.int32) - np.int32(0x3F3504F3)) >> 23
    near = rest < 0x4AFB0CCD  # u is above sqrt(1/2), and 1 - u has more digits
    r = np.where(
        near, -fma32(rest.astype(np.float32), unit, unit / 2), (u.view(np.int32) - (k << 23)).view(np.float32) - 1
    )
    return log32(-_log_sum(np.where(near, 0, k).astype(np.float32), r))
