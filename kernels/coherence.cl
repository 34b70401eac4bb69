// SPDX-License-Identifier: BSD-3-Clause
#pragma OPENCL FP_CONTRACT OFF
#include "common/coherence.h"
#include "common/lattice.h"

#ifndef BLOCK
#define BLOCK 64
#endif

// The preference of common/coherence.h, for distances that are kept.
//
// source   (H, W)                 pixel index in the sample of each site's source
// offsets  (N, 2), reach (N,)     of the neighbours, on the lattice and in the sample
// index_of (pixels,)              number of the candidate at a pixel of the sample, -1 where there is none
// distance (blocks * BLOCK, P)    in and out; the sign bit marks what has been favoured
// nearest  (blocks, P)            in and out
// One work-item per site.
__kernel void coherence(__global const int *restrict sites, const int S, const int P,
                        __global const int *restrict source, __global const ushort *restrict temperature,
                        __global const int2 *restrict offsets, const int N, const Lattice g, __global const int *restrict reach,
                        __global const int *restrict index_of, const int pixels, const float discount,
                        __global float *restrict distance, __global float *restrict nearest)
{
    const int s = get_global_id(0);
    if (s >= S)
        return;
    const int i = ROW_OF(g, sites[s]), j = COL_OF(g, sites[s]);
    for (int k = 0; k < N; ++k) {
        const int r = neighbour(g, i, j, offsets[k].x, offsets[k].y);
        if (r < 0 || temperature[r] >= UNTOUCHED)
            continue;
        const int p = continuing(index_of, source[r], reach[k], pixels);
        if (p < 0)
            continue;
        const float d = distance[p * P + s];
        if (signbit(d))
            continue;
        const float favoured = d * discount;
        distance[p * P + s] = -favoured;
        nearest[p / BLOCK * P + s] = fmin(nearest[p / BLOCK * P + s], favoured);
    }
}
