// SPDX-License-Identifier: BSD-3-Clause
#include "common/lattice.h"

// The grey levels that the sources of a level's sites have at that level, where each level has a sample of its own.
//
// sample (C, plane)   grey levels of the sample at this level
// source (H, W)       pixel index in it of each site's source
// values (C, area)    out, at the sites of the lattice
// One work-item per site.
__kernel void recolour(const Lattice g, const int sites, __global const float *restrict sample, const int plane,
                       __global const int *restrict source, const int area, __global ushort *restrict values)
{
    const int n = get_global_id(0);
    if (n >= sites)
        return;
    const int site = SITE(g, n / g.cols, n % g.cols);
    for (int c = 0; c < C; ++c)
        values[c * area + site] = (ushort)sample[c * plane + source[site]];
}
