// SPDX-License-Identifier: BSD-3-Clause
// log(x) for 1 <= x < 2^24 with the same bits on every device: x = 2^k (1 + r) and a polynomial of degree 9 in r, every
// step an fma. Absolute error below 1.2e-6 (tests/test_arithmetic.py measures it).
#ifndef SIMDTEX_LOG_H
#define SIMDTEX_LOG_H

inline float log32(const float x)
{
    const int bits = as_int(x), k = (bits - 0x3f3504f3) >> 23; // 1 + r from sqrt(1/2) to sqrt(2)
    const float r = as_float(bits - (k << 23)) - 1.0f, e = (float)k;
    float p = 0.0873511881f;
    p = fma(p, r, -0.144429281f);
    p = fma(p, r, 0.14979136f);
    p = fma(p, r, -0.165521428f);
    p = fma(p, r, 0.199536145f);
    p = fma(p, r, -0.250025034f);
    p = fma(p, r, 0.333342254f);
    p = fma(p, r, -0.499999821f);
    return fma(e, 0.693145752f, fma(p, r * r, fma(e, 1.42860677e-6f, r)));
}

#endif
