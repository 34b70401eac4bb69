// SPDX-License-Identifier: BSD-3-Clause
#include "mrf/coherence.h"

// How many known sites, those with t < 1, each candidate is the source of. Whole numbers: their order does not matter.
//
// source (H, W), temperature (H, W)
// index_of (pixels,)   number of the candidate at a pixel of the sample, -1 where there is none
// counts   (count,)    in and out
// One work-item per site.
__kernel void use(const int sites, __global const int *restrict source,
                  __global const ushort *restrict temperature, __global const int *restrict index_of,
                  __global int *restrict counts)
{
    const int n = get_global_id(0);
    if (n >= sites)
        return;
    const int p = temperature[n] < UNTOUCHED ? number_of(index_of, source[n]) : -1;
    if (p >= 0)
        atomic_inc(counts + p);
}
