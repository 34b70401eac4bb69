// SPDX-License-Identifier: BSD-3-Clause
// log(x) of normal x > 0 with the same bits on every device: x = 2^k (1 + r) and a polynomial of degree 9 in r, every
// step an fma. Absolute error below 1.2e-6 for x < 2^24, above 2^-34 (tests/machine/test_arithmetic.py measures it).

// log(2^e (1 + r)) for r from sqrt(1/2) - 1 to sqrt(2) - 1, of T, a float or a vector of them; relative to r where e is 0.
#define LOG_SERIES(T, r)                                                                                               \
    fma(fma(fma(fma(fma(fma(fma((T)0.0873511881f, r, (T)-0.144429281f), r, (T)0.14979136f), r, (T)-0.165521428f), r,  \
                        (T)0.199536145f), r, (T)-0.250025034f), r, (T)0.333342254f), r, (T)-0.499999821f)
#define LOG_SUM(T, e, r)                                                                                               \
    fma(e, (T)0.693145752f, fma(LOG_SERIES(T, r), (r) * (r), fma(e, (T)1.42860677e-6f, r)))

static inline float log32(const float x)
{
    const int bits = as_int(x), k = (bits - 0x3f3504f3) >> 23;
    const float r = as_float(bits - (k << 23)) - 1.0f, e = (float)k;
    return LOG_SUM(float, e, r);
}
