// SPDX-License-Identifier: BSD-3-Clause
#pragma OPENCL FP_CONTRACT OFF
#include "common/costs.h"

#ifndef BLOCK
#define BLOCK 64
#endif

// Add the costs of each candidate to its distance, for distances that are kept.
//
// distance (blocks * BLOCK, P)    in and out; the sign bit that marks what coherence.cl has favoured is gone
// nearest  (blocks, P)            out: the smallest of each block
// One work-item per (site, block).
__kernel void charge(__global const int *restrict sites, const int S, const int P, const int count, const int blocks, COSTS,
                     __global float *restrict distance, __global float *restrict nearest)
{
    const int s = get_global_id(0), block = get_global_id(1);
    if (s >= S || block >= blocks)
        return;
    float least = INFINITY;
    for (int p = block * BLOCK; p < min((block + 1) * BLOCK, count); ++p) {
        const float d = PLUS_COSTS(fabs(distance[p * P + s]), p, sites[s]);
        distance[p * P + s] = d;
        least = fmin(least, d);
    }
    nearest[block * P + s] = least;
}
