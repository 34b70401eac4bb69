// SPDX-License-Identifier: BSD-3-Clause
// The Gaussian of equation (7), as weights of candidates and as a kernel over whole grey levels.
//
// Weights are integers: W_p = floor(2^40 w_p / w_max). Integers add up to the same sum in any order, so
// no work-group size, chunking or reduction can change a draw. A weight below 2^-40 of the largest is zero by this definition.
#pragma OPENCL FP_CONTRACT OFF
#include "common/exp.h"

#ifndef C
#define C 1 // channels of a pixel
#endif
#define NO_WEIGHT 28.0f // exp(-28) 2^40 < 1
#define LOG_ONE 22.1807098f // log 2^32: all steps of a kernel are legal

// W_p: Gaussian of equation (7) relative to the best candidate.
static inline ulong weight(const float d, const float smallest, const float scale)
{
    const float a = (d - smallest) * scale;
    return a < NO_WEIGHT ? (ulong)(exp32(-a) * 0x1p40f) : 0ul;
}

// W_p times the kernel of equation (7) at a gap of grey levels; `window` (radius + 1,) holds exp(-k^2 / 2h^2).
static inline ulong weight_near(const ulong w, const int gap, __global const float *window, const int radius)
{
    return gap <= radius ? (ulong)((float)w * window[gap]) : 0ul;
}

// The kernel of equation (7) around grey level y, cut off at the legal levels 0..top: `noise` holds cumulative
// probabilities of the steps -radius..radius, so the legal steps span noise values low .. low + mass.
static inline uint legal_low(__global const uint *noise, const int radius, const int y)
{
    return radius > y ? noise[radius - y - 1] : 0u;
}

static inline uint legal_mass(__global const uint *noise, const int radius, const int y, const int top)
{
    return noise[min(2 * radius, radius + top - y)] - legal_low(noise, radius, y);
}

// The step that 32 random bits choose from the kernel around grey level y, cut off at the legal levels: the first whose
// cumulative probability exceeds them.
static inline int step_from(__global const uint *noise, const int radius, const int y, const int top, const uint random)
{
    const uint u = legal_low(noise, radius, y) + mul_hi(random, legal_mass(noise, radius, y, top));
    int lo = 0, hi = 2 * radius;
    while (lo < hi) {
        const int mid = (lo + hi) / 2;
        if (noise[mid] > u)
            hi = mid;
        else
            lo = mid + 1;
    }
    return lo - radius;
}
