// SPDX-License-Identifier: BSD-3-Clause
// V numbers side by side in one work-item (-D V=1, 4, 8 or 16): the same arithmetic in the same order for each.

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
#define LEAST1(a) (a)
#define LEAST2(a) min((a).x, (a).y)
#define LEAST4(a) LEAST2(min((a).lo, (a).hi))
#define LEAST8(a) LEAST4(min((a).lo, (a).hi))
#define LEAST16(a) LEAST8(min((a).lo, (a).hi))
#define LEAST(a) JOIN(LEAST, V)(a)
