// SPDX-License-Identifier: BSD-3-Clause
// Philox4x32-10 (Salmon et al., SC 2011): 128 random bits as a pure function of a counter and a key.
// Key: the 64-bit seed. Counter: (site, turn, site and level and purpose, attempt), so that no tile or device changes
// a draw. A site is its place in the whole picture, 48 bits of it: the upper 16 stand above level and purpose. The turn
// counts sweeps, or steps where a sweep may take a site twice.

// Ten rounds of words a, b, c, d of type T, a number or a vector of them; FULL gives both halves of the products.
#define PHILOX(T, a, b, c, d, key, FULL)                                                                               \
    {                                                                                                                  \
        uint k0_ = (key).x, k1_ = (key).y;                                                                             \
        _Pragma("unroll") for (int round_ = 0; round_ < 10; ++round_)                                                  \
        {                                                                                                              \
            T high_, low_, first_, second_;                                                                            \
            FULL(high_, low_, a, 0xD2511F53ul)                                                                         \
            FULL(first_, second_, c, 0xCD9E8D57ul)                                                                     \
            a = first_ ^ b ^ k0_;                                                                                      \
            b = second_;                                                                                               \
            c = high_ ^ d ^ k1_;                                                                                       \
            d = low_;                                                                                                  \
            k0_ += 0x9E3779B9u;                                                                                        \
            k1_ += 0xBB67AE85u;                                                                                        \
        }                                                                                                              \
    }
#define HALVES(high, low, x, by)                                                                                       \
    {                                                                                                                  \
        const ulong both_ = (ulong)(x) * (by); /* PoCL's mul_hi is in halves */                                        \
        high = (uint)(both_ >> 32), low = (uint)both_;                                                                 \
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
    PHILOX(uint, a, b, c, d, key, HALVES)
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
