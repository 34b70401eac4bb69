// SPDX-License-Identifier: BSD-3-Clause

#ifndef BLOCK
#define BLOCK 64
#endif

// Equations (4) and (5): how often each grey level stands, in the sample, amid exactly the neighbours of the site. A
// match is a distance of 0, equation (12), so a neighbour at temperature 1 matches anything.
//
// distance (blocks * BLOCK, P), nearest (blocks, P)   from lcpdf.cl
// counts   (S, greys)                                 out: F(x, neighbours)
// One work-item per site.
__kernel void histogram(__global const float *restrict distance, __global const float *restrict nearest,
                        const int blocks, const int S, const int P, __global const float *restrict sample,
                        __global const int *restrict candidates, const int greys, __global uint *restrict counts)
{
    const int s = get_global_id(0);
    if (s >= S)
        return;
    __global uint *F = counts + (size_t)s * greys;
    for (int x = 0; x < greys; ++x)
        F[x] = 0;
    for (int b = 0; b < blocks; ++b) {
        if (nearest[b * P + s] > 0.0f)
            continue;
        for (int p = b * BLOCK; p < (b + 1) * BLOCK; ++p)
            if (distance[p * P + s] == 0.0f)
                ++F[(int)sample[candidates[p]]];
    }
}
