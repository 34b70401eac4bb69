// SPDX-License-Identifier: BSD-3-Clause
// exp(x) for -87 < x <= 0 with the same bits on every device: Cody-Waite reduction and a polynomial of degree 6,
// every step an fma. Relative error below 2.5e-7 (tests/machine/test_arithmetic.py measures it).

static inline float exp32(const float x)
{
    const float k = rint(x * 1.44269502f);
    float r = fma(k, -0.693145752f, x);
    r = fma(k, -1.42860677e-6f, r);
    float p = 1.38888892e-3f;
    p = fma(p, r, 8.33333377e-3f);
    p = fma(p, r, 4.16666679e-2f);
    p = fma(p, r, 1.66666672e-1f);
    p = fma(p, r, 0.5f);
    p = fma(p, r, 1.0f);
    p = fma(p, r, 1.0f);
    return as_float(as_int(p) + ((int)k << 23));
}
