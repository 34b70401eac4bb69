// SPDX-License-Identifier: BSD-3-Clause
#pragma OPENCL FP_CONTRACT OFF
#define C channels // any number of them
#include "common/confidence.h"
#include "common/lattice.h"

// The neighbourhoods of the sites to relax, ready for the distance of equation (12).
//
// For site s and neighbour r = N_s[k]:  u = 1 - t_r  and  xu = x_r * (1 - t_r), exact in float32 because pixels
// are integers below 2^12 and temperatures integer multiples of 2^-10. A neighbour outside an open lattice has u = 0.
// With -D OWN each channel has its u, and where there are guides the site itself comes last: common/confidence.h.
//
// sites       (S,)        pixel index of each site
// values      (C, H, W)   working grey levels; the first `made` channels are no guides
// temperature (H, W)      in 1/1024
// source      (H, W)      pixel index in the sample; -D OWN: below 0 where a site is hard data
// offsets     (N, 2)      (row, column) on the level's grid, canonical order
// confidence  (N, P)      out: u; P is S rounded up to whole vectors, the rest is 0. -D OWN: (terms, C, P)
// weighted    (terms, C, P)   out: x * u; terms is N, or N + 1 where there are guides
// One work-item per (site, term).
__kernel void neighbourhood(__global const int *restrict sites, const int S, const int P,
                            __global const ushort *restrict values, __global const ushort *restrict temperature,
                            __global const int *restrict source, const float hard, const int channels, const int made, const int plane, __global const int2 *restrict offsets,
                            const int N, const int terms, const float centre, const Lattice g,
                            __global float *restrict confidence, __global float *restrict weighted)
{
    const int s = get_global_id(0), k = get_global_id(1);
    if (s >= P || k >= terms)
        return;
    const int site = s < S ? sites[s] : 0, i = ROW_OF(g, site), j = COL_OF(g, site);
    const int2 o = k < N ? offsets[k] : (int2)(0, 0);
    const int r = s >= S ? -1 : k < N ? neighbour(g, i, j, o.x, o.y) : site;
    const float u = r < 0 || k == N ? 0.0f : (float)(1024 - temperature[r]) * 0x1p-10f;
    const float certain = WEIGHED_AS(u, r < 0 ? 0 : source[r], hard), guide = r < 0 ? 0.0f : k < N ? 1.0f : centre;
    for (int c = 0; c < channels; ++c) {
        const ushort x = r < 0 ? 0 : values[c * plane + r];
        const float uc = CONFIDENCE_OF(c < made, x, certain, guide);
        confidence[(k * CONFIDENCES + CONFIDENT(c)) * P + s] = uc;
        weighted[(k * channels + c) * P + s] = (float)x * uc;
    }
}
