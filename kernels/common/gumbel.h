// SPDX-License-Identifier: BSD-3-Clause
// Gumbel noise. The candidate of least cost_p / 2h^2 - G_p, G_p = -log(-log u_p) with u_p uniform on (0, 1), is a draw
// from the weights exp(-cost_p / 2h^2) of equation (7), whatever these add up to. u_p has 32 bits, and absolute errors of
// G_p are below 3e-6 at both ends (tests/methods/mrf/test_relax.py measures it).
#include "common/log.h"
#include "common/philox.h"
#include "common/vector.h"

#define MOST_GUMBEL 23.0f // G_p <= 33 log 2
typedef WIDE(uint) uvec;

// -G = log(-log((bits + 1/2) 2^-32)). Near u = 1, log u is computed from 1 - u.
static inline vec minus_gumbel(const uvec bits)
{
    const uvec rest = ~bits;
    const vec u = fma(WIDE(convert_float)(bits), (vec)0x1p-32f, (vec)0x1p-33f);
    const ivec at = WIDE(as_int)(u), k = (at - 0x3f3504f3) >> 23, near = rest < (uvec)0x4afb0ccd; // u > sqrt(1/2)
    const vec r = select(WIDE(as_float)(at - (k << 23)) - 1.0f,
                         -fma(WIDE(convert_float)(rest), (vec)0x1p-32f, (vec)0x1p-33f), near);
    const vec e = select(WIDE(convert_float)(k), (vec)0.0f, near);
    const vec x = -LOG_SUM(vec, e, r);
    const ivec bits_ = WIDE(as_int)(x), n = (bits_ - 0x3f3504f3) >> 23;
    const vec s = WIDE(as_float)(bits_ - (n << 23)) - 1.0f, f = WIDE(convert_float)(n);
    return LOG_SUM(vec, f, s);
}

// At most MOST_GUMBEL - G, little less where G > 0, and at least 0, without a logarithm: -G > log(1 - u), and the bits of
// a float are a piecewise linear function below its logarithm.
static inline vec least_noise(const uvec bits)
{
    const vec rest = fma(WIDE(convert_float)(WIDE(as_int)(~bits >> 1)), (vec)0x1p-31f, (vec)0x1p-33f);
    return fma(WIDE(convert_float)(WIDE(as_int)(rest)), (vec)0x1.62e43p-24f, (vec)-65.03f);
}

// Candidates fall into units of 16 in a row of the sample. Lane n of four units in a row takes the four words of a draw.
#define LANES 16
#define DRAW_OF(unit, lane) ((uint)((unit) / 4 * LANES + (lane)))

__constant uint lanes_[LANES] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};

#define PAIRS4(x) as_ulong2(x)
#define PAIRS8(x) as_ulong4(x)
#define PAIRS16(x) as_ulong8(x)
#define PAIRS(x) JOIN(PAIRS, V)(x)
#if V == 1
#define HALVES_OF HALVES
#else // of every other number, and of those between them
#define HALVES_OF(high, low, x, by)                                                                                    \
    high = WIDE(as_uint)((PAIRS(x) & 0xfffffffful) * (by) >> 32 | ((PAIRS(x) >> 32) * (by) & 0xffffffff00000000ul));  \
    low = (x) * (uint)(by);
#endif

// The words of the draws `first`, `first` + 1, ... side by side. A call, since compilers would draw before a loop that
// rarely does, or keep its sums in memory.
static __attribute__((noinline)) void words_of(const ulong seed, const uint level, const uint turn, const ulong place,
                                               const uint first, __private uvec *word)
{
    uvec a = (uvec)(uint)place, b = (uvec)turn, c = (uvec)WHAT_OF(level, place, PURPOSE_GUMBEL), d = LOAD(lanes_) + first;
    PHILOX(uvec, a, b, c, d, KEY_OF(seed), HALVES_OF)
    word[0] = a;
    word[1] = b;
    word[2] = c;
    word[3] = d;
}

static inline float minus_gumbel_of(const ulong seed, const uint level, const uint turn, const ulong place, const int unit,
                                    const int lane)
{
    const uint4 bits = draw4(seed, level, turn, place, PURPOSE_GUMBEL, DRAW_OF(unit, lane));
    const uint word = unit & 2 ? (unit & 1 ? bits.w : bits.z) : (unit & 1 ? bits.y : bits.x);
    const vec noise = minus_gumbel((uvec)word);
#if V == 1
    return noise;
#else
    return noise.s0;
#endif
}
