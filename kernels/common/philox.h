// SPDX-License-Identifier: BSD-3-Clause
// Philox4x32-10 (Salmon et al., SC 2011): 128 random bits as a pure function of a counter and a key.
// Key: the 64-bit seed. Counter: (site, turn, site and level and purpose, attempt), so that no tile or device changes
// a draw. A site is its place in the whole picture, 48 bits of it: the upper 16 stand above level and purpose. The turn
// counts sweeps, or steps where a sweep may take a site twice.
#ifndef SIMDTEX_PHILOX_H
#define SIMDTEX_PHILOX_H

inline uint4 philox(const uint4 counter, const uint2 key)
{
    uint a = counter.x, b = counter.y, c = counter.z, d = counter.w, k0 = key.x, k1 = key.y;
#pragma unroll
    for (int round = 0; round < 10; ++round) {
        const ulong first = 0xD2511F53ul * a, second = 0xCD9E8D57ul * c; // PoCL's mul_hi is in halves
        a = (uint)(second >> 32) ^ b ^ k0;
        b = (uint)second;
        c = (uint)(first >> 32) ^ d ^ k1;
        d = (uint)first;
        k0 += 0x9E3779B9u;
        k1 += 0xBB67AE85u;
    }
    return (uint4)(a, b, c, d);
}

// What a draw is for; the same numbers stand in simdtex/random.py.
#define PURPOSE_START 1u
#define PURPOSE_DRAW 2u
#define PURPOSE_COLOR 3u
#define PURPOSE_SCHEDULE 4u
#define PURPOSE_NOISE 5u
#define PURPOSE_SEARCH 6u

inline uint4 draw4(const ulong seed, const uint level, const uint turn, const ulong site, const uint purpose,
                   const uint attempt)
{
    const uint what = (uint)(site >> 32) << 16 | level << 8 | purpose;
    return philox((uint4)((uint)site, turn, what, attempt), (uint2)((uint)seed, (uint)(seed >> 32)));
}

// An integer 0 .. n-1 from 64 random bits; the bias is below n / 2^64.
inline ulong below(const uint lo, const uint hi, const ulong n)
{
    return mul_hi((ulong)hi << 32 | lo, n);
}

#endif
