// SPDX-License-Identifier: BSD-3-Clause
// Philox4x32-10 (Salmon et al., SC 2011): 128 random bits as a pure function of a counter and a key.
// Key: the 64-bit seed. Counter: (site, turn, site and level and purpose, attempt), so that no tile or device changes
// a draw. A site is its place in the whole picture, 48 bits of it: the upper 16 stand above level and purpose. The turn
// counts sweeps, or steps where a sweep may take a site twice.
#ifndef SIMDTEX_PHILOX_H
#define SIMDTEX_PHILOX_H

// Ten rounds of words a, b, c, d, each a number or a vector of them; L, WIDEN and NARROW are their 64 bits.
#define PHILOX(a, b, c, d, key, L, WIDEN, NARROW)                                                                      \
    {                                                                                                                  \
        uint k0_ = (key).x, k1_ = (key).y;                                                                             \
        _Pragma("unroll") for (int round_ = 0; round_ < 10; ++round_)                                                  \
        {                                                                                                              \
            const L first_ = WIDEN(a) * 0xD2511F53ul, second_ = WIDEN(c) * 0xCD9E8D57ul; /* PoCL's mul_hi is in halves */ \
            a = NARROW(second_ >> 32) ^ b ^ k0_;                                                                       \
            b = NARROW(second_ & 0xfffffffful);                                                                        \
            c = NARROW(first_ >> 32) ^ d ^ k1_;                                                                        \
            d = NARROW(first_ & 0xfffffffful);                                                                         \
            k0_ += 0x9E3779B9u;                                                                                        \
            k1_ += 0xBB67AE85u;                                                                                        \
        }                                                                                                              \
    }

// What a draw is for; the same numbers stand in simdtex/random.py.
#define PURPOSE_START 1u
#define PURPOSE_DRAW 2u
#define PURPOSE_COLOR 3u
#define PURPOSE_SCHEDULE 4u
#define PURPOSE_NOISE 5u
#define PURPOSE_SEARCH 6u
#define PURPOSE_GUMBEL 7u

static inline uint4 philox(const uint4 counter, const uint2 key)
{
    uint a = counter.x, b = counter.y, c = counter.z, d = counter.w;
    PHILOX(a, b, c, d, key, ulong, convert_ulong, convert_uint)
    return (uint4)(a, b, c, d);
}

#define KEY_OF(seed) (uint2)((uint)(seed), (uint)((seed) >> 32))
#define WHAT_OF(level, site, purpose) ((uint)((site) >> 32) << 16 | (level) << 8 | (purpose))

static inline uint4 draw4(const ulong seed, const uint level, const uint turn, const ulong site, const uint purpose,
                          const uint attempt)
{
    return philox((uint4)((uint)site, turn, WHAT_OF(level, site, purpose), attempt), KEY_OF(seed));
}

// An integer 0 .. n-1 from 64 random bits; the bias is below n / 2^64.
static inline ulong below(const uint lo, const uint hi, const ulong n)
{
    return mul_hi((ulong)hi << 32 | lo, n);
}

#endif
