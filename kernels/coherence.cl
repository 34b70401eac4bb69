// SPDX-License-Identifier: BSD-3-Clause
#pragma OPENCL FP_CONTRACT OFF
#include "common/lanes.h"
#include "common/lattice.h"

#ifndef BLOCK
#define BLOCK 64
#endif

// A preference for coherence, which the 1998 paper lacks: neighbour r of site s was taken from sample position
// p_r, so p_r + (s - r) continues it; the squared distance of such a candidate is multiplied by `favour` =
// 1 / (1 + coherence), once however many neighbours propose it. Neighbours that no relaxation has touched (t = 1) propose none.
//
// source     (H, W)                 pixel index in the sample of each site's source
// reach      (N,), offsets (N, 2)   as in lcpdf.cl and neighbourhood.cl; both at the level's spacing
// index_of   (h * w,)               position in the list of candidates, -1 where the pixel is none
// distance   (blocks * BLOCK, P)    in and out; the sign bit marks what has been favoured
// nearest    (blocks, P)            in and out
// One work-item per site.
__kernel void coherence(__global const int *restrict sites, const int S, const int P,
                        __global const int *restrict source, __global const ushort *restrict temperature,
                        __global const int2 *restrict offsets, const int N, GRID, __global const int *restrict index_of,
                        const int sample_rows, const int sample_cols, const float favour,
                        __global float *restrict distance, __global float *restrict nearest LANES_ARG)
{
    const int s = LANE;
    if (IDLE(s))
        return;
    const int i = ROW_OF(sites[s]), j = COL_OF(sites[s]);
    for (int k = 0; k < N; ++k) {
        const int2 o = offsets[k];
        const int r = neighbour(i, j, o.x, o.y, HERE);
        if (r < 0 || temperature[r] >= 1024)
            continue;
        const int row = source[r] / sample_cols - o.x * spacing;
        const int col = source[r] % sample_cols - o.y * spacing;
        if (row < 0 || row >= sample_rows || col < 0 || col >= sample_cols)
            continue;
        const int p = index_of[row * sample_cols + col];
        if (p < 0)
            continue;
        const float d = distance[p * P + s];
        if (signbit(d))
            continue;
        const float favoured = d * favour;
        distance[p * P + s] = -favoured;
        nearest[p / BLOCK * P + s] = fmin(nearest[p / BLOCK * P + s], favoured);
    }
}
