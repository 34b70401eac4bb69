// SPDX-License-Identifier: BSD-3-Clause
#include "common/lattice.h"
#include "common/philox.h"

// Algorithm 1, before the first level: every site takes a pixel of the sample at random, at temperature 1 (step 5).
//
// sample (C, plane) working grey levels; pixels (count,) pixel indices in it to take from
// values (C, sites), source (sites,), temperature (sites,) in 1/1024  out
// One work-item per site.
__kernel void start(const ulong seed, __global const float *restrict sample, const int plane, const int channels,
                    __global const int *restrict pixels, const int count, const Lattice g,
                    __global ushort *restrict values, __global int *restrict source,
                    __global ushort *restrict temperature)
{
    const int s = get_global_id(0);
    const int sites = g.rows * g.cols;
    if (s >= sites)
        return;
    const uint4 bits = draw4(seed, 0, 0, place_of(g, s / g.cols, s % g.cols), PURPOSE_START, 0);
    const int from = pixels[below(bits.x, bits.y, count)];
    source[s] = from;
    temperature[s] = 1024;
    for (int c = 0; c < channels; ++c)
        values[c * sites + s] = (ushort)sample[c * plane + from];
}
