// SPDX-License-Identifier: BSD-3-Clause
// V sites side by side in one work-item (-D V=1, 4, 8 or 16): the same arithmetic in the same order for each.
#ifndef SIMDTEX_VECTOR_H
#define SIMDTEX_VECTOR_H

#ifndef V
#define V 1
#endif
#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)

#if V == 1
typedef float vec;
#define LOAD(p) (*(p))
#define STORE(x, p) (*(p) = (x))
#define ANY(x) (x)

inline float least_of(const vec x)
{
    return x;
}
#else
typedef JOIN(float, V) vec;
#define LOAD(p) JOIN(vload, V)(0, p)
#define STORE(x, p) JOIN(vstore, V)(x, 0, p)
#define ANY(x) any(x)

// The least of a vector's numbers.
inline float least_of(const vec x)
{
#if V == 16
    const float8 y = fmin(x.lo, x.hi);
#elif V == 8
    const float8 y = x;
#endif
#if V == 4
    const float4 z = x;
#else
    const float4 z = fmin(y.lo, y.hi);
#endif
    const float2 w = fmin(z.lo, z.hi);
    return fmin(w.x, w.y);
}
#endif

#endif
