// SPDX-License-Identifier: BSD-3-Clause
// V numbers side by side in one work-item (-D V=1, 4, 8 or 16): the same arithmetic in the same order for each.
#ifndef SIMDTEX_VECTOR_H
#define SIMDTEX_VECTOR_H

#ifndef V
#define V 1
#endif
#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)

#if V == 1
#define WIDE(name) name
#define LOAD(p) (*(p))
#define STORE(x, p) (*(p) = (x))
#else
#define WIDE(name) JOIN(name, V)
#define LOAD(p) JOIN(vload, V)(0, p)
#define STORE(x, p) JOIN(vstore, V)(x, 0, p)
#endif
typedef WIDE(float) vec;
typedef WIDE(int) ivec;

// The least of V integers; PoCL's any() is a branch for each.
static inline int least(const ivec a)
{
#if V == 1
    return a;
#else
#if V == 16
    const int8 half_ = min(a.lo, a.hi);
    const int4 b = min(half_.lo, half_.hi);
#elif V == 8
    const int4 b = min(a.lo, a.hi);
#else
    const int4 b = a;
#endif
    const int2 c = min(b.lo, b.hi);
    return min(c.x, c.y);
#endif
}

#endif
